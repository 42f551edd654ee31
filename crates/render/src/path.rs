//! The reference: a unidirectional path tracer with next-event estimation (Kajiya 1986), whose light samples
//! and BRDF samples share the work by multiple importance sampling with the power heuristic (Veach 1997, 9.2.4).
//!
//! At every vertex all lights are sampled where there are few, otherwise one that is drawn by its importance
//! there. Russian roulette after a few reflections survives with the largest channel of the throughput, so it
//! is indifferent to the lights' intensity. Unlit materials show their base colour to the eye and to nothing else.
//!
//! Rays from the eye and off sharp lobes bend in solid glass, all others go straight on through it, as light samples do (`ways`): what glass
//! gathers into caustics arrives as if it had not been bent.
//!
//! Shading normals are used as they are (the BRDF's cosine is theirs); light that passes the true surface is
//! cut by the BRDF.

use crate::direct::{direct_sample, light_met};
use crate::layers::PixelSum;
use crate::picture::{Picture, Seen};
use crate::sampler::Sampler;
use crate::watch::Cancelled;
use glam::Vec3;
use relight_scene::bsdf;
use relight_scene::image::Layers;
use relight_scene::light_set::LightSet;
use relight_scene::rays::Ray;
use relight_scene::shading::ShadingPoint;
use relight_scene::surface::{SurfaceHit, Surfaces, ray_from};
use relight_scene::traced::TracedScene;

/// Samples per pixel where none are asked for.
pub const SPP: u32 = 64;

/// Up to this many lights are all sampled at every vertex: a shadow ray costs less than the variance of
/// leaving a light out.
const FEW_LIGHTS: usize = 4;

/// Reflections before Russian roulette: they carry most of the light.
const ROULETTE_AFTER: u32 = 3;

/// Largest chance to survive roulette. Below 1, or a room that absorbs nothing would hold a path for ever; so
/// near to 1 that paths at reflectance 0.999 gain no variance from it.
const MAX_SURVIVAL: f32 = 0.9999;

/// Renders an image from paths of at most `max_bounces` reflections, or any number. Layers: see [`crate::layers`].
///
/// # Errors
/// [`Cancelled`] if the picture's watch says so.
pub fn render(picture: &Picture<'_>, max_bounces: Option<u32>) -> Result<Layers, Cancelled> {
    let tracer = Tracer {
        picture,
        scene: picture.scene,
        lights: picture.lights,
        max_bounces: max_bounces.unwrap_or(u32::MAX),
    };
    picture.by_samples(
        picture.spp.unwrap_or(SPP),
        || (),
        |(), pixel, sample, sums| {
            let (eye, mut sampler) = picture.eye_ray(pixel, sample);
            tracer.trace(eye, &mut sampler, sums);
        },
    )
}

struct Tracer<'a> {
    picture: &'a Picture<'a>,
    scene: &'a TracedScene,
    lights: &'a LightSet<'a>,
    max_bounces: u32,
}

impl Tracer<'_> {
    fn trace(&self, eye: Ray, sampler: &mut Sampler, sums: &mut PixelSum) {
        let Some(Seen { mut hit, ray, tint }) = self.picture.see(&eye, sums) else {
            return;
        };
        let mut wo = -ray.direction;
        let mut throughput = tint * self.scene.tint(&ray, hit.t);
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
            let weighed = |light, pdf| power_heuristic(sample.pdf, pdf * choice.probability(light));
            let (way, factor) = self.way(&ray, (&hit, &point), wo, sampler);
            throughput *= factor;
            let look = self.go(way, &ray, |light, radiance, pdf| {
                let weight = pdf.map_or(1.0, |pdf| weighed(light, pdf));
                sums.add(Some(light), reflections, throughput * radiance * weight);
            });
            // From the ray's own origin, not the hit's: distances to lights and surfaces must compare.
            light_met(
                self.scene,
                self.lights,
                look.ray.origin,
                look.ray.direction,
                look.hit.as_ref(),
                Some(&(&hit).into()),
                |light, radiance, pdf| {
                    // Light samples don't bend.
                    let weight = if look.bent { 1.0 } else { weighed(light, pdf) };
                    let radiance = radiance * look.tint;
                    sums.add(Some(light), reflections, throughput * radiance * weight);
                },
            );
            throughput *= look.tint;
            match look.hit {
                Some(next) => {
                    throughput *= self.scene.tint(&look.ray, next.t);
                    hit = next;
                }
                None => return,
            }
            wo = -look.ray.direction;
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

#[cfg(test)]
mod glass_tests;
#[cfg(test)]
mod tests;
mod ways;
