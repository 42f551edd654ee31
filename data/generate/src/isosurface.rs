//! The scene of implicit and volumetric surfaces (after figure 6 of Lehtinen et al. 2008): a bonsai, whose trunk and
//! leaves are isosurfaces of density volumes, in a pot of implicit surfaces, in a box of meshes. `data/README.md`
//! specifies the description.

use crate::sequence::{keys, point, sequence};
use crate::texture::hash01;
use glam::{DVec3, dvec3};
use serde_json::{Value, json};

/// Samples per axis of both volumes.
const N: usize = 48;
/// Density at the surface.
const LEVEL: u8 = 128;

/// A box of densities in the world.
struct Volume {
    file: &'static str,
    low: DVec3,
    high: DVec3,
    albedo: [f64; 3],
}

const TRUNK: Volume = Volume {
    file: "bonsai_trunk.vol",
    low: DVec3::new(-0.28, 0.44, -0.18),
    high: DVec3::new(0.30, 1.10, 0.18),
    albedo: [0.34, 0.21, 0.13],
};
const LEAVES: Volume = Volume {
    file: "bonsai_leaves.vol",
    low: DVec3::new(-0.46, 0.78, -0.30),
    high: DVec3::new(0.46, 1.32, 0.30),
    albedo: [0.16, 0.34, 0.08],
};

/// Distance to a bough: a segment whose radius runs from `r0` to `r1`.
fn bough(p: DVec3, a: DVec3, b: DVec3, r0: f64, r1: f64) -> f64 {
    let t = ((p - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
    p.distance(a + (b - a) * t) - (r0 + (r1 - r0) * t)
}

/// Value noise in space, in [−1, 1], cells of one unit.
fn noise3(p: DVec3, seed: u32) -> f64 {
    let cell = p.floor();
    let f = p - cell;
    let f = f * f * (3.0 - 2.0 * f);
    let at = |k: usize| {
        let (x, y, z) = (
            cell.x as i64 + (k & 1) as i64,
            cell.y as i64 + (k >> 1 & 1) as i64,
            cell.z as i64 + (k >> 2) as i64,
        );
        // 1031 and 4099 are primes far beyond the cells that occur, so no two rows of the lattice coincide.
        2.0 * hash01(x + 1031 * z, y + 4099 * z, seed) - 1.0
    };
    let blend = |a: f64, b: f64, t: f64| a + (b - a) * t;
    let plane = |z: usize| {
        let row = |y: usize| blend(at(4 * z + 2 * y), at(4 * z + 2 * y + 1), f.x);
        blend(row(0), row(1), f.y)
    };
    blend(plane(0), plane(1), f.z)
}

/// A round minimum of two distances, over a width k.
fn smooth_min(a: f64, b: f64, k: f64) -> f64 {
    let h = (0.5 + 0.5 * (b - a) / k).clamp(0.0, 1.0);
    b + (a - b) * h - k * h * (1.0 - h)
}

/// The trunk leans and turns back, as a bonsai's does, and parts into three boughs.
fn trunk(p: DVec3) -> f64 {
    let boughs = [
        (dvec3(-0.02, 0.46, 0.0), dvec3(-0.085, 0.60, 0.02), 0.062, 0.046),
        (dvec3(-0.085, 0.60, 0.02), dvec3(0.03, 0.74, -0.02), 0.046, 0.038),
        (dvec3(0.03, 0.74, -0.02), dvec3(-0.03, 0.90, 0.01), 0.038, 0.028),
        (dvec3(-0.03, 0.90, 0.01), dvec3(0.01, 1.03, 0.0), 0.028, 0.02),
        (dvec3(-0.07, 0.63, 0.01), dvec3(-0.21, 0.82, 0.06), 0.03, 0.018),
        (dvec3(0.03, 0.74, -0.02), dvec3(0.24, 0.86, 0.03), 0.03, 0.018),
        (dvec3(-0.02, 0.47, 0.0), dvec3(0.09, 0.475, 0.06), 0.05, 0.025),
        (dvec3(-0.02, 0.47, 0.0), dvec3(-0.12, 0.475, 0.07), 0.045, 0.022),
    ];
    let d = boughs
        .iter()
        .map(|&(a, b, r0, r1)| bough(p, a, b, r0, r1))
        .reduce(|a, b| smooth_min(a, b, 0.03));
    // Bark: furrows along the height.
    d.unwrap_or(1.0) + 0.004 * noise3(dvec3(p.x * 60.0, p.y * 18.0, p.z * 60.0), 3)
}

/// Clouds of leaves: flat ellipsoids, roughened.
fn leaves(p: DVec3) -> f64 {
    let clouds = [
        (dvec3(0.0, 1.12, 0.0), dvec3(0.22, 0.12, 0.18)),
        (dvec3(-0.24, 0.90, 0.06), dvec3(0.17, 0.075, 0.15)),
        (dvec3(0.26, 0.93, 0.03), dvec3(0.155, 0.07, 0.14)),
        (dvec3(0.08, 1.03, -0.10), dvec3(0.17, 0.08, 0.13)),
        (dvec3(-0.12, 1.03, 0.05), dvec3(0.14, 0.075, 0.14)),
    ];
    let d = clouds.iter().map(|&(c, r)| {
        // The usual estimate of an ellipsoid's distance.
        let (k, l) = (((p - c) / r).length(), ((p - c) / (r * r)).length());
        if l > 0.0 {
            k * (k - 1.0) / l
        } else {
            -r.min_element()
        }
    });
    let d = d.reduce(|a, b| smooth_min(a, b, 0.02)).unwrap_or(1.0);
    d + 0.016 * noise3(p * 28.0, 11) + 0.010 * noise3(p * 55.0, 12)
}

/// Samples a distance into densities, x fastest: the level at the surface, more inside, over some three voxels.
fn densities(volume: &Volume, distance: impl Fn(DVec3) -> f64) -> Vec<u8> {
    let step = (volume.high - volume.low) / N as f64;
    let mut bytes = Vec::with_capacity(N * N * N);
    for k in 0..N {
        for j in 0..N {
            for i in 0..N {
                let p = volume.low + step * dvec3(i as f64 + 0.5, j as f64 + 0.5, k as f64 + 0.5);
                let density = f64::from(LEVEL) - 127.0 * distance(p) / (3.0 * step.max_element());
                // The border is empty, so that the surface closes within the bounds.
                let border = [i, j, k].iter().any(|&x| x == 0 || x == N - 1);
                bytes.push(if border {
                    0
                } else {
                    density.round().clamp(0.0, 255.0) as u8
                });
            }
        }
    }
    bytes
}

fn pot() -> Value {
    let foot = |angle: f64| {
        let (s, c) = angle.to_radians().sin_cos();
        let at = [0.14 * c, 0.315, 0.14 * s].map(|x| (x * 1e4).round() / 1e4);
        json!({ "sphere": { "center": at, "radius": 0.04 } })
    };
    let body = json!({ "smooth_union": { "k": 0.03, "of": [
        { "rounded_cylinder": { "center": [0.0, 0.42, 0.0], "radius": 0.20, "half_height": 0.085, "rounding": 0.04 } },
        { "torus": { "center": [0.0, 0.49, 0.0], "major": 0.20, "minor": 0.022 } },
        foot(30.0), foot(150.0), foot(270.0),
        { "ellipsoid": { "center": [0.21, 0.43, 0.0], "radii": [0.035, 0.03, 0.055] } },
        { "ellipsoid": { "center": [-0.21, 0.43, 0.0], "radii": [0.035, 0.03, 0.055] } } ] } });
    let hollow = json!({ "rounded_cylinder":
        { "center": [0.0, 0.52, 0.0], "radius": 0.175, "half_height": 0.09, "rounding": 0.03 } });
    json!({ "name": "pot", "albedo": [0.20, 0.34, 0.46], "bounds": [[-0.27, 0.27, -0.27], [0.27, 0.53, 0.27]],
        "sdf": { "difference": { "of": [body, hollow] } } })
}

fn description() -> Vec<u8> {
    let slab = |name: &str, low: [f64; 3], high: [f64; 3], albedo: [f64; 3]| json!({ "name": name, "min": low, "max": high, "albedo": albedo });
    let boxes = [
        slab("floor", [-0.9, -0.05, -0.7], [0.9, 0.0, 1.1], [0.72, 0.70, 0.66]),
        slab("back", [-0.9, 0.0, -0.75], [0.9, 1.7, -0.7], [0.75, 0.72, 0.66]),
        slab("left", [-0.95, 0.0, -0.75], [-0.9, 1.7, 1.1], [0.62, 0.16, 0.10]),
        slab("right", [0.9, 0.0, -0.75], [0.95, 1.7, 1.1], [0.18, 0.36, 0.55]),
        slab(
            "stand",
            [-0.32, 0.0, -0.26],
            [0.32, 0.28, 0.26],
            [0.42, 0.28, 0.17],
        ),
    ];
    let soil = json!({ "name": "soil", "albedo": [0.16, 0.11, 0.08], "bounds": [[-0.19, 0.41, -0.19], [0.19, 0.49, 0.19]],
        "sdf": { "rounded_cylinder": { "center": [0.0, 0.45, 0.0], "radius": 0.183, "half_height": 0.035, "rounding": 0.02 } } });
    let pebbles = json!({ "name": "pebbles", "albedo": [0.55, 0.52, 0.48], "bounds": [[0.38, -0.02, 0.27], [0.76, 0.14, 0.59]],
        "sdf": { "union": { "of": [
            { "ellipsoid": { "center": [0.52, 0.06, 0.40], "radii": [0.12, 0.07, 0.10] } },
            { "smooth_union": { "k": 0.02, "of": [
                { "sphere": { "center": [0.68, 0.045, 0.34], "radius": 0.055 } },
                { "sphere": { "center": [0.70, 0.04, 0.42], "radius": 0.045 } } ] } },
            { "intersection": { "of": [
                { "sphere": { "center": [0.47, 0.06, 0.52], "radius": 0.05 } },
                { "sphere": { "center": [0.44, 0.02, 0.52], "radius": 0.06 } } ] } } ] } } });
    let volume = |v: &Volume, name: &str| {
        json!({ "name": name, "file": v.file, "size": [N, N, N], "bounds": [v.low.to_array(), v.high.to_array()],
            "level": LEVEL, "albedo": v.albedo })
    };
    let camera = json!({ "position": [0.25, 1.05, 2.75], "look_at": [0.0, 0.70, 0.0], "up": [0.0, 1.0, 0.0],
        "vfov_deg": 36.0, "aspect": 1.25 });
    let lines = |items: &[Value]| {
        items
            .iter()
            .map(|v| format!("    {v}"))
            .collect::<Vec<_>>()
            .join(",\n")
    };
    format!(
        "{{ \"relight_scene\": 1,\n  \"camera\": {camera},\n  \"boxes\": [\n{} ],\n  \"implicits\": [\n{} ],\n  \"volumes\": [\n{} ] }}\n",
        lines(&boxes),
        lines(&[pot(), soil, pebbles]),
        lines(&[volume(&TRUNK, "trunk"), volume(&LEAVES, "leaves")]),
    )
    .into_bytes()
}

/// The description and its two volumes.
pub fn files() -> Vec<(&'static str, Vec<u8>)> {
    vec![
        ("isosurface.scene.json", description()),
        (TRUNK.file, densities(&TRUNK, trunk)),
        (LEAVES.file, densities(&LEAVES, leaves)),
    ]
}

/// A point light that stands still, as in the paper's figure; one that moves; the open sky.
pub fn sequences() -> Vec<(&'static str, Vec<u8>)> {
    let path = [
        (0, json!([-0.6, 1.5, 0.9])),
        (12, json!([0.0, 1.6, 0.6])),
        (23, json!([0.7, 1.2, 0.8])),
    ];
    let day = json!({ "name": "day", "type": "sun_sky", "turbidity": 3, "sun_direction": [0.4, 0.8, 0.5], "scale": 1.0 });
    vec![
        (
            "isosurface.lights.json",
            sequence(
                1,
                None,
                &[point("lamp", json!([0.55, 1.55, 0.85]), [3.0, 2.8, 2.5])],
            ),
        ),
        (
            "isosurface_moving.lights.json",
            sequence(24, None, &[point("lamp", keys("linear", &path), [3.0, 2.8, 2.5])]),
        ),
        ("isosurface_day.lights.json", sequence(1, None, &[day])),
    ]
}
