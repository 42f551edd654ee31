//! Thin panes (KHR_materials_transmission): rays go straight on through them.
//!
//! Source: the extension's reading of thin walls. Of the light that the surface does not mirror (Schlick's Fresnel term of a
//! dielectric, by KHR_materials_ior and the factors of KHR_materials_specular) `transmission` passes, times the base colour; what is left reflects as ever. Each surface counts once, so a sheet modelled
//! as a box mirrors twice.
//!
//! Whether a ray that looks for a surface stops at a pane is decided by a hash, as alpha is: it passes with probability T, the largest
//! channel of what passes. The surface that stops it reflects its own share over 1 − T (a clear pane is then a white mirror), so
//! that eyes, paths and gathers see the mean of both without a second ray. What is left over, the tint T′/T, is asked for along the ray
//! ([`Surfaces::tint`](crate::surface::Surfaces::tint)). Shadow rays pass all panes, and the light takes the product
//! ([`Surfaces::passed`](crate::surface::Surfaces::passed)): no noise.
//!
//! With [`Shading::Lambert`](super::scene::Shading::Lambert) panes are walls of their base colour, as all materials.
//!
//! Deviation: light is neither refracted nor blurred by roughness on its way through.

use super::corner::Corner;
use super::extended::dielectric;
use super::scene::TracedScene;
use crate::material::{AlphaMode, Material};
use crate::rays::{Hit, Ray};
use crate::shading::DIELECTRIC_F0;
use crate::texture::ColorSpace;
use glam::{Vec3, Vec4Swizzles};
use std::cell::RefCell;

/// Panes that one ray may cross; light that would cross more is lost.
const MOST: usize = 64;

/// What a pane is like at a point.
pub(super) struct Pane {
    /// What passes of the light that is not mirrored, linear RGB in 0..=1.
    passing: Vec3,
    transmission: f32,
    /// Schlick's term at normal incidence and at grazing angles.
    fresnel: [f32; 2],
}

impl Pane {
    /// Largest channel of what passes at normal incidence, without the mirrored share.
    fn most(&self) -> f32 {
        self.passing.max_element()
    }

    /// The part of a colour under the pane's surface that a ray which is stopped there sees: the share that does not pass, over the
    /// chance to be stopped.
    pub fn diffuse(&self, albedo: Vec3) -> Vec3 {
        let stopped = 1.0 - self.most();
        if stopped > 0.0 {
            (albedo * (1.0 - self.transmission) / stopped).min(Vec3::ONE)
        } else {
            Vec3::ZERO
        }
    }

    /// The same of reflectance at normal incidence.
    pub fn mirrored(&self, f0: Vec3) -> Vec3 {
        let stopped = 1.0 - self.most() * (1.0 - self.fresnel[0]);
        if stopped > 0.0 {
            (f0 / stopped).min(Vec3::ONE)
        } else {
            // Only what is mirrored, at whatever angle, is stopped.
            Vec3::ONE
        }
    }

    /// Which share of the light of a ray passes, RGB; `cos` is that between ray and normal.
    fn share(&self, cos: f32) -> Vec3 {
        let [f0, f90] = self.fresnel;
        let fresnel = f0 + (f90 - f0) * (1.0 - cos.clamp(0.0, 1.0)).powi(5);
        self.passing * (1.0 - fresnel)
    }

    /// Colour of what passes, its largest channel 1.
    fn tint(&self) -> Vec3 {
        let most = self.most();
        if most > 0.0 {
            self.passing / most
        } else {
            Vec3::ZERO
        }
    }
}

/// Whether a material is a pane, and one with a colour.
pub(super) fn is_tinted(material: &Material, has_colors: bool) -> bool {
    let [r, g, b, _] = material.base_color.to_array();
    matches!(material.alpha_mode, AlphaMode::Pane { .. })
        && (r != g || g != b || material.base_color_texture.is_some() || has_colors)
}

impl TracedScene {
    /// The pane that the scene's material, whatever edits have made of it, is at a point; `None` of all others.
    pub(super) fn pane(&self, index: u32, corner: &Corner<'_>) -> Option<Pane> {
        if !self.panes {
            return None;
        }
        let material = &self.scene().materials[index as usize];
        let AlphaMode::Pane { transmission } = material.alpha_mode else {
            return None;
        };
        let base = self.texture_value(&material.base_color_texture, corner, ColorSpace::Srgb);
        let base = (material.base_color * base * corner.color()).xyz();
        let texture = self.texture_value(&material.metallic_roughness_texture, corner, ColorSpace::Linear);
        let metallic = (material.metallic * texture.z).clamp(0.0, 1.0);
        // NaN becomes 0.
        let base = base.max(Vec3::ZERO).min(Vec3::ONE);
        // The brightest channel decides for all, as it does for what is diffuse.
        let fresnel = match &material.extensions {
            Some(e) => dielectric(e.ior, e.specular_color, e.specular),
            None => (Vec3::splat(DIELECTRIC_F0), 1.0),
        };
        Some(Pane {
            passing: base * (transmission * (1.0 - metallic)),
            transmission,
            fresnel: [fresnel.0.max_element(), fresnel.1],
        })
    }

    fn pane_met(&self, hit: &Hit) -> Option<Pane> {
        let (material, corner) = self.corner_of(hit.triangle, [hit.u, hit.v]);
        self.pane(material, &corner)
    }

    /// Share of a ray's light that passes where it meets a pane; `None` where it meets something else.
    fn passed_pane(&self, ray: &Ray, hit: &Hit) -> Option<Vec3> {
        let pane = self.pane_met(hit)?;
        let [a, b, c] = self.triangle_positions(hit.triangle).map(|v| v.as_dvec3());
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let cos = normal.dot(ray.direction.as_dvec3().normalize_or_zero()).abs();
        Some(pane.share(cos as f32))
    }

    /// Probability that a ray which looks for a surface passes where it meets a pane.
    pub(super) fn pane_passes(&self, ray: &Ray, hit: &Hit) -> f32 {
        self.passed_pane(ray, hit).map_or(0.0, Vec3::max_element)
    }

    /// See [`Surfaces::passed`](crate::surface::Surfaces::passed); for scenes with panes.
    pub(super) fn passed_panes(&self, ray: &Ray) -> Vec3 {
        let met = RefCell::new(Vec::new());
        let stop = self
            .bvh()
            .some_hit_where(ray, |hit| match self.passed_pane(ray, hit) {
                None => self.stops(ray, hit),
                Some(share) => {
                    let mut met = met.borrow_mut();
                    met.push((hit.t, hit.triangle, share));
                    met.len() > MOST
                }
            });
        match stop {
            Some(_) => Vec3::ZERO,
            None => self.product(met.into_inner()),
        }
    }

    /// See [`Surfaces::tint`](crate::surface::Surfaces::tint); for scenes with tinted panes.
    pub(super) fn tint_of_panes(&self, ray: &Ray, t: f32) -> Vec3 {
        let met = RefCell::new(Vec::new());
        let _none = self.bvh().some_hit_where(&Ray { t_max: t, ..*ray }, |hit| {
            if hit.t < t
                && let Some(pane) = self.pane_met(hit)
            {
                met.borrow_mut().push((hit.t, hit.triangle, pane.tint()));
            }
            false
        });
        self.product(met.into_inner())
    }

    /// Of what was met in any order: in one order. Two triangles that share the edge that a ray goes through are one pane.
    fn product(&self, mut met: Vec<(f32, u32, Vec3)>) -> Vec3 {
        met.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        met.dedup_by(|b, a| a.0 == b.0 && self.instance_of(a.1) == self.instance_of(b.1));
        met.iter()
            .fold(Vec3::ONE, |product, (_, _, share)| product * *share)
    }
}
