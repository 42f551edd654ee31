//! What lies over metallic-roughness: sheen, and clearcoat over that, as the appendices of KHR_materials_sheen and
//! KHR_materials_clearcoat have them.
//!
//! Seen at cosine μ_c with the clearcoat's normal and μ with the surface's, with the clearcoat's share c = clearcoat ×
//! (0.04 + 0.96 (1 − μ_c)⁵), the BRDF is c f_c + (1 − c) (f_s + (1 − max(sheen colour) E(μ)) f_base): f_c is GGX that mirrors all
//! light about the clearcoat's normal, f_s the sheen's lobe of directional albedo E ([`super::sheen`]). Both shares are
//! those of the view alone, so that reflection is not quite reciprocal, and the total never exceeds 1: each layer gets what
//! those over it leave.
//!
//! Deviations: E exceeds 1 for sheen of little roughness at grazing views; the lobe is then scaled to 1. Emission is not darkened by the
//! clearcoat.

use super::sheen;
use crate::shading::{DIELECTRIC_F0, Gloss, Layers, ShadingPoint};
use glam::Vec3;

/// What the sheen's table may understate its albedo by; held back from the base.
const MARGIN: f32 = 5e-3;

/// Factors of the layers for one view.
pub(super) struct Over {
    /// Of the base.
    pub base: f32,
    /// Of the clearcoat's lobe, whose Fresnel term is 1.
    pub coat: f32,
    /// Of the sheen's lobe.
    pub sheen: Vec3,
    /// Directional albedo of the sheen's lobe.
    pub sheen_albedo: f32,
}

impl Over {
    pub fn new(point: &ShadingPoint, layers: &Layers, wo: Vec3) -> Over {
        Over::at(layers, layers.coat_normal.dot(wo), point.shading_normal.dot(wo))
    }

    /// From the view's cosines with the clearcoat's and the surface's normal.
    pub fn at(layers: &Layers, cos_coat: f32, cos: f32) -> Over {
        let grazing = (1.0 - cos_coat.clamp(0.0, 1.0)).powi(5);
        let coat = layers.coat * (DIELECTRIC_F0 + (1.0 - DIELECTRIC_F0) * grazing);
        let left = 1.0 - coat;
        let strongest = layers.sheen.max_element();
        if strongest <= 0.0 {
            return Over {
                base: left,
                coat,
                sheen: Vec3::ZERO,
                sheen_albedo: 0.0,
            };
        }
        let albedo = sheen::albedo(layers.sheen_alpha, cos);
        Over {
            base: left * (1.0 - strongest * (albedo + MARGIN).min(1.0)),
            coat,
            sheen: layers.sheen * (left / albedo.max(1.0)),
            sheen_albedo: albedo,
        }
    }
}

/// The clearcoat by itself, as a mirror of all light.
pub(super) fn coat_point(point: &ShadingPoint, layers: &Layers) -> ShadingPoint {
    ShadingPoint {
        shading_normal: layers.coat_normal,
        diffuse: Vec3::ZERO,
        f0: Vec3::ONE,
        f90: 1.0,
        veil: None,
        alpha: layers.coat_alpha,
        gloss: Gloss::Ggx,
        lambert: false,
        layers: None,
        ..*point
    }
}

/// What lies under the layers.
pub(super) fn base_point(point: &ShadingPoint) -> ShadingPoint {
    ShadingPoint {
        layers: None,
        ..*point
    }
}

/// The point whose lobe is the brighter one at normal incidence: the clearcoat or what lies under it.
pub(super) fn leading(point: &ShadingPoint) -> ShadingPoint {
    match &point.layers {
        Some(layers) => {
            let coat = DIELECTRIC_F0 * layers.coat;
            if coat > (1.0 - coat) * point.f0.max_element() {
                coat_point(point, layers)
            } else {
                base_point(point)
            }
        }
        None => *point,
    }
}
