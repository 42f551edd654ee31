//! Phong and Ward: a Lambert part and one lobe, side by side. The shading point has both in balance: diffuse and
//! specular factor sum to at most 1.

use super::frame::Frame;
use super::{phong, ward};
use crate::shading::{Gloss, ShadingPoint};
use glam::Vec3;
use std::f32::consts::{FRAC_1_PI, TAU};

/// A lobe other than GGX.
pub(super) enum Lobe {
    Phong { exponent: f32 },
    Ward { alpha: [f32; 2], frame: Frame },
}

impl Lobe {
    /// `None` for Lambert and metallic-roughness.
    pub(super) fn of(point: &ShadingPoint) -> Option<Lobe> {
        match point.gloss {
            _ if point.lambert => None,
            Gloss::Ggx | Gloss::GgxAnisotropic { .. } => None,
            Gloss::Phong { exponent } => Some(Lobe::Phong { exponent }),
            Gloss::Ward { alpha, tangent } => Some(Lobe::Ward {
                alpha,
                frame: Frame::new(point.shading_normal, tangent),
            }),
        }
    }

    fn value_and_density(&self, normal: Vec3, wo: Vec3, wi: Vec3) -> (f32, f32) {
        match self {
            Lobe::Phong { exponent } => phong::value_and_density(*exponent, normal, wo, wi),
            Lobe::Ward { alpha, frame } => ward::value_and_density(*alpha, frame, wo, wi),
        }
    }

    /// Both directions are above the horizons.
    pub(super) fn eval(&self, point: &ShadingPoint, wo: Vec3, wi: Vec3) -> Vec3 {
        let (value, _) = self.value_and_density(point.shading_normal, wo, wi);
        point.diffuse * FRAC_1_PI + point.f0 * value
    }

    /// Density of [`Lobe::direction`].
    pub(super) fn pdf(&self, point: &ShadingPoint, wo: Vec3, wi: Vec3, (cos_o, cos_i): (f32, f32)) -> f32 {
        let chance = self.chance(point, cos_o);
        let (_, density) = self.value_and_density(point.shading_normal, wo, wi);
        (1.0 - chance) * cos_i * FRAC_1_PI + chance * density
    }

    /// A direction; it may be below a horizon.
    pub(super) fn direction(&self, point: &ShadingPoint, wo: Vec3, u: [f32; 3]) -> Vec3 {
        let normal = point.shading_normal;
        if u[2] < self.chance(point, normal.dot(wo)) {
            return self.specular_direction(normal, wo, [u[0], u[1]]);
        }
        let (x, y) = normal.any_orthonormal_pair();
        let (sin, cos) = (TAU * u[1]).sin_cos();
        let radius = u[0].sqrt();
        (x * (radius * cos) + y * (radius * sin) + normal * (1.0 - u[0]).sqrt()).normalize()
    }

    fn specular_direction(&self, normal: Vec3, wo: Vec3, u: [f32; 2]) -> Vec3 {
        match self {
            Lobe::Phong { exponent } => phong::sample(*exponent, normal, wo, u),
            Lobe::Ward { alpha, frame } => ward::sample(*alpha, frame, wo, u),
        }
    }

    /// A direction of the lobe alone, which may be below a horizon, and the lobe's value × cosine / density there.
    pub(super) fn sample_specular(&self, point: &ShadingPoint, wo: Vec3, u: [f32; 2]) -> (Vec3, Vec3) {
        let normal = point.shading_normal;
        let wi = self.specular_direction(normal, wo, u);
        let (value, density) = self.value_and_density(normal, wo, wi);
        (wi, point.f0 * (value * normal.dot(wi) / density))
    }

    /// Rough directional albedo of the lobe.
    pub(super) fn rough_albedo(&self, point: &ShadingPoint, cos_o: f32) -> Vec3 {
        let share = match self {
            Lobe::Phong { exponent } => phong::rough_albedo(*exponent, cos_o),
            Lobe::Ward { .. } => 1.0,
        };
        point.f0 * share
    }

    /// Chance of the lobe: its share of the directional albedo, roughly.
    fn chance(&self, point: &ShadingPoint, cos_o: f32) -> f32 {
        if point.diffuse == Vec3::ZERO {
            return 1.0;
        }
        if point.f0 == Vec3::ZERO {
            return 0.0;
        }
        let specular = self.rough_albedo(point, cos_o).element_sum();
        // Both keep a chance, so that no weight explodes.
        (specular / (specular + point.diffuse.element_sum())).clamp(0.02, 0.98)
    }

    /// Share of cosine-weighted light that the point reflects in all, RGB.
    pub(super) fn hemispherical_albedo(&self, point: &ShadingPoint) -> Vec3 {
        let lobe = match self {
            Lobe::Phong { exponent } => phong::hemispherical_albedo(*exponent),
            Lobe::Ward { alpha, .. } => ward::hemispherical_albedo(*alpha),
        };
        (point.diffuse + point.f0 * lobe).clamp(Vec3::ZERO, Vec3::ONE)
    }
}
