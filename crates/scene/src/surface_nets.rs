//! Triangles for surfaces that are given by a field: the asset holds triangles, whatever a scene is described by.
//!
//! Source: Gibson 1998, "Constrained Elastic Surface Nets": a vertex in every cell that the surface crosses, at the
//! mean of the crossings of its edges, and a quad around every edge that is crossed. Then vertices are moved onto the
//! surface by Newton's method, within their cells.

use crate::scene::Mesh;
use glam::{DVec3, UVec3, Vec3};
use rayon::prelude::*;

/// A field on a grid of nodes; its zero set is the surface, negative is inside.
pub struct Field<'a> {
    /// World space: the first node and the last.
    pub low: DVec3,
    /// See `low`.
    pub high: DVec3,
    /// Nodes along each axis, at least 2. What is inside at the outermost ones is cut off there.
    pub nodes: UVec3,
    /// At a place.
    pub value: &'a (dyn Fn(DVec3) -> f64 + Sync),
    /// Outward, at a place: any length.
    pub gradient: &'a (dyn Fn(DVec3) -> DVec3 + Sync),
}

/// Steps of Newton's method: a distance field takes one, others halve their error's digits.
const STEPS: usize = 4;

impl Field<'_> {
    /// The surface, fronts outside, with smooth normals.
    pub fn mesh(&self, material: u32) -> Mesh {
        let values = self.values();
        let cells = self.nodes - 1;
        let layers: Vec<Vec<(u32, Vec3, Vec3)>> = (0..cells.z)
            .into_par_iter()
            .map(|z| {
                let layer = (0..cells.y).flat_map(|y| (0..cells.x).map(move |x| UVec3::new(x, y, z)));
                layer
                    .filter_map(|cell| {
                        let (position, normal) = self.vertex(&values, cell)?;
                        Some((index(cell, cells) as u32, position, normal))
                    })
                    .collect()
            })
            .collect();
        let mut vertex_of_cell = vec![u32::MAX; cells.as_usizevec3().element_product()];
        let mut mesh = Mesh {
            material,
            ..Mesh::default()
        };
        for (cell, position, normal) in layers.into_iter().flatten() {
            vertex_of_cell[cell as usize] = mesh.positions.len() as u32;
            mesh.positions.push(position);
            mesh.normals.push(normal);
        }
        mesh.triangles = self.triangles(&values, &vertex_of_cell, &mesh.positions);
        mesh
    }

    fn place(&self, node: DVec3) -> DVec3 {
        self.low + (self.high - self.low) * node / (self.nodes - 1).as_dvec3()
    }

    fn values(&self) -> Vec<f64> {
        let last = self.nodes - 1;
        (0..self.nodes.as_usizevec3().element_product())
            .into_par_iter()
            .map(|i| {
                let node = node(i, self.nodes);
                let value = (self.value)(self.place(node.as_dvec3()));
                let outermost = node.cmpeq(UVec3::ZERO).any() || node.cmpeq(last).any();
                // No number counts as outside.
                if value.is_nan() || (outermost && value < 0.0) {
                    f64::MIN_POSITIVE
                } else {
                    value
                }
            })
            .collect()
    }

    /// Position and normal of a cell's vertex, if the surface crosses the cell.
    fn vertex(&self, values: &[f64], cell: UVec3) -> Option<(Vec3, Vec3)> {
        let corner = |k: u32| cell + UVec3::new(k & 1, k >> 1 & 1, k >> 2);
        let value = |k: u32| values[index(corner(k), self.nodes)];
        let (mut sum, mut count) = (DVec3::ZERO, 0.0);
        for k in 0..8u32 {
            for other in [k | 1, k | 2, k | 4] {
                let (a, b) = (value(k), value(other));
                if (a < 0.0) != (b < 0.0) {
                    // Infinite values cross in the middle.
                    let t = a / (a - b);
                    let t = if t.is_finite() { t } else { 0.5 };
                    sum += corner(k).as_dvec3().lerp(corner(other).as_dvec3(), t);
                    count += 1.0;
                }
            }
        }
        if count == 0.0 {
            return None;
        }
        let (low, high) = (self.place(cell.as_dvec3()), self.place((cell + 1).as_dvec3()));
        let mut place = self.place(sum / count);
        // At the outermost cells the surface may be cut off, where the field is not zero.
        let cut_off = cell.cmpeq(UVec3::ZERO).any() || cell.cmpeq(self.nodes - 2).any();
        for _ in 0..if cut_off { 0 } else { STEPS } {
            let (f, g) = ((self.value)(place), (self.gradient)(place));
            let step = g * (f / g.length_squared());
            if step.is_finite() {
                place = (place - step).clamp(low, high);
            }
        }
        let normal = (self.gradient)(place).try_normalize().unwrap_or(DVec3::Y);
        Some((place.as_vec3(), normal.as_vec3()))
    }

    fn triangles(&self, values: &[f64], vertex_of_cell: &[u32], positions: &[Vec3]) -> Vec<[u32; 3]> {
        let cells = self.nodes - 1;
        let mut triangles = Vec::new();
        for i in 0..values.len() {
            let at = node(i, self.nodes);
            for axis in 0..3 {
                let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                // Edges of the outermost nodes are not crossed: all of these are outside.
                if at[axis] + 1 >= self.nodes[axis] || at[u] == 0 || at[v] == 0 {
                    continue;
                }
                let mut next = at;
                next[axis] += 1;
                let (inside, beyond) = (values[i] < 0.0, values[index(next, self.nodes)] < 0.0);
                if inside == beyond || at[u] >= cells[u] || at[v] >= cells[v] {
                    continue;
                }
                // Counter-clockwise seen from along the axis.
                let mut quad = [(1, 1), (0, 1), (0, 0), (1, 0)].map(|(du, dv)| {
                    let mut cell = at;
                    cell[u] -= du;
                    cell[v] -= dv;
                    vertex_of_cell[index(cell, cells)]
                });
                if beyond {
                    quad.reverse();
                }
                let [a, b, c, d] = quad;
                let p = |vertex: u32| positions[vertex as usize];
                // Along the shorter diagonal.
                if p(a).distance_squared(p(c)) <= p(b).distance_squared(p(d)) {
                    triangles.extend([[a, b, c], [a, c, d]]);
                } else {
                    triangles.extend([[a, b, d], [b, c, d]]);
                }
            }
        }
        triangles
    }
}

fn index(at: UVec3, size: UVec3) -> usize {
    (at.z as usize * size.y as usize + at.y as usize) * size.x as usize + at.x as usize
}

fn node(index: usize, size: UVec3) -> UVec3 {
    let (x, y) = (size.x as usize, size.y as usize);
    UVec3::new(
        (index % x) as u32,
        (index / x % y) as u32,
        (index / (x * y)) as u32,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sphere(half: f64) -> Mesh {
        Field {
            low: DVec3::splat(-half),
            high: DVec3::splat(half),
            nodes: UVec3::new(33, 31, 29),
            value: &|p| p.length_squared() - 1.0,
            gradient: &|p| 2.0 * p,
        }
        .mesh(0)
    }

    fn volume(mesh: &Mesh) -> f64 {
        let corners = |t: &[u32; 3]| t.map(|i| mesh.positions[i as usize].as_dvec3());
        let part = |[a, b, c]: [DVec3; 3]| a.dot(b.cross(c)) / 6.0;
        mesh.triangles.iter().map(|t| part(corners(t))).sum()
    }

    #[test]
    fn a_sphere_is_round_closed_and_faces_outwards() {
        let mesh = sphere(1.3);
        for (p, n) in mesh.positions.iter().zip(&mesh.normals) {
            assert!(
                (p.length() - 1.0).abs() < 1e-6 && p.distance(*n) < 1e-6,
                "{p} {n}"
            );
        }
        // Every edge is gone along once in each direction.
        let mut edges: Vec<(u32, u32)> = mesh
            .triangles
            .iter()
            .flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)])
            .collect();
        edges.sort_unstable();
        assert!(edges.windows(2).all(|pair| pair[0] != pair[1]));
        assert!(edges.iter().all(|&(a, b)| edges.binary_search(&(b, a)).is_ok()));
        // Flat triangles of some 0.09 lose 0.4 %.
        let truth = 4.0 / 3.0 * std::f64::consts::PI;
        assert!((volume(&mesh) / truth - 1.0).abs() < 0.005, "{}", volume(&mesh));
    }

    #[test]
    fn what_reaches_the_bounds_is_cut_off_there_and_closed() {
        // A cube of edge 1.2 within the sphere's reach: only parts of the sphere are round.
        let mesh = sphere(0.6);
        let box_volume = 1.2f64.powi(3);
        assert!(
            (volume(&mesh) / box_volume - 1.0).abs() < 0.06,
            "{}",
            volume(&mesh)
        );
        assert!(mesh.positions.iter().all(|p| p.abs().max_element() <= 0.6));
    }

    #[test]
    fn nothing_has_no_triangles() {
        let field = |value: &'static (dyn Fn(DVec3) -> f64 + Sync)| Field {
            low: DVec3::ZERO,
            high: DVec3::ONE,
            nodes: UVec3::splat(4),
            value,
            gradient: &|_| DVec3::ZERO,
        };
        for value in [(&|_| 1.0) as &'static (dyn Fn(DVec3) -> f64 + Sync), &|_| {
            f64::NAN
        }] {
            assert_eq!(field(value).mesh(0).triangles, Vec::<[u32; 3]>::new());
        }
        // Inside all over: the bounds.
        assert!(!field(&|_| f64::NEG_INFINITY).mesh(0).triangles.is_empty());
    }
}
