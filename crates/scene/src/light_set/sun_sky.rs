//! Sun and sky, clear or of any weather.

use super::distant::Split;
use super::emitters::Emitters;
use super::form::{DistantMap, LightForm};
use super::map::TurnedMap;
use super::shape::{Extent, LightSample, LongRay, ReferencePoint, Seen, Shape, extended, luminance64, times};
use super::sphere::sample_cone;
use crate::environment::{EnvironmentSampler, luminance};
use crate::sky::{SUN_HALF_ANGLE, SunSky};
use glam::{DVec3, Vec3};
use std::f64::consts::PI;
use std::sync::Arc;

/// A sky as a map, and the sun's disc before it.
#[derive(Clone)]
pub(super) struct SunSkyLight {
    sky: TurnedMap,
    sun: SunDisc,
}

/// The sun's disc.
#[derive(Clone, Copy)]
struct SunDisc {
    axis: DVec3,
    radiance: Vec3,
    one_minus_cos: f64,
    /// Chance that the sun is drawn rather than the sky.
    chance: f64,
}

impl SunDisc {
    fn contains(&self, direction: Vec3) -> bool {
        let d = direction.as_dvec3();
        // Between unit vectors, |a − b|² / 2 is 1 − cos without cancellation.
        (d.normalize() - self.axis).length_squared() * 0.5 <= self.one_minus_cos
    }

    fn pdf(&self) -> f64 {
        1.0 / (2.0 * PI * self.one_minus_cos)
    }
}

impl SunSkyLight {
    /// `None` where the sky is black.
    pub(super) fn new(sun_sky: SunSky) -> Option<SunSkyLight> {
        let SunSky {
            sky,
            sun_direction,
            sun_radiance,
        } = sun_sky;
        let sampler = EnvironmentSampler::new(&sky)?;
        let one_minus_cos = 2.0 * (SUN_HALF_ANGLE / 2.0).sin().powi(2);
        let sun = f64::from(luminance(sun_radiance)) * 2.0 * PI * one_minus_cos;
        // By irradiance the sun would take nearly every sample, and a place in its shade would see noise:
        // a disc this small needs no more than half of them.
        let chance = (sun / (sun + f64::from(luminance(sampler.flux())))).min(0.5);
        Some(SunSkyLight {
            sky: TurnedMap {
                map: Arc::new(sky),
                sampler: Arc::new(sampler),
                scale: Vec3::ONE,
                turn: 0.0,
            },
            sun: SunDisc {
                axis: sun_direction.as_dvec3().normalize(),
                radiance: sun_radiance,
                one_minus_cos,
                chance,
            },
        })
    }

    /// The same, multiplied.
    pub(super) fn scaled(&self, scale: Vec3) -> SunSkyLight {
        let mut scaled = self.clone();
        scaled.sky.scale *= scale;
        scaled.sun.radiance *= scale;
        scaled
    }

    /// Radiance of sun and sky in a direction and the density of the mixture that samples them.
    fn seen(&self, direction: Vec3) -> Seen {
        let SunSkyLight { sky, sun } = self;
        let uv = sky.map_uv(direction);
        let mut radiance = sky.radiance(uv);
        let mut pdf = (1.0 - sun.chance) * f64::from(sky.sampler.pdf(uv));
        if sun.contains(direction) {
            radiance += sun.radiance;
            pdf += sun.chance * sun.pdf();
        }
        Seen {
            radiance,
            pdf: pdf as f32,
        }
    }
}

impl Shape for SunSkyLight {
    fn extent(&self) -> Extent {
        Extent::Distant
    }

    fn sample(&self, _: &dyn Emitters, _: &ReferencePoint, [r0, r1, r2]: [f32; 3]) -> Option<LightSample> {
        let SunSkyLight { sky, sun } = self;
        let direction = if f64::from(r2) < sun.chance {
            sample_cone(sun.axis, sun.one_minus_cos, [r0, r1]).as_vec3()
        } else {
            sky.sample([r0, r1]).0
        };
        let seen = self.seen(direction);
        Some(extended(
            direction,
            f64::INFINITY,
            seen.radiance,
            f64::from(seen.pdf),
        ))
    }

    fn met_by(&self, ray: &LongRay) -> Option<Seen> {
        (ray.reach == f64::INFINITY).then(|| self.seen(ray.direction_f32))
    }

    fn importance(&self, _: DVec3) -> f64 {
        let SunSkyLight { sky, sun } = self;
        luminance64(sky.sampler.flux() * sky.scale) + luminance64(sun.radiance) * 2.0 * PI * sun.one_minus_cos
    }

    fn power(&self, disc: f64) -> Vec3 {
        let SunSkyLight { sky, sun } = self;
        times(sky.sampler.flux() * sky.scale, disc) + times(sun.radiance, 2.0 * PI * sun.one_minus_cos * disc)
    }

    fn form<'a>(&'a self, _: &'a dyn Emitters) -> LightForm<'a> {
        LightForm::SunSky {
            sky: DistantMap::new(&self.sky),
            sun: self.sun.axis.as_vec3(),
            one_minus_cos: self.sun.one_minus_cos,
            sun_radiance: self.sun.radiance,
        }
    }

    /// The sky is taken and the sun stays.
    fn split(&self, _: Option<&Split>) -> Option<(Box<dyn Shape>, TurnedMap)> {
        let sun = SunSkyLight {
            sky: TurnedMap {
                scale: Vec3::ZERO,
                ..self.sky.clone()
            },
            sun: SunDisc {
                chance: 1.0,
                ..self.sun
            },
        };
        Some((Box::new(sun), self.sky.clone()))
    }
}
