//! A scene as binary glTF with a lightmap: the second set of texture coordinates of every mesh, and the map in its materials by
//! MOZ_lightmap, the one extension for it that is read.
//!
//! Source: glTF 2.0, sections 3 and 4.4; MOZ_lightmap as three.js reads it: linear irradiance, times `intensity`.

use super::unwrap::{Coordinates, Layout};
use anyhow::{Result, bail};
use glam::{Affine2, Mat4, Vec2, Vec3};
use relight_scene::camera::CameraTrack;
use relight_scene::material::{AlphaMode, Material, Texture, TextureUse, Wrap};
use relight_scene::scene::{Mesh, Scene};
use serde_json::{Map, Value, json};

/// Sizes of vertex data and of indices, and kinds of their numbers.
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;
const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;

/// The file's parts while it is made.
#[derive(Default)]
struct Parts {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Parts {
    /// Appends bytes; returns the number of their view.
    fn view(&mut self, bytes: impl IntoIterator<Item = u8>, target: Option<u32>) -> usize {
        let start = self.bytes.len();
        self.bytes.extend(bytes);
        let mut view = json!({"buffer": 0, "byteOffset": start, "byteLength": self.bytes.len() - start});
        if let Some(target) = target {
            view["target"] = target.into();
        }
        self.views.push(view);
        // Numbers begin at multiples of four.
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.views.len() - 1
    }

    /// Appends an attribute of `N` numbers per vertex; returns the number of its accessor.
    fn attribute<const N: usize>(
        &mut self,
        values: impl Iterator<Item = [f32; N]> + Clone,
        bounds: bool,
    ) -> usize {
        let count = values.clone().count();
        let bytes = values.clone().flatten().flat_map(f32::to_le_bytes);
        let view = self.view(bytes, Some(ARRAY_BUFFER));
        let kind = ["SCALAR", "VEC2", "VEC3", "VEC4"][N - 1];
        let mut accessor = json!({"bufferView": view, "componentType": FLOAT, "count": count, "type": kind});
        if bounds {
            let least = |a: [f32; N], b: [f32; N]| std::array::from_fn(|i| a[i].min(b[i]));
            let most = |a: [f32; N], b: [f32; N]| std::array::from_fn(|i| a[i].max(b[i]));
            accessor["min"] = values.clone().fold([f32::INFINITY; N], least).to_vec().into();
            accessor["max"] = values.fold([f32::NEG_INFINITY; N], most).to_vec().into();
        }
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    fn indices(&mut self, triangles: &[[u32; 3]]) -> usize {
        let bytes = triangles.as_flattened().iter().flat_map(|i| i.to_le_bytes());
        let view = self.view(bytes, Some(ELEMENT_ARRAY_BUFFER));
        self.accessors.push(json!({
            "bufferView": view, "componentType": UNSIGNED_INT, "count": 3 * triangles.len(), "type": "SCALAR"
        }));
        self.accessors.len() - 1
    }
}

/// The file's bytes. `picture`: the map as PNG, and the irradiance of its white; `name`: of the maps beside it, without their ending.
///
/// # Errors
/// It takes more than 4 GiB.
pub fn scene(scene: &Scene, coordinates: &Coordinates, picture: (&[u8], f32), name: &str) -> Result<Vec<u8>> {
    let mut parts = Parts::default();
    let (mut meshes, mut nodes) = (Vec::new(), Vec::new());
    for (i, (instance, layout)) in scene.instances.iter().zip(&coordinates.instances).enumerate() {
        let mesh = &scene.meshes[instance.mesh as usize];
        if layout.triangles.is_empty() {
            continue;
        }
        let called = scene.object_names.get(i).map_or("", String::as_str);
        meshes.push(json!({"name": called, "primitives": [primitive(&mut parts, mesh, layout)]}));
        let matrix = Mat4::from(instance.world_from_mesh).to_cols_array();
        nodes.push(json!({"name": called, "mesh": meshes.len() - 1, "matrix": matrix.to_vec()}));
    }
    let cameras: Vec<Value> = scene.cameras.iter().map(camera).collect();
    nodes.extend((scene.cameras.iter().enumerate()).map(|(i, track)| camera_node(i, track)));
    let mut textures = Textures::default();
    for texture in &scene.textures {
        textures.add(&mut parts, texture);
    }
    let map = textures.add_map(&mut parts, picture.0);
    let extension = json!({"index": map, "texCoord": 1, "intensity": picture.1});
    let materials: Vec<Value> = (scene.materials.iter())
        .map(|own| material(own, &extension, &textures))
        .collect();
    let children: Vec<usize> = (0..nodes.len()).collect();
    // Far scenes are moved by f64 numbers, which a node's translation has.
    nodes.push(json!({"name": "relight", "children": children, "translation": scene.offset.to_array()}));
    let mut used = vec![
        "MOZ_lightmap",
        "KHR_materials_emissive_strength",
        "KHR_materials_transmission",
        "KHR_materials_unlit",
        "KHR_texture_transform",
    ];
    let mut document = json!({
        "asset": {"version": "2.0", "generator": concat!("relight ", env!("CARGO_PKG_VERSION"))},
        "scene": 0,
        "scenes": [{"nodes": [nodes.len() - 1], "extras": {"lightmap": {
            "exr": format!("{name}.exr"), "ktx2": format!("{name}.ktx2"), "texCoord": 1, "quantity": "irradiance, W/m²"
        }}}],
        "nodes": nodes, "meshes": meshes, "materials": materials,
        "textures": textures.textures, "images": textures.images, "samplers": textures.samplers,
        "accessors": parts.accessors, "bufferViews": parts.views,
        "buffers": [{"byteLength": parts.bytes.len()}],
    });
    if !cameras.is_empty() {
        document["cameras"] = cameras.into();
    }
    if textures.webp {
        used.push("EXT_texture_webp");
        document["extensionsRequired"] = json!(["EXT_texture_webp"]);
    }
    let text = document.to_string();
    used.retain(|name| text.contains(name));
    document["extensionsUsed"] = used.into();
    container(&document.to_string(), &parts.bytes)
}

/// Header, JSON and binary chunk.
fn container(json: &str, bytes: &[u8]) -> Result<Vec<u8>> {
    let padded = json.len().next_multiple_of(4);
    let whole = 12 + 8 + padded + 8 + bytes.len();
    let (Ok(length), Ok(text), Ok(binary)) = (
        u32::try_from(whole),
        u32::try_from(padded),
        u32::try_from(bytes.len()),
    ) else {
        bail!("the scene takes {whole} bytes as .glb, which can have 4 GiB at most");
    };
    let mut file = Vec::with_capacity(whole);
    file.extend(b"glTF");
    for word in [2, length, text] {
        file.extend(word.to_le_bytes());
    }
    file.extend(b"JSON");
    file.extend(json.bytes());
    file.resize(20 + padded, b' ');
    file.extend(binary.to_le_bytes());
    file.extend(b"BIN\0");
    file.extend(bytes);
    Ok(file)
}

/// A mesh with the map's coordinates as TEXCOORD_1. Its own sets are TEXCOORD_0 and, from the second on, TEXCOORD_2 and so on.
fn primitive(parts: &mut Parts, mesh: &Mesh, layout: &Layout) -> Value {
    let of = |i: &u32| *i as usize;
    let origins = || layout.origins.iter().map(of);
    let mut attributes = Map::new();
    let positions = parts.attribute(origins().map(|i| mesh.positions[i].to_array()), true);
    attributes.insert("POSITION".into(), positions.into());
    if !mesh.normals.is_empty() {
        let normals = parts.attribute(origins().map(|i| mesh.normals[i].to_array()), false);
        attributes.insert("NORMAL".into(), normals.into());
    }
    if !mesh.tangents.is_empty() && !mesh.normals.is_empty() {
        let tangents = parts.attribute(origins().map(|i| mesh.tangents[i].to_array()), false);
        attributes.insert("TANGENT".into(), tangents.into());
    }
    if !mesh.colors.is_empty() {
        let colors = parts.attribute(origins().map(|i| mesh.colors[i].to_array()), false);
        attributes.insert("COLOR_0".into(), colors.into());
    }
    let map = parts.attribute(layout.uvs.iter().map(Vec2::to_array), false);
    // Sets are numbered without gaps.
    attributes.insert("TEXCOORD_0".into(), map.into());
    attributes.insert("TEXCOORD_1".into(), map.into());
    for (set, uvs) in mesh.uvs.iter().enumerate() {
        let own = match uvs.is_empty() {
            true => map,
            false => parts.attribute(origins().map(|i| uvs[i].to_array()), false),
        };
        attributes.insert(format!("TEXCOORD_{}", shown_set(set as u32)), own.into());
    }
    let indices = parts.indices(&layout.triangles);
    json!({"attributes": attributes, "indices": indices, "material": mesh.material})
}

/// Number of one of the scene's own sets in the file.
fn shown_set(own: u32) -> u32 {
    if own == 0 { 0 } else { own + 1 }
}

fn camera(track: &CameraTrack) -> Value {
    let yfov = 2.0 * track.at(0.0).tan_half_vfov.atan();
    let mut perspective = json!({"yfov": yfov, "znear": 0.01});
    if let Some(aspect) = track.aspect {
        perspective["aspectRatio"] = aspect.into();
    }
    json!({"type": "perspective", "name": track.name, "perspective": perspective})
}

fn camera_node(number: usize, track: &CameraTrack) -> Value {
    let at = track.at(0.0);
    let columns = [
        at.right.extend(0.0),
        at.up.extend(0.0),
        (-at.forward).extend(0.0),
        at.position.extend(1.0),
    ];
    let matrix: Vec<f32> = columns.iter().flat_map(|c| c.to_array()).collect();
    json!({"name": track.name, "camera": number, "matrix": matrix})
}

/// Textures of the file: those of the scene, by the same numbers, and the map.
#[derive(Default)]
struct Textures {
    textures: Vec<Value>,
    images: Vec<Value>,
    samplers: Vec<Value>,
    webp: bool,
}

impl Textures {
    fn add(&mut self, parts: &mut Parts, texture: &Texture) {
        let bytes = &texture.encoded;
        let kind = match () {
            () if bytes.starts_with(b"\x89PNG") => "image/png",
            () if bytes.starts_with(b"RIFF") => "image/webp",
            () => "image/jpeg",
        };
        let view = parts.view(bytes.iter().copied(), None);
        self.images
            .push(json!({"name": texture.name, "bufferView": view, "mimeType": kind}));
        let wrap = |wrap: Wrap| match wrap {
            Wrap::Repeat => 10497,
            Wrap::Mirror => 33648,
            Wrap::Clamp => 33071,
        };
        let filters = match texture.nearest {
            true => [9728, 9728],
            false => [9729, 9987],
        };
        self.samplers.push(json!({
            "wrapS": wrap(texture.wrap[0]), "wrapT": wrap(texture.wrap[1]), "magFilter": filters[0], "minFilter": filters[1]
        }));
        let (sampler, source) = (self.samplers.len() - 1, self.images.len() - 1);
        self.textures.push(match kind {
            "image/webp" => {
                self.webp = true;
                json!({"sampler": sampler, "extensions": {"EXT_texture_webp": {"source": source}}})
            }
            _ => json!({"sampler": sampler, "source": source}),
        });
    }

    /// The map, without mip levels: farther ones mix charts that are nothing to each other.
    fn add_map(&mut self, parts: &mut Parts, png: &[u8]) -> usize {
        let view = parts.view(png.iter().copied(), None);
        self.images
            .push(json!({"name": "lightmap", "bufferView": view, "mimeType": "image/png"}));
        self.samplers
            .push(json!({"wrapS": 33071, "wrapT": 33071, "magFilter": 9729, "minFilter": 9729}));
        let (sampler, source) = (self.samplers.len() - 1, self.images.len() - 1);
        self.textures.push(json!({"sampler": sampler, "source": source}));
        self.textures.len() - 1
    }

    /// A reference to a texture.
    fn info(&self, usage: &TextureUse) -> Value {
        let mut info = json!({"index": usage.texture, "texCoord": shown_set(usage.uv_set)});
        if usage.texture_from_mesh != Affine2::IDENTITY {
            let (scale, angle, offset) = usage.texture_from_mesh.to_scale_angle_translation();
            info["extensions"] = json!({"KHR_texture_transform": {
                "offset": offset.to_array(), "rotation": -angle, "scale": scale.to_array()
            }});
        }
        info
    }
}

fn material(own: &Material, lightmap: &Value, textures: &Textures) -> Value {
    let mut surface = json!({
        "baseColorFactor": own.base_color.to_array(), "metallicFactor": own.metallic, "roughnessFactor": own.roughness
    });
    if let Some(usage) = &own.base_color_texture {
        surface["baseColorTexture"] = textures.info(usage);
    }
    if let Some(usage) = &own.metallic_roughness_texture {
        surface["metallicRoughnessTexture"] = textures.info(usage);
    }
    let mut material =
        json!({"name": own.name, "pbrMetallicRoughness": surface, "doubleSided": own.double_sided});
    let mut extensions = Map::new();
    if let Some(usage) = &own.normal_texture {
        material["normalTexture"] = textures.info(usage);
        material["normalTexture"]["scale"] = own.normal_scale.into();
    }
    // Factors go up to 1, what is beyond is a strength.
    let strength = own.emission.max_element().max(1.0);
    if own.emission != Vec3::ZERO {
        material["emissiveFactor"] = json!((own.emission / strength).to_array());
    }
    if strength > 1.0 {
        extensions.insert(
            "KHR_materials_emissive_strength".into(),
            json!({"emissiveStrength": strength}),
        );
    }
    if let Some(usage) = &own.emission_texture {
        material["emissiveTexture"] = textures.info(usage);
    }
    match own.alpha_mode {
        AlphaMode::Opaque => {}
        AlphaMode::Mask { cutoff } => {
            material["alphaMode"] = "MASK".into();
            material["alphaCutoff"] = cutoff.into();
        }
        AlphaMode::Blend => material["alphaMode"] = "BLEND".into(),
        AlphaMode::Pane { transmission } => {
            extensions.insert(
                "KHR_materials_transmission".into(),
                json!({"transmissionFactor": transmission}),
            );
        }
    }
    match own.unlit {
        true => extensions.insert("KHR_materials_unlit".into(), json!({})),
        false => extensions.insert("MOZ_lightmap".into(), lightmap.clone()),
    };
    material["extensions"] = extensions.into();
    material
}
