//! Glass (KHR_materials_transmission) as rays see it that go straight on through it: all but those that [`super::refracted`] bends.
//!
//! Source: the extension's reading of thin walls. Of the light that the surface does not mirror (Schlick's Fresnel term of a
//! dielectric, by KHR_materials_ior and the factors of KHR_materials_specular) `transmission` passes, times the base colour; what is left
//! reflects as ever. Each surface counts once, so a sheet modelled as a box mirrors twice.
//!
//! Solid glass (KHR_materials_volume, on a closed mesh) also takes what its absorption says over the length of the way inside. Where the mesh is
//! open, each surface takes what half of the material's thickness does.
//!
//! Whether a ray that looks for a surface stops at a pane is decided by a hash, as alpha is: it passes with probability T, the largest
//! channel of what passes. The surface that stops it reflects its own share over 1 − T (a clear pane is then a white mirror), so
//! that eyes, paths and gathers see the mean of both without a second ray. What is left over, the tint T′/T and absorption, is asked for along the ray
//! ([`Surfaces::tint`](crate::surface::Surfaces::tint)). Shadow rays pass all panes, and the light takes the product
//! ([`Surfaces::passed`](crate::surface::Surfaces::passed)): no noise.
//!
//! With [`Shading::Lambert`](super::scene::Shading::Lambert) panes are walls of their base colour, as all materials.
//!
//! Deviation: light is not blurred by roughness on its way through.

use super::corner::Corner;
use super::extended::dielectric;
use super::scene::TracedScene;
use crate::material::{AlphaMode, Material};
use crate::rays::{Hit, Ray};
use crate::shading::DIELECTRIC_F0;
use crate::texture::ColorSpace;
use glam::{Vec3, Vec4Swizzles};
use std::cell::RefCell;

/// Surfaces of glass that one ray may meet; light that would meet more is lost.
pub(super) const MOST: usize = 64;

/// What a pane is like at a point.
pub(super) struct Pane {
    /// What passes of the light that is not mirrored, linear RGB in 0..=1.
    pub passing: Vec3,
    pub transmission: f32,
    /// Schlick's term at normal incidence and at grazing angles.
    fresnel: [f32; 2],
}

/// Where a straight ray meets glass.
struct Met {
    t: f32,
    triangle: u32,
    /// Factor of the light, linear RGB.
    share: Vec3,
    /// The surface of a body that the ray enters there (1) or leaves (−1); 0 where it is thin.
    inwards: i32,
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

    /// Share of the light that is mirrored; `cos` is that between the ray, outside of glass, and the normal.
    pub fn fresnel(&self, cos: f32) -> f32 {
        let [f0, f90] = self.fresnel;
        f0 + (f90 - f0) * (1.0 - cos.clamp(0.0, 1.0)).powi(5)
    }

    /// Which share of the light of a ray passes, RGB; `cos` as in [`Pane::fresnel`].
    fn share(&self, cos: f32) -> Vec3 {
        self.passing * (1.0 - self.fresnel(cos))
    }

    /// Colour of what passes, its largest channel 1.
    pub fn tint(&self) -> Vec3 {
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
    let absorbs = material.is_solid_glass() && absorption(material) != Vec3::ZERO;
    matches!(material.alpha_mode, AlphaMode::Pane { .. })
        && (r != g || g != b || material.base_color_texture.is_some() || has_colors || absorbs)
}

/// 1/m, linear RGB.
fn absorption(material: &Material) -> Vec3 {
    let e = material.extensions.as_ref();
    e.map_or(Vec3::ZERO, |e| e.absorption.max(Vec3::ZERO))
}

/// What is left after a length, m, in something that absorbs, 1/m.
pub(super) fn left_after(absorption: Vec3, length: f32) -> Vec3 {
    if absorption == Vec3::ZERO {
        return Vec3::ONE;
    }
    let depth = absorption * length.max(0.0);
    // NaN, of nothing over no end, is nothing lost.
    Vec3::from(depth.to_array().map(|x| (-x.max(0.0)).exp()))
}

impl TracedScene {
    /// The pane that the scene's material, whatever edits have made of it, is at a point; `None` of all others.
    /// `solid`: it belongs to a body of solid glass.
    pub(super) fn pane(&self, index: u32, corner: &Corner<'_>, solid: bool) -> Option<Pane> {
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
        let mut base = base.max(Vec3::ZERO).min(Vec3::ONE);
        let mut transmission = transmission;
        if let Some(e) = &material.extensions {
            transmission *= self
                .texture_value(&e.transmission_texture, corner, ColorSpace::Linear)
                .x;
            if e.thickness > 0.0 && !solid {
                base *= left_after(absorption(material), 0.5 * e.thickness);
            }
        }
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

    pub(super) fn pane_met(&self, hit: &Hit) -> Option<Pane> {
        let (instance, corner) = self.corner(hit.triangle, [hit.u, hit.v]);
        self.pane(instance.material, &corner, instance.solid)
    }

    /// Absorption of the body that a triangle belongs to, 1/m.
    pub(super) fn absorption_of(&self, triangle: u32) -> Vec3 {
        absorption(&self.scene().materials[self.material_of(triangle) as usize])
    }

    /// 1 where a ray goes into solid glass, −1 where it comes out, 0 at anything else.
    fn inwards(&self, ray: &Ray, triangle: u32) -> i32 {
        if !self.traced_instance(triangle).solid {
            return 0;
        }
        let [a, b, c] = self.triangle_positions(triangle).map(|v| v.as_dvec3());
        let cos = (b - a).cross(c - a).dot(ray.direction.as_dvec3());
        if cos <= 0.0 { 1 } else { -1 }
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
            .some_hit_where(ray, |hit| self.stops_or_met(ray, hit, &met));
        match stop {
            Some(_) => Vec3::ZERO,
            None => self.product(ray, ray.t_max, met.into_inner()),
        }
    }

    /// [`Surfaces::passed_packet`](crate::surface::Surfaces::passed_packet) of scenes with panes.
    pub(super) fn passed_panes_packet(&self, rays: &[Ray], passed: &mut [Vec3], occluded: &mut Vec<bool>) {
        occluded.clear();
        occluded.resize(rays.len(), false);
        let met: Vec<RefCell<Vec<Met>>> = rays.iter().map(|_| RefCell::default()).collect();
        self.bvh()
            .any_hit_packet_where(rays, occluded, |i, hit| self.stops_or_met(&rays[i], hit, &met[i]));
        for (((ray, met), out), &stopped) in rays.iter().zip(met).zip(passed).zip(occluded.iter()) {
            *out = match stopped {
                true => Vec3::ZERO,
                false => self.product(ray, ray.t_max, met.into_inner()),
            };
        }
    }

    /// Whether a ray ends where it meets a triangle; panes that it passes are added to those that it has `met`.
    fn stops_or_met(&self, ray: &Ray, hit: &Hit, met: &RefCell<Vec<Met>>) -> bool {
        match self.passed_pane(ray, hit) {
            None => self.stops(ray, hit),
            Some(share) => {
                let mut met = met.borrow_mut();
                met.push(self.met(ray, hit, share));
                met.len() > MOST
            }
        }
    }

    /// See [`Surfaces::tint`](crate::surface::Surfaces::tint); for scenes with tinted panes.
    pub(super) fn tint_of_panes(&self, ray: &Ray, t: f32) -> Vec3 {
        let met = RefCell::new(Vec::new());
        let _none = self.bvh().some_hit_where(&Ray { t_max: t, ..*ray }, |hit| {
            if hit.t < t
                && let Some(pane) = self.pane_met(hit)
            {
                met.borrow_mut().push(self.met(ray, hit, pane.tint()));
            }
            false
        });
        self.product(ray, t, met.into_inner())
    }

    fn met(&self, ray: &Ray, hit: &Hit, share: Vec3) -> Met {
        Met {
            t: hit.t,
            triangle: hit.triangle,
            share,
            inwards: if self.solid {
                self.inwards(ray, hit.triangle)
            } else {
                0
            },
        }
    }

    /// Of what was met in any order before `end`: in one order. Two triangles that share the edge that a ray goes through are one pane.
    fn product(&self, ray: &Ray, end: f32, mut met: Vec<Met>) -> Vec3 {
        met.sort_unstable_by(|a, b| a.t.total_cmp(&b.t).then(a.triangle.cmp(&b.triangle)));
        let of = |met: &Met| (met.t, self.instance_of(met.triangle), met.inwards);
        met.dedup_by(|b, a| of(a) == of(b));
        let surfaces = met.iter().fold(Vec3::ONE, |product, met| product * met.share);
        if self.solid {
            surfaces * self.absorbed(ray, end, &met)
        } else {
            surfaces
        }
    }

    /// What is left after a straight way through bodies of glass whose surfaces are met in this order.
    fn absorbed(&self, ray: &Ray, end: f32, met: &[Met]) -> Vec3 {
        let scale = ray.direction.as_dvec3().length();
        let mut left = Vec3::ONE;
        let bodies = || met.iter().filter(|met| met.inwards != 0);
        for (i, first) in bodies().enumerate() {
            let body = self.instance_of(first.triangle);
            let same = |met: &&Met| self.instance_of(met.triangle) == body;
            if bodies().take(i).any(|met| same(&met)) {
                continue;
            }
            let sums = bodies().filter(same).fold((0, 0.0), |(open, inside), met| {
                (
                    open + met.inwards,
                    inside - f64::from(met.inwards) * f64::from(met.t),
                )
            });
            // Whoever comes out more often than in has started inside; the other way round, the ray ends there.
            let (open, mut inside) = sums;
            if open > 0 {
                // Where there is no end, an edge was missed.
                let end = if end.is_finite() {
                    end
                } else {
                    bodies().map(|m| m.t).fold(0.0, f32::max)
                };
                inside += f64::from(open) * f64::from(end);
            }
            left *= left_after(self.absorption_of(first.triangle), (inside * scale) as f32);
        }
        left
    }
}
