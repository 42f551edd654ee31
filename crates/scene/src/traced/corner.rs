//! What a triangle carries at a point: interpolated attributes, and the hash that decides coverage.

use crate::rays::Ray;
use crate::scene::Mesh;
use glam::{Vec2, Vec3A, Vec4};

/// A point of a mesh's triangle: three vertices and their weights.
pub(crate) struct Corner<'a> {
    pub(crate) mesh: &'a Mesh,
    pub(crate) indices: [usize; 3],
    weights: [f32; 3],
}

impl<'a> Corner<'a> {
    pub(super) fn new(mesh: &'a Mesh, indices: [u32; 3], barycentric: [f32; 2]) -> Corner<'a> {
        Corner {
            mesh,
            indices: indices.map(|index| index as usize),
            weights: weights(barycentric),
        }
    }

    /// Normals of the three vertices, mesh space, of any length; `None` where the mesh has none.
    pub(super) fn vertex_normals(&self) -> Option<[Vec3A; 3]> {
        let normals = &self.mesh.normals;
        (!normals.is_empty()).then(|| self.indices.map(|index| Vec3A::from(normals[index])))
    }

    /// Interpolated tangent, mesh space, of any length, with vertex 0's handedness in w.
    pub(crate) fn tangent(&self) -> Option<Vec4> {
        let tangents = &self.mesh.tangents;
        (!tangents.is_empty()).then(|| {
            let sum: Vec4 = (0..3).map(|k| tangents[self.indices[k]] * self.weights[k]).sum();
            sum.truncate().extend(tangents[self.indices[0]].w)
        })
    }

    /// The three vertices' coordinates of one set; zeros where the mesh has no such set.
    pub(crate) fn vertex_uvs(&self, set: u32) -> [Vec2; 3] {
        match self.mesh.uvs.get(set as usize) {
            Some(uvs) if !uvs.is_empty() => self.indices.map(|index| uvs[index]),
            _ => [Vec2::ZERO; 3],
        }
    }

    pub(super) fn uv(&self, set: u32) -> Vec2 {
        let uvs = self.vertex_uvs(set);
        (0..3).map(|k| uvs[k] * self.weights[k]).sum()
    }

    pub(super) fn color(&self) -> Vec4 {
        match self.vertex_colors() {
            Some(colors) => (0..3).map(|k| colors[k] * self.weights[k]).sum(),
            None => Vec4::ONE,
        }
    }

    /// Colours of the three vertices; `None` where the mesh has none.
    pub(super) fn vertex_colors(&self) -> Option<[Vec4; 3]> {
        let colors = &self.mesh.colors;
        (!colors.is_empty()).then(|| self.indices.map(|index| colors[index]))
    }
}

/// Weights of the three vertices.
pub(super) fn weights([u, v]: [f32; 2]) -> [f32; 3] {
    [1.0 - u - v, u, v]
}

/// A number in 0..1 that depends on the ray's origin and direction and on the triangle: equal rays get equal
/// numbers, rays that differ in one bit independent ones.
pub(super) fn hash_to_unit(ray: &Ray, triangle: u32) -> f32 {
    let mut state = u64::from(triangle);
    for value in ray.origin.to_array().into_iter().chain(ray.direction.to_array()) {
        // Adding zero makes -0 and 0 alike.
        state = mix(state ^ u64::from((value + 0.0).to_bits()));
    }
    // The upper 24 bits are as many as a float in 0..1 can hold.
    (state >> 40) as f32 / (1u64 << 24) as f32
}

/// The finaliser of SplitMix64 (Steele, Lea and Flood 2014), with its increment.
fn mix(state: u64) -> u64 {
    let z = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}
