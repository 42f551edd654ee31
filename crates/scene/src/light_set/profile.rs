//! Point lights that shine as a photometric file says.

use super::emitters::Emitters;
use super::form::LightForm;
use super::shape::{Extent, LightSample, ReferencePoint, Shape, attenuate, from_point, luminance64, times};
use crate::photometry::{LampAxes, Photometry};
use glam::{DVec3, Vec3};
use std::sync::Arc;

/// A lamp without extent that was measured.
pub(super) struct ProfileLight {
    pub position: DVec3,
    pub axes: LampAxes,
    pub profile: Arc<Photometry>,
    /// RGB, W/sr per candela.
    pub scale: Vec3,
}

impl Shape for ProfileLight {
    fn extent(&self) -> Extent {
        Extent::Delta
    }

    fn sample(&self, _: &dyn Emitters, at: &ReferencePoint, _: [f32; 3]) -> Option<LightSample> {
        let intensity = |direction| times(self.scale, self.profile.candela(&self.axes, direction));
        from_point(self.position, at, intensity).filter(|sample| sample.radiance_over_pdf != Vec3::ZERO)
    }

    fn importance(&self, from: DVec3) -> f64 {
        let candela = match (from - self.position).try_normalize() {
            Some(direction) => self.profile.candela(&self.axes, direction),
            None => self.profile.peak(),
        };
        attenuate(luminance64(self.scale) * candela, from, self.position, 0.0)
    }

    fn power(&self, _: f64) -> Vec3 {
        times(self.scale, self.profile.lumens())
    }

    fn form<'a>(&'a self, _: &'a dyn Emitters) -> LightForm<'a> {
        LightForm::Profile {
            position: self.position.as_vec3(),
            axes: self.axes,
            profile: &self.profile,
            scale: self.scale,
        }
    }
}
