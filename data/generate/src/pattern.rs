//! Textures of the indoor scenes: wood, bricks, hammered metal, scratches, a lattice, a book's cover, glowing signs.

use crate::texture::{color, color_alpha, fbm, grey, hash01, mix, noise, normal_map, smoothstep};
use glam::{DVec3, dvec3};
use std::f64::consts::TAU;

/// Floor boards along u: six to a tile, with grain and dark joints.
pub fn planks(size: u32) -> Vec<u8> {
    color(size, size, |u, v| {
        let row = (v * 6.0).floor() as i64;
        let shifted = (u + hash01(row, 0, 3)).fract();
        let (fy, end) = ((v * 6.0).fract(), shifted.min(1.0 - shifted));
        let joint = 1.0 - smoothstep(0.02, 0.06, fy.min(1.0 - fy)).min(smoothstep(0.002, 0.006, end));
        let tone = hash01(row, 1, 7) - 0.5;
        let grain = fbm(u, v * 8.0, 3, 4, 11 + row as u32) - 0.5;
        let wood = mix(
            dvec3(0.62, 0.43, 0.26),
            dvec3(0.74, 0.55, 0.36),
            0.5 + tone + 0.9 * grain,
        );
        wood * (1.0 - 0.55 * joint)
    })
}

/// Height of a brick wall in units of the tile's width and the mask of its joints: eight courses, three bricks and a half each.
fn bricks(u: f64, v: f64) -> (f64, f64, i64) {
    let course = (v * 8.0).floor() as i64;
    let x = u * 4.0 + 0.5 * (course % 2) as f64;
    let (fx, fy) = ((x.fract()) / 4.0, (v * 8.0).fract() / 8.0);
    let edge = fx.min(0.25 - fx).min(fy.min(0.125 - fy)) + 0.006 * (fbm(u, v, 16, 2, 5) - 0.5);
    let inside = smoothstep(0.004, 0.014, edge);
    let height = 0.009 * inside + 0.004 * (fbm(u, v, 16, 3, 9) - 0.5);
    (height, inside, (x.floor() as i64).rem_euclid(4) + 4 * course)
}

/// Colour of the bricks.
pub fn brick_color(size: u32) -> Vec<u8> {
    color(size, size, |u, v| {
        let (_, inside, id) = bricks(u.rem_euclid(1.0), v.rem_euclid(1.0));
        let tone = hash01(id, 1, 21);
        let clay = mix(dvec3(0.62, 0.36, 0.27), dvec3(0.78, 0.52, 0.40), tone);
        let clay = clay * (0.82 + 0.36 * fbm(u, v, 24, 3, 31));
        mix(dvec3(0.72, 0.69, 0.63), clay, inside)
    })
}

/// Normals of the bricks.
pub fn brick_normal(size: u32) -> Vec<u8> {
    normal_map(size, |u, v| bricks(u.rem_euclid(1.0), v.rem_euclid(1.0)).0)
}

/// Distance to the nearest of the jittered points of a repeating lattice of `n` × `n` cells, in cells.
fn worley(u: f64, v: f64, n: i64, seed: u32) -> f64 {
    let (x, y) = (u * n as f64, v * n as f64);
    let (i, j) = (x.floor() as i64, y.floor() as i64);
    let mut best = f64::INFINITY;
    for dj in -1..=1 {
        for di in -1..=1 {
            let (a, b) = ((i + di).rem_euclid(n), (j + dj).rem_euclid(n));
            let px = (i + di) as f64 + 0.15 + 0.7 * hash01(a, b, seed);
            let py = (j + dj) as f64 + 0.15 + 0.7 * hash01(a, b, seed + 1);
            best = best.min((px - x).hypot(py - y));
        }
    }
    best
}

/// Normals of hammered metal: round dents.
pub fn hammered_normal(size: u32) -> Vec<u8> {
    normal_map(size, |u, v| {
        let d = worley(u, v, 10, 41).min(0.62);
        0.035 * d * d
    })
}

/// Metallic-roughness texture of worn, partly painted metal: green is roughness, blue is metalness.
pub fn worn_metal(size: u32) -> Vec<u8> {
    color(size, size, |u, v| {
        let bare = worn(u, v);
        let rough = 0.45 * (1.0 - bare) + (0.18 + 0.2 * noise(u, v, 32, 8)) * bare;
        dvec3(0.0, rough, bare)
    })
}

/// Base colour that goes with [`worn_metal`]: teal paint and bare steel.
pub fn worn_color(size: u32) -> Vec<u8> {
    color(size, size, |u, v| {
        mix(dvec3(0.10, 0.42, 0.45), dvec3(0.78, 0.76, 0.73), worn(u, v))
    })
}

fn worn(u: f64, v: f64) -> f64 {
    smoothstep(0.52, 0.56, fbm(u, v, 5, 5, 61))
}

/// A lattice of diagonal slats with holes between: alpha is cut out.
pub fn lattice(size: u32) -> Vec<u8> {
    color_alpha(size, size, |u, v| {
        let slat = |t: f64| (t - t.round()).abs() < 0.16;
        let (a, b) = ((u + v) * 4.0, (u - v) * 4.0);
        let over = slat(a);
        let edge = u.min(1.0 - u).min(v.min(1.0 - v)) < 0.02;
        let solid = over || slat(b) || edge;
        let wood = (if over { 0.80 } else { 0.66 }) * (0.85 + 0.3 * noise(u, v, 32, 77));
        // The colour runs on under the holes, so that filtering at their edges does not darken.
        [wood, wood * 0.72, wood * 0.45, f64::from(u8::from(solid))]
    })
}

/// A book's cover: dark green cloth with a golden frame, a title and a rosette.
pub fn book_cover(size: u32) -> Vec<u8> {
    color(size, size, |u, v| {
        let cloth = dvec3(0.11, 0.27, 0.20) * (0.85 + 0.3 * noise(u, v, 64, 4));
        let gold = dvec3(0.86, 0.68, 0.30);
        let edge = u.min(1.0 - u).min(v.min(1.0 - v));
        let frame = (edge - 0.07).abs() < 0.012 || (edge - 0.10).abs() < 0.004;
        let (x, y) = (u - 0.5, v - 0.60);
        let (r, angle) = (x.hypot(y), y.atan2(x));
        let rosette = (r - 0.10 - 0.05 * (6.0 * angle).cos()).abs() < 0.012 || r < 0.025;
        // A title of dashes: letters would be too small to read.
        let line = |at: f64, half: f64| (v - at).abs() < 0.018 && x.abs() < half && (u * 23.0).fract() > 0.25;
        if frame || rosette || line(0.24, 0.26) || line(0.31, 0.16) {
            gold
        } else {
            cloth
        }
    })
}

/// A dial that glows: twelve marks, two hands and a ring, white on black.
pub fn glowing_dial(size: u32) -> Vec<u8> {
    grey(size, size, |u, v| {
        let (x, y) = (u - 0.5, v - 0.5);
        let (r, angle) = (x.hypot(y), x.atan2(-y).rem_euclid(TAU));
        let mark = ((angle / TAU * 12.0 + 0.5).fract() - 0.5).abs() * r < 0.035 && (0.34..0.42).contains(&r);
        let ring = (r - 0.455).abs() < 0.015;
        let hand = |turn: f64, length: f64| {
            let (s, c) = (turn * TAU).sin_cos();
            let (along, across) = (x * s - y * c, x * c + y * s);
            (-0.04..length).contains(&along) && across.abs() < 0.016
        };
        f64::from(u8::from(
            mark || ring || hand(10.15 / 12.0, 0.20) || hand(9.0 / 60.0, 0.31),
        ))
    })
}

/// The colours of a glaze by height, 0 to 1: for vertex colours (linear).
pub fn glaze(t: f64) -> DVec3 {
    let stops = [
        dvec3(0.05, 0.12, 0.40),
        dvec3(0.10, 0.45, 0.50),
        dvec3(0.85, 0.70, 0.35),
        dvec3(0.75, 0.20, 0.08),
    ];
    let x = t.clamp(0.0, 1.0) * 3.0;
    let k = (x.floor() as usize).min(2);
    mix(stops[k], stops[k + 1], smoothstep(0.0, 1.0, x - k as f64))
}
