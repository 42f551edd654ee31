//! The Cornell box from its published measurements (Program of Computer Graphics, Cornell University, "Cornell Box Data").
//!
//! The vertex lists below are the published ones, in millimetres with +Y up. They are already right-handed: the camera
//! looks along +Z, so its right is −X and the wall at x ≈ 553, the red one, stands on the left as in the photograph.
//! Reflectances and the light's radiance are the usual linear RGB renderings of the measured spectra.

use crate::glb::{Glb, Material, Placement, matt};
use crate::mesh::{Mesh, join, quad, with_normals};
use crate::sequence::{emissive, keys, point, sequence};
use glam::{DVec3, dvec3};
use serde_json::json;

/// Metres per published unit.
const UNIT: f64 = 0.001;

const LIGHT: [[f64; 3]; 4] = [
    [343.0, 548.8, 227.0],
    [343.0, 548.8, 332.0],
    [213.0, 548.8, 332.0],
    [213.0, 548.8, 227.0],
];
const FLOOR: [[f64; 3]; 4] = [
    [552.8, 0.0, 0.0],
    [0.0, 0.0, 0.0],
    [0.0, 0.0, 559.2],
    [549.6, 0.0, 559.2],
];
const CEILING: [[f64; 3]; 4] = [
    [556.0, 548.8, 0.0],
    [556.0, 548.8, 559.2],
    [0.0, 548.8, 559.2],
    [0.0, 548.8, 0.0],
];
const BACK: [[f64; 3]; 4] = [
    [549.6, 0.0, 559.2],
    [0.0, 0.0, 559.2],
    [0.0, 548.8, 559.2],
    [556.0, 548.8, 559.2],
];
const GREEN: [[f64; 3]; 4] = [
    [0.0, 0.0, 559.2],
    [0.0, 0.0, 0.0],
    [0.0, 548.8, 0.0],
    [0.0, 548.8, 559.2],
];
const RED: [[f64; 3]; 4] = [
    [552.8, 0.0, 0.0],
    [549.6, 0.0, 559.2],
    [556.0, 548.8, 559.2],
    [556.0, 548.8, 0.0],
];
const SHORT_BLOCK: [[[f64; 3]; 4]; 5] = [
    [
        [130.0, 165.0, 65.0],
        [82.0, 165.0, 225.0],
        [240.0, 165.0, 272.0],
        [290.0, 165.0, 114.0],
    ],
    [
        [290.0, 0.0, 114.0],
        [290.0, 165.0, 114.0],
        [240.0, 165.0, 272.0],
        [240.0, 0.0, 272.0],
    ],
    [
        [130.0, 0.0, 65.0],
        [130.0, 165.0, 65.0],
        [290.0, 165.0, 114.0],
        [290.0, 0.0, 114.0],
    ],
    [
        [82.0, 0.0, 225.0],
        [82.0, 165.0, 225.0],
        [130.0, 165.0, 65.0],
        [130.0, 0.0, 65.0],
    ],
    [
        [240.0, 0.0, 272.0],
        [240.0, 165.0, 272.0],
        [82.0, 165.0, 225.0],
        [82.0, 0.0, 225.0],
    ],
];
const TALL_BLOCK: [[[f64; 3]; 4]; 5] = [
    [
        [423.0, 330.0, 247.0],
        [265.0, 330.0, 296.0],
        [314.0, 330.0, 456.0],
        [472.0, 330.0, 406.0],
    ],
    [
        [423.0, 0.0, 247.0],
        [423.0, 330.0, 247.0],
        [472.0, 330.0, 406.0],
        [472.0, 0.0, 406.0],
    ],
    [
        [472.0, 0.0, 406.0],
        [472.0, 330.0, 406.0],
        [314.0, 330.0, 456.0],
        [314.0, 0.0, 456.0],
    ],
    [
        [314.0, 0.0, 456.0],
        [314.0, 330.0, 456.0],
        [265.0, 330.0, 296.0],
        [265.0, 0.0, 296.0],
    ],
    [
        [265.0, 0.0, 296.0],
        [265.0, 330.0, 296.0],
        [423.0, 330.0, 247.0],
        [423.0, 0.0, 247.0],
    ],
];

fn metres(p: [f64; 3]) -> DVec3 {
    DVec3::from_array(p) * UNIT
}

/// A published quad, turned where needed so that its front is the side of `seen_from`.
fn facing(corners: [[f64; 3]; 4], seen_from: DVec3) -> Mesh {
    let p = corners.map(metres);
    let normal = (p[1] - p[0]).cross(p[2] - p[0]);
    if normal.dot(seen_from - p[0]) > 0.0 {
        quad(p[0], p[1], p[2], p[3])
    } else {
        quad(p[3], p[2], p[1], p[0])
    }
}

fn block(faces: &[[[f64; 3]; 4]; 5]) -> Mesh {
    let centre = faces[1..].iter().flatten().map(|&p| metres(p)).sum::<DVec3>() / 16.0;
    // A block is seen from outside: from the point beyond each face, mirrored at the face's middle.
    join(&faces.map(|face| {
        let middle = face.iter().map(|&p| metres(p)).sum::<DVec3>() / 4.0;
        facing(face, 2.0 * middle - centre)
    }))
}

/// The box, 0.5528 m wide, open at the front, with its area light in the hole of the ceiling (material `Light`).
pub fn cornell() -> Glb {
    let inside = metres([278.0, 273.0, 279.6]);
    // The ceiling is the published quad around its published hole: four trapezoids that share the corners.
    let hole = [LIGHT[0], LIGHT[1], LIGHT[2], LIGHT[3]];
    let ceiling = join(&[0, 1, 2, 3].map(|k| {
        let n = (k + 1) % 4;
        facing([CEILING[k], CEILING[n], hole[n], hole[k]], inside)
    }));
    let mut glb = Glb::new();
    let white = glb.add_material(&matt("White", [0.725, 0.71, 0.68]));
    let red = glb.add_material(&matt("Red", [0.63, 0.065, 0.05]));
    let green = glb.add_material(&matt("Green", [0.14, 0.45, 0.091]));
    // The published reflectance of the light is 0.78; (17, 12, 4) is the usual RGB of its spectrum.
    let light = glb.add_material(&Material {
        emission: [17.0, 12.0, 4.0],
        ..matt("Light", [0.78, 0.78, 0.78])
    });
    let parts = [
        ("Floor", facing(FLOOR, inside), white),
        ("Ceiling", ceiling, white),
        ("Back wall", facing(BACK, inside), white),
        ("Right wall", facing(GREEN, inside), green),
        ("Left wall", facing(RED, inside), red),
        ("Light", facing(LIGHT, inside), light),
        ("Short block", block(&SHORT_BLOCK), white),
        ("Tall block", block(&TALL_BLOCK), white),
    ];
    for (name, mut mesh, material) in parts {
        mesh.uvs.clear();
        let mesh = glb.add_mesh(name, &[(&with_normals(&mesh, 1.0), material)]);
        glb.add_node(name, mesh, Placement::HERE);
    }
    // Published: at (278, 273, −800), direction +Z, focal length 0.035 for a sensor of 0.025 × 0.025.
    let vfov_deg = 2.0 * (0.0125f64 / 0.035).atan().to_degrees();
    glb.add_camera(
        "Camera",
        metres([278.0, 273.0, -800.0]),
        metres([278.0, 273.0, 0.0]),
        vfov_deg,
        1.0,
    );
    glb
}

/// The box's own light; a point light that moves for 24 frames; a coloured panel.
pub fn sequences() -> Vec<(&'static str, Vec<u8>)> {
    let path = [
        (0, json!([0.12, 0.45, 0.10])),
        (8, json!([0.45, 0.40, 0.15])),
        (16, json!([0.40, 0.25, 0.05])),
        (23, json!([0.10, 0.10, 0.20])),
    ];
    let panel = json!({ "name": "panel", "type": "rect", "center": dvec3(0.02, 0.275, 0.28).to_array(),
        "edge_u": [0.0, 0.2, 0.0], "edge_v": [0.0, 0.0, 0.2], "radiance": [3.0, 9.0, 15.0] });
    vec![
        (
            "cornell.lights.json",
            sequence(1, None, &[emissive("light", "Light")]),
        ),
        (
            "cornell_moving.lights.json",
            sequence(
                24,
                None,
                &[point("lamp", keys("cubic", &path), [0.3, 0.27, 0.22])],
            ),
        ),
        ("cornell_panel.lights.json", sequence(1, None, &[panel])),
    ]
}
