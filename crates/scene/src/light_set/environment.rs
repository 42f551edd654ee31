//! Light from all around, by a map.

use super::distant::Split;
use super::emitters::Emitters;
use super::form::{DistantMap, LightForm};
use super::map::TurnedMap;
use super::shape::{
    Dark, Extent, LightSample, LongRay, ReferencePoint, Seen, Shape, extended, luminance64, times,
};
use glam::{DVec3, Vec3};

/// An environment map that shines.
pub(super) struct EnvironmentLight(pub TurnedMap);

impl Shape for EnvironmentLight {
    fn extent(&self) -> Extent {
        Extent::Distant
    }

    fn sample(&self, _: &dyn Emitters, _: &ReferencePoint, [r0, r1, _]: [f32; 3]) -> Option<LightSample> {
        let (direction, radiance, pdf) = self.0.sample([r0, r1]);
        Some(extended(direction, f64::INFINITY, radiance, f64::from(pdf)))
    }

    fn met_by(&self, ray: &LongRay) -> Option<Seen> {
        (ray.reach == f64::INFINITY).then(|| {
            let uv = self.0.map_uv(ray.direction_f32);
            Seen {
                radiance: self.0.radiance(uv),
                pdf: self.0.sampler.pdf(uv),
            }
        })
    }

    fn importance(&self, _: DVec3) -> f64 {
        // Half of the sphere of directions lies above a surface.
        0.5 * luminance64(self.0.sampler.flux() * self.0.scale)
    }

    fn power(&self, disc: f64) -> Vec3 {
        times(self.0.sampler.flux() * self.0.scale, disc)
    }

    fn form<'a>(&'a self, _: &'a dyn Emitters) -> LightForm<'a> {
        LightForm::Environment(DistantMap::new(&self.0))
    }

    fn split(&self, parts: Option<&Split>) -> Option<(Box<dyn Shape>, TurnedMap)> {
        let parts = parts?;
        let bright: Box<dyn Shape> = match &parts.bright {
            None => Box::new(Dark),
            Some((map, sampler)) => Box::new(EnvironmentLight(TurnedMap {
                map: map.clone(),
                sampler: sampler.clone(),
                ..self.0.clone()
            })),
        };
        let smooth = TurnedMap {
            map: parts.smooth.clone(),
            ..self.0.clone()
        };
        Some((bright, smooth))
    }
}
