//! The stone parts of the atrium that repeat: columns, arches, balustrades. Each is made once and drawn by many nodes.
//!
//! Proportions follow the usual rules of the classical orders loosely: an Attic base (torus, scotia, torus) of half a
//! diameter, a shaft of seven to eight diameters that thins by a sixth, a capital with two tiers of leaves.

use crate::mesh::{Mesh, append, cuboid, grid, join, lathe, lathe_with, moved, square_lathe, with_normals};
use crate::texture::smoothstep;
use glam::{DVec3, dvec2, dvec3};
use std::f64::consts::{PI, TAU};

/// Metres of texture around a shaft: a whole number of the 2 m tiles, so that the seam doesn't show.
const AROUND: f64 = 2.0;

/// A profile moved up and scaled.
fn raised(profile: &[(f64, f64)], scale: f64, y: f64) -> Vec<(f64, f64)> {
    profile.iter().map(|&(r, h)| (r * scale, y + h * scale)).collect()
}

/// A column of a given height and lower radius on y = 0, with plinth, base, shaft (fluted or not), capital and abacus.
/// The abacus is a square of side 2.6 radii. `segments` divides the shaft of a plain column.
pub fn column(height: f64, radius: f64, flutes: Option<usize>, segments: usize) -> Mesh {
    let r = radius;
    let plinth = square_lathe(&[(1.42 * r, 0.0), (1.42 * r, 0.34 * r), (0.0, 0.34 * r)]);
    // Two half-round tori with a hollow between, in units of the radius, from the plinth's top.
    let half_round = |r0: f64, bulge: f64, y0: f64, y1: f64, n: usize| -> Vec<(f64, f64)> {
        (0..=n)
            .map(|i| {
                let a = PI * i as f64 / n as f64;
                (r0 + bulge * a.sin(), 0.5 * (y0 + y1) - 0.5 * (y1 - y0) * a.cos())
            })
            .collect()
    };
    let mut base = half_round(1.22, 0.17, 0.0, 0.34, 6);
    base.push((1.20, 0.38));
    base.extend(half_round(1.18, -0.09, 0.38, 0.60, 4));
    base.push((1.18, 0.64));
    base.extend(half_round(1.12, 0.11, 0.64, 0.86, 5));
    base.extend([(1.08, 0.88), (1.08, 0.94)]);
    let base = lathe(&raised(&base, r, 0.34 * r), 24, AROUND);

    let shaft_low = 1.28 * r;
    let capital_height = 2.1 * r;
    let abacus_height = 0.36 * r;
    let shaft_high = height - capital_height - abacus_height;
    let thinning = |t: f64| 1.0 - 0.16 * t.powf(1.7);
    let stops = [0.0, 0.02, 0.05, 0.2, 0.35, 0.5, 0.65, 0.8, 0.95, 0.98, 1.0];
    let shaft: Vec<(f64, f64)> = stops
        .iter()
        .map(|&t| (r * thinning(t), shaft_low + (shaft_high - shaft_low) * t))
        .collect();
    let shaft = match flutes {
        // Four segments per flute; the flutes run out near both ends.
        Some(n) => lathe_with(&shaft, 4 * n, AROUND, |angle, y, at| {
            let t = (y - shaft_low) / (shaft_high - shaft_low);
            let depth = smoothstep(0.015, 0.055, t) * smoothstep(0.985, 0.945, t);
            at * (1.0 - 0.085 * depth * (0.5 * n as f64 * angle).sin().abs())
        }),
        None => lathe(&shaft, segments, AROUND),
    };
    let neck = r * thinning(1.0);
    let astragal = half_round(neck, 0.09 * r, shaft_high - 0.10 * r, shaft_high + 0.10 * r, 4);
    let astragal = lathe(&astragal, 24, AROUND);

    // The bell: leaves of two tiers rise, lean outwards and end in a curl; eight per tier, one tier turned by half a leaf.
    let (around, up) = if flutes.is_some() { (48, 16) } else { (32, 12) };
    let bell = grid(around, up, |u, v| {
        let angle = if u >= 1.0 { 0.0 } else { u * TAU };
        let leaf = |low: f64, high: f64, lean: f64, shift: f64| {
            let s = ((v - low) / (high - low)).clamp(0.0, 1.0);
            let rise = if v < high {
                s.powf(1.6)
            } else {
                1.0 - smoothstep(high, high + 0.08, v)
            };
            let blade = (0.5 + 0.5 * (8.0 * angle + shift).cos()).powf(0.6);
            lean * rise * (0.25 + 0.75 * blade)
        };
        let flare = 0.30 * v.powi(3);
        let out = neck + r * (flare + 0.10 * smoothstep(0.0, 0.1, v));
        let out = out + r * leaf(0.0, 0.42, 0.26, 0.0).max(leaf(0.30, 0.76, 0.34, PI));
        let y = shaft_high + capital_height * v;
        (
            dvec3(out * angle.cos(), y, -out * angle.sin()),
            dvec2(u * AROUND, -y),
        )
    });
    // Four scrolls under the corners of the abacus.
    let scroll = grid(12, 8, |u, v| {
        let a = if u >= 1.0 { 0.0 } else { u * TAU };
        let ring = 0.20 * r * (PI * v).sin().max(0.0).powf(0.5);
        let out = 1.36 * r;
        let across = 0.22 * r * (2.0 * v - 1.0);
        let (x, z) = (out + ring * a.cos(), across);
        let y = height - abacus_height - 0.24 * r + ring * a.sin();
        let (c, s) = (PI / 4.0).sin_cos();
        (dvec3(c * x + s * z, y, c * z - s * x), dvec2(u * 0.3, v * 0.2))
    });
    let scrolls = join(&[0.0, 90.0, 180.0, 270.0].map(|turn| crate::mesh::turned(scroll.clone(), turn)));
    let top = height - abacus_height;
    let abacus = square_lathe(&[
        (0.0, top),
        (1.20 * r, top),
        (1.20 * r, top + 0.14 * r),
        (1.30 * r, top + 0.20 * r),
        (1.30 * r, height),
        (0.0, height),
    ]);
    with_normals(
        &join(&[plinth, base, shaft, astragal, bell, scrolls, abacus]),
        38.0,
    )
}

/// A square pier of the same height and moulding as a column of that radius, for the corners.
pub fn pier(height: f64, radius: f64) -> Mesh {
    let r = radius;
    let h = height;
    let profile = [
        (1.42 * r, 0.0),
        (1.42 * r, 0.5 * r),
        (1.36 * r, 0.55 * r),
        (1.36 * r, 0.8 * r),
        (1.25 * r, 0.95 * r),
        (1.25 * r, h - 2.2 * r),
        (1.32 * r, h - 2.1 * r),
        (1.32 * r, h - 1.9 * r),
        (1.25 * r, h - 1.8 * r),
        (1.25 * r, h - 0.9 * r),
        (1.38 * r, h - 0.6 * r),
        (1.38 * r, h - 0.36 * r),
        (1.46 * r, h - 0.30 * r),
        (1.46 * r, h),
        (0.0, h),
    ];
    with_normals(&square_lathe(&profile), 20.0)
}

/// The wall over one bay of an arcade: x in ±`half`, z in ±`depth`/2, from the springing at `y0` to `top`, with a
/// semicircular opening of radius `r`. Its undersides beside the opening stand on the abaci and are left out.
pub fn arch_wall(half: f64, depth: f64, r: f64, y0: f64, top: f64, segments: usize) -> Mesh {
    let z = 0.5 * depth;
    let mut mesh = Mesh::default();
    let point = |k: usize| {
        let a = PI * k as f64 / segments as f64;
        let (s, c) = a.sin_cos();
        (r * c, y0 + r * s, r * a)
    };
    let mut face = |p: [DVec3; 4], uv: [glam::DVec2; 4]| {
        append(
            &mut mesh,
            &Mesh {
                positions: p.to_vec(),
                uvs: uv.to_vec(),
                indices: vec![0, 1, 2, 0, 2, 3],
                ..Mesh::default()
            },
        );
    };
    for side in [1.0, -1.0] {
        let mut wall = |a: (f64, f64), b: (f64, f64), c: (f64, f64), d: (f64, f64)| {
            // Counter-clockwise for the front; the back is the front turned by half a turn.
            let p = [a, b, c, d].map(|(x, y)| dvec3(side * x, y, side * z));
            face(p, p.map(|p| dvec2(p.x, -p.y)));
        };
        wall((-half, y0), (-r, y0), (-r, top), (-half, top));
        wall((r, y0), (half, y0), (half, top), (r, top));
        for k in 0..segments {
            let ((x0, ya, _), (x1, yb, _)) = (point(k), point(k + 1));
            wall((x1, yb), (x0, ya), (x0, top), (x1, top));
        }
    }
    for k in 0..segments {
        let ((x0, ya, l0), (x1, yb, l1)) = (point(k), point(k + 1));
        face(
            [
                dvec3(x0, ya, z),
                dvec3(x1, yb, z),
                dvec3(x1, yb, -z),
                dvec3(x0, ya, -z),
            ],
            [dvec2(l0, z), dvec2(l1, z), dvec2(l1, -z), dvec2(l0, -z)],
        );
    }
    with_normals(&mesh, 30.0)
}

/// A moulding around a semicircular opening of radius `r` with springing at `y0`, projecting from the plane z = `z`,
/// with a keystone.
pub fn archivolt(r: f64, y0: f64, z: f64, segments: usize) -> Mesh {
    // (distance from the edge of the opening, projection), metres.
    let profile = [
        (0.0, 0.0),
        (0.0, 0.045),
        (0.085, 0.045),
        (0.095, 0.065),
        (0.185, 0.065),
        (0.20, 0.095),
        (0.235, 0.095),
        (0.245, 0.0),
    ];
    let mut mesh = Mesh::default();
    let mut along = 0.0;
    for pair in profile.windows(2) {
        let ((d0, p0), (d1, p1)) = (pair[0], pair[1]);
        let step = dvec2(d1 - d0, p1 - p0).length();
        append(
            &mut mesh,
            &grid(segments, 1, |u, v| {
                let a = PI * u;
                let (d, p) = if v < 0.5 { (d0, p0) } else { (d1, p1) };
                let at = dvec3((r + d) * a.cos(), y0 + (r + d) * a.sin(), z + p);
                (at, dvec2(a * r, along + v * step))
            }),
        );
        along += step;
    }
    // ∂p/∂u runs counter-clockwise and ∂p/∂v outwards: their product points away from the viewer.
    let mesh = crate::mesh::flipped(mesh);
    // The keystone tapers towards the opening.
    let key = |w: f64, y: f64, p: f64| dvec3(w, y, z + p);
    let (low, high) = (y0 + r - 0.03, y0 + r + 0.34);
    let (a, b, c, d) = (
        key(-0.075, low, 0.13),
        key(0.075, low, 0.13),
        key(0.115, high, 0.13),
        key(-0.115, high, 0.13),
    );
    let (ab, bb, cb, db) = (
        key(-0.075, low, 0.0),
        key(0.075, low, 0.0),
        key(0.115, high, 0.0),
        key(-0.115, high, 0.0),
    );
    let faces = [
        [a, b, c, d],
        [b, bb, cb, c],
        [ab, a, d, db],
        [ab, bb, b, a],
        [d, c, cb, db],
    ];
    let keystone = join(&faces.map(|f| crate::mesh::quad(f[0], f[1], f[2], f[3])));
    with_normals(&join(&[mesh, keystone]), 25.0)
}

/// A balustrade between x = ±`half`, 0.95 m high on y = 0: two rails and `count` turned balusters.
pub fn balustrade(half: f64, count: usize) -> Mesh {
    let rail = |y0: f64, y1: f64, w: f64| cuboid(dvec3(-half, y0, -w), dvec3(half, y1, w));
    let outline = [
        (0.045, 0.0),
        (0.062, 0.05),
        (0.035, 0.10),
        (0.075, 0.24),
        (0.062, 0.34),
        (0.030, 0.50),
        (0.040, 0.56),
        (0.055, 0.60),
        (0.05, 0.64),
    ];
    let mut parts = vec![
        rail(0.0, 0.14, 0.12),
        rail(0.78, 0.86, 0.11),
        rail(0.86, 0.95, 0.15),
    ];
    for k in 0..count {
        let x = half * (2.0 * (k as f64 + 0.5) / count as f64 - 1.0);
        parts.push(moved(lathe(&outline, 9, 0.5), dvec3(x, 0.14, 0.0)));
    }
    with_normals(&join(&parts), 50.0)
}

/// The pedestal of an upper column: a moulded square block, `height` high, its side 2.8 radii.
pub fn pedestal(height: f64, r: f64) -> Mesh {
    let h = height;
    let profile = [
        (1.50 * r, 0.0),
        (1.50 * r, 0.13),
        (1.40 * r, 0.17),
        (1.40 * r, h - 0.15),
        (1.52 * r, h - 0.11),
        (1.52 * r, h),
        (0.0, h),
    ];
    with_normals(&square_lathe(&profile), 20.0)
}
