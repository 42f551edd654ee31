//! Hashes of what units depend on.

use crate::points::candidates::Candidate;
use glam::{Vec2, Vec3};
use relight_scene::material::{AlphaMode, Extensions, Material, Texture, TextureUse};
use relight_scene::scene::{Mesh, Scene};
use relight_transport::basis::Level;
use xxhash_rust::xxh3::{Xxh3, xxh3_128};

/// A hash in the making: XXH3-128 of numbers, each array with its length.
#[derive(Default)]
pub struct Key(Xxh3);

impl Key {
    /// The hash.
    pub fn hash(&self) -> u128 {
        self.0.digest128()
    }

    /// Adds bytes.
    pub fn bytes(&mut self, bytes: &[u8]) -> &mut Key {
        self.0.update(&(bytes.len() as u64).to_le_bytes());
        self.0.update(bytes);
        self
    }

    /// Adds numbers.
    pub fn u64s(&mut self, numbers: &[u64]) -> &mut Key {
        self.each(numbers.len(), numbers.iter().map(|n| n.to_le_bytes()))
    }

    /// Adds hashes.
    pub fn u128s(&mut self, numbers: &[u128]) -> &mut Key {
        self.each(numbers.len(), numbers.iter().map(|n| n.to_le_bytes()))
    }

    /// Adds numbers.
    pub fn u32s(&mut self, numbers: &[u32]) -> &mut Key {
        self.each(numbers.len(), numbers.iter().map(|n| n.to_le_bytes()))
    }

    /// Adds numbers, bit by bit.
    pub fn f32s(&mut self, numbers: &[f32]) -> &mut Key {
        self.each(numbers.len(), numbers.iter().map(|n| n.to_le_bytes()))
    }

    /// Adds vectors.
    pub fn vectors<'a>(&mut self, vectors: impl ExactSizeIterator<Item = &'a Vec3>) -> &mut Key {
        self.each(vectors.len(), vectors.map(|v| triple(*v)))
    }

    /// Adds where rays start and what they start from; not what it reflects.
    pub fn places(&mut self, places: &[Candidate]) -> &mut Key {
        let bytes = |p: &Candidate| [p.position, p.normal, p.geometric_normal, p.origin].map(triple);
        for place in places {
            self.0.update(bytes(place).as_flattened());
        }
        self.u64s(&[places.len() as u64])
    }

    /// Adds the points of a level and their radii.
    pub fn level(&mut self, level: &Level) -> &mut Key {
        self.vectors(level.positions.iter())
            .vectors(level.normals.iter())
            .bytes(&level.widenings)
            .f32s(&[level.disk_radius, level.support_radius])
    }

    fn each<const N: usize>(&mut self, count: usize, numbers: impl Iterator<Item = [u8; N]>) -> &mut Key {
        self.0.update(&(count as u64).to_le_bytes());
        numbers.for_each(|bytes| self.0.update(&bytes));
        self
    }
}

fn triple(v: Vec3) -> [u8; 12] {
    let mut bytes = [0; 12];
    for (out, x) in bytes.chunks_exact_mut(4).zip(v.to_array()) {
        out.copy_from_slice(&x.to_le_bytes());
    }
    bytes
}

/// What rays meet of each mesh: triangles in their order, their smooth normals, and what lets rays pass. Colours, roughness
/// and emission are not in it.
pub(super) fn meshes(scene: &Scene) -> Vec<u128> {
    let textures: Vec<u128> = scene.textures.iter().map(|t| xxh3_128(&t.encoded)).collect();
    scene
        .meshes
        .iter()
        .map(|mesh| {
            let mut key = Key::default();
            key.vectors(mesh.positions.iter()).vectors(mesh.normals.iter());
            key.u32s(mesh.triangles.as_flattened());
            if let Some(material) = scene.materials.get(mesh.material as usize) {
                alpha(&mut key, mesh, material, &scene.textures, &textures);
            }
            key.hash()
        })
        .collect()
}

fn alpha(key: &mut Key, mesh: &Mesh, material: &Material, textures: &[Texture], hashes: &[u128]) {
    match material.alpha_mode {
        AlphaMode::Opaque => return,
        AlphaMode::Mask { cutoff } => key.f32s(&[cutoff]),
        AlphaMode::Blend => key.f32s(&[]),
        AlphaMode::Pane { transmission } => key
            .f32s(&[transmission, material.metallic])
            .f32s(&material.base_color.to_array())
            .f32s(
                &material
                    .extensions
                    .iter()
                    .flat_map(|e| mirrored(e))
                    .collect::<Vec<f32>>(),
            )
            .f32s(
                &mesh
                    .colors
                    .iter()
                    .flat_map(|c| c.to_array())
                    .collect::<Vec<f32>>(),
            ),
    };
    key.f32s(&[material.base_color.w]);
    key.f32s(&mesh.colors.iter().map(|c| c.w).collect::<Vec<f32>>());
    let e = material.extensions.as_ref();
    if let (AlphaMode::Pane { .. }, Some(e)) = (material.alpha_mode, e)
        && e.have_glass()
    {
        key.f32s(&[e.thickness]).f32s(&e.absorption.to_array());
        looked_up(key, mesh, &e.transmission_texture, textures, hashes);
    }
    looked_up(key, mesh, &material.base_color_texture, textures, hashes);
}

/// What a texture shows on a mesh.
fn looked_up(key: &mut Key, mesh: &Mesh, usage: &Option<TextureUse>, textures: &[Texture], hashes: &[u128]) {
    let Some(usage) = usage else {
        return;
    };
    let at = usage.texture as usize;
    if let (Some(texture), Some(&hash)) = (textures.get(at), hashes.get(at)) {
        let wrap = texture.wrap.map(|w| w as u32);
        key.u128s(&[hash])
            .u32s(&[wrap[0], wrap[1], u32::from(texture.nearest)])
            .f32s(&usage.texture_from_mesh.to_cols_array());
    }
    if let Some(uvs) = mesh.uvs.get(usage.uv_set as usize) {
        key.f32s(&uvs.iter().flat_map(Vec2::to_array).collect::<Vec<f32>>());
    }
}

/// What a pane mirrors.
fn mirrored(extensions: &Extensions) -> [f32; 5] {
    let [r, g, b] = extensions.specular_color.to_array();
    [extensions.ior, extensions.specular, r, g, b]
}

/// All of a scene as it was imported, whatever files it came from: for telling whether it has changed.
pub fn scene(scene: &Scene) -> u128 {
    let mut key = Key::default();
    key.u128s(&meshes(scene));
    for instance in &scene.instances {
        key.u32s(&[instance.mesh])
            .f32s(&instance.world_from_mesh.to_cols_array());
    }
    for mesh in &scene.meshes {
        key.u32s(&[mesh.material]);
        for set in &mesh.uvs {
            key.f32s(&set.iter().flat_map(Vec2::to_array).collect::<Vec<f32>>());
        }
        for fours in [&mesh.colors, &mesh.tangents] {
            key.f32s(&fours.iter().flat_map(|v| v.to_array()).collect::<Vec<f32>>());
        }
    }
    for texture in &scene.textures {
        key.bytes(&texture.encoded);
    }
    // Small, and Debug prints every field, numbers so that they come back: none that is added can be forgotten.
    let rest = (&scene.materials, &scene.variants, &scene.cameras, &scene.sequence);
    key.bytes(format!("{rest:?}").as_bytes());
    key.hash()
}
