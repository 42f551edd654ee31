//! Virtual lights: what particles from the direct lights hit reflects on (instant radiosity, Keller 1997; Walter et al.
//! 2005, section 5).
//!
//! A particle leaves a point drawn by power, and at every hit leaves an oriented light with the diffuse part of what it
//! brings; it goes on by the whole BRDF, by Russian roulette with the reflectance, so that all particles of a white
//! light keep about the same power. Light that reaches the eye by way of a gloss on its last reflection but one (a
//! caustic) is therefore missing, as the paper says of itself.
//!
//! An oriented light leans on the true surface: its cosine is that of the geometric normal, and the particle's power is
//! changed by what the shading normal's cosine differs from the geometric one's on the way in (Veach 1997, 5.3.2), so
//! that the sum over virtual lights is what a path from the eye finds.

use super::points::{End, PointLights, PointSettings, stage};
use crate::sampler::Sampler;
use glam::{DVec3, Vec2};
use rayon::prelude::*;
use relight_scene::bsdf;
use relight_scene::environment::luminance;
use relight_scene::rays::{Ray, SurfacePoint, ray_from_surface};
use relight_scene::surface::{SurfaceHit, Surfaces, ray_end, ray_from};
use relight_scene::traced::TracedScene;
use relight_transport::point_light::{Emission, PointLight};
use relight_transport::random::{Stream, mix};
use relight_transport::sampling::{Frame, cosine_hemisphere};
use std::f32::consts::FRAC_1_PI;
use std::f64::consts::{PI, TAU};

/// Largest chance to go on: below 1, or a room that absorbs nothing would hold a particle for ever (as in
/// [`crate::path`]).
const MAX_SURVIVAL: f32 = 0.9999;
/// Particles that find out how many hits one has, and the fewest that are traced where so many lights are wanted: with
/// fewer, the lights of one path would show.
const PILOT: usize = 4096;
/// How often the number of particles is raised where they hit too little, and by how much more than it takes.
const ROUNDS: u32 = 4;
const MARGIN: f64 = 1.1;
/// Particles that one task traces.
const BATCH: usize = 256;
/// A surface within this share of the distance to the next one is one that the light lies in, as
/// [`relight_scene::rays::shadow_ray_to_point`] has it.
const TOUCHING: f32 = 1.0 / (1u32 << 17) as f32;
/// Smallest cosine with the true surface at which a hit counts: beyond, f32 knows neither cosine.
const MIN_COSINE: f32 = 1e-6;

/// A virtual light before it is known how many particles there are.
struct Deposit {
    light: PointLight,
    source: u32,
    clearance: f32,
}

/// Adds virtual lights of all that shines directly.
pub(super) fn push(points: &mut PointLights, scene: &TracedScene, settings: &PointSettings) {
    let wanted = settings.vpls as usize;
    if wanted == 0 {
        return;
    }
    let Some(emitter) = Emitter::new(points, scene, settings.seed) else {
        return;
    };
    let mut particles = PILOT;
    let mut deposits = emitter.deposits(particles);
    for _ in 0..ROUNDS {
        if deposits.len() >= wanted || deposits.is_empty() {
            break;
        }
        let hits = deposits.len() as f64 / particles as f64;
        particles = ((wanted as f64 / hits * MARGIN) as usize).max(particles + 1);
        deposits = emitter.deposits(particles);
    }
    // As many of them as wanted, evenly; each then stands for as many more.
    let kept = wanted.min(deposits.len());
    let start = f64::from(Stream::new(settings.seed, stage::THINNING, 0).uniform());
    let each = deposits.len() as f64 / kept.max(1) as f64;
    let power = emitter.particle_power(particles) * each;
    for k in 0..kept {
        let at = ((k as f64 + start) * each) as usize;
        let Deposit {
            light,
            source,
            clearance,
        } = &deposits[at.min(deposits.len() - 1)];
        let light = PointLight {
            intensity: (light.intensity.as_dvec3() * power).as_vec3(),
            ..*light
        };
        points.push(
            light,
            *source,
            End::Surface {
                clearance: *clearance,
            },
        );
    }
}

/// The direct lights as sources of particles.
struct Emitter<'a> {
    points: &'a PointLights,
    scene: &'a TracedScene,
    seed: u64,
    /// A ball around the scene, for directional lights.
    center: DVec3,
    radius: f64,
    /// Rising sums of the lights' power (luminance), the last 1.
    sums: Vec<f64>,
    /// W.
    total: f64,
}

impl<'a> Emitter<'a> {
    /// `None` without lights or surfaces.
    fn new(points: &'a PointLights, scene: &'a TracedScene, seed: u64) -> Option<Emitter<'a>> {
        let (low, high) = scene.bounds()?;
        let (low, high) = (low.as_dvec3(), high.as_dvec3());
        // A little more than half of the diagonal, or rounding would cut corners off.
        let radius = 0.5 * (high - low).length() * 1.001;
        let disc = PI * radius * radius;
        let mut total = 0.0;
        let mut sums: Vec<f64> = points
            .lights
            .iter()
            .map(|light| {
                total += f64::from(luminance(light.intensity)) * points.solid_angle(&light.emission, disc);
                total
            })
            .collect();
        sums.iter_mut().for_each(|sum| *sum /= total);
        (total > 0.0 && total.is_finite()).then_some(Emitter {
            points,
            scene,
            seed: mix(seed ^ stage::PARTICLES),
            center: 0.5 * (low + high),
            radius,
            sums,
            total,
        })
    }

    /// Luminance that each of so many particles starts with, W.
    fn particle_power(&self, particles: usize) -> f64 {
        self.total / particles as f64
    }

    /// What particles 0 to `count` leave behind, in their order, for a power of 1 each.
    fn deposits(&self, count: usize) -> Vec<Deposit> {
        let batches: Vec<Vec<Deposit>> = (0..count.div_ceil(BATCH))
            .into_par_iter()
            .map(|batch| {
                let mut deposits = Vec::new();
                for particle in batch * BATCH..((batch + 1) * BATCH).min(count) {
                    self.trace(particle as u32, &mut deposits);
                }
                deposits
            })
            .collect();
        batches.into_iter().flatten().collect()
    }

    fn trace(&self, particle: u32, deposits: &mut Vec<Deposit>) {
        let mut sampler = Sampler::new(self.seed, 0, particle);
        let random = f64::from(sampler.next_1d());
        let i = self
            .sums
            .partition_point(|&sum| sum <= random)
            .min(self.sums.len() - 1);
        let (light, source) = (&self.points.lights[i], self.points.source[i]);
        // Its colour; the luminance is 1.
        let mut power = light.intensity.as_dvec3() / f64::from(luminance(light.intensity));
        let (mut ray, weight) = self.leave(i, light, &mut sampler);
        power *= weight;
        let mut first = true;
        loop {
            let hit = if first {
                self.first_hit(&ray)
            } else {
                self.scene.closest_hit(&ray)
            };
            first = false;
            let Some(hit) = hit else { return };
            let wi = -ray.direction;
            let point = self.scene.shading_point(&hit).facing(wi);
            let (shading, geometric) = (point.shading_normal.dot(wi), hit.geometric_normal.dot(wi));
            if !(geometric > MIN_COSINE && shading > 0.0) {
                return;
            }
            let arrived = power * f64::from(shading / geometric);
            let intensity = arrived * (bsdf::diffuse_reflectance(&point, shading) * FRAC_1_PI).as_dvec3();
            let deposit = PointLight {
                emission: Emission::Oriented,
                position: hit.position,
                axis: hit.geometric_normal,
                intensity: intensity.as_vec3(),
            };
            if deposit.intensity.max_element() > 0.0 && deposit.intensity.is_finite() {
                let clearance = ray_end(&hit).clearance;
                deposits.push(Deposit {
                    light: deposit,
                    source,
                    clearance,
                });
            }
            let Some(sample) = bsdf::sample(&point, wi, sampler.next_3d()) else {
                return;
            };
            let (shading, geometric) = (
                point.shading_normal.dot(sample.wi),
                hit.geometric_normal.dot(sample.wi),
            );
            power = arrived * sample.weight.as_dvec3() * f64::from(geometric / shading);
            // By what the surface does to a white particle, so that nothing hangs on the light's colour or strength.
            let survival = sample.weight.max_element().min(MAX_SURVIVAL);
            if sampler.next_1d() >= survival || !power.is_finite() {
                return;
            }
            power /= f64::from(survival);
            ray = ray_from(&hit, sample.wi);
        }
    }

    /// A ray from light `i`, by its emission, and what its power is over that of others: 1 but for measured lights.
    fn leave(&self, i: usize, light: &PointLight, sampler: &mut Sampler) -> (Ray, f64) {
        let random = sampler.next_2d();
        let [a, b] = random.map(f64::from);
        let ray = match light.emission {
            Emission::Measured { profile, .. } => {
                let (direction, weight) = self.points.measured[profile as usize].sample([a, b]);
                return (Ray::endless(light.position, direction.as_vec3()), weight);
            }
            Emission::Omni => {
                let direction = around(DVec3::Z, 2.0 * a - 1.0, b);
                let position = light.position.as_dvec3();
                let start = match self.points.ends[i] {
                    End::Sphere(sphere) => {
                        let sphere = &self.points.spheres[sphere as usize];
                        position
                            + direction
                                * way_out(position - sphere.center.as_dvec3(), direction, sphere.radius)
                    }
                    _ => position,
                };
                Ray::endless(start.as_vec3(), direction.as_vec3())
            }
            Emission::Oriented | Emission::Patch(_) => {
                let local = cosine_hemisphere(Vec2::from(random));
                let direction = Frame::around(light.axis).world_from_local(local).normalize();
                match self.points.ends[i] {
                    End::Surface { clearance } => {
                        let surface = SurfacePoint {
                            position: light.position,
                            normal: light.axis,
                            clearance,
                        };
                        ray_from_surface(&surface, direction)
                    }
                    _ => Ray::endless(light.position, direction),
                }
            }
            Emission::Spot { scale, offset } => {
                let cos = Ramp::new(scale, offset).sample(a);
                Ray::endless(light.position, around(light.axis.as_dvec3(), cos, b).as_vec3())
            }
            Emission::Directional => {
                let axis = light.axis.as_dvec3();
                let (u, v) = axis.any_orthonormal_pair();
                let (sin, cos) = (TAU * b).sin_cos();
                let beside = (u * cos + v * sin) * (a.sqrt() * self.radius);
                Ray::endless((self.center - axis * self.radius + beside).as_vec3(), light.axis)
            }
        };
        (ray, 1.0)
    }

    /// The first surface that the light does not lie in.
    fn first_hit(&self, ray: &Ray) -> Option<SurfaceHit> {
        // No surface is farther away than this: what is nearer than the share of it may be touched.
        let t_min = 2.0 * self.radius as f32 * TOUCHING;
        let next = self.scene.closest_hit(&Ray { t_min, ..*ray });
        let near = self.scene.closest_hit(&Ray { t_max: t_min, ..*ray });
        match (near, next) {
            (Some(near), Some(next)) if near.t < next.t * TOUCHING => Some(next),
            (near, next) => near.or(next),
        }
    }
}

impl PointLights {
    /// ∫ emission dω of a light with intensity 1, in sr; for directional lights the disc (m²) that they light.
    fn solid_angle(&self, emission: &Emission, disc: f64) -> f64 {
        match *emission {
            Emission::Omni => 4.0 * PI,
            Emission::Oriented | Emission::Patch(_) => PI,
            Emission::Spot { scale, offset } => TAU * Ramp::new(scale, offset).integral(),
            Emission::Measured { profile, .. } => self.measured[profile as usize].solid_angle(),
            Emission::Directional => disc,
        }
    }
}

/// A spot's fall-off over the cosine: ((cos − outer) · scale)² from `outer` to `inner`, then 1.
struct Ramp {
    outer: f64,
    /// At most 1.
    inner: f64,
    scale: f64,
}

impl Ramp {
    fn new(scale: f32, offset: f32) -> Ramp {
        let (scale, offset) = (f64::from(scale), f64::from(offset));
        Ramp {
            outer: (-offset / scale).max(-1.0),
            inner: ((1.0 - offset) / scale).min(1.0),
            scale,
        }
    }

    fn rising(&self) -> f64 {
        ((self.inner - self.outer).max(0.0) * self.scale).powi(2) * (self.inner - self.outer).max(0.0) / 3.0
    }

    fn integral(&self) -> f64 {
        self.rising() + (1.0 - self.inner).max(0.0)
    }

    /// A cosine by its share of the light.
    fn sample(&self, random: f64) -> f64 {
        let at = random * self.integral();
        let rising = self.rising();
        if at < rising {
            self.outer + (self.inner - self.outer) * (at / rising).cbrt()
        } else {
            (self.inner + at - rising).min(1.0)
        }
    }
}

/// The unit direction at the given cosine to `axis` and `turn` turns about it.
fn around(axis: DVec3, cos: f64, turn: f64) -> DVec3 {
    let (u, v) = axis.any_orthonormal_pair();
    let sin = (1.0 - cos * cos).max(0.0).sqrt();
    let (sin_phi, cos_phi) = (TAU * turn).sin_cos();
    (axis * cos + (u * cos_phi + v * sin_phi) * sin).normalize()
}

/// Distance along a unit direction from a point inside a sphere, given relative to its middle, to its surface.
fn way_out(from: DVec3, direction: DVec3, radius: f32) -> f64 {
    let along = from.dot(direction);
    let inside = (f64::from(radius).powi(2) - from.length_squared()).max(0.0);
    (along * along + inside).sqrt() - along
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ramp_is_sampled_by_its_light() {
        // The mean of cos under the density ramp² against a midpoint rule; a ramp cut off by the axis included.
        for (inner, outer) in [(0.95f64, 0.7f64), (0.5, 0.499), (1.2, 0.6)] {
            let scale = 1.0 / (inner - outer);
            let ramp = Ramp::new(scale as f32, (-outer * scale) as f32);
            let n = 200_000;
            let (mut sum, mut moment, mut drawn) = (0.0, 0.0, 0.0);
            for i in 0..n {
                let r = (f64::from(i) + 0.5) / f64::from(n);
                let cos = outer + (1.0 - outer) * r;
                let share = ((cos - outer) * scale).clamp(0.0, 1.0).powi(2) * (1.0 - outer) / f64::from(n);
                sum += share;
                moment += share * cos;
                drawn += ramp.sample(r) / f64::from(n);
            }
            assert!((ramp.integral() / sum - 1.0).abs() < 1e-4);
            assert!(
                (drawn - moment / sum).abs() < 1e-4,
                "{drawn}, not {}",
                moment / sum
            );
        }
    }
}
