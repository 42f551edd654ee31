//! A small writer of binary glTF 2.0 (`.glb`), as the specification of Khronos lays it out: a header of 12 bytes,
//! a JSON chunk and one binary chunk that holds vertices, indices and images.
//!
//! It writes what the scenes here need and nothing else: indexed triangles, PNG images inside the file, metallic-roughness
//! materials, a tree of nodes, perspective cameras. It checks nothing, since all of its input comes from this crate;
//! the crate's tests parse every file again.

use crate::mesh::Mesh;
use glam::{DQuat, DVec3};
use serde_json::{Map, Value, json};

/// The extension for lights without extent.
const PUNCTUAL: &str = "KHR_lights_punctual";

/// A use of a texture by a material: which one, which set of coordinates, and how they are transformed.
#[derive(Clone, Copy)]
pub struct TextureRef {
    /// Index that [`Glb::add_texture`] returned.
    pub texture: usize,
    /// KHR_texture_transform: offset, rotation in radians, scale; none leaves the coordinates as they are.
    pub transform: Option<([f64; 2], f64, [f64; 2])>,
}

impl TextureRef {
    /// The texture with untransformed coordinates.
    pub fn new(texture: usize) -> Self {
        Self {
            texture,
            transform: None,
        }
    }
}

/// How the alpha of the base colour is used.
#[derive(Clone, Copy, PartialEq)]
pub enum Alpha {
    /// Ignored.
    Opaque,
    /// Cut out where it is below this cutoff.
    Mask(f64),
    /// Coverage.
    Blend,
}

/// A metallic-roughness material; [`Material::default`] is a matt white of reflectance 0.8.
#[derive(Clone)]
pub struct Material {
    /// Name, by which lighting sequences find emissive materials.
    pub name: &'static str,
    /// Linear base colour and alpha, multiplied with the texture and the vertex colours.
    pub base_color: [f64; 4],
    /// Base colour texture (sRGB).
    pub base_color_texture: Option<TextureRef>,
    /// Metalness, 0 to 1.
    pub metallic: f64,
    /// Roughness, 0 to 1 (GGX alpha is its square).
    pub roughness: f64,
    /// Metallic-roughness texture (linear; green is roughness, blue is metalness).
    pub metallic_roughness_texture: Option<TextureRef>,
    /// Normal texture in tangent space, +Y towards the top of the image.
    pub normal_texture: Option<TextureRef>,
    /// Radiance that the front emits, W/(m²·sr), linear RGB. Values above one go through KHR_materials_emissive_strength.
    pub emission: [f64; 3],
    /// Emissive texture (sRGB), multiplied with `emission`.
    pub emissive_texture: Option<TextureRef>,
    /// Use of alpha.
    pub alpha: Alpha,
    /// Whether both sides are shaded (and emit).
    pub double_sided: bool,
}

impl Default for Material {
    fn default() -> Self {
        Self {
            name: "White",
            base_color: [0.8, 0.8, 0.8, 1.0],
            base_color_texture: None,
            metallic: 0.0,
            roughness: 1.0,
            metallic_roughness_texture: None,
            normal_texture: None,
            emission: [0.0; 3],
            emissive_texture: None,
            alpha: Alpha::Opaque,
            double_sided: false,
        }
    }
}

/// A matt material of one colour.
pub fn matt(name: &'static str, rgb: [f64; 3]) -> Material {
    Material {
        name,
        base_color: [rgb[0], rgb[1], rgb[2], 1.0],
        ..Material::default()
    }
}

/// Grey metal that reflects so much at normal incidence.
pub fn metal(name: &'static str, reflectance: f64, roughness: f64) -> Material {
    Material {
        metallic: 1.0,
        roughness,
        ..matt(name, [reflectance; 3])
    }
}

/// Where a node stands in its parent: parent_from_node = translation · rotation · scale.
#[derive(Clone, Copy)]
pub struct Placement {
    /// Metres.
    pub translation: DVec3,
    /// Unit quaternion.
    pub rotation: DQuat,
    /// Factor per axis.
    pub scale: DVec3,
}

impl Placement {
    /// The identity.
    pub const HERE: Self = Self {
        translation: DVec3::ZERO,
        rotation: DQuat::IDENTITY,
        scale: DVec3::ONE,
    };

    /// Moved to a point.
    pub fn at(x: f64, y: f64, z: f64) -> Self {
        Self {
            translation: DVec3::new(x, y, z),
            ..Self::HERE
        }
    }

    /// Also turned counter-clockwise about +Y, in degrees.
    pub fn turned(self, degrees: f64) -> Self {
        Self {
            rotation: DQuat::from_rotation_y(degrees.to_radians()),
            ..self
        }
    }

    /// Also scaled by one factor.
    pub fn scaled(self, factor: f64) -> Self {
        Self {
            scale: DVec3::splat(factor),
            ..self
        }
    }

    fn write(&self, node: &mut Map<String, Value>) {
        // Rounded to what a single float resolves at a few metres: the JSON stays short and free of 1e-17.
        let round = |v: &[f64]| -> Value { v.iter().map(|x| json!((x * 1e7).round() / 1e7 + 0.0)).collect() };
        if self.translation != DVec3::ZERO {
            node.insert("translation".into(), round(&self.translation.to_array()));
        }
        if self.rotation != DQuat::IDENTITY {
            node.insert("rotation".into(), round(&self.rotation.to_array()));
        }
        if self.scale != DVec3::ONE {
            node.insert("scale".into(), round(&self.scale.to_array()));
        }
    }
}

/// A glTF file under construction, and the finished one.
#[derive(Clone)]
pub struct Glb {
    accessors: Vec<Value>,
    views: Vec<Value>,
    images: Vec<Value>,
    textures: Vec<Value>,
    materials: Vec<Value>,
    meshes: Vec<Value>,
    cameras: Vec<Value>,
    lights: Vec<Value>,
    nodes: Vec<Value>,
    roots: Vec<usize>,
    extensions: Vec<&'static str>,
    triangles: Vec<usize>,
    drawn: usize,
    bin: Vec<u8>,
}

impl Default for Glb {
    fn default() -> Self {
        Self::new()
    }
}

impl Glb {
    /// An empty file.
    pub fn new() -> Self {
        Self {
            accessors: vec![],
            views: vec![],
            images: vec![],
            textures: vec![],
            materials: vec![],
            meshes: vec![],
            cameras: vec![],
            lights: vec![],
            nodes: vec![],
            roots: vec![],
            extensions: vec![],
            triangles: vec![],
            drawn: 0,
            bin: vec![],
        }
    }

    /// Triangles that are drawn, those of shared meshes counted once per node.
    pub fn triangle_count(&self) -> usize {
        self.drawn
    }

    /// Adds a PNG file as a texture that repeats, with trilinear filtering.
    pub fn add_texture(&mut self, name: &str, png: &[u8]) -> usize {
        let view = self.add_view(png, None);
        self.images
            .push(json!({ "name": name, "bufferView": view, "mimeType": "image/png" }));
        self.textures
            .push(json!({ "source": self.images.len() - 1, "sampler": 0 }));
        self.textures.len() - 1
    }

    /// Adds a material and returns its index.
    pub fn add_material(&mut self, m: &Material) -> usize {
        let mut pbr = Map::new();
        pbr.insert("baseColorFactor".into(), json!(m.base_color));
        pbr.insert("metallicFactor".into(), json!(m.metallic));
        pbr.insert("roughnessFactor".into(), json!(m.roughness));
        if let Some(t) = m.base_color_texture {
            pbr.insert("baseColorTexture".into(), self.texture_info(t));
        }
        if let Some(t) = m.metallic_roughness_texture {
            pbr.insert("metallicRoughnessTexture".into(), self.texture_info(t));
        }
        let mut out = Map::new();
        out.insert("name".into(), json!(m.name));
        out.insert("pbrMetallicRoughness".into(), Value::Object(pbr));
        if let Some(t) = m.normal_texture {
            out.insert("normalTexture".into(), self.texture_info(t));
        }
        if let Some(t) = m.emissive_texture {
            out.insert("emissiveTexture".into(), self.texture_info(t));
        }
        let strength = m.emission.iter().fold(0.0f64, |a, &b| a.max(b));
        if strength > 1.0 {
            self.use_extension("KHR_materials_emissive_strength");
            out.insert("emissiveFactor".into(), json!(m.emission.map(|e| e / strength)));
            let extension = json!({ "KHR_materials_emissive_strength": { "emissiveStrength": strength } });
            out.insert("extensions".into(), extension);
        } else if strength > 0.0 {
            out.insert("emissiveFactor".into(), json!(m.emission));
        }
        match m.alpha {
            Alpha::Opaque => {}
            Alpha::Mask(cutoff) => {
                out.insert("alphaMode".into(), json!("MASK"));
                out.insert("alphaCutoff".into(), json!(cutoff));
            }
            Alpha::Blend => {
                out.insert("alphaMode".into(), json!("BLEND"));
            }
        }
        if m.double_sided {
            out.insert("doubleSided".into(), json!(true));
        }
        self.materials.push(Value::Object(out));
        self.materials.len() - 1
    }

    /// Adds a mesh of one primitive per part, a part being triangles and the index of their material.
    pub fn add_mesh(&mut self, name: &str, parts: &[(&Mesh, usize)]) -> usize {
        let primitives: Vec<Value> = parts
            .iter()
            .map(|(mesh, material)| self.primitive(mesh, *material))
            .collect();
        self.triangles
            .push(parts.iter().map(|(mesh, _)| mesh.indices.len() / 3).sum());
        self.meshes
            .push(json!({ "name": name, "primitives": primitives }));
        self.meshes.len() - 1
    }

    /// Adds a mesh that shares all vertices and indices of another one and differs in the materials of its parts.
    pub fn add_recolored(&mut self, name: &str, mesh: usize, materials: &[usize]) -> usize {
        let mut copy = self.meshes[mesh].clone();
        copy["name"] = json!(name);
        for (part, &material) in materials.iter().enumerate() {
            copy["primitives"][part]["material"] = json!(material);
        }
        self.triangles.push(self.triangles[mesh]);
        self.meshes.push(copy);
        self.meshes.len() - 1
    }

    /// Adds a node that draws a mesh at a place in the world.
    pub fn add_node(&mut self, name: &str, mesh: usize, place: Placement) -> usize {
        let id = self.push_node(name, Some(mesh), place);
        self.roots.push(id);
        id
    }

    /// Adds a node without a mesh whose children are the given meshes at places relative to it.
    pub fn add_group(&mut self, name: &str, place: Placement, children: &[(usize, Placement)]) -> usize {
        let ids: Vec<usize> = children
            .iter()
            .map(|&(mesh, place)| self.push_node("", Some(mesh), place))
            .collect();
        let id = self.push_node(name, None, place);
        self.nodes[id]["children"] = json!(ids);
        self.roots.push(id);
        id
    }

    /// Adds a perspective camera at `eye` that looks at `target`; vertical field of view in degrees, aspect = width / height.
    pub fn add_camera(&mut self, name: &str, eye: DVec3, target: DVec3, vfov_deg: f64, aspect: f64) {
        self.cameras
            .push(json!({ "name": name, "type": "perspective", "perspective":
            { "yfov": vfov_deg.to_radians(), "aspectRatio": aspect, "znear": 0.01, "zfar": 1000.0 } }));
        let back = (eye - target).normalize();
        let right = DVec3::Y.cross(back).normalize();
        let world_from_camera = glam::DMat3::from_cols(right, back.cross(right), back);
        let rotation = DQuat::from_mat3(&world_from_camera);
        let id = self.push_node(
            name,
            None,
            Placement {
                translation: eye,
                rotation,
                scale: DVec3::ONE,
            },
        );
        self.nodes[id]["camera"] = json!(self.cameras.len() - 1);
        self.roots.push(id);
    }

    /// Adds a light of KHR_lights_punctual (its JSON: type, intensity in cd or lx, colour, cone) that shines along
    /// `direction`, a unit vector.
    pub fn add_light(&mut self, name: &str, light: Value, position: DVec3, direction: DVec3) {
        self.use_extension(PUNCTUAL);
        self.lights.push(light);
        let place = Placement {
            translation: position,
            rotation: DQuat::from_rotation_arc(DVec3::NEG_Z, direction),
            scale: DVec3::ONE,
        };
        let id = self.push_node(name, None, place);
        self.nodes[id]["extensions"] = json!({ PUNCTUAL: { "light": self.lights.len() - 1 } });
        self.roots.push(id);
    }

    /// Puts all that was added so far under one node.
    pub fn put_under(&mut self, name: &str, place: Placement) {
        let children = std::mem::take(&mut self.roots);
        let id = self.push_node(name, None, place);
        self.nodes[id]["children"] = json!(children);
        self.roots.push(id);
    }

    /// The bytes of the `.glb` file.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut root = Map::new();
        root.insert(
            "asset".into(),
            json!({ "version": "2.0", "generator": "relight-data-generate" }),
        );
        root.insert("scene".into(), json!(0));
        root.insert("scenes".into(), json!([{ "nodes": self.roots }]));
        if !self.extensions.is_empty() {
            root.insert("extensionsUsed".into(), json!(self.extensions));
        }
        if !self.lights.is_empty() {
            root.insert(
                "extensions".into(),
                json!({ PUNCTUAL: { "lights": self.lights } }),
            );
        }
        // 9729 linear, 9987 trilinear, 10497 repeat.
        let sampler = json!({ "magFilter": 9729, "minFilter": 9987, "wrapS": 10497, "wrapT": 10497 });
        let samplers = if self.textures.is_empty() {
            vec![]
        } else {
            vec![sampler]
        };
        let arrays = [
            ("nodes", &self.nodes),
            ("meshes", &self.meshes),
            ("materials", &self.materials),
            ("textures", &self.textures),
            ("images", &self.images),
            ("samplers", &samplers),
            ("cameras", &self.cameras),
            ("accessors", &self.accessors),
            ("bufferViews", &self.views),
        ];
        for (key, array) in arrays {
            if !array.is_empty() {
                root.insert(key.into(), json!(array));
            }
        }
        let mut bin = self.bin.clone();
        bin.resize(bin.len().next_multiple_of(4), 0);
        root.insert("buffers".into(), json!([{ "byteLength": bin.len() }]));
        let mut text = Value::Object(root).to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');

        let mut out = Vec::with_capacity(28 + text.len() + bin.len());
        out.extend_from_slice(b"glTF");
        out.extend_from_slice(&2u32.to_le_bytes());
        out.extend_from_slice(&((28 + text.len() + bin.len()) as u32).to_le_bytes());
        for (kind, chunk) in [(b"JSON", &text), (b"BIN\0", &bin)] {
            out.extend_from_slice(&(chunk.len() as u32).to_le_bytes());
            out.extend_from_slice(kind);
            out.extend_from_slice(chunk);
        }
        out
    }

    fn push_node(&mut self, name: &str, mesh: Option<usize>, place: Placement) -> usize {
        let mut node = Map::new();
        if !name.is_empty() {
            node.insert("name".into(), json!(name));
        }
        if let Some(mesh) = mesh {
            node.insert("mesh".into(), json!(mesh));
            self.drawn += self.triangles[mesh];
        }
        place.write(&mut node);
        self.nodes.push(Value::Object(node));
        self.nodes.len() - 1
    }

    fn primitive(&mut self, mesh: &Mesh, material: usize) -> Value {
        let positions: Vec<[f32; 3]> = mesh.positions.iter().map(|p| p.as_vec3().to_array()).collect();
        let mut low = [f32::INFINITY; 3];
        let mut high = [f32::NEG_INFINITY; 3];
        for p in &positions {
            for axis in 0..3 {
                low[axis] = low[axis].min(p[axis]);
                high[axis] = high[axis].max(p[axis]);
            }
        }
        let position = self.add_floats(positions.as_flattened(), 3, "VEC3");
        self.accessors[position]["min"] = json!(low);
        self.accessors[position]["max"] = json!(high);
        let normals: Vec<[f32; 3]> = mesh.normals.iter().map(|n| n.as_vec3().to_array()).collect();
        let mut attributes = json!({ "POSITION": position });
        attributes["NORMAL"] = json!(self.add_floats(normals.as_flattened(), 3, "VEC3"));
        if !mesh.uvs.is_empty() {
            let uvs: Vec<[f32; 2]> = mesh.uvs.iter().map(|t| t.as_vec2().to_array()).collect();
            attributes["TEXCOORD_0"] = json!(self.add_floats(uvs.as_flattened(), 2, "VEC2"));
        }
        if !mesh.colors.is_empty() {
            attributes["COLOR_0"] = json!(self.add_floats(mesh.colors.as_flattened(), 3, "VEC3"));
        }
        let indices = self.add_indices(&mesh.indices, positions.len());
        json!({ "attributes": attributes, "indices": indices, "material": material })
    }

    fn add_floats(&mut self, values: &[f32], width: usize, kind: &str) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        // 34962: a buffer of vertex attributes; 5126: float.
        let view = self.add_view(&bytes, Some(34962));
        let count = values.len() / width;
        self.accessors
            .push(json!({ "bufferView": view, "componentType": 5126, "count": count, "type": kind }));
        self.accessors.len() - 1
    }

    fn add_indices(&mut self, indices: &[u32], vertices: usize) -> usize {
        // 65535 itself is the restart value of 16-bit indices, so that many vertices already need 32 bits.
        let narrow = vertices <= 65535;
        let bytes: Vec<u8> = if narrow {
            indices.iter().flat_map(|&i| (i as u16).to_le_bytes()).collect()
        } else {
            indices.iter().flat_map(|&i| i.to_le_bytes()).collect()
        };
        // 34963: a buffer of indices; 5123: u16; 5125: u32.
        let view = self.add_view(&bytes, Some(34963));
        let kind = if narrow { 5123 } else { 5125 };
        let count = indices.len();
        self.accessors
            .push(json!({ "bufferView": view, "componentType": kind, "count": count, "type": "SCALAR" }));
        self.accessors.len() - 1
    }

    fn add_view(&mut self, bytes: &[u8], target: Option<u32>) -> usize {
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        let mut view = json!({ "buffer": 0, "byteOffset": self.bin.len(), "byteLength": bytes.len() });
        if let Some(target) = target {
            view["target"] = json!(target);
        }
        self.bin.extend_from_slice(bytes);
        self.views.push(view);
        self.views.len() - 1
    }

    fn texture_info(&mut self, t: TextureRef) -> Value {
        let mut info = json!({ "index": t.texture });
        if let Some((offset, rotation, scale)) = t.transform {
            self.use_extension("KHR_texture_transform");
            info["extensions"] = json!({ "KHR_texture_transform": { "offset": offset, "rotation": rotation, "scale": scale } });
        }
        info
    }

    fn use_extension(&mut self, name: &'static str) {
        if !self.extensions.contains(&name) {
            self.extensions.push(name);
        }
    }
}
