//! Triangle meshes and the few ways in which the scenes make them: parametric grids, boxes, surfaces of revolution,
//! mouldings swept along a path, rooms cut out of a block.
//!
//! Every builder returns triangles wound counter-clockwise seen from outside and texture coordinates in metres (or as
//! its documentation says); [`with_normals`] then derives the normals from the faces, so that they agree with the winding.
//! Coordinates are snapped to a fine power-of-two grid: seams then close exactly, and the last bit of a sine, which may
//! differ between machines, cannot reach the file.

use glam::{DVec2, DVec3, dvec2, dvec3};
use std::collections::HashMap;

/// Positions lie on multiples of this, a micrometre (2⁻²⁰ m), which a single float holds exactly within ±16 m.
pub const POSITION_GRID: f64 = 1.0 / 1_048_576.0;
/// Texture coordinates lie on multiples of this: 2⁻¹⁶, a 128th of a texel of the largest texture.
const UV_GRID: f64 = 1.0 / 65_536.0;

/// Triangles with vertex attributes. `normals` has the length of `positions`; `uvs` and `colors` have it or are empty.
#[derive(Clone, Default)]
pub struct Mesh {
    /// Metres.
    pub positions: Vec<DVec3>,
    /// Unit length; empty until [`with_normals`].
    pub normals: Vec<DVec3>,
    /// Texture coordinates, v pointing down the image.
    pub uvs: Vec<DVec2>,
    /// Linear RGB factors of the base colour.
    pub colors: Vec<[f32; 3]>,
    /// Three per triangle.
    pub indices: Vec<u32>,
}

/// Rounds to a multiple of `grid`; adding zero turns −0 into 0.
pub fn snap(x: f64, grid: f64) -> f64 {
    (x / grid).round() * grid + 0.0
}

/// Rounds a vector to the grid of positions.
pub fn snap3(p: DVec3) -> DVec3 {
    DVec3::from_array(p.to_array().map(|x| snap(x, POSITION_GRID)))
}

/// Appends another mesh's triangles.
pub fn append(mesh: &mut Mesh, other: &Mesh) {
    let base = mesh.positions.len() as u32;
    mesh.positions.extend_from_slice(&other.positions);
    mesh.normals.extend_from_slice(&other.normals);
    mesh.uvs.extend_from_slice(&other.uvs);
    mesh.colors.extend_from_slice(&other.colors);
    mesh.indices.extend(other.indices.iter().map(|i| i + base));
}

/// One mesh of all the parts.
pub fn join(parts: &[Mesh]) -> Mesh {
    let mut all = Mesh::default();
    parts.iter().for_each(|part| append(&mut all, part));
    all
}

/// The mesh with every position mapped, for moving and turning before the normals are made. The map must keep orientation.
pub fn mapped(mut mesh: Mesh, map: impl Fn(DVec3) -> DVec3) -> Mesh {
    mesh.positions.iter_mut().for_each(|p| *p = map(*p));
    mesh
}

/// The mesh moved by an offset.
pub fn moved(mesh: Mesh, offset: DVec3) -> Mesh {
    mapped(mesh, |p| p + offset)
}

/// The mesh turned counter-clockwise about +Y, in degrees.
pub fn turned(mesh: Mesh, degrees: f64) -> Mesh {
    let rotation = glam::DQuat::from_rotation_y(degrees.to_radians());
    mapped(mesh, |p| rotation * p)
}

/// The mesh with its texture coordinates divided by the size of a tile.
pub fn tiled(mut mesh: Mesh, metres_per_tile: f64) -> Mesh {
    mesh.uvs.iter_mut().for_each(|t| *t /= metres_per_tile);
    mesh
}

/// The same triangles seen from the other side.
pub fn flipped(mut mesh: Mesh) -> Mesh {
    mesh.indices.chunks_exact_mut(3).for_each(|t| t.swap(1, 2));
    mesh.normals.iter_mut().for_each(|n| *n = -*n);
    mesh
}

/// A planar quad with corners counter-clockwise; its texture coordinates are metres from `a`, u towards `b`, v up.
pub fn quad(a: DVec3, b: DVec3, c: DVec3, d: DVec3) -> Mesh {
    let u = (b - a).normalize();
    let v = (a - d).reject_from(u).normalize();
    let uv = |p: DVec3| dvec2((p - a).dot(u), (p - a).dot(v));
    Mesh {
        positions: vec![a, b, c, d],
        uvs: vec![uv(a), uv(b), uv(c), uv(d)],
        indices: vec![0, 1, 2, 0, 2, 3],
        ..Mesh::default()
    }
}

/// A box seen from outside. Texture coordinates are metres in world axes, so that neighbours continue each other.
pub fn cuboid(low: DVec3, high: DVec3) -> Mesh {
    let corner = |i: usize| {
        dvec3(
            [low.x, high.x][i & 1],
            [low.y, high.y][i >> 1 & 1],
            [low.z, high.z][i >> 2 & 1],
        )
    };
    let faces = [
        [0, 4, 6, 2],
        [5, 1, 3, 7],
        [0, 1, 5, 4],
        [6, 7, 3, 2],
        [1, 0, 2, 3],
        [4, 5, 7, 6],
    ];
    let mut mesh = join(&faces.map(|f| quad(corner(f[0]), corner(f[1]), corner(f[2]), corner(f[3]))));
    for (i, p) in mesh.positions.iter().enumerate() {
        mesh.uvs[i] = match i / 8 {
            0 => dvec2(p.z, -p.y),
            1 => dvec2(p.x, p.z),
            _ => dvec2(p.x, -p.y),
        };
    }
    mesh
}

/// A parametric surface over (nu + 1) × (nv + 1) samples of [0, 1]²; `surface(u, v)` gives position and texture coordinates.
/// Its front is the side of ∂p/∂u × ∂p/∂v. Poles and seams close when the positions there are the same up to rounding.
pub fn grid(nu: usize, nv: usize, surface: impl Fn(f64, f64) -> (DVec3, DVec2)) -> Mesh {
    let mut mesh = Mesh::default();
    for j in 0..=nv {
        for i in 0..=nu {
            let (p, t) = surface(i as f64 / nu as f64, j as f64 / nv as f64);
            mesh.positions.push(p);
            mesh.uvs.push(t);
        }
    }
    let row = nu as u32 + 1;
    for j in 0..nv as u32 {
        for i in 0..nu as u32 {
            let a = j * row + i;
            // Alternating diagonals keep waves and flutes symmetric.
            if (i + j) % 2 == 0 {
                mesh.indices
                    .extend([a, a + 1, a + row + 1, a, a + row + 1, a + row]);
            } else {
                mesh.indices
                    .extend([a, a + 1, a + row, a + 1, a + row + 1, a + row]);
            }
        }
    }
    mesh
}

/// A surface of revolution about +Y. The profile is (radius, height), followed with the solid on its left-hand side when
/// the radius points right: upwards for an outside. u runs once around per `around` metres-of-texture, v along the profile.
pub fn lathe(profile: &[(f64, f64)], segments: usize, around: f64) -> Mesh {
    lathe_with(profile, segments, around, |_, _, r| r)
}

/// A surface of revolution whose radius is changed per angle: `radius(angle, height, r)`.
pub fn lathe_with(
    profile: &[(f64, f64)],
    segments: usize,
    around: f64,
    radius: impl Fn(f64, f64, f64) -> f64,
) -> Mesh {
    let mut length = vec![0.0];
    for pair in profile.windows(2) {
        let step = dvec2(pair[1].0 - pair[0].0, pair[1].1 - pair[0].1).length();
        length.push(length.last().copied().unwrap_or(0.0) + step);
    }
    let last = profile.len() - 1;
    grid(segments, last, |u, v| {
        let k = ((v * last as f64).round() as usize).min(last);
        let (r, y) = profile[k];
        // The seam repeats the first sample exactly.
        let turn = if u >= 1.0 { 0.0 } else { u };
        let angle = turn * std::f64::consts::TAU;
        let r = radius(angle, y, r);
        // z = −sin makes ∂p/∂u × ∂p/∂v point outwards for a rising profile.
        (
            dvec3(r * angle.cos(), y, -r * angle.sin()),
            dvec2(u * around, -length[k]),
        )
    })
}

/// A square surface with mouldings: like [`lathe`], the profile being (half of the side, height).
pub fn square_lathe(profile: &[(f64, f64)]) -> Mesh {
    let wide: Vec<(f64, f64)> = profile
        .iter()
        .map(|&(r, y)| (r * std::f64::consts::SQRT_2, y))
        .collect();
    let widest = profile.iter().fold(0.0f64, |a, p| a.max(p.0));
    turned(lathe(&wide, 4, 8.0 * widest), 45.0)
}

/// A smooth curve through the given (radius, height) points (Catmull-Rom), `steps` samples per span.
pub fn smooth_profile(points: &[(f64, f64)], steps: usize) -> Vec<(f64, f64)> {
    let at = |i: isize| {
        let p = points[i.clamp(0, points.len() as isize - 1) as usize];
        dvec2(p.0, p.1)
    };
    let mut out = vec![];
    for i in 0..points.len() as isize - 1 {
        let (a, b, c, d) = (at(i - 1), at(i), at(i + 1), at(i + 2));
        for s in 0..steps {
            let t = s as f64 / steps as f64;
            let p = 0.5
                * (2.0 * b
                    + (c - a) * t
                    + (2.0 * a - 5.0 * b + 4.0 * c - d) * t * t
                    + (3.0 * b - a - 3.0 * c + d) * t * t * t);
            // No overshoot in height: a foot stays on its floor.
            out.push((p.x.max(0.0), p.y.clamp(b.y.min(c.y), b.y.max(c.y))));
        }
    }
    out.push(points[points.len() - 1]);
    out
}

/// A moulding along the inside of a rectangle of half-sizes (hx, hz), mitred at the corners: each profile point is
/// (projection into the courtyard, height), listed upwards; the front faces the centre.
pub fn moulding_inside(hx: f64, hz: f64, profile: &[(f64, f64)]) -> Mesh {
    let mut mesh = Mesh::default();
    let mut along = 0.0;
    for pair in profile.windows(2) {
        let ((d0, y0), (d1, y1)) = (pair[0], pair[1]);
        let step = dvec2(d1 - d0, y1 - y0).length();
        let corner = |d: f64, y: f64, k: usize| {
            let (sx, sz) = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)][k % 4];
            dvec3(sx * (hx - d), y, sz * (hz - d))
        };
        for k in 0..4 {
            let (a, b) = (corner(d0, y0, k), corner(d0, y0, k + 1));
            let (c, d) = (corner(d1, y1, k + 1), corner(d1, y1, k));
            let axis = (b - a).normalize();
            let side = Mesh {
                positions: vec![a, b, c, d],
                uvs: [(a, along), (b, along), (c, along + step), (d, along + step)]
                    .map(|(p, l)| dvec2(p.dot(axis), -l))
                    .to_vec(),
                indices: vec![0, 1, 2, 0, 2, 3],
                ..Mesh::default()
            };
            append(&mut mesh, &side);
        }
        along += step;
    }
    mesh
}

/// Surfaces between air and solid in a block cut by the planes `xs`, `ys`, `zs`, each rectangle once, facing the air,
/// with what `class` says of it: (midpoint, outward normal) → index of the returned mesh. Outside of the block is solid.
/// The result is closed and every edge has two faces, since neighbours share the planes' corners.
pub fn carved(
    xs: &[f64],
    ys: &[f64],
    zs: &[f64],
    air: impl Fn(DVec3) -> bool,
    classes: usize,
    class: impl Fn(DVec3, DVec3) -> usize,
) -> Vec<Mesh> {
    let planes = [xs, ys, zs];
    let cells = planes.map(|p| p.len() as isize - 1);
    let is_air = |cell: [isize; 3]| {
        (0..3).all(|k| cell[k] >= 0 && cell[k] < cells[k]) && {
            let mid = |k: usize| 0.5 * (planes[k][cell[k] as usize] + planes[k][cell[k] as usize + 1]);
            air(dvec3(mid(0), mid(1), mid(2)))
        }
    };
    let mut out = vec![Mesh::default(); classes];
    for z in 0..cells[2] {
        for y in 0..cells[1] {
            for x in 0..cells[0] {
                let cell = [x, y, z];
                if !is_air(cell) {
                    continue;
                }
                for axis in 0..3 {
                    for side in [0usize, 1] {
                        let mut beyond = cell;
                        beyond[axis] += 2 * side as isize - 1;
                        if is_air(beyond) {
                            continue;
                        }
                        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                        let corner = |du: usize, dv: usize| {
                            let mut p = [0.0; 3];
                            p[axis] = planes[axis][cell[axis] as usize + side];
                            p[u] = planes[u][cell[u] as usize + du];
                            p[v] = planes[v][cell[v] as usize + dv];
                            DVec3::from_array(p)
                        };
                        let mut normal = [0.0; 3];
                        normal[axis] = 1.0 - 2.0 * side as f64;
                        // Counter-clockwise about the normal, which points from the solid into the air.
                        let loop_uv =
                            [[(0, 0), (1, 0), (1, 1), (0, 1)], [(0, 0), (0, 1), (1, 1), (1, 0)]][side];
                        let p = loop_uv.map(|(du, dv)| corner(du, dv));
                        let mid = (p[0] + p[1] + p[2] + p[3]) / 4.0;
                        let face = Mesh {
                            positions: p.to_vec(),
                            uvs: p
                                .map(|p| {
                                    if axis == 1 {
                                        dvec2(p.x, p.z)
                                    } else {
                                        dvec2(p.x + p.z, -p.y)
                                    }
                                })
                                .to_vec(),
                            indices: vec![0, 1, 2, 0, 2, 3],
                            ..Mesh::default()
                        };
                        append(&mut out[class(mid, DVec3::from_array(normal))], &face);
                    }
                }
            }
        }
    }
    out
}

/// Derives the normals: faces that meet in a vertex at less than `crease_deg` share a normal (the mean by angle), others
/// keep an edge. Equal vertices become one, triangles without area go. Colours are not carried over: add them after.
pub fn with_normals(mesh: &Mesh, crease_deg: f64) -> Mesh {
    let positions: Vec<DVec3> = mesh.positions.iter().map(|&p| snap3(p)).collect();
    let key3 = |p: DVec3, grid: f64| p.to_array().map(|x| (x / grid).round() as i64);
    let mut place_of = HashMap::new();
    let places: Vec<usize> = positions
        .iter()
        .map(|&p| {
            let next = place_of.len();
            *place_of.entry(key3(p, POSITION_GRID)).or_insert(next)
        })
        .collect();

    let mut faces: Vec<([usize; 3], DVec3, [f64; 3])> = vec![];
    for t in mesh.indices.chunks_exact(3) {
        let ids = [t[0] as usize, t[1] as usize, t[2] as usize];
        let p = ids.map(|i| positions[i]);
        let cross = (p[1] - p[0]).cross(p[2] - p[0]);
        // A square micrometre: less is a pole's or a seam's collapsed triangle.
        if cross.length() < 1e-10 {
            continue;
        }
        let angles = [0, 1, 2].map(|k| (p[(k + 1) % 3] - p[k]).angle_between(p[(k + 2) % 3] - p[k]));
        faces.push((ids, cross.normalize(), angles));
    }
    let mut around: Vec<Vec<(usize, f64)>> = vec![vec![]; place_of.len()];
    for (f, (ids, _, angles)) in faces.iter().enumerate() {
        for k in 0..3 {
            around[places[ids[k]]].push((f, angles[k]));
        }
    }

    // A thousandth of a degree of tolerance, so that faces exactly at the crease fall on one side everywhere.
    let limit = (crease_deg + 1e-3).to_radians().cos();
    let mut out = Mesh::default();
    let mut vertex_of = HashMap::new();
    for (ids, face_normal, _) in &faces {
        for &id in ids {
            let sum: DVec3 = around[places[id]]
                .iter()
                .filter(|(f, _)| faces[*f].1.dot(*face_normal) >= limit)
                .map(|(f, angle)| faces[*f].1 * *angle)
                .sum();
            let normal = snap3(sum.normalize());
            let uv = mesh
                .uvs
                .get(id)
                .map(|t| dvec2(snap(t.x, UV_GRID), snap(t.y, UV_GRID)));
            let uv_key = uv.map(|t| [(t.x / UV_GRID).round() as i64, (t.y / UV_GRID).round() as i64]);
            // Normals closer than 1e-4 are the same: the order of summation must not split vertices.
            let key = (places[id], key3(normal, 1e-4), uv_key);
            let vertex = *vertex_of.entry(key).or_insert_with(|| {
                out.positions.push(positions[id]);
                out.normals.push(normal);
                out.uvs.extend(uv);
                out.positions.len() as u32 - 1
            });
            out.indices.push(vertex);
        }
    }
    out
}
