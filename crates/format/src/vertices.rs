//! Which vertices cuts stand at (SPEC 6.13.1).

use crate::asset::{Geometry, Mesh};
use crate::codec::octahedral;
use crate::section::geometry::NORMAL_BITS;
use std::collections::HashMap;

/// Sites of cuts on one mesh.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct VertexSites {
    /// Number of sites.
    pub count: usize,
    /// The site of each corner of each triangle of the mesh.
    pub of_corners: Vec<[u32; 3]>,
}

/// The sites of a mesh: its vertices in the order in which its triangles use them, those of one position and normal
/// once. Without normals a vertex faces each of its triangles' way, and each corner is a site of its own.
///
/// Normals count as they are stored, so that writer and reader agree. A vertex index out of range is taken for a
/// vertex of its own; valid geometry has none.
pub fn vertex_sites(mesh: &Mesh) -> VertexSites {
    let mut count = 0;
    let mut new = || {
        count += 1;
        count - 1
    };
    let of_corners = match &mesh.normals {
        None => mesh.triangles.iter().map(|_| [(); 3].map(|()| new())).collect(),
        Some(normals) => {
            let mut known = HashMap::new();
            let mut site = |vertex: u32| {
                let (position, normal) = (mesh.positions.get(vertex as usize), normals.get(vertex as usize));
                let (Some(position), Some(&normal)) = (position, normal) else {
                    return new();
                };
                let key = (
                    position.map(f32::to_bits),
                    octahedral::encode(normal, NORMAL_BITS),
                );
                *known.entry(key).or_insert_with(&mut new)
            };
            mesh.triangles
                .iter()
                .map(|corners| corners.map(&mut site))
                .collect()
        }
    };
    VertexSites {
        count: count as usize,
        of_corners,
    }
}

/// Number of sites on all instances, which follow each other. `None`: an instance of a mesh that is not there.
pub fn vertex_site_count(geometry: &Geometry) -> Option<usize> {
    let counts: Vec<usize> = geometry.meshes.iter().map(|m| vertex_sites(m).count).collect();
    (geometry.instances.iter())
        .map(|instance| counts.get(instance.mesh as usize))
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square of two triangles, and a third one that stands on one of its edges.
    fn corner() -> Mesh {
        let up = [0.0, 1.0, 0.0];
        let side = [1.0, 0.0, 0.0];
        Mesh {
            positions: vec![
                [0.0; 3],
                [1.0, 0.0, 0.0],
                [1.0, 0.0, 1.0],
                // The same places as 0 and 2, as a seam of texture coordinates leaves them.
                [0.0; 3],
                [1.0, 0.0, 1.0],
                [0.0, 0.0, 1.0],
                // Place 0 and 5 with another normal.
                [0.0; 3],
                [0.0, 0.0, 1.0],
                [0.0, 1.0, 0.0],
            ],
            normals: Some([[up; 6].as_slice(), &[side; 3]].concat()),
            triangles: vec![[2, 1, 0], [3, 5, 4], [6, 7, 8]],
            ..Mesh::default()
        }
    }

    #[test]
    fn vertices_of_one_place_and_normal_are_one_site() {
        let sites = vertex_sites(&corner());
        assert_eq!(sites.of_corners, [[0, 1, 2], [2, 3, 0], [4, 5, 6]]);
        assert_eq!(sites.count, 7);
    }

    #[test]
    fn normals_that_are_stored_alike_are_alike() {
        let mut mesh = corner();
        if let Some(normals) = &mut mesh.normals {
            normals[3] = [0.0, 1.0, 1e-7];
        }
        assert_eq!(vertex_sites(&mesh), vertex_sites(&corner()));
    }

    #[test]
    fn without_normals_every_corner_is_a_site() {
        let mesh = Mesh {
            normals: None,
            ..corner()
        };
        let sites = vertex_sites(&mesh);
        assert_eq!(sites.of_corners, [[0, 1, 2], [3, 4, 5], [6, 7, 8]]);
        assert_eq!(sites.count, 9);
    }
}
