//! Two rooms that share a wall of 2 cm with a door opening: the test for light that leaks through thin walls.
//!
//! The rooms' surface is one closed shell: walls, the wall's two sides, the jambs and the threshold, cut from a block so
//! that every edge has exactly two faces. The near room (x < 0) holds the camera.

use crate::furnishing::{topiary, urn};
use crate::glb::{Glb, Material, Placement, TextureRef, matt};
use crate::mesh::{Mesh, carved, cuboid, join, lathe, moved, tiled, with_normals};
use crate::pattern;
use crate::sequence::{point, sequence};
use glam::{DVec3, dvec3};
use serde_json::json;

/// Half the thickness of the shared wall, metres.
pub const HALF_WALL: f64 = 0.01;
/// The door opening: z from, z to, height.
pub const DOOR: (f64, f64, f64) = (0.5, 1.4, 2.05);

/// A table on four legs: its top's middle stands at (0, height, 0).
fn table(width: f64, depth: f64, height: f64) -> Mesh {
    let (w, d) = (0.5 * width, 0.5 * depth);
    let mut parts = vec![cuboid(dvec3(-w, height - 0.04, -d), dvec3(w, height, d))];
    for (x, z) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
        let leg = cuboid(dvec3(-0.03, 0.0, -0.03), dvec3(0.03, height - 0.04, 0.03));
        parts.push(moved(leg, dvec3(x * (w - 0.06), 0.0, z * (d - 0.06))));
    }
    join(&parts)
}

/// The two rooms, 4 m × 4.4 m each and 2.7 m high.
pub fn two_rooms() -> Glb {
    let (z0, z1, high) = DOOR;
    let air = |p: DVec3| p.x.abs() > HALF_WALL || (p.z > z0 && p.z < z1 && p.y < high);
    // 0 floor, 1 ceiling, 2 walls of the near room, 3 of the far room, 4 the shared wall, 5 jambs and threshold.
    let class = |p: DVec3, n: DVec3| {
        if p.x.abs() < HALF_WALL {
            5
        } else if n.y > 0.5 {
            0
        } else if n.y < -0.5 {
            1
        } else if n.x.abs() > 0.5 && p.x.abs() < 1.0 {
            4
        } else if p.x < 0.0 {
            2
        } else {
            3
        }
    };
    let xs = [-4.0, -HALF_WALL, HALF_WALL, 4.0];
    let shell = carved(&xs, &[0.0, high, 2.7], &[-2.2, z0, z1, 2.2], air, 6, class);
    let shell: Vec<Mesh> = shell
        .into_iter()
        .map(|part| with_normals(&tiled(part, 1.2), 10.0))
        .collect();

    let mut glb = Glb::new();
    let planks = TextureRef::new(glb.add_texture("planks", &pattern::planks(256)));
    let floor = glb.add_material(&Material {
        base_color_texture: Some(planks),
        ..matt("Floor", [1.0, 1.0, 1.0])
    });
    let ceiling = glb.add_material(&matt("Ceiling", [0.82, 0.82, 0.80]));
    let near = glb.add_material(&matt("Near walls", [0.74, 0.62, 0.46]));
    let far = glb.add_material(&matt("Far walls", [0.42, 0.58, 0.66]));
    let shared = glb.add_material(&matt("Shared wall", [0.78, 0.77, 0.74]));
    let jamb = glb.add_material(&matt("Jamb", [0.60, 0.58, 0.55]));
    let oak = glb.add_material(&Material {
        roughness: 0.6,
        ..matt("Oak", [0.45, 0.28, 0.15])
    });
    let clay = glb.add_material(&matt("Clay", [0.72, 0.36, 0.20]));
    let leaf = glb.add_material(&matt("Leaf", [0.14, 0.27, 0.06]));
    let red = glb.add_material(&matt("Red", [0.65, 0.10, 0.08]));
    let parts: Vec<(&Mesh, usize)> = shell
        .iter()
        .zip([floor, ceiling, near, far, shared, jamb])
        .collect();
    let rooms = glb.add_mesh("Rooms", &parts);
    glb.add_node("Rooms", rooms, Placement::HERE);

    let flat = |mesh: Mesh| with_normals(&tiled(mesh, 1.2), 10.0);
    let furniture = glb.add_mesh("Table", &[(&flat(table(1.5, 0.8, 0.74)), oak)]);
    glb.add_node(
        "Near table",
        furniture,
        Placement::at(-1.6, 0.0, 0.1).turned(15.0),
    );
    glb.add_node("Far table", furniture, Placement::at(2.4, 0.0, -1.2).turned(90.0));
    let plant = glb.add_mesh("Plant", &[(&urn(), clay), (&topiary(), leaf)]);
    glb.add_node("Near plant", plant, Placement::at(-0.5, 0.0, -1.6));
    glb.add_node("Far plant", plant, Placement::at(0.9, 0.0, 1.9).scaled(0.9));
    // A cabinet whose back touches the shared wall on the far side, and a red ball on the near table.
    let cabinet = join(&[
        cuboid(dvec3(HALF_WALL, 0.0, -1.9), dvec3(0.45, 1.8, -0.6)),
        cuboid(dvec3(0.45, 0.05, -1.88), dvec3(0.47, 1.76, -1.26)),
        cuboid(dvec3(0.45, 0.05, -1.24), dvec3(0.47, 1.76, -0.62)),
    ]);
    let cabinet = glb.add_mesh("Cabinet", &[(&flat(cabinet), oak)]);
    glb.add_node("Cabinet", cabinet, Placement::HERE);
    let arc: Vec<(f64, f64)> = (0..=14)
        .map(|k| {
            let a = std::f64::consts::PI * (f64::from(k) / 14.0 - 0.5);
            (0.16 * a.cos().max(0.0), 0.16 + 0.16 * a.sin())
        })
        .collect();
    let ball = glb.add_mesh("Ball", &[(&with_normals(&lathe(&arc, 28, 1.0), 60.0), red)]);
    glb.add_node("Ball", ball, Placement::at(-1.45, 0.74, 0.1));

    glb.add_camera(
        "Camera",
        dvec3(-3.7, 1.55, -1.7),
        dvec3(-0.4, 1.05, 0.35),
        55.0,
        16.0 / 9.0,
    );
    glb.add_camera(
        "Far",
        dvec3(3.7, 1.6, -1.2),
        dvec3(0.2, 1.0, 0.5),
        55.0,
        16.0 / 9.0,
    );
    glb
}

/// Light in the far room, which reaches the near one through the door only; light in the near room.
pub fn sequences() -> Vec<(&'static str, Vec<u8>)> {
    let panel = json!({ "name": "ceiling", "type": "rect", "center": [-2.2, 2.68, 0.4],
        "edge_u": [0.0, 0.0, 0.6], "edge_v": [-1.2, 0.0, 0.0], "radiance": [9.0, 8.6, 7.8] });
    let lamp = point("lamp", json!([2.0, 2.2, 0.6]), [60.0, 56.0, 48.0]);
    vec![
        ("two_rooms_far.lights.json", sequence(1, None, &[lamp])),
        ("two_rooms_near.lights.json", sequence(1, None, &[panel])),
    ]
}
