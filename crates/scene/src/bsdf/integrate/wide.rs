//! The sums of [`super`] compiled for eight lanes, chosen at run time.
//!
//! The same code, operation by operation and without fused ones, so that every processor gives the same bits; tests
//! compare the two. Shading with visibility cuts takes 1.6 times as long without (docs/cuts.md).
#![allow(unsafe_code)] // calling code compiled for AVX2, after asking the processor

use super::{Ggx, Incident, irradiance_lanes};
use crate::shading::ShadingPoint;
use glam::Vec3;

/// See [`Ggx::lanes`].
pub(super) fn ggx(ggx: &Ggx, light: &Incident) -> Vec3 {
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2") {
        // SAFETY: the processor has the instructions.
        return unsafe { avx2::ggx(ggx, light) };
    }
    ggx.lanes(light)
}

/// See [`irradiance_lanes`].
pub(super) fn irradiance(point: &ShadingPoint, light: &Incident) -> Vec3 {
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2") {
        // SAFETY: the processor has the instructions.
        return unsafe { avx2::irradiance(point, light) };
    }
    irradiance_lanes(point, light)
}

#[cfg(target_arch = "x86_64")]
mod avx2 {
    use super::*;

    #[target_feature(enable = "avx2")]
    pub(super) fn ggx(ggx: &Ggx, light: &Incident) -> Vec3 {
        ggx.lanes(light)
    }

    #[target_feature(enable = "avx2")]
    pub(super) fn irradiance(point: &ShadingPoint, light: &Incident) -> Vec3 {
        irradiance_lanes(point, light)
    }
}
