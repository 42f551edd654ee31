//! Point and spot lights.

use super::emitters::Emitters;
use super::form::LightForm;
use super::shape::{Extent, LightSample, ReferencePoint, Shape, attenuate, from_point, luminance64, times};
use glam::{DVec3, Vec3};
use std::f64::consts::PI;

/// A point that shines in all directions, or within a cone.
pub(super) struct PointLight {
    pub position: DVec3,
    /// RGB, W/sr, on the axis.
    pub intensity: Vec3,
    pub cone: Option<Cone>,
}

/// The cone of a spot light.
#[derive(Clone, Copy)]
pub(super) struct Cone {
    pub axis: DVec3,
    pub cos_inner: f64,
    pub cos_outer: f64,
}

impl Cone {
    /// KHR_lights_punctual: the square of a ramp in the cosine, from the outer to the inner angle. 0.001 is
    /// the extension's own smallest width of the ramp.
    fn falloff(&self, from_light: DVec3) -> f32 {
        let ramp = (self.axis.dot(from_light) - self.cos_outer) * self.ramp();
        ramp.clamp(0.0, 1.0).powi(2) as f32
    }

    /// Rise of the ramp per cosine.
    fn ramp(&self) -> f64 {
        1.0 / (self.cos_inner - self.cos_outer).max(1e-3)
    }

    /// ∫ falloff dω.
    fn solid_angle(&self) -> f64 {
        2.0 * PI * ((1.0 - self.cos_inner) + (self.cos_inner - self.cos_outer) / 3.0)
    }
}

impl Shape for PointLight {
    fn extent(&self) -> Extent {
        Extent::Delta
    }

    fn sample(&self, _: &dyn Emitters, at: &ReferencePoint, _: [f32; 3]) -> Option<LightSample> {
        let falloff = |direction| (self.cone.as_ref()).map_or(1.0, |cone| cone.falloff(direction));
        from_point(self.position, at, |direction| self.intensity * falloff(direction))
    }

    fn importance(&self, from: DVec3) -> f64 {
        let d = from - self.position;
        let falloff = match (&self.cone, d.try_normalize()) {
            (Some(cone), Some(direction)) => f64::from(cone.falloff(direction)),
            _ => 1.0,
        };
        attenuate(luminance64(self.intensity) * falloff, from, self.position, 0.0)
    }

    fn power(&self, _: f64) -> Vec3 {
        times(
            self.intensity,
            self.cone.as_ref().map_or(4.0 * PI, Cone::solid_angle),
        )
    }

    fn form<'a>(&'a self, _: &'a dyn Emitters) -> LightForm<'a> {
        let (position, intensity) = (self.position.as_vec3(), self.intensity);
        match &self.cone {
            None => LightForm::Point { position, intensity },
            Some(cone) => {
                let scale = cone.ramp();
                LightForm::Spot {
                    position,
                    axis: cone.axis.as_vec3(),
                    scale: scale as f32,
                    offset: (-cone.cos_outer * scale) as f32,
                    intensity,
                }
            }
        }
    }
}
