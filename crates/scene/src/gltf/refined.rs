//! KHR_materials_ior, _specular, _clearcoat, _sheen, _anisotropy and _iridescence, and of panes _volume and the texture of _transmission.

use super::json::At;
use super::notes::Notes;
use super::texture_use::parse_use;
use crate::material::{AlphaMode, Extensions};
use glam::Vec3;

/// Largest index of refraction that is read: of what is larger nothing is known, and it mirrors nearly all.
const MAX_IOR: f32 = 100.0;
/// Largest absorption, 1/m: of what is more nothing is left after a thousandth of a millimetre.
const MAX_ABSORPTION: f32 = 1e8;
/// Largest thickness of a film, nanometres: beyond some micrometres no colours are left.
const MAX_THICKNESS: f32 = 1e6;
/// Largest factor of a specular colour: the product with the reflectance is limited to 1 where it is evaluated.
const MAX_COLOR: f32 = 1e4;

/// What a material's extensions say; `None` where that is nothing new. Values out of range are clamped, with a note.
pub(super) fn parse(
    at: &At,
    textures: usize,
    alpha: AlphaMode,
    notes: &mut Notes,
) -> Option<Box<Extensions>> {
    let mut e = Extensions::default();
    let mut read = Reader { notes };
    if let Some(ior) = at.extension("KHR_materials_ior") {
        let value = ior.float("ior").unwrap_or(e.ior);
        // 0 is the specification's word for a dielectric that mirrors all light.
        e.ior = if value == 0.0 {
            0.0
        } else {
            read.clamped(value, 1.0, MAX_IOR, "indices of refraction")
        };
    }
    if let Some(specular) = at.extension("KHR_materials_specular") {
        e.specular = read.factor(&specular, "specularFactor", 1.0);
        e.specular_texture = parse_use(&specular, "specularTexture", textures);
        e.specular_color = read.color(&specular, "specularColorFactor", Vec3::ONE, MAX_COLOR);
        e.specular_color_texture = parse_use(&specular, "specularColorTexture", textures);
    }
    if let Some(coat) = at.extension("KHR_materials_clearcoat") {
        e.clearcoat = read.factor(&coat, "clearcoatFactor", 0.0);
        e.clearcoat_texture = parse_use(&coat, "clearcoatTexture", textures);
        e.clearcoat_roughness = read.factor(&coat, "clearcoatRoughnessFactor", 0.0);
        e.clearcoat_roughness_texture = parse_use(&coat, "clearcoatRoughnessTexture", textures);
        e.clearcoat_normal_texture = parse_use(&coat, "clearcoatNormalTexture", textures);
        let scale = coat
            .object("clearcoatNormalTexture")
            .and_then(|map| map.float("scale"));
        e.clearcoat_normal_scale = scale.unwrap_or(1.0);
    }
    if let Some(sheen) = at.extension("KHR_materials_sheen") {
        e.sheen_color = read.color(&sheen, "sheenColorFactor", Vec3::ZERO, 1.0);
        e.sheen_color_texture = parse_use(&sheen, "sheenColorTexture", textures);
        e.sheen_roughness = read.factor(&sheen, "sheenRoughnessFactor", 0.0);
        e.sheen_roughness_texture = parse_use(&sheen, "sheenRoughnessTexture", textures);
    }
    if let Some(anisotropy) = at.extension("KHR_materials_anisotropy") {
        e.anisotropy = read.factor(&anisotropy, "anisotropyStrength", 0.0);
        e.anisotropy_rotation = anisotropy.float("anisotropyRotation").unwrap_or(0.0);
        e.anisotropy_texture = parse_use(&anisotropy, "anisotropyTexture", textures);
    }
    if let Some(film) = at.extension("KHR_materials_iridescence") {
        e.iridescence = read.factor(&film, "iridescenceFactor", 0.0);
        e.iridescence_texture = parse_use(&film, "iridescenceTexture", textures);
        let ior = film.float("iridescenceIor").unwrap_or(e.iridescence_ior);
        e.iridescence_ior = read.clamped(ior, 1.0, MAX_IOR, "indices of refraction");
        let [thin, thick] = e.iridescence_thickness;
        let mut thickness = |key, default| {
            let value = film.float(key).unwrap_or(default);
            read.clamped(value, 0.0, MAX_THICKNESS, "thicknesses of films")
        };
        e.iridescence_thickness = [
            thickness("iridescenceThicknessMinimum", thin),
            thickness("iridescenceThicknessMaximum", thick),
        ];
        e.iridescence_thickness_texture = parse_use(&film, "iridescenceThicknessTexture", textures);
    }
    if let AlphaMode::Pane { .. } = alpha {
        read.glass(at, textures, &mut e);
    }
    if let AlphaMode::Pane { .. } = alpha
        && (e.clearcoat > 0.0 || e.sheen_color != Vec3::ZERO)
    {
        read.notes.count(
            "clearcoats and sheen of transmitting materials, which are ignored",
            1,
        );
    }
    forget_unused(&mut e);
    (e != Extensions::default()).then(|| Box::new(e))
}

/// What is switched off counts for nothing, whatever else is said of it.
fn forget_unused(e: &mut Extensions) {
    let default = Extensions::default();
    if e.clearcoat == 0.0 {
        e.clearcoat_roughness = default.clearcoat_roughness;
        e.clearcoat_normal_scale = default.clearcoat_normal_scale;
        (
            e.clearcoat_texture,
            e.clearcoat_roughness_texture,
            e.clearcoat_normal_texture,
        ) = (None, None, None);
    }
    if e.sheen_color == Vec3::ZERO {
        e.sheen_roughness = default.sheen_roughness;
        (e.sheen_color_texture, e.sheen_roughness_texture) = (None, None);
    }
    if e.anisotropy == 0.0 {
        e.anisotropy_rotation = default.anisotropy_rotation;
        e.anisotropy_texture = None;
    }
    if e.iridescence == 0.0 {
        e.iridescence_ior = default.iridescence_ior;
        e.iridescence_thickness = default.iridescence_thickness;
        (e.iridescence_texture, e.iridescence_thickness_texture) = (None, None);
    }
}

struct Reader<'a> {
    notes: &'a mut Notes,
}

impl Reader<'_> {
    fn clamped(&mut self, value: f32, low: f32, high: f32, what: &str) -> f32 {
        if value < low || value > high {
            self.notes.count(&format!("{what} out of range, clamped"), 1);
        }
        value.clamp(low, high)
    }

    fn glass(&mut self, at: &At, textures: usize, e: &mut Extensions) {
        if let Some(transmission) = at.extension("KHR_materials_transmission") {
            e.transmission_texture = parse_use(&transmission, "transmissionTexture", textures);
        }
        let Some(volume) = at.extension("KHR_materials_volume") else {
            return;
        };
        let thickness = volume.float("thicknessFactor").unwrap_or(0.0);
        e.thickness = self.clamped(thickness, 0.0, f32::MAX, "thicknesses of glass");
        let color = self.color(&volume, "attenuationColor", Vec3::ONE, 1.0);
        let distance = volume.float("attenuationDistance").unwrap_or(f32::INFINITY);
        if e.thickness > 0.0 && distance > 0.0 {
            // Of black nothing is left after any length, as far as numbers go.
            let absorbed = |c: f32| (-f64::from(c.max(f32::MIN_POSITIVE)).ln() / f64::from(distance)) as f32;
            e.absorption = Vec3::from(color.to_array().map(|c| absorbed(c).clamp(0.0, MAX_ABSORPTION)));
        }
    }

    fn factor(&mut self, at: &At, key: &str, default: f32) -> f32 {
        let value = at.float(key).unwrap_or(default);
        self.clamped(value, 0.0, 1.0, &format!("values of {key}"))
    }

    fn color(&mut self, at: &At, key: &str, default: Vec3, high: f32) -> Vec3 {
        let color = at.floats(key).map_or(default, Vec3::from_array);
        let what = format!("values of {key}");
        Vec3::from(color.to_array().map(|x| self.clamped(x, 0.0, high, &what)))
    }
}
