//! What lamps send over glossy surfaces: their lobes in place of the matt reflection that links are for.
//!
//! A link takes a cluster's radiosity to a receiver as if the cluster sent it evenly. Of light that comes from one side, a glossy surface sends
//! most to the other, so that a receiver gets more or less. Of each cluster a few points stand for all: they know their irradiance and
//! whence the lamp shines, and their BRDF says what they send to this receiver; the difference to what is matt goes over the same
//! link. Each counts by the mean light around it, not by its own: a shadow's edge that passes one of four points would switch a quarter of
//! the cluster. Lobes are as much wider as the piece of surface is that a point stands for, and as the lamp. All of it is linear in the
//! lamps' light. Light of further reflections comes from all around, and is taken as ever.

use crate::reflections;
use crate::transfer::Transfer;
use glam::{Vec3, Vec3A};
use rayon::prelude::*;
use relight_render::irradiance::Incident;
use relight_scene::bsdf;
use relight_scene::shading::ShadingPoint;
use relight_scene::surface::SurfaceHit;
use relight_scene::traced::TracedScene;
use relight_transport::kernel::width;
use relight_transport::pyramid::VectorIrradiance;
use std::f32::consts::PI;

/// Points that stand for a cluster.
const SAMPLES: usize = 4;

/// Where within its share of a cluster's weight the point lies that stands for it. About its middle; at the very middle, of points that weigh
/// the same, rounding would choose.
const MIDDLE: f64 = 0.518_034;

/// Least α of a lobe: one of 0.3 sends some five times as much one way as a matt surface does. Links are chosen for matt ones; narrower
/// lobes would want links that were left out.
const SLOPE: f32 = 0.3;

/// Glossy points of an asset and the clusters that they stand for.
pub(crate) struct GlossySenders {
    /// Glossy ones of the points that stand for clusters.
    points: Vec<GlossyPoint>,
    /// Of each finest point, which of those it is; [`NONE`] for matt ones and those that stand for no cluster.
    glossy_of: Vec<u32>,
    /// Of all senders.
    clusters: Vec<Cluster>,
}

/// No point.
const NONE: u32 = u32::MAX;

struct Cluster {
    /// Finest points that stand for it; [`NONE`] where it has none.
    samples: [u32; SAMPLES],
    /// Of each the cluster of the next finer level around it; [`NONE`] on the finest.
    around: [u32; SAMPLES],
    /// Radius of the surface that each of those stands for, m.
    radius: f32,
    /// The sender above it; itself on the coarsest level.
    parent: u32,
}

struct GlossyPoint {
    /// Which finest point.
    number: u32,
    shading: ShadingPoint,
    /// What links take it to reflect.
    albedo: Vec3,
}

impl GlossySenders {
    /// Those of the finest points, which lie at `places`; `None` where nothing is glossy enough. `footprint`: surface that a point stands for
    /// where they are closest, m².
    pub fn new(
        scene: &TracedScene,
        places: &[Option<SurfaceHit>],
        footprint: f32,
        transfer: &Transfer,
    ) -> Option<GlossySenders> {
        let clusters = clusters(transfer, footprint);
        let mut numbers: Vec<u32> = (clusters.iter().flat_map(|cluster| cluster.samples))
            .filter(|&point| point != NONE)
            .collect();
        numbers.sort_unstable();
        numbers.dedup();
        let points: Vec<GlossyPoint> = (numbers.into_par_iter())
            .with_min_len(256)
            .filter_map(|number| {
                let hit = places[number as usize].as_ref()?;
                let on_triangle = (hit.primitive as usize) < scene.triangle_count();
                let shading = on_triangle.then(|| scene.shading_point(hit)).filter(is_glossy)?;
                let albedo = transfer.albedo[number as usize];
                Some(GlossyPoint {
                    number,
                    shading,
                    albedo,
                })
            })
            .collect();
        let mut glossy_of = vec![NONE; transfer.finest.len()];
        for (at, point) in (0u32..).zip(&points) {
            glossy_of[point.number as usize] = at;
        }
        (!points.is_empty()).then_some(GlossySenders {
            points,
            glossy_of,
            clusters,
        })
    }

    /// Where the glossy points are that stand for clusters: numbers of finest points.
    pub fn numbers(&self) -> impl Iterator<Item = u32> {
        self.points.iter().map(|point| point.number)
    }

    /// Vector irradiance at all receivers, of all levels: what they get of a lamp's light over lobes, less what they would get if those were
    /// matt. `direct`: its irradiance at the finest points; `incident`: the same at [`GlossySenders::numbers`], as many directions of
    /// each. `None` where it is nothing.
    pub fn over_lobes(
        &self,
        transfer: &Transfer,
        direct: &[Vec3],
        incident: &[Incident],
    ) -> Option<Vec<VectorIrradiance>> {
        let each = incident.len() / self.points.len();
        let lit: Vec<Vec<Incident>> = (incident.chunks(each.max(1)))
            .map(|of| {
                of.iter()
                    .copied()
                    .filter(|lit| lit.irradiance != Vec3::ZERO)
                    .collect()
            })
            .collect();
        if lit.iter().all(Vec::is_empty) {
            return None;
        }
        let radiosity = transfer.radiosity(direct);
        let means = transfer.senders.pulled(&radiosity).concat();
        let around = |cluster: &Cluster, k: usize| match cluster.around[k] {
            NONE => radiosity[cluster.samples[k] as usize],
            around => means[around as usize],
        };
        let is_lit = |sender: u32| {
            let cluster = &self.clusters[sender as usize];
            cluster.samples.into_iter().enumerate().any(|(k, point)| {
                let glossy = self.glossy(point).filter(|&glossy| !lit[glossy].is_empty());
                glossy.is_some() && around(cluster, k) != Vec3::ZERO
            })
        };
        let wanted: Vec<bool> = (0u32..)
            .zip(&self.clusters)
            .map(|(sender, cluster)| is_lit(sender) || is_lit(cluster.parent))
            .collect();
        let difference = |sender: usize, receiver: usize| -> Vec3 {
            let cluster = &self.clusters[sender];
            let (to, normal) = (transfer.position_of(receiver), transfer.normal_of(receiver));
            let (mut more, mut matt, mut seen) = (Vec3::ZERO, Vec3::ZERO, 0.0);
            for (k, &point) in (cluster.samples.iter().enumerate()).filter(|(_, point)| **point != NONE) {
                // What lies behind a receiver, it does not see: a cluster goes on beyond the wall.
                if normal.dot(transfer.finest.positions[point as usize] - to) <= 0.0 {
                    continue;
                }
                let around = around(cluster, k);
                matt += around;
                seen += 1.0;
                if let Some(glossy) = self.glossy(point) {
                    let [own, own_matt] = self.points[glossy].sent(&lit[glossy], to, cluster.radius);
                    // Of a lamp with extent a few rays may by chance find less.
                    let expected = if each == 1 { around } else { Vec3::ZERO };
                    more += around * share(own - own_matt, own_matt, expected);
                }
            }
            means[sender] * share(more, matt, means[sender] * seen)
        };
        Some(transfer.over_links(&wanted, |sender, receiver| {
            let own = difference(sender, receiver);
            let above = self.clusters[sender].parent as usize;
            Vec3A::from(match above == sender {
                true => own,
                false => own - difference(above, receiver),
            })
        }))
    }

    fn glossy(&self, point: u32) -> Option<usize> {
        let glossy = *self.glossy_of.get(point as usize)?;
        (glossy != NONE).then_some(glossy as usize)
    }
}

/// What `more` is of the larger of what points have and what is `expected` of them; 0 of nothing. Those that have less than expected stand for
/// what is dark: they send what they would if they were lit, and the first ray that reaches them does not turn all of a cluster's light.
fn share(more: Vec3, had: Vec3, expected: Vec3) -> Vec3 {
    more / had.max(expected).max(Vec3::splat(f32::MIN_POSITIVE))
}

/// All senders; `footprint` as above.
fn clusters(transfer: &Transfer, footprint: f32) -> Vec<Cluster> {
    let (senders, finest) = (&transfer.senders, &transfer.finest);
    let mut clusters = Vec::new();
    for level in 0..senders.levels() {
        let range = senders.ranges.range(level);
        let mut samples = vec![[NONE; SAMPLES]; range.len()];
        let (mut weights, mut areas) = (vec![0.0; range.len()], vec![0.0; range.len()]);
        for (point, (cluster, weight)) in senders.point_weights(level).into_iter().enumerate() {
            let cluster = cluster as usize;
            let width = finest.widenings.get(point).map_or(1.0, |&k| width(k));
            areas[cluster] += footprint * width * width;
            // Whoever has the weight at the middle of a sample's share stands for it.
            let before: f64 = weights[cluster];
            weights[cluster] += weight;
            for (k, sample) in samples[cluster].iter_mut().enumerate() {
                let middle = (k as f64 + MIDDLE) / SAMPLES as f64;
                if before <= middle && middle < weights[cluster] {
                    *sample = point as u32;
                }
            }
        }
        let finer = (level + 1 < senders.levels()).then(|| {
            let start = senders.ranges.range(level + 1).start as u32;
            (start, senders.cluster_of_point(level + 1))
        });
        let around = |point: u32| match &finer {
            Some((start, cluster_of_point)) if point != NONE => start + cluster_of_point[point as usize],
            _ => NONE,
        };
        for (cluster, (samples, area)) in samples.into_iter().zip(areas).enumerate() {
            let parent = match level {
                0 => range.start as u32 + cluster as u32,
                _ => senders.ranges.range(level - 1).start as u32 + senders.parents[level - 1][cluster],
            };
            clusters.push(Cluster {
                around: samples.map(around),
                samples,
                radius: (area / (PI * SAMPLES as f32)).sqrt(),
                parent,
            });
        }
    }
    clusters
}

impl GlossyPoint {
    /// Radiosity towards a place, and what it would be if the point were matt, W/m².
    fn sent(&self, lit: &[Incident], to: Vec3, radius: f32) -> [Vec3; 2] {
        let way = to - self.shading.position;
        let distance = way.length();
        let view = way / distance.max(f32::MIN_POSITIVE);
        let irradiance: Vec3 = lit.iter().map(|lit| lit.irradiance).sum();
        let matt = irradiance * self.albedo;
        if self.shading.geometric_normal.dot(view) <= 0.0 {
            return [matt; 2];
        }
        // Half vectors turn by half of what either direction does over the surface that the point stands for, whose places lie half its
        // radius from the middle along each axis.
        let turn = |distance: f32| 0.25 * radius / distance.max(radius);
        let of = |lit: &Incident| {
            let turn = turn(distance) + turn(lit.distance);
            let slope = (self.shading.alpha * self.shading.alpha + 2.0 * turn * turn).sqrt();
            let wide = bsdf::at_least_as_wide(&self.shading, slope.clamp(SLOPE, 1.0));
            lit.irradiance * bsdf::eval(&wide, view, lit.direction) * PI
        };
        [lit.iter().map(of).sum(), matt]
    }
}

/// Whether a lobe matters, as for what the eye sees.
fn is_glossy(point: &ShadingPoint) -> bool {
    reflections::rays(point, point.shading_normal, 1) > 0
}
