//! A static scene as data: what an importer makes and what an asset stores.

use crate::camera::CameraTrack;
use crate::material::{Material, Texture};
use crate::sequence::Sequence;
use glam::{Affine3A, DVec3, Vec2, Vec3, Vec4};
use std::collections::HashMap;

/// Triangles with one material, in their own space. All vertex arrays have the length of `positions` or,
/// where the mesh lacks the attribute, are empty.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Mesh space; finite.
    pub positions: Vec<Vec3>,
    /// Unit normals; empty: flat shading.
    pub normals: Vec<Vec3>,
    /// Tangents as glTF has them (w = handedness); empty: derived from the first normal-map's coordinates.
    pub tangents: Vec<Vec4>,
    /// Sets of texture coordinates.
    pub uvs: Vec<Vec<Vec2>>,
    /// Linear vertex colours with alpha.
    pub colors: Vec<Vec4>,
    /// Vertex indices, all in range; counter-clockwise seen from the front.
    pub triangles: Vec<[u32; 3]>,
    /// Index into [`Scene::materials`].
    pub material: u32,
}

impl Mesh {
    /// Whether it bounds a body, fronts outwards: each edge is shared by as many triangles in one direction as in the other, vertices
    /// at one place being one, and the volume is positive.
    pub fn is_closed(&self) -> bool {
        let mut numbers = HashMap::new();
        let number = |position: &Vec3| {
            let next = numbers.len();
            // Adding zero makes -0 and 0 alike.
            *numbers
                .entry((*position + Vec3::ZERO).to_array().map(f32::to_bits))
                .or_insert(next)
        };
        let places: Vec<usize> = self.positions.iter().map(number).collect();
        let center = (self.positions.first()).map_or(DVec3::ZERO, |position| position.as_dvec3());
        let mut edges: HashMap<(usize, usize), i64> = HashMap::new();
        let mut volume = 0.0;
        for triangle in &self.triangles {
            let at = triangle.map(|vertex| places[vertex as usize]);
            for (from, to) in [(at[0], at[1]), (at[1], at[2]), (at[2], at[0])] {
                let way = (to > from) as i64 - (to < from) as i64;
                *edges.entry((from.min(to), from.max(to))).or_default() += way;
            }
            let [a, b, c] = triangle.map(|vertex| self.positions[vertex as usize].as_dvec3() - center);
            volume += a.dot(b.cross(c));
        }
        volume > 0.0 && edges.values().all(|&ways| ways == 0)
    }
}

/// A mesh placed in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instance {
    /// Index into [`Scene::meshes`].
    pub mesh: u32,
    /// May mirror: a negative determinant flips the winding, so that fronts stay fronts.
    pub world_from_mesh: Affine3A,
}

/// A set of materials in place of others, which a scene may be shown with.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Variant {
    /// What the source calls it.
    pub name: String,
    /// Materials that it replaces, and by which: indices into [`Scene::materials`].
    pub materials: Vec<[u32; 2]>,
}

/// What variants put in place of materials: of each material that has any, rising.
pub fn replacements(variants: &[Variant]) -> HashMap<u32, Vec<u32>> {
    let mut all: HashMap<u32, Vec<u32>> = HashMap::new();
    for &[of, by] in variants.iter().flat_map(|variant| &variant.materials) {
        all.entry(of).or_default().push(by);
    }
    for replacements in all.values_mut() {
        replacements.sort_unstable();
        replacements.dedup();
    }
    all
}

/// A material, and its [`replacements`].
pub fn shown_as(material: u32, replacements: &HashMap<u32, Vec<u32>>) -> impl Iterator<Item = u32> {
    let by = replacements.get(&material).into_iter().flatten();
    std::iter::once(material).chain(by.copied())
}

/// A whole scene: geometry at rest, materials, and the cameras and lights that came with it.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// Every mesh once, however often it is placed.
    pub meshes: Vec<Mesh>,
    /// Placed meshes, in the order of the source.
    pub instances: Vec<Instance>,
    /// What the source calls each instance: its node, else its mesh; empty where it has no name. As many as instances, or none.
    pub object_names: Vec<String>,
    /// At least one if there are meshes.
    pub materials: Vec<Material>,
    /// Sets of materials to choose from; all materials are those of none of them.
    pub variants: Vec<Variant>,
    /// Referenced by the materials.
    pub textures: Vec<Texture>,
    /// Perspective camera nodes; the first is the default.
    pub cameras: Vec<CameraTrack>,
    /// The scene's own lights (punctual and emissive) and its animation's length.
    pub sequence: Sequence,
    /// Taken away from all positions of the source, metres: the source's coordinates are these here plus this. Zero
    /// but for scenes far from their origin, which 32-bit numbers would tear apart.
    pub offset: DVec3,
    /// What the importer had to leave out or change, one sentence each.
    pub notes: Vec<String>,
}
