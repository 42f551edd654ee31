//! KHR_materials_pbrSpecularGlossiness, converted to metallic-roughness as the Khronos reference conversion does it
//! ("Convert Between Workflows" beside the extension's specification): the metallic value that explains both colours'
//! perceived brightness over a dielectric's specular of 0.04, and the base colour between what the diffuse and
//! what the specular colour ask for. Where there are textures, texel by texel, in linear light.
//!
//! Deviation: a diffuse and a specular-glossiness texture that are looked up differently have no texels in common. Each is
//! then converted with the other's mean, and a note says so.

use super::accessors::Data;
use super::json::{At, Faults};
use super::list::List;
use super::materials::{Materials, TextureSource, load_image, wraps};
use super::notes::Notes;
use super::texture_use::parse_use;
use crate::image::{Image8, Limits, decode_ldr, encode_png};
use crate::material::{Material, Texture, TextureUse};
use glam::{DVec3, DVec4, Vec4};
use std::collections::BTreeMap;
use std::path::Path;

/// Specular reflectance of dielectrics in the metallic-roughness model.
const DIELECTRIC: f64 = 0.04;

/// A material of the extension; texture uses refer to textures of the file.
pub(super) struct SpecularGlossiness {
    path: String,
    /// Linear RGB and alpha.
    diffuse: DVec4,
    /// Linear RGB and glossiness.
    specular: DVec4,
    diffuse_texture: Option<TextureUse>,
    specular_texture: Option<TextureUse>,
}

/// The extension of each material that has it.
pub(super) fn parse(root: &At, source: &Materials) -> List<SpecularGlossiness> {
    let textures = source.textures.len();
    List::parse(root, "materials", |at| {
        let at = at.extension("KHR_materials_pbrSpecularGlossiness")?;
        let diffuse = at.floats("diffuseFactor").unwrap_or([1.0; 4]);
        let [r, g, b] = at.floats("specularFactor").unwrap_or([1.0; 3]);
        let glossiness = at.float("glossinessFactor").unwrap_or(1.0);
        let unit = |factors: [f32; 4]| DVec4::from_array(factors.map(|x| f64::from(x.clamp(0.0, 1.0))));
        Some(SpecularGlossiness {
            path: at.path.clone(),
            diffuse: unit(diffuse),
            specular: unit([r, g, b, glossiness]),
            diffuse_texture: parse_use(&at, "diffuseTexture", textures),
            specular_texture: parse_use(&at, "specularGlossinessTexture", textures),
        })
    })
}

/// Converts the factors. The extension counts where a material has metallic-roughness as well: that is for programs that
/// don't know the extension.
pub(super) fn set_factors(found: &List<SpecularGlossiness>, materials: &mut [Material], notes: &mut Notes) {
    let mut count = 0;
    for (index, material) in materials.iter_mut().enumerate() {
        if let Some(spec) = found.peek(index) {
            (material.base_color_texture, material.metallic_roughness_texture) = (None, None);
            set(material, spec.diffuse, spec.specular);
            count += 1;
        }
    }
    notes.count(
        "materials of specular and glossiness, converted to metallic-roughness",
        count,
    );
}

/// Makes a material of constant factors.
fn set(material: &mut Material, diffuse: DVec4, specular: DVec4) {
    let (base, metallic) = converted(diffuse.truncate(), specular.truncate());
    material.base_color = base.extend(diffuse.w).as_vec4();
    material.metallic = metallic as f32;
    material.roughness = (1.0 - specular.w) as f32;
}

/// Base colour and metallic of a diffuse and a specular colour, all linear and in 0..=1.
fn converted(diffuse: DVec3, specular: DVec3) -> (DVec3, f64) {
    const EPSILON: f64 = 1e-6;
    let left = 1.0 - specular.max_element();
    let metallic = metallic(brightness(diffuse), brightness(specular), left);
    let from_diffuse = diffuse * (left / (1.0 - DIELECTRIC) / (1.0 - metallic).max(EPSILON));
    let from_specular = (specular - DIELECTRIC * (1.0 - metallic)) / metallic.max(EPSILON);
    let base = from_diffuse.lerp(from_specular, metallic * metallic);
    (base.clamp(DVec3::ZERO, DVec3::ONE), metallic)
}

/// Perceived brightness (HSP colour model).
fn brightness(color: DVec3) -> f64 {
    (color * color).dot(DVec3::new(0.299, 0.587, 0.114)).sqrt()
}

/// The root in 0..=1 of a m² + b m + c that the reference solves.
fn metallic(diffuse: f64, specular: f64, left: f64) -> f64 {
    if specular < DIELECTRIC {
        return 0.0;
    }
    let a = DIELECTRIC;
    let b = diffuse * left / (1.0 - DIELECTRIC) + specular - 2.0 * DIELECTRIC;
    let c = DIELECTRIC - specular;
    let discriminant = (b * b - 4.0 * a * c).max(0.0);
    ((-b + discriminant.sqrt()) / (2.0 * a)).clamp(0.0, 1.0)
}

/// What makes converted textures: those of the file, and the factors as bits.
type Key = (Option<TextureSource>, Option<TextureSource>, [u64; 8]);

/// Converts the textures of all `used` materials that [`parse`] found, and appends them to `textures`.
pub(super) fn convert(
    found: &List<SpecularGlossiness>,
    source: &Materials,
    materials: &mut [Material],
    used: &[bool],
    textures: &mut Vec<Texture>,
    data: &Data,
    folder: &Path,
    faults: &Faults,
    notes: &mut Notes,
) {
    let mut made: BTreeMap<Key, Option<[u32; 2]>> = BTreeMap::new();
    let mut total = 0;
    for (index, material) in materials.iter_mut().enumerate().filter(|(index, _)| used[*index]) {
        let Some(spec) = found.peek(index) else { continue };
        let key_of = |usage: &Option<TextureUse>| {
            usage.and_then(|usage| source.textures.get(usage.texture as usize, faults).copied())
        };
        let keys = [&spec.diffuse_texture, &spec.specular_texture].map(key_of);
        let [diffuse, specular] = keys;
        if diffuse.is_none() && specular.is_none() {
            continue;
        }
        let alike = match (&spec.diffuse_texture, &spec.specular_texture) {
            (Some(a), Some(b)) if diffuse.is_some() && specular.is_some() => {
                let wraps_alike = diffuse.map(|key| key.wrap) == specular.map(|key| key.wrap);
                let same = a.uv_set == b.uv_set && a.texture_from_mesh == b.texture_from_mesh && wraps_alike;
                if !same {
                    notes.count(
                        "diffuse and specular textures that lie differently, converted by means",
                        1,
                    );
                }
                same
            }
            _ => true,
        };
        let bits = |v: DVec4| v.to_array().map(f64::to_bits);
        let ([a, b, c, d], [e, f, g, h]) = (bits(spec.diffuse), bits(spec.specular));
        let factors = [a, b, c, if alike { d } else { !d }, e, f, g, h];
        let pair = *made.entry((diffuse, specular, factors)).or_insert_with(|| {
            let mut read = |key: Option<TextureSource>| {
                let Some(key) = key else { return Some(None) };
                let bytes = load_image(source, key.image, data, folder, &mut total, notes);
                let name = format!("images[{}]", key.image);
                let image = bytes.and_then(|bytes| {
                    decode_ldr(&name, &bytes, &Limits::default()).map_err(|e| e.to_string())
                });
                image.map_err(|message| faults.add(name, message)).ok().map(Some)
            };
            let maps = Maps {
                diffuse: read(diffuse)?,
                specular: read(specular)?,
                diffuse_factor: spec.diffuse,
                specular_factor: spec.specular,
            };
            let images = match alike {
                true => maps.converted(),
                false => maps.converted_apart(),
            };
            let first = textures.len() as u32;
            let images = images
                .map_err(|message| faults.add(spec.path.clone(), message))
                .ok()?;
            for (image, key, what) in [
                (&images[0], diffuse.or(specular), "base colour"),
                (&images[1], specular.or(diffuse), "metallic and roughness"),
            ] {
                let key = key?;
                let name = format!("{} ({what})", source.images.peek(key.image)?.0);
                let encoded =
                    encode_png(&name, image).map_err(|e| faults.add(spec.path.clone(), e.to_string()));
                textures.push(Texture {
                    name,
                    encoded: encoded.ok()?,
                    wrap: wraps(&key),
                    nearest: key.nearest,
                });
            }
            Some([first, first + 1])
        });
        let Some([base, rough]) = pair else { continue };
        let uses = [spec.diffuse_texture, spec.specular_texture];
        let (Some(base_use), Some(rough_use)) = (uses[0].or(uses[1]), uses[1].or(uses[0])) else {
            continue;
        };
        material.base_color = Vec4::new(1.0, 1.0, 1.0, spec.diffuse.w as f32);
        (material.metallic, material.roughness) = (1.0, 1.0);
        material.base_color_texture = Some(TextureUse {
            texture: base,
            ..base_use
        });
        material.metallic_roughness_texture = Some(TextureUse {
            texture: rough,
            ..rough_use
        });
    }
}

/// Decoded textures with their factors.
struct Maps {
    diffuse: Option<Image8>,
    specular: Option<Image8>,
    diffuse_factor: DVec4,
    specular_factor: DVec4,
}

impl Maps {
    /// Images of base colour (sRGB, with the diffuse texture's alpha) and of roughness (green) and metallic (blue), as large as
    /// the larger texture.
    fn converted(&self) -> Result<[Image8; 2], String> {
        let sides = |of: fn(&Image8) -> usize| {
            let images = [&self.diffuse, &self.specular].into_iter().flatten();
            images.map(of).max().unwrap_or(1)
        };
        let (width, height) = (sides(|i| i.width), sides(|i| i.height));
        (Limits::default().check("the converted texture", width as u64, height as u64, 8))
            .map_err(|e| e.to_string())?;
        let [mut base, mut rough] = [(); 2].map(|()| Vec::with_capacity(width * height));
        let linear: [f64; 256] = std::array::from_fn(|code| linear_from_srgb(code as f64 / 255.0));
        for i in 0..width * height {
            let texel = |image: &Option<Image8>| {
                let Some(image) = image else {
                    return (DVec4::ONE, 255);
                };
                let (x, y) = (i % width * image.width / width, i / width * image.height / height);
                let [r, g, b, a] = image.rgba8[y * image.width + x];
                let [r, g, b] = [r, g, b].map(|code| linear[usize::from(code)]);
                (DVec4::new(r, g, b, f64::from(a) / 255.0), a)
            };
            let (diffuse, alpha) = texel(&self.diffuse);
            let specular = texel(&self.specular).0 * self.specular_factor;
            let diffuse = diffuse * self.diffuse_factor;
            let (color, metallic) = converted(diffuse.truncate(), specular.truncate());
            let [r, g, b] = color.to_array().map(|x| unorm(srgb_from_linear(x)));
            base.push([r, g, b, alpha]);
            rough.push([0, unorm(1.0 - specular.w), unorm(metallic), 255]);
        }
        Ok([base, rough].map(|rgba8| Image8 { width, height, rgba8 }))
    }

    /// The same for textures without texels in common: each as large as its own, with the mean of the other.
    fn converted_apart(self) -> Result<[Image8; 2], String> {
        let mean = |image: &Option<Image8>, factor: DVec4| {
            let Some(image) = image else { return factor };
            let texels = image.rgba8.iter().map(|texel| {
                let [r, g, b, a] = texel.map(|code| f64::from(code) / 255.0);
                DVec4::new(linear_from_srgb(r), linear_from_srgb(g), linear_from_srgb(b), a)
            });
            texels.sum::<DVec4>() / image.rgba8.len().max(1) as f64 * factor
        };
        let diffuse_mean = mean(&self.diffuse, self.diffuse_factor);
        let specular_mean = mean(&self.specular, self.specular_factor);
        let base = Maps {
            specular: None,
            specular_factor: specular_mean,
            ..self
        };
        let rough = Maps {
            diffuse: None,
            diffuse_factor: diffuse_mean,
            specular: self.specular,
            specular_factor: self.specular_factor,
        };
        let [[base, _], [_, rough]] = [base.converted()?, rough.converted()?];
        Ok([base, rough])
    }
}

/// IEC 61966-2-1.
fn linear_from_srgb(s: f64) -> f64 {
    if s <= 0.04045 {
        s / 12.92
    } else {
        ((s + 0.055) / 1.055).powf(2.4)
    }
}

fn srgb_from_linear(x: f64) -> f64 {
    if x <= 0.003_130_8 {
        12.92 * x
    } else {
        1.055 * x.powf(1.0 / 2.4) - 0.055
    }
}

fn unorm(x: f64) -> u8 {
    (x.clamp(0.0, 1.0) * 255.0).round() as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Truth: the meaning of both models at their ends. A dielectric of the usual specular keeps its diffuse colour; a
    /// metal without diffuse light has its specular colour as base.
    #[test]
    fn plain_dielectrics_and_plain_metals_keep_their_colours() {
        let color = DVec3::new(0.6, 0.3, 0.1);
        let (base, metallic) = converted(color, DVec3::splat(DIELECTRIC));
        assert!(
            base.abs_diff_eq(color, 1e-12) && metallic.abs() < 1e-12,
            "{base} {metallic}"
        );
        let (base, metallic) = converted(DVec3::ZERO, color);
        assert!(
            base.abs_diff_eq(color, 1e-9) && (metallic - 1.0).abs() < 1e-9,
            "{base} {metallic}"
        );
    }

    /// Truth: the equation itself. With m metallic and base colour B a metallic-roughness material has diffuse B (1 − m) and
    /// specular 0.04 (1 − m) + B m; for grey colours both hold at once.
    #[test]
    fn greys_come_back_from_what_they_were_converted_to() {
        for m in [0.1, 0.4, 0.8] {
            for grey in [0.2, 0.5, 0.9] {
                let specular = DIELECTRIC * (1.0 - m) + grey * m;
                // The reference reads diffuse before the specular's share is taken from it.
                let diffuse = grey * (1.0 - m) * (1.0 - DIELECTRIC) / (1.0 - specular);
                let (base, metallic) = converted(DVec3::splat(diffuse), DVec3::splat(specular));
                assert!(
                    (metallic - m).abs() < 1e-9 && (base.x - grey).abs() < 1e-9,
                    "{m} {grey}: {base} {metallic}"
                );
            }
        }
    }
}
