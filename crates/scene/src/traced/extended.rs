//! What glTF's extensions of metallic-roughness make of a point.
//!
//! Source: KHR_materials_ior, KHR_materials_specular, KHR_materials_iridescence, KHR_materials_anisotropy, KHR_materials_clearcoat and
//! KHR_materials_sheen, the sections on how factors and textures combine.

use super::corner::Corner;
use super::scene::TracedScene;
use super::shade::unit_interval;
use crate::bsdf::MIN_SHEEN_ALPHA;
use crate::material::{Extensions, Material};
use crate::shading::{Gloss, Layers, MIN_ALPHA, ShadingPoint, bend_towards};
use crate::surface::SurfaceHit;
use crate::texture::ColorSpace;
use crate::thin_film;
use glam::{Vec2, Vec3};

/// Schlick's term of a dielectric: reflectances at normal incidence, linear RGB, and at grazing angles.
pub(super) fn dielectric(ior: f32, color: Vec3, specular: f32) -> (Vec3, f32) {
    let specular = unit_interval(specular);
    let normal = (ior - 1.0) / (ior + 1.0);
    // NaN becomes 0.
    let f0 = (color * (normal * normal)).max(Vec3::ZERO).min(Vec3::ONE);
    (f0 * specular, specular)
}

impl TracedScene {
    /// Puts the extensions in place of what the core specification has; `metallic` is the point's.
    pub(super) fn extend(
        &self,
        material: &Material,
        extensions: &Extensions,
        metallic: f32,
        hit: &SurfaceHit,
        corner: &Corner<'_>,
        point: &mut ShadingPoint,
    ) {
        self.set_fresnel(extensions, metallic, corner, point);
        let e = extensions;
        let linear = |usage| self.texture_value(usage, corner, ColorSpace::Linear);
        let value = linear(&e.anisotropy_texture);
        let strength = unit_interval(e.anisotropy * value.z);
        if strength > 0.0 {
            let direction = match e.anisotropy_texture {
                Some(_) => (Vec2::new(value.x, value.y) * 2.0 - 1.0).normalize_or(Vec2::X),
                None => Vec2::X,
            };
            let turned = Vec2::from_angle(e.anisotropy_rotation).rotate(direction);
            let (x, y) = self.tangents(hit, corner, material);
            let along = point.alpha + (1.0 - point.alpha) * strength * strength;
            point.gloss = Gloss::GgxAnisotropic {
                alpha: [along, point.alpha],
                tangent: x * turned.x + y * turned.y,
            };
        }
        let coat = unit_interval(e.clearcoat * linear(&e.clearcoat_texture).x);
        let color = self.texture_value(&e.sheen_color_texture, corner, ColorSpace::Srgb);
        let sheen = (e.sheen_color * color.truncate()).max(Vec3::ZERO).min(Vec3::ONE);
        if coat <= 0.0 && sheen == Vec3::ZERO {
            return;
        }
        let squared = |roughness: f32| unit_interval(roughness).powi(2);
        let usage = &e.clearcoat_normal_texture;
        let normal = self.mapped_normal(usage, e.clearcoat_normal_scale, hit, corner);
        let roughness = e.clearcoat_roughness * linear(&e.clearcoat_roughness_texture).y;
        let sheen_roughness = e.sheen_roughness * linear(&e.sheen_roughness_texture).w;
        point.layers = Some(Layers {
            coat,
            coat_alpha: squared(roughness).max(MIN_ALPHA),
            coat_normal: bend_towards(normal.unwrap_or(hit.normal), hit.geometric_normal),
            sheen,
            sheen_alpha: squared(sheen_roughness).max(MIN_SHEEN_ALPHA),
        });
    }

    fn set_fresnel(&self, e: &Extensions, metallic: f32, corner: &Corner<'_>, point: &mut ShadingPoint) {
        let linear = |usage| self.texture_value(usage, corner, ColorSpace::Linear);
        let color = self.texture_value(&e.specular_color_texture, corner, ColorSpace::Srgb);
        let strength = e.specular * linear(&e.specular_texture).w;
        let (f0, f90) = dielectric(e.ior, e.specular_color * color.truncate(), strength);
        point.f0 = f0 * (1.0 - metallic) + point.base_color * metallic;
        point.f90 = f90 * (1.0 - metallic) + metallic;
        // What is coloured takes its brightest channel from all of the light below.
        let grey = f0.min_element() == f0.max_element();
        if metallic < 1.0 && (!grey || f90 != 1.0) {
            point.veil = Some([f0.max_element(), f90]);
        }
        let film = unit_interval(e.iridescence * linear(&e.iridescence_texture).x);
        let [thin, thick] = e.iridescence_thickness;
        let thickness = thin + (thick - thin) * linear(&e.iridescence_thickness_texture).y;
        if film > 0.0 && thickness > 0.0 {
            let mirrored = thin_film::mean_reflectance(point.f0, e.iridescence_ior, thickness);
            point.f0 = point.f0.lerp(mirrored, film).min(Vec3::splat(point.f90));
            point.veil = (metallic < 1.0).then(|| [point.f0.max_element(), point.f90]);
        }
    }
}
