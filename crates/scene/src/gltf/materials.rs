//! Materials, textures, samplers and images (glTF 2.0, sections 3.8 and 3.9), with KHR_texture_transform,
//! KHR_materials_emissive_strength, KHR_materials_unlit, EXT_texture_webp, KHR_texture_basisu and the proposed KHR_texture_ktx.
//!
//! Read straight from the JSON, because the gltf crate does not apply texture transforms to normal maps.
//! Occlusion textures are left out: relight computes occlusion.

use super::accessors::Data;
use super::basis;
use super::error::Fault;
use super::extensions::advice;
use super::json::{At, Faults};
use super::layout::{Layout, MAX_BYTES};
use super::list::List;
use super::notes::Notes;
use super::refined;
use super::texture_use::parse_use;
use super::uri;
use crate::json::quantity::MAX_FACTOR;
use crate::material::{AlphaMode, Material, Texture, Wrap};
use glam::{Vec3, Vec4};
use std::collections::BTreeMap;
use std::path::Path;

/// Where an image's bytes are.
pub(super) enum ImageSource {
    View(usize),
    Uri(String),
}

/// A glTF texture: an image and how it is sampled.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct TextureSource {
    pub image: usize,
    /// 0 repeat, 1 mirror, 2 clamp: ordered, so that equal samplers can be found.
    pub wrap: [u8; 2],
    pub nearest: bool,
}

/// How coordinates beyond a texture are taken.
pub(super) fn wraps(key: &TextureSource) -> [Wrap; 2] {
    (key.wrap).map(|w| [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp][w as usize])
}

/// Everything about materials that the JSON says. Texture uses refer to `textures`.
pub(super) struct Materials {
    pub materials: List<Material>,
    pub textures: List<TextureSource>,
    pub images: List<(String, ImageSource)>,
}

impl Materials {
    /// Reads and checks images, samplers, textures and materials.
    pub fn parse(root: &At, layout: &Layout, notes: &mut Notes) -> Materials {
        let images = List::parse(root, "images", |at| {
            let name = at.text("name").filter(|name| !name.is_empty());
            let name = name.map_or_else(|| at.path.clone(), str::to_owned);
            Some((name, parse_image(at, layout)?))
        });
        let samplers = List::parse(root, "samplers", |at| Some(parse_sampler(at)));
        let textures = List::parse(root, "textures", |at| parse_texture(at, &images, &samplers));
        let materials = List::parse(root, "materials", |at| {
            Some(parse_material(at, textures.len(), notes))
        });
        Materials {
            materials,
            textures,
            images,
        }
    }
}

impl Materials {
    /// Notes what is wrong with what nobody used.
    pub fn note_unused(&self, notes: &mut Notes) {
        self.materials.note_unused(notes);
        self.textures.note_unused(notes);
        self.images.note_unused(notes);
    }
}

fn parse_image(at: &At, layout: &Layout) -> Option<ImageSource> {
    let view = at.get("bufferView").is_some();
    match (view, at.text("uri")) {
        (true, None) => Some(ImageSource::View(at.index(
            "bufferView",
            layout.views.len(),
            "bufferViews",
        )?)),
        (false, Some(uri)) => Some(ImageSource::Uri(uri.to_owned())),
        (true, Some(_)) => {
            at.fault("has both a uri and a bufferView; keep one");
            None
        }
        (false, None) => {
            if at.get("uri").is_none() {
                at.fault("has neither a uri nor a bufferView; export the scene again");
            }
            None
        }
    }
}

fn parse_sampler(at: &At) -> ([u8; 2], bool) {
    let wrap = |key| match at.uint(key) {
        None | Some(10497) => 0,
        Some(33648) => 1,
        Some(33071) => 2,
        Some(other) => {
            at.fault_at(key, format!("is {other}; glTF knows 10497, 33648 and 33071"));
            0
        }
    };
    let nearest = match at.uint("magFilter") {
        None | Some(9729) => false,
        Some(9728) => true,
        Some(other) => {
            at.fault_at("magFilter", format!("is {other}; glTF knows 9728 and 9729"));
            false
        }
    };
    ([wrap("wrapS"), wrap("wrapT")], nearest)
}

fn parse_texture(
    at: &At,
    images: &List<(String, ImageSource)>,
    samplers: &List<([u8; 2], bool)>,
) -> Option<TextureSource> {
    let sampler = at.index("sampler", samplers.len(), "samplers");
    let sampler = sampler.and_then(|sampler| samplers.get(sampler, at.faults()));
    let &(wrap, nearest) = sampler.unwrap_or(&([0, 0], false));
    // Where there is another image, that one lost less.
    let extension = ["EXT_texture_webp", "KHR_texture_basisu", "KHR_texture_ktx"]
        .iter()
        .find_map(|name| at.extension(name));
    if at.get("source").is_none()
        && let Some(image) = extension
            .as_ref()
            .and_then(|of| of.index("source", images.len(), "images"))
    {
        // Only KHR_texture_ktx has layers.
        if let Some(layer) = extension
            .as_ref()
            .and_then(|of| of.uint("layer"))
            .filter(|&layer| layer > 0)
        {
            at.fault(format!("asks for layer {layer} of its image, of which the first is read; give each layer an image of its own"));
            return None;
        }
        images.get(image, at.faults())?;
        return Some(TextureSource { image, wrap, nearest });
    }
    if at.get("source").is_none() {
        let name = ["EXT_texture_avif", "MSFT_texture_dds"]
            .into_iter()
            .find(|name| at.extension(name).is_some());
        at.fault(match name {
            Some(name) => format!("has only an image of {name}: {}", advice(name)),
            None => "has no source image; give it one or remove it".into(),
        });
        return None;
    }
    let image = at.index("source", images.len(), "images")?;
    images.get(image, at.faults())?;
    Some(TextureSource { image, wrap, nearest })
}

fn parse_material(at: &At, textures: usize, notes: &mut Notes) -> Material {
    let default = Material::default();
    let mut clamp = |value: f32, high: f32, what: &str| {
        if value < 0.0 || value > high {
            notes.count(&format!("{what} out of range, clamped"), 1);
        }
        value.clamp(0.0, high)
    };
    let pbr = at.object("pbrMetallicRoughness");
    let pbr_float = |key| pbr.as_ref().and_then(|pbr| pbr.float(key));
    let pbr_texture = |key| pbr.as_ref().and_then(|pbr| parse_use(pbr, key, textures));
    let base_color = pbr.as_ref().and_then(|pbr| pbr.floats("baseColorFactor"));
    let base_color = base_color.map_or(default.base_color, Vec4::from_array);
    // More than all light would be reflected otherwise.
    let base_color = Vec4::from(
        base_color
            .to_array()
            .map(|x| clamp(x, 1.0, "base colour factors")),
    );
    let strength = at
        .extension("KHR_materials_emissive_strength")
        .and_then(|strength| strength.float("emissiveStrength"))
        .unwrap_or(1.0);
    let emission = at.floats("emissiveFactor").map_or(Vec3::ZERO, Vec3::from_array) * strength;
    // Factors above 1 are against the specification, but older exporters write them and the meaning is clear.
    let emission = Vec3::from(
        emission
            .to_array()
            .map(|x| clamp(x, MAX_FACTOR as f32, "emissive factors")),
    );
    let cutoff = at.float("alphaCutoff").unwrap_or(0.5);
    let alpha_mode = match at.text("alphaMode") {
        None | Some("OPAQUE") => AlphaMode::Opaque,
        Some("MASK") => AlphaMode::Mask { cutoff },
        Some("BLEND") => AlphaMode::Blend,
        Some(other) => {
            at.fault_at(
                "alphaMode",
                format!("is \"{other}\"; glTF knows OPAQUE, MASK and BLEND"),
            );
            AlphaMode::Opaque
        }
    };
    let glass = at.extension("KHR_materials_transmission");
    let transmission = glass.as_ref().and_then(|glass| glass.float("transmissionFactor"));
    let transmission = clamp(transmission.unwrap_or(0.0), 1.0, "transmission factors");
    let normal = at.object("normalTexture");
    let mut material = Material {
        name: at.text("name").unwrap_or_default().to_owned(),
        base_color,
        base_color_texture: pbr_texture("baseColorTexture"),
        metallic: clamp(
            pbr_float("metallicFactor").unwrap_or(1.0),
            1.0,
            "metallic factors",
        ),
        roughness: clamp(
            pbr_float("roughnessFactor").unwrap_or(1.0),
            1.0,
            "roughness factors",
        ),
        metallic_roughness_texture: pbr_texture("metallicRoughnessTexture"),
        normal_texture: parse_use(at, "normalTexture", textures),
        normal_scale: normal.and_then(|normal| normal.float("scale")).unwrap_or(1.0),
        emission,
        emission_texture: parse_use(at, "emissiveTexture", textures),
        alpha_mode,
        double_sided: at.flag("doubleSided"),
        unlit: at.extension("KHR_materials_unlit").is_some(),
        ..Material::default()
    };
    if transmission > 0.0 && !material.unlit {
        if alpha_mode != AlphaMode::Opaque {
            notes.count("transmitting materials with alpha, which is ignored", 1);
        }
        material.alpha_mode = AlphaMode::Pane { transmission };
    }
    if !material.unlit {
        material.extensions = refined::parse(at, textures, material.alpha_mode, notes);
    }
    material
}

/// Loads the images that `materials` use, and points their texture uses at the list that is returned:
/// every pair of image and sampler once. What is wrong with those of materials that are not `used` is noted, no fault.
pub(super) fn load_textures(
    source: &Materials,
    materials: &mut [Material],
    used: &[bool],
    data: &Data,
    folder: &Path,
    faults: &Faults,
    notes: &mut Notes,
) -> Vec<Texture> {
    let mut textures: Vec<Texture> = Vec::new();
    let mut index_of: BTreeMap<TextureSource, Result<u32, Fault>> = BTreeMap::new();
    let mut total = 0;
    let unused = Faults::default();
    for (i, material) in materials.iter_mut().enumerate() {
        let faults = if used[i] { faults } else { &unused };
        for slot in material.source_textures_mut() {
            let Some(texture_use) = slot else { continue };
            let Some(&key) = source.textures.get(texture_use.texture as usize, faults) else {
                *slot = None;
                continue;
            };
            let index = index_of.entry(key).or_insert_with(|| {
                let encoded =
                    load_image(source, key.image, data, folder, &mut total, notes).map_err(|message| {
                        Fault {
                            path: format!("images[{}]", key.image),
                            message,
                        }
                    })?;
                textures.push(Texture {
                    name: source
                        .images
                        .peek(key.image)
                        .map_or_else(String::new, |image| image.0.clone()),
                    encoded,
                    wrap: wraps(&key),
                    nearest: key.nearest,
                });
                Ok(textures.len() as u32 - 1)
            });
            match index {
                Ok(index) => texture_use.texture = *index,
                Err(fault) => {
                    faults.add(fault.path.clone(), fault.message.clone());
                    *slot = None;
                }
            }
        }
    }
    for fault in unused.take() {
        notes.say(format!("nothing that is shown uses what is wrong here: {fault}"));
    }
    textures
}

/// The bytes of an image that players read: as the file has it, but for KTX2, which becomes PNG; `total` counts all that were loaded.
pub(super) fn load_image(
    source: &Materials,
    image: usize,
    data: &Data,
    folder: &Path,
    total: &mut u64,
    notes: &mut Notes,
) -> Result<Vec<u8>, String> {
    let (_, image_source) = source.images.peek(image).ok_or("cannot be read")?;
    let left = MAX_BYTES - *total;
    let too_big = || format!("brings the images to more than {MAX_BYTES} bytes; scale them down");
    let bytes = match image_source {
        ImageSource::View(view) => {
            let bytes = data
                .view_bytes(*view)
                .map_err(|fault| format!("cannot be read: {fault}"))?;
            if bytes.len() as u64 > left {
                return Err(too_big());
            }
            bytes.to_vec()
        }
        ImageSource::Uri(uri) => {
            uri::decode_data_uri(uri).unwrap_or_else(|| uri::read_relative(folder, uri, left + 1))?
        }
    };
    *total += bytes.len() as u64;
    if *total > MAX_BYTES {
        return Err(too_big());
    }
    if bytes.starts_with(basis::MAGIC) {
        return basis::png(&format!("images[{image}]"), &bytes, notes);
    }
    check_image_type(&bytes)?;
    Ok(bytes)
}

/// Refuses images of other kinds than PNG, JPEG and WebP. The bytes decide: media types are often wrong.
fn check_image_type(bytes: &[u8]) -> Result<(), String> {
    let is_png = bytes.starts_with(b"\x89PNG\r\n\x1a\n");
    let is_webp = bytes.starts_with(b"RIFF") && bytes.get(8..12) == Some(b"WEBP");
    if is_png || is_webp || bytes.starts_with(b"\xff\xd8\xff") {
        return Ok(());
    }
    let known = match bytes {
        _ if bytes.get(4..12) == Some(b"ftypavif") => Some(("AVIF", "EXT_texture_avif")),
        _ if bytes.starts_with(b"DDS ") => Some(("DDS", "MSFT_texture_dds")),
        _ => None,
    };
    Err(match known {
        Some((what, extension)) => format!(
            "is a {what} image; only PNG, JPEG, WebP and KTX2 are read: {}",
            advice(extension)
        ),
        None => "is neither a PNG, a JPEG, a WebP nor a KTX2 image; export the textures again".to_owned(),
    })
}
