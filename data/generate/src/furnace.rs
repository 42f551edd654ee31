//! Closed furnaces: enclosures whose interreflection has an analytic answer.
//!
//! In a closed Lambertian enclosure of uniform albedo ρ whose walls all emit the same radiance L, direct irradiance is πL
//! and indirect irradiance πLρ/(1 − ρ), whatever the shape. In a sphere, whose every element irradiates every other
//! alike, E_ind = ⟨ρE_d⟩/(1 − ⟨ρ⟩) for any direct irradiance E_d and any albedo ρ, the means being over the surface.

use crate::glb::{Glb, Material, Placement, matt};
use crate::mesh::{Mesh, carved, snap3, with_normals};
use crate::sequence::{emissive, point, sequence};
use glam::{DVec3, dvec3};
use serde_json::json;
use std::collections::HashMap;

/// Radius of both spheres and half the edge of the box, metres.
pub const RADIUS: f64 = 1.0;
/// Position of the point light in the sphere of varying albedo, metres from its centre.
pub const VARYING_LIGHT: [f64; 3] = [0.45, 0.25, -0.2];
/// Intensity of that light, W/sr.
pub const VARYING_INTENSITY: [f64; 3] = [1.0, 1.0, 1.0];
/// Triangles per edge of the icosahedron: its longest edge then spans 3.4°, and the middle of a triangle lies less than
/// 6e-4 under the sphere.
const FREQUENCY: usize = 24;

fn wall(albedo: [f32; 3]) -> Material {
    // Through the shortest decimal, so that the JSON says 0.9 and reads back as the same f32.
    let decimal = albedo.map(|a| a.to_string().parse().unwrap_or(f64::from(a)));
    Material {
        emission: [1.0; 3],
        ..matt("Wall", decimal)
    }
}

/// A geodesic sphere seen from inside, normals towards the centre.
fn sphere_inside() -> Mesh {
    let g = 0.5 * (1.0 + 5.0f64.sqrt());
    let corners = [
        [-1.0, g, 0.0],
        [1.0, g, 0.0],
        [-1.0, -g, 0.0],
        [1.0, -g, 0.0],
        [0.0, -1.0, g],
        [0.0, 1.0, g],
        [0.0, -1.0, -g],
        [0.0, 1.0, -g],
        [g, 0.0, -1.0],
        [g, 0.0, 1.0],
        [-g, 0.0, -1.0],
        [-g, 0.0, 1.0],
    ]
    .map(|p| DVec3::from_array(p).normalize());
    let faces = [
        [0, 11, 5],
        [0, 5, 1],
        [0, 1, 7],
        [0, 7, 10],
        [0, 10, 11],
        [1, 5, 9],
        [5, 11, 4],
        [11, 10, 2],
        [10, 7, 6],
        [7, 1, 8],
        [3, 9, 4],
        [3, 4, 2],
        [3, 2, 6],
        [3, 6, 8],
        [3, 8, 9],
        [4, 9, 5],
        [2, 4, 11],
        [6, 2, 10],
        [8, 6, 7],
        [9, 8, 1],
    ];
    let mut mesh = Mesh::default();
    let mut known = HashMap::new();
    for [a, b, c] in faces {
        let mut vertex = |i: usize, j: usize| {
            let k = FREQUENCY - i - j;
            let flat = corners[a] * k as f64 + corners[b] * i as f64 + corners[c] * j as f64;
            let normal = -flat.normalize();
            // A millionth tells vertices of different faces that coincide from their neighbours, 5e-2 away.
            let key = normal.to_array().map(|x| (x * 1e6).round() as i64);
            *known.entry(key).or_insert_with(|| {
                mesh.positions.push(snap3(-normal * RADIUS));
                mesh.normals.push(snap3(normal));
                mesh.positions.len() as u32 - 1
            })
        };
        let mut triangles = vec![];
        for j in 0..FREQUENCY {
            for i in 0..FREQUENCY - j {
                // Clockwise seen from outside, so the front looks inwards.
                triangles.extend([vertex(i, j), vertex(i, j + 1), vertex(i + 1, j)]);
                if i + j + 2 <= FREQUENCY {
                    triangles.extend([vertex(i + 1, j), vertex(i, j + 1), vertex(i + 1, j + 1)]);
                }
            }
        }
        mesh.indices.extend(triangles);
    }
    mesh
}

fn enclosure(mesh: &Mesh, material: &Material) -> Glb {
    let mut glb = Glb::new();
    let wall = glb.add_material(material);
    let mesh = glb.add_mesh("Furnace", &[(mesh, wall)]);
    glb.add_node("Furnace", mesh, Placement::HERE);
    glb.add_camera("Camera", dvec3(-0.3, 0.1, 0.5), dvec3(0.6, -0.1, -0.5), 70.0, 1.0);
    glb
}

/// A closed sphere of radius 1 m seen from inside, emitting radiance 1 everywhere (material `Wall`).
pub fn furnace_sphere(albedo: [f32; 3]) -> Glb {
    enclosure(&sphere_inside(), &wall(albedo))
}

/// A closed cube of edge 2 m seen from inside, emitting radiance 1 everywhere (material `Wall`).
pub fn furnace_box(albedo: [f32; 3]) -> Glb {
    let edge = [-RADIUS, RADIUS];
    let mut mesh = carved(&edge, &edge, &edge, |_| true, 1, |_, _| 0).remove(0);
    mesh.uvs.clear();
    enclosure(&with_normals(&mesh, 1.0), &wall(albedo))
}

/// The closed sphere with the albedo of [`varying_albedo`] as vertex colours; it does not emit.
/// `mean` + |`amplitude`| must stay below one, `mean` above |`amplitude`|.
pub fn furnace_varying(mean: f32, amplitude: f32) -> Glb {
    let mut mesh = sphere_inside();
    mesh.colors = mesh
        .positions
        .iter()
        .map(|&p| varying_albedo(p, mean, amplitude))
        .collect();
    enclosure(&mesh, &matt("Wall", [1.0; 3]))
}

/// The albedo of [`furnace_varying`] in a direction from the centre: a smooth pattern of degrees 1 to 3 in each channel,
/// within `mean` ± `amplitude`, whose mean over the sphere is `mean` (the patterns are odd, or of mean zero).
pub fn varying_albedo(direction: DVec3, mean: f32, amplitude: f32) -> [f32; 3] {
    let d = direction.normalize();
    // Each is at most 1 in magnitude: 2xy, and 3√3 xyz; the first is a coordinate.
    let pattern = [d.x, 2.0 * d.x * d.y, 27.0f64.sqrt() * d.x * d.y * d.z];
    pattern.map(|p| ((f64::from(mean) + f64::from(amplitude) * p) * 65536.0).round() as f32 / 65536.0)
}

/// The glowing walls of the first two furnaces; the uneven light of the third.
pub fn sequences() -> Vec<(&'static str, Vec<u8>)> {
    vec![
        (
            "furnace.lights.json",
            sequence(1, None, &[emissive("walls", "Wall")]),
        ),
        (
            "furnace_varying.lights.json",
            sequence(1, None, &[point("lamp", json!(VARYING_LIGHT), VARYING_INTENSITY)]),
        ),
    ]
}
