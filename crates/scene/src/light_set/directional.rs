//! Parallel light.

use super::emitters::Emitters;
use super::form::LightForm;
use super::shape::{Extent, LightSample, ReferencePoint, Shape, luminance64, times};
use glam::{DVec3, Vec3};

/// Parallel light from infinitely far away.
pub(super) struct DirectionalLight {
    /// Unit, against the way it travels.
    pub towards: DVec3,
    /// RGB, W/m².
    pub irradiance: Vec3,
}

impl Shape for DirectionalLight {
    fn extent(&self) -> Extent {
        Extent::Delta
    }

    fn sample(&self, _: &dyn Emitters, _: &ReferencePoint, _: [f32; 3]) -> Option<LightSample> {
        Some(LightSample {
            direction: self.towards.as_vec3(),
            distance: f32::INFINITY,
            radiance_over_pdf: self.irradiance,
            pdf: 0.0,
            emitter: None,
        })
    }

    fn importance(&self, _: DVec3) -> f64 {
        luminance64(self.irradiance)
    }

    fn power(&self, disc: f64) -> Vec3 {
        times(self.irradiance, disc)
    }

    fn form<'a>(&'a self, _: &'a dyn Emitters) -> LightForm<'a> {
        LightForm::Directional {
            axis: -self.towards.as_vec3(),
            irradiance: self.irradiance,
        }
    }
}
