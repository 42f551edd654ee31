//! GGX whose slopes spread differently along and across a tangent, with Smith's height-correlated masking and shadowing.
//!
//! Source: KHR_materials_anisotropy, appendix; Heitz 2014, "Understanding the masking-shadowing function", section 5.4. With
//! h in the frame of tangent, bitangent and normal: D = 1 / (π αx αy (hx²/αx² + hy²/αy² + hz²)²), and √(αx² x² + αy² y² + z²) in the
//! place of the root of the isotropic functions.

use super::frame::Frame;
use super::microfacet::{sample_visible_normal_of, visibility_by_roots};
use crate::shading::{Gloss, ShadingPoint};
use glam::Vec3;
use std::f32::consts::PI;

pub(super) struct Anisotropic {
    alpha: [f32; 2],
    frame: Frame,
}

/// What a pair of directions gives.
pub(super) struct Pair {
    /// D V, 1/sr.
    pub value: f32,
    /// Density of [`Anisotropic::sample`], 1/sr.
    pub density: f32,
    /// Cosine between view and half vector.
    pub cos_oh: f32,
}

impl Anisotropic {
    /// `None` of all other lobes.
    pub fn of(point: &ShadingPoint) -> Option<Anisotropic> {
        match point.gloss {
            Gloss::GgxAnisotropic { alpha, tangent } if !point.lambert => Some(Anisotropic {
                alpha,
                frame: Frame::new(point.shading_normal, tangent),
            }),
            _ => None,
        }
    }

    /// Both directions are above the horizon.
    pub fn pair(&self, wo: Vec3, wi: Vec3) -> Pair {
        let half = (wo + wi)
            .try_normalize()
            .unwrap_or_else(|| self.frame.world(Vec3::Z));
        self.pair_at(self.frame.local(wo), self.frame.local(wi), self.frame.local(half))
    }

    /// The same in the frame.
    fn pair_at(&self, wo: Vec3, wi: Vec3, half: Vec3) -> Pair {
        let [x, y] = self.alpha;
        let stretched = (half.x / x).powi(2) + (half.y / y).powi(2) + half.z * half.z;
        let distribution = 1.0 / (PI * x * y * stretched * stretched);
        let (root_o, root_i) = (self.root(wo), self.root(wi));
        Pair {
            value: distribution * visibility_by_roots((wo.z, root_o), (wi.z, root_i)),
            density: distribution * 0.5 / (wo.z + root_o),
            cos_oh: wo.dot(half).clamp(0.0, 1.0),
        }
    }

    /// √(αx² x² + αy² y² + z²) of a direction in the frame.
    fn root(&self, w: Vec3) -> f32 {
        let [x, y] = self.alpha;
        ((x * w.x).powi(2) + (y * w.y).powi(2) + w.z * w.z).sqrt()
    }

    /// The same of a direction in the world.
    pub fn root_of(&self, w: Vec3) -> f32 {
        self.root(self.frame.local(w))
    }

    /// Reflects `wo` in a visible normal: a direction, which may be below a horizon, and the pair.
    pub fn sample(&self, wo: Vec3, u: [f32; 2]) -> (Vec3, Pair) {
        let local_o = self.frame.local(wo);
        let half = sample_visible_normal_of(local_o, self.alpha, u);
        let local_i = half * (2.0 * local_o.dot(half)) - local_o;
        let pair = self.pair_at(local_o, local_i.with_z(local_i.z.max(f32::MIN_POSITIVE)), half);
        (self.frame.world(local_i).normalize(), pair)
    }
}
