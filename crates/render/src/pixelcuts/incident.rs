//! Incident light at all points by cuts of pixel trees.

use super::stats::{PixelcutsStats, lap};
use super::view::{Point, View};
use crate::direct::reflected;
use crate::many_lights::{PointLights, clamped};
use crate::watch::{Cancelled, Watch, go_on};
use glam::{Mat3, Quat, Vec3};
use rayon::prelude::*;
use relight_scene::bsdf::bounds::ReflectionBound;
use relight_scene::rays::SurfacePoint;
use relight_scene::surface::{Surfaces, ray_end};
use relight_scene::traced::TracedScene;
use relight_transport::pixel_scatter::{Run, scatter, stride};
use relight_transport::pixel_tree::{CutLight, CutLimits, PixelTree, choose_cut};
use relight_transport::point_light::Emission;
use relight_transport::random::{Stream, mix};
use std::f32::consts::TAU;
use std::time::Instant;

/// Cuts grow by refinement to this many times their random size at most (section 3).
const REFINED: u32 = 10;
/// Which tree a light goes to.
fn group(seed: u64, light: u32, trees: u32) -> u32 {
    (mix(mix(seed ^ stage::GROUP) ^ u64::from(light)) % u64::from(trees)) as u32
}

/// Stages of the random streams.
mod stage {
    pub const GROUP: u64 = 0x7078_0001;
    pub const ROTATION: u32 = 0x7078_0002;
    pub const CUT: u32 = 0x7078_0003;
    pub const COARSE_CUT: u32 = 0x7078_0004;
    pub const PIXEL: u32 = 0x7078_0005;
}

/// Metres that a normal's difference of 1 counts for in a tree, as a share of the diagonal: some five times the size of
/// a cluster, so that walls are told apart first.
const NORMAL_SCALE: f32 = 0.1;
/// Leaves of a tree for each cluster that the largest cut may have, at least.
const PER_FINEST: u64 = 3;
/// Clusters of the lights that are in memory at once, some 40 bytes each, before refinement.
const BATCH: usize = 1 << 20;

/// What incident light comes from.
pub(super) struct Gather<'a> {
    pub scene: &'a TracedScene,
    pub points: &'a PointLights,
    pub view: &'a View,
    /// Mean incident light, largest channel, W/m².
    pub mean: f64,
    pub flat: bool,
    /// What is asked of each of the view's points.
    pub targets: Vec<Target>,
    pub seed: u64,
    pub watch: &'a dyn Watch,
}

/// What sending asks of a point, in one place: points are visited at random.
pub(super) struct Target {
    end: SurfacePoint,
    shading_normal: Vec3,
    /// Most that a virtual light may give, reflected radiance.
    limit: f32,
    /// Incident light, largest channel, that cannot be reflected as more than that.
    unlimited: f32,
}

impl Target {
    pub fn new(point: &Point) -> Target {
        Target {
            end: ray_end(&point.hit),
            shading_normal: point.shading.shading_normal,
            limit: f32::INFINITY,
            unlimited: f32::INFINITY,
        }
    }

    /// With a limit on what virtual lights may give, reflected radiance.
    pub fn limited(&mut self, point: &Point, limit: f32) {
        let most = ReflectionBound::new(&point.shading, point.wo).bound(|_| (1.0, 0.0));
        self.limit = limit;
        self.unlimited = limit / most.max_element();
    }
}

/// How fine.
pub(super) struct Job {
    pub clusters: u32,
    pub trees: u32,
    pub threshold: f32,
    /// Highest degree of the harmonics.
    pub degree: usize,
    /// For the clamp: lights count for at most the mean incident light.
    pub coarse: bool,
}

/// A light's cut as runs, with the number of its clusters and shadow rays.
struct Sent {
    runs: Vec<Run>,
    clusters: u64,
    shadow_rays: u64,
}

impl Gather<'_> {
    /// For each of `belongs` the incident light ([`stride`] numbers a point) of those of `lights` that belong to it;
    /// empty where none does.
    pub fn incident(
        &self,
        job: &Job,
        lights: &[u32],
        belongs: &[impl Fn(u32) -> bool],
        stats: &mut PixelcutsStats,
    ) -> Result<Vec<Vec<f32>>, Cancelled> {
        let stride = stride(job.degree);
        let mut incident: Vec<Vec<f32>> = belongs.iter().map(|_| Vec::new()).collect();
        let pixels = self.view.tree_pixels();
        let mut row = Vec::new();
        for tree in 0..job.trees {
            let mut clock = Instant::now();
            let own: Vec<u32> = lights
                .iter()
                .copied()
                .filter(|&light| group(self.seed, light, job.trees) == tree)
                .collect();
            if own.is_empty() || pixels.is_empty() {
                continue;
            }
            let rotation = rotation(&mut Stream::new(self.seed, stage::ROTATION, u64::from(tree)));
            let finest = u64::from(job.clusters) * u64::from(REFINED) * PER_FINEST;
            let leaf = (pixels.len() as u64 / finest) as usize;
            let tree = PixelTree::new(&pixels, rotation, self.view.diagonal * NORMAL_SCALE, leaf);
            let mut place = vec![0u32; tree.order.len()];
            tree.order
                .iter()
                .enumerate()
                .for_each(|(at, &pixel)| place[pixel as usize] = at as u32);
            lap(&mut clock, &mut stats.times.trees);
            for (belongs, incident) in belongs.iter().zip(&mut incident) {
                let own: Vec<u32> = own.iter().copied().filter(|&light| belongs(light)).collect();
                if own.is_empty() {
                    continue;
                }
                row.clear();
                row.resize(pixels.len() * stride, 0.0f32);
                incident.resize(pixels.len() * stride, 0.0);
                for batch in own.chunks((BATCH / job.clusters as usize).max(1)) {
                    go_on(self.watch)?;
                    let sent: Vec<Sent> = batch
                        .par_iter()
                        .map_init(Vec::new, |cut, &light| self.send(job, &tree, light, cut))
                        .collect();
                    for sent in &sent {
                        stats.clusters += sent.clusters;
                        stats.shadow_rays += sent.shadow_rays;
                    }
                    let runs: Vec<Vec<Run>> = sent.into_iter().map(|sent| sent.runs).collect();
                    lap(&mut clock, &mut stats.times.cuts);
                    scatter(&runs, job.degree, &mut row);
                    lap(&mut clock, &mut stats.times.scatter);
                }
                incident
                    .par_chunks_exact_mut(stride)
                    .zip(&place)
                    .for_each(|(out, &at)| {
                        let from = &row[at as usize * stride..][..stride];
                        out.iter_mut().zip(from).for_each(|(out, from)| *out += from);
                    });
                lap(&mut clock, &mut stats.times.scatter);
            }
        }
        Ok(incident)
    }

    /// Sends one light to the clusters of its cut.
    fn send(&self, job: &Job, tree: &PixelTree, light: u32, cut: &mut Vec<u32>) -> Sent {
        let i = light as usize;
        let source = &self.points.lights[i];
        let stage = if job.coarse { stage::COARSE_CUT } else { stage::CUT };
        let mut stream = Stream::new(self.seed, stage, u64::from(light));
        let strength = f64::from(source.intensity.max_element()) / self.mean;
        let limits = CutLimits {
            clusters: job.clusters,
            threshold: job.threshold,
            most: job.clusters.saturating_mul(REFINED),
        };
        choose_cut(
            tree,
            &CutLight::new(source, tree.rotation, strength as f32),
            &limits,
            &mut stream,
            cut,
        );
        let mut runs: Vec<Run> = Vec::with_capacity(cut.len());
        let (mut rays, mut rayed) = (Vec::with_capacity(cut.len()), Vec::with_capacity(cut.len()));
        let own = mix(self.seed ^ u64::from(light));
        // Chosen by themselves first: points lie far apart in memory, and are waited for together.
        let chosen: Vec<u32> = (cut.iter())
            .map(|&at| {
                let node = &tree.nodes[at as usize];
                let pixels = node.end - node.first;
                // By the node's number: of a cut that has changed a little, other nodes keep their pixels.
                let random = Stream::new(own, stage::PIXEL, at.into()).uniform();
                let chosen = node.first + ((random * pixels as f32) as u32).min(pixels - 1);
                tree.order[chosen as usize]
            })
            .collect();
        for (&at, &point) in cut.iter().zip(&chosen) {
            let node = &tree.nodes[at as usize];
            let mut run = self.unoccluded(job, i, point as usize, node.flat && self.flat, node.glossy);
            run.start = node.first;
            if run.light != Vec3::ZERO {
                let place = &self.targets[point as usize];
                match self.points.shadow_ray(i, &place.end) {
                    Some(ray) => {
                        rays.push(ray);
                        rayed.push(runs.len());
                    }
                    None => run.light = Vec3::ZERO,
                }
            }
            runs.push(run);
        }
        let mut occluded = vec![false; rays.len()];
        self.scene.occluded_packet(&rays, &mut occluded);
        for (&at, _) in rayed.iter().zip(&occluded).filter(|(_, occluded)| **occluded) {
            runs[at].light = Vec3::ZERO;
        }
        let (clusters, shadow_rays) = (cut.len() as u64, rays.len() as u64);
        // Dark neighbours are one run.
        runs.dedup_by(|run, before| run.light == Vec3::ZERO && before.light == Vec3::ZERO);
        runs.shrink_to_fit();
        Sent {
            runs,
            clusters,
            shadow_rays,
        }
    }

    /// What light `i` sends to a point, as incident light of its cluster.
    fn unoccluded(&self, job: &Job, i: usize, point: usize, flat: bool, glossy: bool) -> Run {
        let light = &self.points.lights[i];
        let mut run = Run {
            start: 0,
            light: Vec3::ZERO,
            direction: Vec3::Z,
            cosine: 0.0,
            harmonics: false,
        };
        let place = &self.targets[point];
        let Some(arrival) = self.points.arrival(i, place.end.position) else {
            return run;
        };
        let cosine = place.shading_normal.dot(arrival.direction);
        // From behind it reaches no surface.
        if place.end.normal.dot(arrival.direction) <= 0.0 || (flat && cosine <= 0.0) {
            return run;
        }
        let irradiance = light.intensity.as_dvec3() * f64::from(arrival.factor);
        let mut share = 1.0;
        if job.coarse && light.emission != Emission::Directional {
            share = (self.mean / irradiance.max_element()).min(1.0);
        }
        if self.points.is_clamped(i) && irradiance.max_element() > f64::from(place.unlimited) {
            let Point { shading, wo, .. } = &self.view.points[point];
            let toll = reflected(shading, *wo, arrival.direction).as_dvec3() * irradiance;
            let radiance = toll.as_vec3();
            let largest = radiance.max_element();
            if largest > 0.0 {
                share *= f64::from(clamped(radiance, place.limit).max_element() / largest);
            }
        }
        let incoming = (irradiance * share).as_vec3();
        if !incoming.is_finite() {
            return run;
        }
        run.light = incoming;
        run.direction = arrival.direction;
        run.harmonics = glossy || !flat;
        if flat {
            // Where there are harmonics, too, what they get wrong of the cosine.
            let known = if run.harmonics {
                harmonic_cosine(cosine, job.degree)
            } else {
                0.0
            };
            run.cosine = cosine - known;
        }
        run
    }
}

/// What harmonics up to `degree` make of light from one direction as irradiance of a surface at this cosine to it:
/// Σ Âₗ (2l + 1)/4π Pₗ, with the factors of [`relight_transport::sh::irradiance_factors`].
fn harmonic_cosine(cosine: f32, degree: usize) -> f32 {
    let terms = [0.25, 0.5 * cosine, 0.3125 * (1.5 * cosine * cosine - 0.5)];
    terms.iter().take(degree + 1).sum()
}

/// A uniformly distributed rotation (Shoemake 1992).
fn rotation(stream: &mut Stream) -> Mat3 {
    let (a, b, c) = (stream.uniform(), stream.uniform() * TAU, stream.uniform() * TAU);
    let (r, s) = ((1.0 - a).sqrt(), a.sqrt());
    Mat3::from_quat(Quat::from_xyzw(r * b.sin(), r * b.cos(), s * c.sin(), s * c.cos()).normalize())
}
