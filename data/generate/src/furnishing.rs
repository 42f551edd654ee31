//! What stands and hangs in the atrium: curtains, banners, the fountain with its sculpture, urns with clipped trees.

use crate::mesh::{Mesh, append, grid, join, lathe, lathe_with, mapped, moved, smooth_profile, with_normals};
use crate::texture::{noise, smoothstep};
use glam::{dvec2, dvec3};
use std::f64::consts::{PI, TAU};

/// Width of the golden hem of curtains and banners, as a fraction of the cloth's height.
const HEM: f64 = 0.055;

/// A pair of curtains in a bay, hung from a rod `height` above the floor and tied back at the sides: (cloth, hem, rod).
pub fn curtain(height: f64) -> (Mesh, Mesh, Mesh) {
    // v runs down from the rod. The cloth narrows to the tie at 0.62 and falls open below.
    let sheet = |side: f64, from: f64, to: f64, rows: usize| {
        let surface = move |u: f64, w: f64| {
            let v = from + (to - from) * w;
            let tie = 0.62;
            let gather = if v < tie {
                smoothstep(0.0, 1.0, v / tie).powf(1.4)
            } else {
                1.0 - 0.35 * smoothstep(tie, 1.0, v)
            };
            let width = 1.13 - 0.80 * gather;
            // The inner edge sags in a curve; the outer edge hangs straight.
            let x = -1.15 + width * u;
            let folds = 0.030 + 0.045 * (1.0 - (2.0 * v - 1.0).powi(2)).max(0.0);
            let z = folds * (TAU * 5.0 * u + 1.3 * v).sin() + 0.02 * (TAU * 2.0 * u + 4.0 * v).cos();
            let y = height * (1.0 - v * 0.985) - 0.03 * (1.0 - v) * (TAU * 10.0 * u).cos().abs();
            (dvec3(side * x, y, z), dvec2(side * u * 1.5, v * 2.6))
        };
        let sheet = grid(40, rows, surface);
        // Mirroring would turn the triangles over.
        if side < 0.0 {
            sheet
        } else {
            crate::mesh::flipped(sheet)
        }
    };
    let pair = |from: f64, to: f64, rows: usize| {
        with_normals(
            &join(&[sheet(1.0, from, to, rows), sheet(-1.0, from, to, rows)]),
            120.0,
        )
    };
    // The rod is a lathe laid on its side: (x, y, z) ← (y, z, x) keeps the orientation.
    let rod = lathe(
        &[(0.0, -1.18), (0.022, -1.18), (0.022, 1.18), (0.0, 1.18)],
        10,
        1.0,
    );
    let rod = mapped(rod, |p| dvec3(p.y, p.z + height + 0.01, p.x));
    (
        pair(0.0, 1.0 - HEM, 21),
        pair(1.0 - HEM, 1.0, 1),
        with_normals(&rod, 40.0),
    )
}

/// A banner that hangs over a balustrade into the courtyard (towards +z), its origin the middle of the rail's top:
/// (cloth, hem). It ends in a swallowtail.
pub fn banner() -> (Mesh, Mesh) {
    let piece = |from: f64, to: f64, rows: usize| {
        let sheet = grid(20, rows, |u, w| {
            let v = from + (to - from) * w;
            let x = 1.3 * (u - 0.5);
            // Down the arc length: from behind the rail over its top, slanting out to the cornice (z = 0.48, 0.96 m
            // below the rail) and down in front of the arch.
            let arc = 3.25 * v;
            let path = [
                (-0.22, -0.165),
                (0.012, -0.165),
                (0.012, 0.165),
                (-0.93, 0.505),
                (-3.5, 0.515),
            ];
            let mut left = arc;
            let (mut y, mut z) = path[0];
            for pair in path.windows(2) {
                let step = dvec2(pair[1].0 - pair[0].0, pair[1].1 - pair[0].1);
                let t = (left / step.length()).clamp(0.0, 1.0);
                (y, z) = (pair[0].0 + step.x * t, pair[0].1 + step.y * t);
                left -= step.length();
                if left <= 0.0 {
                    break;
                }
            }
            let hang = smoothstep(1.5, 3.2, arc);
            let swing = 0.06 * hang * (1.0 + (TAU * 1.5 * u + 2.0 * arc).sin());
            let notch = 0.22 * smoothstep(0.7, 1.0, v) * (1.0 - (2.0 * u - 1.0).abs());
            let narrow = 1.0 - 0.06 * hang * (PI * v).sin();
            (dvec3(x * narrow, y + notch, z + swing), dvec2(u * 1.5, v * 2.6))
        });
        // u runs along +x and v down: their product points to −z, so the front must be turned to the courtyard.
        with_normals(&crate::mesh::flipped(sheet), 120.0)
    };
    (piece(0.0, 1.0 - HEM, 28), piece(1.0 - HEM, 1.0, 1))
}

/// The stone of the fountain: an octagonal step, a round basin, a baluster stem and a gadrooned upper bowl.
pub fn fountain() -> Mesh {
    let step = lathe(&[(2.15, 0.0), (2.15, 0.13), (2.10, 0.16), (0.0, 0.16)], 8, 12.0);
    let basin = smooth_profile(
        &[
            (1.52, 0.16),
            (1.52, 0.24),
            (1.44, 0.30),
            (1.46, 0.45),
            (1.58, 0.56),
            (1.66, 0.60),
        ],
        2,
    );
    let mut basin = basin;
    basin.extend([
        (1.70, 0.62),
        (1.70, 0.68),
        (1.66, 0.72),
        (1.46, 0.72),
        (1.44, 0.70),
        (1.40, 0.30),
        (0.0, 0.28),
    ]);
    let basin = lathe(&basin, 48, 10.0);
    let stem = smooth_profile(
        &[
            (0.42, 0.28),
            (0.42, 0.40),
            (0.26, 0.50),
            (0.17, 0.70),
            (0.22, 0.92),
            (0.30, 1.04),
            (0.20, 1.18),
            (0.15, 1.30),
            (0.24, 1.42),
        ],
        3,
    );
    let stem = lathe(&stem, 28, 2.0);
    let bowl = smooth_profile(&[(0.24, 1.42), (0.50, 1.48), (0.74, 1.62), (0.82, 1.76)], 4);
    let bowl = lathe_with(&bowl, 96, 4.0, |angle, y, r| {
        let lobes = smoothstep(1.42, 1.50, y) * smoothstep(1.76, 1.70, y);
        r * (1.0 + 0.05 * lobes * (8.0 * angle).sin().abs())
    });
    let lip = lathe(
        &[
            (0.82, 1.76),
            (0.87, 1.78),
            (0.87, 1.81),
            (0.84, 1.83),
            (0.79, 1.83),
            (0.74, 1.72),
            (0.0, 1.70),
        ],
        48,
        4.0,
    );
    let plinth = lathe(
        &[
            (0.27, 1.70),
            (0.27, 1.86),
            (0.23, 1.90),
            (0.20, 1.96),
            (0.20, 2.0),
            (0.0, 2.0),
        ],
        28,
        2.0,
    );
    with_normals(&join(&[step, basin, stem, bowl, lip, plinth]), 35.0)
}

/// The two water surfaces, with rings running out from the stem.
pub fn water() -> Mesh {
    let disc = |r0: f64, r1: f64, y: f64, rings: usize, around: usize| {
        grid(around, rings, move |u, v| {
            let a = if u >= 1.0 { 0.0 } else { u * TAU };
            let r = r0 + (r1 - r0) * v;
            let wave =
                0.004 * (36.0 * r).sin() * (1.0 - v) + 0.003 * (5.0 * a + 9.0 * r).sin() * v * (1.0 - v);
            (
                dvec3(r * a.cos(), y + wave, -r * a.sin()),
                dvec2(r * a.cos(), r * a.sin()),
            )
        })
    };
    // u × v runs counter-clockwise × outwards: downwards. Turned over.
    let mesh = join(&[disc(0.2, 1.43, 0.60, 16, 40), disc(0.2, 0.77, 1.785, 8, 28)]);
    with_normals(&crate::mesh::flipped(mesh), 80.0)
}

/// The form on top of the fountain: three folds that turn about each other as they rise and close in a bud.
pub fn sculpture() -> Mesh {
    let outline = smooth_profile(
        &[
            (0.0, 0.0),
            (0.15, 0.005),
            (0.17, 0.06),
            (0.12, 0.20),
            (0.16, 0.42),
            (0.235, 0.66),
            (0.20, 0.90),
            (0.115, 1.10),
            (0.10, 1.22),
            (0.07, 1.34),
            (0.0, 1.44),
        ],
        5,
    );
    let form = lathe_with(&outline, 60, 2.0, |angle, y, r| {
        let turn = angle * 3.0 + 4.2 * y;
        let fold = 0.5 + 0.5 * turn.cos();
        r * (0.62 + 0.55 * fold.powf(1.3)) * (1.0 + 0.05 * (2.0 * turn).cos())
    });
    with_normals(&moved(form, dvec3(0.0, 2.0, 0.0)), 60.0)
}

/// A footed urn with a moulded rim, 0.62 m high, filled with earth.
pub fn urn() -> Mesh {
    let mut outline = smooth_profile(
        &[
            (0.17, 0.0),
            (0.17, 0.04),
            (0.09, 0.08),
            (0.075, 0.13),
            (0.14, 0.19),
            (0.235, 0.30),
            (0.255, 0.40),
            (0.215, 0.49),
            (0.205, 0.53),
        ],
        3,
    );
    outline.extend([
        (0.27, 0.56),
        (0.28, 0.585),
        (0.27, 0.61),
        (0.235, 0.62),
        (0.21, 0.60),
        (0.20, 0.54),
        (0.0, 0.55),
    ]);
    let body = lathe_with(&outline, 32, 2.0, |angle, y, r| {
        let lobes = smoothstep(0.16, 0.24, y) * smoothstep(0.42, 0.34, y);
        r * (1.0 + 0.035 * lobes * (8.0 * angle).sin().abs())
    });
    with_normals(&body, 40.0)
}

/// A clipped tree in the urn: a trunk and two leafy balls.
pub fn topiary() -> Mesh {
    let ball = |radius: f64, y: f64, seed: u32| {
        grid(30, 18, move |u, v| {
            let a = if u >= 1.0 { 0.0 } else { u * TAU };
            // From the lower pole to the upper one; leaves are bumps of the radius, none at the poles.
            let polar = PI * (1.0 - v);
            let (s, c) = polar.sin_cos();
            let (nu, nv) = (u.fract(), v);
            let bump = (noise(nu, nv, 15, seed) + 0.5 * noise(nu, nv, 30, seed + 1) - 0.75) * s.min(1.0);
            let r = radius * (1.0 + 0.17 * bump);
            (dvec3(r * s * a.cos(), y + r * c, -r * s * a.sin()), dvec2(u, v))
        })
    };
    let mut mesh = lathe(&[(0.022, 0.54), (0.018, 1.3)], 8, 1.0);
    append(&mut mesh, &ball(0.27, 0.86, 3));
    append(&mut mesh, &ball(0.17, 1.30, 8));
    with_normals(&mesh, 60.0)
}
