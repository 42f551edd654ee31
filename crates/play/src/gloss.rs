//! What lamps send over glossy surfaces: their lobes in place of the matt reflection that links are for.
//!
//! A link takes a cluster's radiosity to a receiver as if the cluster sent it evenly. Of light that comes from one side, a glossy surface sends
//! most to the other, so that a receiver gets more or less. Of each cluster some points stand for all: they know their irradiance and
//! whence the lamp shines, and their BRDF says what they send to this receiver; the difference to what is matt goes over the same
//! link. Each counts by the mean light around it, not by its own: a shadow's edge that passes one of four points would switch a quarter of
//! the cluster. Lobes are as much wider as the piece of surface is that a point stands for, and as the lamp. All of it is linear in the
//! lamps' light. Light of further reflections comes from all around, and is taken as ever.

use crate::lit::{Lit, share};
use crate::reflections;
use crate::transfer::Transfer;
use glam::{Vec3, Vec3A};
use rayon::prelude::*;
use relight_render::irradiance::Arrivals;
use relight_scene::shading::ShadingPoint;
use relight_scene::surface::SurfaceHit;
use relight_scene::traced::TracedScene;
use relight_transport::links::FamilyRow;
use relight_transport::pyramid::VectorIrradiance;
use relight_transport::senders::SenderTree;
use std::f32::consts::PI;
use std::ops::Range;

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
    /// Points that stand for clusters, cluster by cluster.
    samples: Vec<Sample>,
    /// All senders but children without siblings, which have no coefficient.
    families: Vec<Family>,
}

/// Senders of one parent, or one of the coarsest level.
struct Family {
    senders: Vec<u32>,
    parent: Option<u32>,
}

/// Length of links from which on the coefficients of siblings leave their mean to their parent exactly: what a hemisphere full of radiosity 1
/// sends. Where a row keeps all of a family but one small child, links are as much longer than that as the child is smaller than its family, and
/// cancel each other for coefficients whose weighted sum is zero alone. Of shorter ones the parent's own points say its mean.
const LONG: f32 = 1.0;

/// No point.
const NONE: u32 = u32::MAX;

/// One of the points that stand for a cluster.
#[derive(Clone, Copy)]
struct Sample {
    /// Finest point.
    point: u32,
    /// The cluster of the next finer level around it; [`NONE`] on the finest.
    around: u32,
}

struct Cluster {
    /// Points that stand for it, in the list of all; none where it has no points.
    samples: Range<usize>,
    /// Radius of the surface that each of those stands for, m.
    radius: f32,
    /// Its part of its parent; 1 on the coarsest level.
    share: f32,
}

struct GlossyPoint {
    /// Which finest point.
    number: u32,
    shading: ShadingPoint,
    /// What links take it to reflect.
    albedo: Vec3,
}

impl GlossySenders {
    /// Those of the finest points, which lie at `places`; `None` where nothing is glossy enough.
    pub fn new(
        scene: &TracedScene,
        places: &[Option<SurfaceHit>],
        transfer: &Transfer,
    ) -> Option<GlossySenders> {
        let (clusters, samples) = clusters(transfer);
        let mut numbers: Vec<u32> = samples.iter().map(|sample| sample.point).collect();
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
            samples,
            families: families(&transfer.senders),
        })
    }

    /// Where the glossy points are that stand for clusters: numbers of finest points.
    pub fn numbers(&self) -> impl Iterator<Item = u32> {
        self.points.iter().map(|point| point.number)
    }

    /// Vector irradiance at all receivers, of all levels: what they get of a lamp's light over lobes, less what they would get if those were
    /// matt. `direct`: its irradiance at the finest points; `arrivals`: the same at [`GlossySenders::numbers`].
    /// `None` where it is nothing.
    pub fn over_lobes(
        &self,
        transfer: &Transfer,
        direct: &[Vec3],
        arrivals: &Arrivals,
    ) -> Option<Vec<VectorIrradiance>> {
        let lit = Lit::of(arrivals)?;
        let light = LampLight {
            of: self,
            transfer,
            direct,
            irradiances: transfer.senders.pulled(direct).concat(),
            radiosities: transfer.senders.pulled(&transfer.radiosity(direct)).concat(),
            lit,
        };
        let families = light.families();
        let senders: Vec<&[u32]> = families.iter().map(|family| &family.senders[..]).collect();
        Some(transfer.over_links(&senders, |family, receiver, row, own| {
            light.coefficients(families[family], receiver, row, own);
        }))
    }

    fn samples_of(&self, sender: u32) -> &[Sample] {
        &self.samples[self.clusters[sender as usize].samples.clone()]
    }

    fn glossy(&self, point: u32) -> Option<usize> {
        let glossy = *self.glossy_of.get(point as usize)?;
        (glossy != NONE).then_some(glossy as usize)
    }
}

/// A lamp's light at what is glossy.
struct LampLight<'a> {
    of: &'a GlossySenders,
    transfer: &'a Transfer,
    /// Irradiance at the finest points.
    direct: &'a [Vec3],
    /// Its means over the senders.
    irradiances: Vec<Vec3>,
    /// Of what they reflect of it, too.
    radiosities: Vec<Vec3>,
    /// Whence it comes at each of the glossy points.
    lit: Vec<Lit>,
}

impl LampLight<'_> {
    /// Families over whose lobes some of it goes.
    fn families(&self) -> Vec<&Family> {
        let is_lit = |sample: &Sample| {
            let glossy = self.of.glossy(sample.point);
            glossy.is_some_and(|glossy| !self.lit[glossy].is_dark()) && self.around(sample) != Vec3::ZERO
        };
        let is_lit: Vec<bool> = (0..self.of.clusters.len() as u32)
            .map(|sender| self.of.samples_of(sender).iter().any(is_lit))
            .collect();
        let is_lit = |&sender: &u32| is_lit[sender as usize];
        (self.of.families.iter())
            .filter(|family| family.senders.iter().chain(&family.parent).any(is_lit))
            .collect()
    }

    /// Mean irradiance around a point that stands for a cluster.
    fn around(&self, sample: &Sample) -> Vec3 {
        match sample.around {
            NONE => self.direct[sample.point as usize],
            around => self.irradiances[around as usize],
        }
    }

    /// Coefficients of the members of a row's family, into `own`: what each sends to this receiver over lobes, less what it would if it were
    /// matt, and less that of its parent.
    fn coefficients(&self, family: &Family, receiver: usize, row: &FamilyRow, own: &mut [Vec3A]) {
        let Family { senders, parent } = family;
        let mut fill = |member: usize| own[member] = self.difference(senders[member], receiver).into();
        let above = match *parent {
            Some(_) if row.longest > LONG => {
                (0..senders.len()).for_each(&mut fill);
                let share = |&sender: &u32| self.of.clusters[sender as usize].share;
                (own.iter().zip(senders.iter().map(share)))
                    .map(|(&own, share)| own * share)
                    .sum()
            }
            _ => {
                row.members.iter().copied().for_each(&mut fill);
                parent.map_or(Vec3A::ZERO, |parent| self.difference(parent, receiver).into())
            }
        };
        row.members.iter().for_each(|&member| own[member] -= above);
    }

    /// What a sender has to send to a receiver over lobes, less what it would have if it were matt: radiosity, W/m².
    fn difference(&self, sender: u32, receiver: usize) -> Vec3 {
        let transfer = self.transfer;
        let radius = self.of.clusters[sender as usize].radius;
        let (to, normal) = (transfer.position_of(receiver), transfer.normal_of(receiver));
        let (mut more, mut matt, mut seen) = (Vec3::ZERO, Vec3::ZERO, 0.0);
        for sample in self.of.samples_of(sender) {
            let point = sample.point as usize;
            // What lies behind a receiver, it does not see: a cluster goes on beyond the wall.
            if normal.dot(transfer.finest.positions[point] - to) <= 0.0 {
                continue;
            }
            let around = self.around(sample);
            matt += around * transfer.albedo[point];
            seen += 1.0;
            if let Some(glossy) = self.of.glossy(sample.point) {
                let lit = &self.lit[glossy];
                let GlossyPoint { shading, albedo, .. } = &self.of.points[glossy];
                let irradiance = lit.irradiance();
                let part = match lit.is_unoccluded() {
                    // The light around says how much of it there is.
                    true => share(around, irradiance),
                    // Rays have its visibility: on average they are right.
                    false => Vec3::ONE,
                };
                let reflected = lit.reflected(shading, (to, Vec3::ZERO), radius, SLOPE);
                more += part * (reflected - *albedo * irradiance);
            }
        }
        match seen > 0.0 {
            true => more / seen * share(self.radiosities[sender as usize], matt / seen),
            false => Vec3::ZERO,
        }
    }
}

fn families(senders: &SenderTree) -> Vec<Family> {
    let mut families: Vec<Family> = (senders.ranges.range(0))
        .map(|sender| Family {
            senders: vec![sender as u32],
            parent: None,
        })
        .collect();
    for level in 1..senders.levels() {
        let start = senders.ranges.range(level).start as u32;
        for (at, parent) in senders.ranges.range(level - 1).enumerate() {
            let children = senders.children(level - 1, at);
            if children.len() > 1 {
                families.push(Family {
                    senders: children.iter().map(|child| start + child).collect(),
                    parent: Some(parent as u32),
                });
            }
        }
    }
    families
}

/// All senders, and the points that stand for them.
fn clusters(transfer: &Transfer) -> (Vec<Cluster>, Vec<Sample>) {
    let senders = &transfer.senders;
    let (mut clusters, mut samples) = (Vec::new(), Vec::new());
    for level in 0..senders.levels() {
        let range = senders.ranges.range(level);
        let is_finest = level + 1 == senders.levels();
        let mut found = vec![[NONE; SAMPLES]; range.len()];
        let mut weights = vec![0.0; range.len()];
        for (point, (cluster, weight)) in senders.point_weights(level).into_iter().enumerate() {
            let cluster = cluster as usize;
            // Whoever has the weight at the middle of a sample's share stands for it.
            let before: f64 = weights[cluster];
            weights[cluster] += weight;
            for (k, sample) in found[cluster].iter_mut().enumerate() {
                let middle = (k as f64 + MIDDLE) / SAMPLES as f64;
                if before <= middle && middle < weights[cluster] {
                    *sample = point as u32;
                }
            }
        }
        let finer = (!is_finest).then(|| {
            let start = senders.ranges.range(level + 1).start as u32;
            (start, senders.cluster_of_point(level + 1))
        });
        let around = |point: u32| match &finer {
            Some((start, cluster_of_point)) => start + cluster_of_point[point as usize],
            None => NONE,
        };
        let areas = &transfer.sender_areas[range.clone()];
        for (cluster, (found, area)) in found.into_iter().zip(areas).enumerate() {
            let start = samples.len();
            let points = found.into_iter().filter(|&point| point != NONE);
            samples.extend(points.map(|point| Sample {
                point,
                around: around(point),
            }));
            clusters.push(Cluster {
                samples: start..samples.len(),
                radius: (area / (PI * SAMPLES as f32)).sqrt(),
                share: senders.shares[range.start + cluster],
            });
        }
    }
    (clusters, samples)
}

/// Whether a lobe matters, as for what the eye sees.
fn is_glossy(point: &ShadingPoint) -> bool {
    reflections::rays(point, point.shading_normal, 1) > 0
}
