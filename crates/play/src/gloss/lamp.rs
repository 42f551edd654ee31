//! What a lamp's light sends over lobes.

use super::clusters::{NONE, SAMPLES, Sample};
use super::links::var;
use super::{GlossyPoint, GlossySenders};
use crate::lit::{Lit, share};
use crate::transfer::Transfer;
use glam::Vec3;
use rayon::prelude::*;
use relight_scene::shading::ShadingPoint;
use relight_transport::pyramid::VectorIrradiance;
use relight_transport::sparse;

/// Least α of a lobe.
const SLOPE: f32 = 0.1;

/// A lamp's light at what is glossy.
pub(super) struct LampLight<'a> {
    of: &'a GlossySenders,
    transfer: &'a Transfer,
    /// Of what senders reflect of it, means over their points, W/m².
    radiosities: Vec<Vec3>,
    /// Whence it comes at each of the glossy points.
    lit: Vec<Lit>,
    /// What each of the points that stand for clusters reflects of it.
    sent: Vec<Sent>,
    /// Of each sender, about the most that it sends anywhere over its lobes.
    most: Vec<f32>,
    mean: f32,
}

/// What a point that stands for a cluster reflects of a lamp's light.
struct Sent {
    place: Vec3,
    normal: Vec3,
    /// If it is matt: radiosity, W/m².
    matt: Vec3,
    /// Which glossy point it is, and what part of the lamp's light there is the cluster's.
    lobe: Option<(usize, Vec3)>,
}

impl LampLight<'_> {
    /// `direct`: a lamp's irradiance at the finest points; `lit`: whence it comes at the glossy ones.
    pub fn new<'a>(of: &'a GlossySenders, transfer: &'a Transfer, direct: &[Vec3], lit: Vec<Lit>) -> LampLight<'a> {
        let irradiances = transfer.senders.pulled(direct).concat();
        let radiosity = transfer.radiosity(direct);
        let mean = radiosity.iter().map(|r| f64::from(r.max_element())).sum::<f64>() as f32 / radiosity.len() as f32;
        let radiosities = transfer.senders.pulled(&radiosity).concat();
        let sent: Vec<Sent> = (of.clusters.samples.par_iter().with_min_len(256))
            .map(|&Sample { point, around }| {
                let around = match around {
                    NONE => direct[point as usize],
                    around => irradiances[around as usize],
                };
                let lobe = of.glossy(point).filter(|&glossy| !lit[glossy].is_dark() && around != Vec3::ZERO);
                let part = |glossy: usize| match lit[glossy].is_unoccluded() {
                    // The light around says how much of it there is.
                    true => share(around, lit[glossy].irradiance()),
                    // Rays have its visibility: on average they are right.
                    false => Vec3::ONE,
                };
                let point = point as usize;
                Sent {
                    place: transfer.finest.positions[point],
                    normal: transfer.finest.normals[point],
                    matt: around * transfer.albedo[point],
                    lobe: lobe.map(|glossy| (glossy, part(glossy))),
                }
            })
            .collect();
        let most = (0..of.clusters.len() as u32).map(|sender| {
            let samples = &sent[of.clusters.range_of(sender)];
            samples.iter().filter_map(|sample| {
                let (glossy, part) = sample.lobe?;
                let alpha = of.points[glossy].shading.alpha.max(SLOPE);
                Some((part * lit[glossy].irradiance()).max_element() / (4.0 * alpha * alpha))
            }).fold(0.0, f32::max)
        }).collect();
        LampLight {
            of,
            transfer,
            radiosities,
            lit,
            sent,
            most,
            mean,
        }
    }

    /// What receivers of all levels get of it over lobes, less what they would if those were matt.
    pub fn received(&self) -> Vec<VectorIrradiance> {
        let links = &self.of.links;
        let mean = self.mean;
        let least = mean * var("LEASTL", 0.03);
        let skipped = std::sync::atomic::AtomicUsize::new(0);
        let received: Vec<(VectorIrradiance, VectorIrradiance)> = (0..links.receivers())
            .into_par_iter()
            .with_min_len(64)
            .map(|receiver| {
                links.row(receiver).apply(|sender, weight| match self.most[sender as usize] * weight.length() > least {
                    true => { skipped.fetch_add(1, std::sync::atomic::Ordering::Relaxed); self.difference(sender, receiver) },
                    false => (Vec3::ZERO, Vec3::ZERO),
                })
            })
            .collect();
        if std::env::var("TIMES").is_ok() { eprintln!("used lobe links {:?}", skipped); }
        let (parents, _) = self.transfer.parents();
        (received.par_iter().with_min_len(1024).enumerate())
            .map(|(receiver, &(mut own, _))| {
                let normal = self.transfer.normal_of(receiver);
                for (parent, weight) in sparse::row(parents, receiver) {
                    let parent = parent as usize;
                    own.add_carried(&received[parent].1, self.transfer.normal_of(parent), normal, -weight);
                }
                own
            })
            .collect()
    }

    /// What a sender has to send to a receiver over lobes, less what it would have if it were matt: radiosity, W/m².
    fn difference(&self, sender: u32, receiver: usize) -> (Vec3, Vec3) {
        let transfer = self.transfer;
        let radius = self.of.clusters.radius_of(sender);
        let spread = var("CURV", 2.52) * self.of.clusters.spread_of(sender);
        let (to, normal) = (transfer.position_of(receiver), transfer.normal_of(receiver));
        let (mut more, mut less, mut matt, mut seen) = (Vec3::ZERO, Vec3::ZERO, Vec3::ZERO, 0.0);
        let (slope, subc, most) = (var("SLOPE", SLOPE), var("SUBC", 2.0), var("SUB", 16.0));
        for sample in &self.sent[self.of.clusters.range_of(sender)] {
            let lobe = sample.lobe.map(|(glossy, part)| (&self.lit[glossy], &self.of.points[glossy], part));
            let count = match lobe {
                Some((lit, GlossyPoint { shading, .. }, _)) => {
                    let alpha = (shading.alpha.powi(2) + spread).sqrt().max(slope);
                    let wide = subc * alpha * sample.place.distance(to).min(lit.distance() / var("NEARL", 1.0));
                    ((radius / wide).powi(2).ceil()).clamp(1.0, most) as usize
                }
                None => 1,
            };
            let radius = radius / (count as f32).sqrt();
            let at = |k: usize| match count {
                1 => sample.place,
                _ => {
                    let (a, b) = sample.normal.any_orthonormal_pair();
                    let (u, v) = (k as f32 + 0.5, k as f32 * 2.399_963);
                    sample.place + radius * u.sqrt() * (a * v.cos() + b * v.sin())
                }
            };
            let bright = |place: Vec3| lobe.map_or(1.0, |(lit, ..)| if var("EW", 1.0) > 0.0 { lit.brightness(sample.normal, place - sample.place) } else { 1.0 });
            let mean = (0..count).map(|k| bright(at(k))).sum::<f32>() / count as f32;
            let (mut sum, mut seen_all) = (0.0, 0.0);
            for k in 0..count {
                let place = at(k);
                let way = place - to;
                // What lies behind a receiver, it does not see: a cluster goes on beyond the wall.
                let (here, there) = (normal.dot(way), -sample.normal.dot(way));
                if here <= 0.0 || there <= 0.0 {
                    continue;
                }
                let square = way.length_squared();
                let weight = bright(place) / mean.max(f32::MIN_POSITIVE) * here * there * radius * radius / (square * square.max(radius * radius));
                sum += weight;
                seen_all += weight / (bright(place) / mean.max(f32::MIN_POSITIVE)).max(1e-20);
                if let Some((lit, GlossyPoint { shading, albedo, .. }, part)) = lobe {
                    let moved = ShadingPoint {
                        position: shading.position + (place - sample.place),
                        ..*shading
                    };
                    let reflected = lit.reflected(&moved, (to, place - sample.place), (radius, spread), slope);
                    more += weight * part * reflected;
                    less += weight * part * *albedo * lit.irradiance();
                }
            }
            matt += sum * sample.matt;
            seen += seen_all;
        }
        match seen > 0.0 {
            true => {
                let least = Vec3::splat(f32::MIN_POSITIVE);
                let n = var("NORM", SAMPLES as f32);
                let f = (self.radiosities[sender as usize].max(least) / (matt / seen).max(least)).min(Vec3::splat(n));
                (more / seen * f, less / seen * f)
            }
            false => (Vec3::ZERO, Vec3::ZERO),
        }
    }
}
