//! The reference: a unidirectional path tracer with next-event estimation (Kajiya 1986), whose light samples
//! and BRDF samples share the work by multiple importance sampling with the power heuristic (Veach 1997, 9.2.4).
//!
//! At every vertex all lights are sampled where there are few, otherwise one that is drawn by its importance
//! there. Russian roulette after a few reflections survives with the largest channel of the throughput, so it
//! is indifferent to the lights' intensity. Unlit materials show their base colour to the eye and to nothing else.
//!
//! Shading normals are used as they are (the BRDF's cosine is theirs); light that passes the true surface is
//! cut by the BRDF.

use crate::direct::{direct_sample, light_met};
use crate::layers::{PixelSum, RenderSize, render_tiles};
use crate::sampler::Sampler;
use crate::watch::{Cancelled, Watch};
use glam::{Vec2, Vec3};
use relight_scene::bsdf;
use relight_scene::camera::Camera;
use relight_scene::image::Layers;
use relight_scene::light_set::LightSet;
use relight_scene::rays::Ray;
use relight_scene::shading::ShadingPoint;
use relight_scene::surface::{SurfaceHit, Surfaces, ray_from};
use relight_scene::traced::TracedScene;

/// How to path-trace.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PathSettings {
    /// Samples per pixel.
    pub spp: u32,
    /// Most reflections of a path; unlimited where `None`.
    pub max_bounces: Option<u32>,
    /// Images with different seeds are independent.
    pub seed: u64,
    /// Whether to make a layer per light.
    pub light_layers: bool,
}

impl Default for PathSettings {
    fn default() -> Self {
        PathSettings {
            spp: 64,
            max_bounces: None,
            seed: 0,
            light_layers: false,
        }
    }
}

/// Up to this many lights are all sampled at every vertex: a shadow ray costs less than the variance of
/// leaving a light out.
const FEW_LIGHTS: usize = 4;

/// Reflections before Russian roulette: they carry most of the light.
const ROULETTE_AFTER: u32 = 3;

/// Largest chance to survive roulette. Below 1, or a room that absorbs nothing would hold a path for ever; so
/// near to 1 that paths at reflectance 0.999 gain no variance from it.
const MAX_SURVIVAL: f32 = 0.9999;

/// Renders an image. Layers: see [`crate::layers`].
///
/// # Errors
/// [`Cancelled`] if `watch` says so.
pub fn render(
    scene: &TracedScene,
    lights: &LightSet<'_>,
    camera: &Camera,
    size: RenderSize,
    settings: &PathSettings,
    watch: &dyn Watch,
) -> Result<Layers, Cancelled> {
    let tracer = Tracer {
        scene,
        lights,
        max_bounces: settings.max_bounces.unwrap_or(u32::MAX),
    };
    render_tiles(
        size,
        lights,
        settings.light_layers,
        settings.spp,
        watch,
        |x, y, sums| {
            let pixel = (y * size.width + x) as u64;
            for sample in 0..settings.spp {
                let mut sampler = Sampler::new(settings.seed, pixel, sample);
                tracer.trace(eye_ray(camera, size, x, y, &mut sampler), &mut sampler, sums);
            }
        },
    )
}

/// A ray through a random point of a pixel (box filter).
pub(crate) fn eye_ray(camera: &Camera, size: RenderSize, x: usize, y: usize, sampler: &mut Sampler) -> Ray {
    let place = Vec2::from(sampler.next_2d()) + Vec2::new(x as f32, y as f32);
    Ray {
        origin: camera.position,
        direction: camera.direction(place, Vec2::new(size.width as f32, size.height as f32)),
        t_min: 0.0,
        t_max: f32::INFINITY,
    }
}

/// What the eye sees of a ray: emission of lights and surfaces and what surfaces are like. Returns the hit.
pub(crate) fn see(
    scene: &TracedScene,
    lights: &LightSet<'_>,
    ray: &Ray,
    sums: &mut PixelSum,
) -> Option<SurfaceHit> {
    let hit = scene.closest_hit(ray);
    met(scene, lights, ray, hit.as_ref(), sums);
    hit
}

/// Adds what an eye ray that ends at `hit` shows without any reflection, as [`see`] does.
pub(crate) fn met(
    scene: &TracedScene,
    lights: &LightSet<'_>,
    ray: &Ray,
    hit: Option<&SurfaceHit>,
    sums: &mut PixelSum,
) {
    light_met(
        scene,
        lights,
        ray.origin,
        ray.direction,
        hit,
        |light, radiance, _| {
            sums.add(Some(light), 0, radiance);
        },
    );
    if let Some(hit) = hit {
        let point = scene.shading_point(hit);
        if scene.material(hit.primitive).unlit {
            sums.add(None, 0, point.emission);
        }
        sums.add_surface(scene.albedo(hit), point.shading_normal, hit.t);
    }
}

struct Tracer<'a> {
    scene: &'a TracedScene,
    lights: &'a LightSet<'a>,
    max_bounces: u32,
}

impl Tracer<'_> {
    fn trace(&self, eye: Ray, sampler: &mut Sampler, sums: &mut PixelSum) {
        let Some(mut hit) = see(self.scene, self.lights, &eye, sums) else {
            return;
        };
        let mut wo = -eye.direction;
        let mut throughput = Vec3::ONE;
        let mut choice = Choice::default();
        for reflections in 1..=self.max_bounces {
            let point = self.scene.shading_point(&hit).facing(wo);
            choice.prepare(self.lights, hit.position);
            self.next_event(&hit, &point, wo, reflections, throughput, &choice, sampler, sums);

            let random = sampler.next_3d();
            let Some(sample) = bsdf::sample(&point, wo, random) else {
                return;
            };
            throughput *= sample.weight;
            let strength = throughput.max_element();
            if strength.is_nan() || strength <= 0.0 {
                return;
            }
            if reflections > ROULETTE_AFTER {
                let survival = strength.min(MAX_SURVIVAL);
                if sampler.next_1d() >= survival {
                    return;
                }
                throughput /= survival;
            }

            let ray = ray_from(&hit, sample.wi);
            let next = self.scene.closest_hit(&ray);
            // From the ray's own origin, not the hit's: distances to lights and surfaces must compare.
            light_met(
                self.scene,
                self.lights,
                ray.origin,
                sample.wi,
                next.as_ref(),
                |light, radiance, pdf| {
                    let weight = power_heuristic(sample.pdf, pdf * choice.probability(light));
                    sums.add(Some(light), reflections, throughput * radiance * weight);
                },
            );
            match next {
                Some(next) => hit = next,
                None => return,
            }
            wo = -sample.wi;
        }
    }

    /// Light samples at a vertex.
    fn next_event(
        &self,
        hit: &SurfaceHit,
        point: &ShadingPoint,
        wo: Vec3,
        reflections: u32,
        throughput: Vec3,
        choice: &Choice,
        sampler: &mut Sampler,
        sums: &mut PixelSum,
    ) {
        let mut one = |light: usize, chance: f32, random: [f32; 3]| {
            let found = direct_sample(self.scene, self.lights, light, hit, point, wo, random);
            if let Some((radiance, sample)) = found {
                let weight = if sample.pdf > 0.0 {
                    power_heuristic(sample.pdf * chance, bsdf::pdf(point, wo, sample.direction))
                } else {
                    1.0
                };
                sums.add(
                    Some(light),
                    reflections,
                    throughput * radiance * (weight / chance),
                );
            }
        };
        if choice.all {
            for light in 0..self.lights.len() {
                one(light, 1.0, sampler.next_3d());
            }
        } else if let Some(light) = choice.draw(sampler.next_1d()) {
            one(light, choice.probability(light), sampler.next_3d());
        }
    }
}

/// Which lights a vertex samples.
#[derive(Default)]
struct Choice {
    /// All of them.
    all: bool,
    /// Otherwise one: rising sums of the chances, the last 1; empty if nothing shines there.
    sums: Vec<f64>,
}

impl Choice {
    fn prepare(&mut self, lights: &LightSet<'_>, x: Vec3) {
        self.all = lights.len() <= FEW_LIGHTS;
        if self.all {
            return;
        }
        self.sums.clear();
        let mut total = 0.0;
        for light in 0..lights.len() {
            let importance = lights.importance(light, x);
            total += if importance.is_finite() { importance } else { 0.0 };
            self.sums.push(total);
        }
        if total > 0.0 {
            self.sums.iter_mut().for_each(|sum| *sum /= total);
        } else {
            self.sums.clear();
        }
    }

    fn draw(&self, random: f32) -> Option<usize> {
        let light = self.sums.partition_point(|&sum| sum <= f64::from(random));
        (light < self.sums.len()).then_some(light)
    }

    /// Chance that a light is sampled at this vertex.
    fn probability(&self, light: usize) -> f32 {
        if self.all {
            return 1.0;
        }
        match (light, self.sums.get(light)) {
            (_, None) => 0.0,
            (0, Some(sum)) => *sum as f32,
            (_, Some(sum)) => (sum - self.sums[light - 1]) as f32,
        }
    }
}

/// Weight of a sample drawn with density `own` where the other strategy has density `other`: own² / (own² +
/// other²), written so that densities of any size neither overflow nor vanish.
fn power_heuristic(own: f32, other: f32) -> f32 {
    if other <= 0.0 {
        return 1.0;
    }
    let ratio = f64::from(other) / f64::from(own);
    (1.0 / (1.0 + ratio * ratio)) as f32
}
