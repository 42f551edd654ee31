//! Flat convex pieces of opaque surface: what lies behind one of them is hidden for sure.
//!
//! Neighbouring triangles of one plane are joined as long as their outline stays convex, so that a wall of a thousand
//! triangles is one piece. Joined edges are removed as in Hertel and Mehlhorn 1983, longest first, which makes quads
//! of triangles, then strips, then rectangles.
//!
//! All of it on one thread: pieces are made when a worker of a pool first asks, and a pool's own work within that could
//! make the worker ask again while it waits.

use glam::{DVec3, Vec3};
use std::collections::HashMap;

/// Sine of the angle that normals of one plane may differ by.
const FLAT: f64 = 1e-5;
/// How far, relative to its extent, a piece may bulge out of its plane.
pub const BULGE: f32 = 1e-5;
/// How far, relative to the scene's largest coordinate, a corner may lie off the line between its neighbours where they
/// count as one edge: some f32 roundings.
const STRAIGHT: f64 = 5e-7;
/// Most corners of a piece while it grows, with those on straight edges: bounds the time of a join.
const MOST_CORNERS: usize = 256;
/// Most rounds of joining: strips that meet only once both are whole take another.
const MOST_ROUNDS: usize = 8;
/// The piece of triangles that stand alone.
const ALONE: u32 = u32::MAX;

/// A flat convex piece of opaque surface, world space.
#[derive(Clone, Copy, Debug)]
pub struct FlatPiece<'a> {
    /// Around it; no three on one line. Flat within [`BULGE`] of its extent.
    pub corners: &'a [Vec3],
    /// How far the surface's own edge may lie inside of the line between two corners, metres.
    pub slack: f32,
}

/// The pieces of a scene. 4 bytes per triangle; pieces of more than one take 8 and 12 per corner.
#[derive(Debug)]
pub(super) struct Occluders {
    piece_of_triangle: Vec<u32>,
    /// Where each piece's corners start, and the end of the last.
    starts: Vec<u32>,
    corners: Vec<Vec3>,
    /// As [`FlatPiece::slack`].
    slacks: Vec<f32>,
}

impl Occluders {
    /// Of `count` triangles; `opaque` has the vertices of those that no ray passes.
    pub fn new(count: u32, opaque: impl Fn(u32) -> Option<[Vec3; 3]>) -> Occluders {
        let mut pieces = Pieces::new(count, opaque);
        let joints = pieces.joints();
        for _ in 0..MOST_ROUNDS {
            let mut joined = false;
            for joint in &joints {
                joined |= pieces.join(joint);
            }
            if !joined {
                break;
            }
        }
        pieces.finish()
    }

    /// The piece that a triangle is of; `None` of triangles that stand alone.
    pub fn piece(&self, triangle: u32) -> Option<FlatPiece<'_>> {
        let piece = *self.piece_of_triangle.get(triangle as usize)?;
        (piece != ALONE).then(|| {
            let [start, end] = [piece as usize, piece as usize + 1].map(|i| self.starts[i] as usize);
            FlatPiece {
                corners: &self.corners[start..end],
                slack: self.slacks[piece as usize],
            }
        })
    }
}

/// An edge of two triangles of one plane, from `a` to `b` in the first, from `b` to `a` in the second.
struct Joint {
    triangles: [u32; 2],
    a: u32,
    b: u32,
}

struct Pieces {
    positions: Vec<DVec3>,
    /// [`STRAIGHT`] in metres.
    straight: f64,
    /// Unit normals of the triangles; zero of those that are never part of a piece.
    normals: Vec<DVec3>,
    /// Disjoint sets of triangles: parents.
    parents: Vec<u32>,
    /// Corners of each set's piece at its root, as indices into `positions`.
    outlines: Vec<Vec<u32>>,
}

impl Pieces {
    fn new(count: u32, opaque: impl Fn(u32) -> Option<[Vec3; 3]>) -> Pieces {
        let mut pieces = Pieces {
            positions: Vec::new(),
            straight: 0.0,
            normals: Vec::with_capacity(count as usize),
            parents: (0..count).collect(),
            outlines: Vec::with_capacity(count as usize),
        };
        // Corners at the same place are one.
        let mut numbers: HashMap<[u32; 3], u32> = HashMap::new();
        for triangle in 0..count {
            let vertices = opaque(triangle).unwrap_or([Vec3::NAN; 3]);
            let [a, b, c] = vertices.map(|vertex| vertex.as_dvec3());
            let normal = (b - a).cross(c - a).normalize_or_zero();
            if normal == DVec3::ZERO {
                pieces.normals.push(DVec3::ZERO);
                pieces.outlines.push(Vec::new());
                continue;
            }
            let outline = vertices.map(|vertex| {
                // −0 is 0.
                let key = (vertex + Vec3::ZERO).to_array().map(f32::to_bits);
                *numbers.entry(key).or_insert_with(|| {
                    pieces.positions.push(vertex.as_dvec3());
                    pieces.positions.len() as u32 - 1
                })
            });
            pieces.normals.push(normal);
            pieces.outlines.push(outline.to_vec());
        }
        let largest = pieces.positions.iter().map(|p| p.abs().max_element());
        pieces.straight = STRAIGHT * largest.fold(0.0, f64::max);
        pieces
    }

    /// Edges that two triangles of one plane share, longest first; those of about one length by direction, or the squares
    /// of a grid would be joined to blocks that no longer fit together.
    fn joints(&self) -> Vec<Joint> {
        let mut edges: Vec<(u32, u32, bool, u32)> = Vec::new();
        for (outline, triangle) in self.outlines.iter().zip(0u32..) {
            if let &[a, b, c] = outline.as_slice() {
                edges.extend([(a, b), (b, c), (c, a)].map(|(u, v)| (u.min(v), u.max(v), u < v, triangle)));
            }
        }
        edges.sort_unstable();
        let mut joints: Vec<((i64, [i64; 3]), Joint)> = edges
            .chunk_by(|x, y| (x.0, x.1) == (y.0, y.1))
            .filter_map(|edge| {
                // `false` sorts first: it runs from the higher number to the lower one.
                let &[(a, b, false, second), (_, _, true, first)] = edge else {
                    return None;
                };
                let triangles = [first, second];
                let [m, n] = triangles.map(|triangle| self.normals[triangle as usize]);
                let flat = m.dot(n) > 0.0 && m.cross(n).length() <= FLAT;
                flat.then_some((self.order(a, b), Joint { triangles, a, b }))
            })
            .collect();
        // Stable: what is alike stays in the order of its numbers.
        joints.sort_by_key(|&(order, _)| order);
        joints.into_iter().map(|(_, joint)| joint).collect()
    }

    /// Where an edge is in the order of joints: steps of 4 % in length, and of some 4° in direction.
    fn order(&self, a: u32, b: u32) -> (i64, [i64; 3]) {
        let way = self.positions[b as usize] - self.positions[a as usize];
        let length = way.length();
        let mut direction = (way / length * 16.0).round().to_array().map(|c| c as i64);
        if direction < [0; 3] {
            direction = direction.map(|c| -c);
        }
        (-(16.0 * length.log2()).round() as i64, direction)
    }

    fn root(&mut self, mut triangle: u32) -> u32 {
        while self.parents[triangle as usize] != triangle {
            let above = self.parents[self.parents[triangle as usize] as usize];
            self.parents[triangle as usize] = above;
            triangle = above;
        }
        triangle
    }

    /// Joins the two pieces at an edge if the result is convex.
    fn join(&mut self, joint: &Joint) -> bool {
        let [first, second] = joint.triangles.map(|triangle| self.root(triangle));
        if first == second {
            return false;
        }
        let [one, other] = [first, second].map(|root| self.outlines[root as usize].as_slice());
        if one.len() + other.len() > MOST_CORNERS {
            return false;
        }
        let Some(outline) = joined(one, other, joint.a, joint.b) else {
            return false;
        };
        if !self.is_flat_and_convex(&outline, self.normals[first as usize]) {
            return false;
        }
        self.outlines[first as usize] = outline;
        self.outlines[second as usize] = Vec::new();
        self.parents[second as usize] = first;
        true
    }

    fn is_flat_and_convex(&self, outline: &[u32], normal: DVec3) -> bool {
        let at = |i: usize| self.positions[outline[i % outline.len()] as usize];
        let extent = outline.iter().fold(0.0, |most: f64, &corner| {
            most.max(self.positions[corner as usize].distance(at(0)))
        });
        (0..outline.len()).all(|i| {
            let chord = at(i + 2) - at(i);
            let outwards = chord.cross(normal).dot(at(i + 1) - at(i));
            outwards >= -self.straight * chord.length()
                && (at(i) - at(0)).dot(normal).abs() <= 0.5 * f64::from(BULGE) * extent
        })
    }

    fn finish(mut self) -> Occluders {
        let roots: Vec<u32> = (0..self.parents.len() as u32)
            .map(|triangle| self.root(triangle))
            .collect();
        let mut occluders = Occluders {
            piece_of_triangle: vec![ALONE; roots.len()],
            starts: vec![0],
            corners: Vec::new(),
            slacks: Vec::new(),
        };
        let mut numbers: HashMap<u32, u32> = HashMap::new();
        for (&root, triangle) in roots.iter().zip(0u32..) {
            if root == triangle {
                continue;
            }
            let piece = *numbers.entry(root).or_insert_with(|| {
                let (corners, slack) = self.corners(root);
                occluders.corners.extend(corners);
                occluders.slacks.push(slack);
                occluders.starts.push(occluders.corners.len() as u32);
                occluders.starts.len() as u32 - 2
            });
            for part in [root, triangle] {
                occluders.piece_of_triangle[part as usize] = piece;
            }
        }
        occluders
    }

    /// Corners of a piece without those on straight edges, and the slack.
    fn corners(&self, root: u32) -> (Vec<Vec3>, f32) {
        let (outline, normal) = (&self.outlines[root as usize], self.normals[root as usize]);
        let count = outline.len();
        let at = |i: usize| self.positions[outline[i % count] as usize];
        // How far corner i lies outside of the line from one corner to another.
        let outside = |from: usize, to: usize, i: usize| {
            let chord = at(to) - at(from);
            chord.cross(normal).dot(at(i) - at(from)) / chord.length()
        };
        let kept: Vec<usize> = (0..count)
            .filter(|&i| outside(i + count - 1, i + 1, i) > self.straight)
            .collect();
        if kept.len() < 3 {
            // As round as that: all of them.
            return (
                outline
                    .iter()
                    .map(|&i| self.positions[i as usize].as_vec3())
                    .collect(),
                0.0,
            );
        }
        let mut slack = 0.0f64;
        for (k, &from) in kept.iter().enumerate() {
            let next = kept.get(k + 1).copied().unwrap_or(kept[0] + count);
            for i in from + 1..next {
                slack = slack.max(-outside(from, next, i));
            }
        }
        (kept.iter().map(|&i| at(i).as_vec3()).collect(), slack as f32)
    }
}

/// The outline of two pieces with a common edge, from `a` to `b` in `one`. `None` where it would touch itself.
fn joined(one: &[u32], other: &[u32], a: u32, b: u32) -> Option<Vec<u32>> {
    let edge = |outline: &[u32], from: u32, to: u32| {
        (0..outline.len()).find(|&i| outline[i] == from && outline[(i + 1) % outline.len()] == to)
    };
    let (i, j) = (edge(one, a, b)?, edge(other, b, a)?);
    // From b around the first piece to a, then around the second one until before b.
    let mut outline: Vec<u32> = (1..=one.len()).map(|k| one[(i + k) % one.len()]).collect();
    outline.extend((2..other.len()).map(|k| other[(j + k) % other.len()]));
    // Further common edges are gone there and back.
    let mut at = 0;
    while outline.len() > 2 && at < outline.len() {
        let count = outline.len();
        if outline[at] == outline[(at + 2) % count] {
            let mut gone = [(at + 1) % count, (at + 2) % count];
            gone.sort_unstable();
            outline.remove(gone[1]);
            outline.remove(gone[0]);
            at = 0;
        } else {
            at += 1;
        }
    }
    let mut sorted = outline.clone();
    sorted.sort_unstable();
    (outline.len() > 2 && sorted.windows(2).all(|pair| pair[0] != pair[1])).then_some(outline)
}

#[cfg(test)]
mod tests {
    use super::super::scene::{Shading, Stop, TracedScene};
    use super::super::tests::{matt, place, scene};
    use super::*;
    use crate::material::{AlphaMode, Material};
    use crate::rays::Ray;
    use crate::scene::Mesh;
    use glam::{Affine3A, Quat, Vec4};

    /// A grid of squares of side 1 in z = 0, those of `keep`, each cut in two, turned and moved out of the axes.
    fn tiles(columns: u32, rows: u32, alpha: AlphaMode, keep: impl Fn(u32, u32) -> bool) -> TracedScene {
        let mut mesh = Mesh::default();
        for y in 0..=rows {
            mesh.positions
                .extend((0..=columns).map(|x| Vec3::new(x as f32, y as f32, 0.0)));
        }
        for (x, y) in (0..rows).flat_map(|y| (0..columns).map(move |x| (x, y))) {
            if keep(x, y) {
                let a = y * (columns + 1) + x;
                let (b, c, d) = (a + 1, a + columns + 2, a + columns + 1);
                // The diagonals alternate.
                let halves = [[[a, b, c], [a, c, d]], [[a, b, d], [b, c, d]]];
                mesh.triangles.extend(halves[(x + y) as usize % 2]);
            }
        }
        let turned = Affine3A::from_rotation_translation(
            Quat::from_euler(glam::EulerRot::XYZ, 0.3, 0.5, 0.7),
            Vec3::new(3.0, -2.0, 5.0),
        );
        let material = Material {
            alpha_mode: alpha,
            ..matt(Vec4::new(1.0, 1.0, 1.0, 0.5))
        };
        let scene = scene(vec![mesh], vec![place(turned)], vec![material], Vec::new());
        TracedScene::new(scene, Shading::Full).unwrap()
    }

    fn area(corners: &[Vec3]) -> f32 {
        let from = |i: usize| corners[i] - corners[0];
        let parts = (1..corners.len() - 1).map(|i| from(i).cross(from(i + 1)));
        0.5 * parts.sum::<Vec3>().length()
    }

    #[test]
    fn a_wall_of_many_triangles_is_one_piece() {
        let wall = tiles(7, 5, AlphaMode::Opaque, |_, _| true);
        for triangle in 0..wall.triangle_count() as u32 {
            wall.with_flat_piece(triangle, |FlatPiece { corners, slack }| {
                assert_eq!(corners.len(), 4, "{triangle}: {corners:?}");
                assert!(
                    (area(corners) - 35.0).abs() < 1e-3 && slack < 2e-5,
                    "{slack} {corners:?}"
                );
            });
        }
    }

    #[test]
    fn pieces_are_convex_and_hold_their_triangles_only() {
        // A window in the wall: no piece may close it.
        let wall = tiles(7, 5, AlphaMode::Opaque, |x, y| {
            !(2..4).contains(&x) || !(1..3).contains(&y)
        });
        let mut sum = 0.0;
        for triangle in 0..wall.triangle_count() as u32 {
            let own = wall.triangle_area(triangle);
            wall.with_flat_piece(triangle, |FlatPiece { corners, .. }| {
                sum += own / area(corners);
                let at = |i: usize| corners[i % corners.len()];
                let turn = |i: usize| (at(i + 1) - at(i)).cross(at(i + 2) - at(i + 1));
                for i in 0..corners.len() {
                    assert!(turn(i).dot(turn(0)) > 0.0, "{corners:?}");
                }
            });
        }
        // Every piece's triangles make up its area; and four rectangles at best.
        assert!((sum - sum.round()).abs() < 1e-4 && sum.round() < 9.0, "{sum}");
    }

    #[test]
    fn a_thin_veil_stops_some_rays_but_is_never_sure_to() {
        let towards = |wall: &TracedScene, k: u32| {
            let [a, b, c] = wall.triangle_positions(0);
            let normal = (b - a).cross(c - a);
            wall.stop(&Ray {
                origin: a + 0.3 * (b - a) + (0.1 + 1e-3 * k as f32) * (c - a) + normal,
                direction: -normal,
                t_min: 0.0,
                t_max: f32::INFINITY,
            })
        };
        let veil = tiles(2, 1, AlphaMode::Blend, |_, _| true);
        let stops: Vec<_> = (0..100).map(|k| towards(&veil, k)).collect();
        assert!(
            stops.contains(&None) && stops.contains(&Some(Stop::Other)),
            "{stops:?}"
        );
        assert!(!stops.iter().any(|stop| matches!(stop, Some(Stop::Opaque(_)))));
        veil.with_flat_piece(0, |piece| assert_eq!(piece.corners.len(), 3));
        let wall = tiles(2, 1, AlphaMode::Opaque, |_, _| true);
        assert!(matches!(towards(&wall, 0), Some(Stop::Opaque(_))));
    }
}
