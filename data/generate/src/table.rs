//! A table of objects in a room that is open at the front: every material feature of glTF's core once or more (base
//! colour, metallic-roughness, normal and emissive textures, vertex colours, alpha cut and coverage, a texture transform,
//! a mirrored node, shared meshes).

use crate::glb::{Alpha, Glb, Material, Placement, TextureRef, matt};
use crate::mesh::{
    Mesh, cuboid, grid, join, lathe, lathe_with, mapped, moved, quad, smooth_profile, tiled, with_normals,
};
use crate::pattern;
use crate::sequence::{keys, point, sequence};
use glam::{DVec2, DVec3, dvec2, dvec3};
use serde_json::json;
use std::f64::consts::{PI, TAU};

/// Height of the table's top, metres.
const TOP: f64 = 0.75;

/// A tube along a curve over [0, 1]; `side` is roughly across the curve and fixes where the seam runs.
fn tube(
    curve: impl Fn(f64) -> DVec3,
    radius: impl Fn(f64) -> f64,
    side: impl Fn(f64) -> DVec3,
    around: usize,
    along: usize,
    closed: bool,
) -> Mesh {
    grid(around, along, |u, v| {
        let v = if closed && v >= 1.0 { 0.0 } else { v };
        let e = 1e-4;
        let tangent = (curve(v + e) - curve(v - e)).normalize();
        let s = side(v).reject_from(tangent).normalize();
        let a = if u >= 1.0 { 0.0 } else { u * TAU };
        let p = curve(v) + radius(v) * (a.cos() * s + a.sin() * tangent.cross(s));
        (p, dvec2(u, v * 6.0))
    })
}

/// A sphere as a surface of revolution, its lowest point at the origin; texture once around and once up.
fn sphere(radius: f64, around: usize) -> Mesh {
    let rows = around / 2;
    let arc: Vec<(f64, f64)> = (0..=rows)
        .map(|k| {
            let a = PI * (k as f64 / rows as f64 - 0.5);
            (
                if k == 0 || k == rows {
                    0.0
                } else {
                    radius * a.cos()
                },
                radius + radius * a.sin(),
            )
        })
        .collect();
    let mut mesh = lathe(&arc, around, 2.0);
    let length = PI * radius;
    mesh.uvs.iter_mut().for_each(|t| t.y /= length);
    mesh
}

/// The (2, 3) torus knot, its lowest point near the origin.
fn torus_knot() -> Mesh {
    let curve = |t: f64| {
        let a = t * TAU;
        let r = 0.075 + 0.034 * (3.0 * a).cos();
        dvec3(
            r * (2.0 * a).cos(),
            0.125 + r * (2.0 * a).sin(),
            0.042 * (3.0 * a).sin(),
        )
    };
    let e = 1e-3;
    let knot = tube(
        curve,
        |_| 0.0165,
        |t| curve(t + e) + curve(t - e) - 2.0 * curve(t),
        14,
        130,
        true,
    );
    with_normals(&knot, 80.0)
}

/// A teapot: body and lid of revolution, spout and handle as tubes.
fn teapot() -> Mesh {
    let body = smooth_profile(
        &[
            (0.0, 0.0),
            (0.07, 0.0),
            (0.075, 0.012),
            (0.105, 0.05),
            (0.118, 0.085),
            (0.10, 0.13),
            (0.068, 0.155),
            (0.066, 0.162),
        ],
        4,
    );
    let lid = smooth_profile(
        &[
            (0.070, 0.160),
            (0.071, 0.166),
            (0.055, 0.178),
            (0.022, 0.19),
            (0.009, 0.197),
            (0.016, 0.208),
            (0.013, 0.220),
            (0.0, 0.224),
        ],
        4,
    );
    let bezier = |p: [DVec3; 4]| {
        move |t: f64| {
            let s = 1.0 - t;
            p[0] * (s * s * s) + p[1] * (3.0 * s * s * t) + p[2] * (3.0 * s * t * t) + p[3] * (t * t * t)
        }
    };
    let spout = bezier([
        dvec3(0.09, 0.055, 0.0),
        dvec3(0.175, 0.06, 0.0),
        dvec3(0.14, 0.14, 0.0),
        dvec3(0.195, 0.165, 0.0),
    ]);
    let spout = tube(spout, |t| 0.026 - 0.014 * t, |_| DVec3::Z, 16, 20, false);
    let handle = bezier([
        dvec3(-0.085, 0.135, 0.0),
        dvec3(-0.20, 0.175, 0.0),
        dvec3(-0.20, 0.04, 0.0),
        dvec3(-0.10, 0.048, 0.0),
    ]);
    let handle = tube(handle, |_| 0.0105, |_| DVec3::Z, 12, 26, false);
    with_normals(
        &join(&[lathe(&body, 48, 1.0), lathe(&lid, 40, 1.0), spout, handle]),
        50.0,
    )
}

/// A bowl with an inside and an outside, 0.28 m wide.
fn bowl() -> Mesh {
    let mut outline = smooth_profile(
        &[
            (0.0, 0.006),
            (0.05, 0.006),
            (0.052, 0.0),
            (0.06, 0.0),
            (0.062, 0.012),
            (0.105, 0.045),
            (0.14, 0.10),
        ],
        3,
    );
    outline.extend([(0.1405, 0.104), (0.138, 0.106), (0.135, 0.104)]);
    outline.extend(smooth_profile(
        &[(0.133, 0.10), (0.10, 0.05), (0.06, 0.022), (0.0, 0.018)],
        4,
    ));
    with_normals(&lathe(&outline, 48, 1.0), 40.0)
}

/// A shallow plate that leans: its texture lies flat over it, so that the dents are round.
fn plate() -> Mesh {
    let mut outline = smooth_profile(&[(0.0, 0.0), (0.10, 0.0), (0.15, 0.012), (0.19, 0.030)], 3);
    outline.extend([(0.192, 0.034), (0.188, 0.035)]);
    outline.extend(smooth_profile(
        &[(0.186, 0.034), (0.148, 0.017), (0.10, 0.006), (0.0, 0.006)],
        3,
    ));
    let mut mesh = lathe(&outline, 56, 1.0);
    mesh.uvs = mesh.positions.iter().map(|p| dvec2(p.x, p.z) / 0.25).collect();
    with_normals(&mesh, 40.0)
}

/// A closed book lying on its back cover: (covers with the front's texture on top, block of pages).
fn book() -> (Mesh, Mesh) {
    let board = |low: DVec3, high: DVec3| {
        let mut b = cuboid(low, high);
        // Top and bottom show the whole cover, the rims a bit of plain cloth (its margin outside the golden frame).
        b.uvs = b
            .positions
            .iter()
            .enumerate()
            .map(|(i, p)| {
                if (8..16).contains(&i) {
                    dvec2(p.x / 0.17 + 0.5, p.z / 0.24 + 0.5)
                } else {
                    DVec2::splat(0.02)
                }
            })
            .collect();
        b
    };
    let cover = join(&[
        board(dvec3(-0.085, 0.0, -0.12), dvec3(0.085, 0.004, 0.12)),
        board(dvec3(-0.085, 0.036, -0.12), dvec3(0.085, 0.040, 0.12)),
        board(dvec3(-0.085, 0.004, -0.12), dvec3(-0.081, 0.036, 0.12)),
    ]);
    let pages = cuboid(dvec3(-0.081, 0.004, -0.115), dvec3(0.080, 0.036, 0.115));
    (with_normals(&cover, 10.0), with_normals(&pages, 10.0))
}

/// A vase with spiral lobes, coloured by height with vertex colours.
fn vase() -> Mesh {
    let outline = smooth_profile(
        &[
            (0.0, 0.0),
            (0.045, 0.0),
            (0.05, 0.01),
            (0.08, 0.09),
            (0.075, 0.16),
            (0.034, 0.235),
            (0.03, 0.27),
            (0.045, 0.30),
        ],
        4,
    );
    let mut outline = outline;
    outline.extend([(0.042, 0.302), (0.027, 0.27), (0.0, 0.26)]);
    let body = lathe_with(&outline, 60, 1.0, |angle, y, r| {
        let lobes = (y * (0.28 - y)).max(0.0) * 51.0;
        r * (1.0 + 0.05 * lobes * (6.0 * angle + 14.0 * y).cos())
    });
    let mut mesh = with_normals(&Mesh { uvs: vec![], ..body }, 50.0);
    mesh.colors = mesh
        .positions
        .iter()
        // Rounded, so that the last bit of a power cannot reach the file.
        .map(|p| {
            pattern::glaze(p.y / 0.30)
                .to_array()
                .map(|c| (c * 65536.0).round() as f32 / 65536.0)
        })
        .collect();
    mesh
}

/// A turned table leg.
fn leg() -> Mesh {
    let outline = smooth_profile(
        &[
            (0.0, 0.0),
            (0.022, 0.0),
            (0.026, 0.03),
            (0.018, 0.07),
            (0.022, 0.12),
            (0.034, 0.35),
            (0.030, 0.52),
            (0.022, 0.58),
            (0.036, 0.62),
            (0.036, 0.71),
        ],
        3,
    );
    with_normals(&lathe(&outline, 16, 1.0), 50.0)
}

fn add_room(glb: &mut Glb, planks: TextureRef) {
    let brick = TextureRef::new(glb.add_texture("brick", &pattern::brick_color(256)));
    let relief = TextureRef::new(glb.add_texture("brick normals", &pattern::brick_normal(256)));
    let brick = glb.add_material(&Material {
        base_color_texture: Some(brick),
        normal_texture: Some(relief),
        roughness: 0.9,
        ..matt("Brick", [1.0; 3])
    });
    let floor = glb.add_material(&Material {
        base_color_texture: Some(planks),
        roughness: 0.35,
        ..matt("Polished boards", [0.9, 0.9, 0.9])
    });
    let left = glb.add_material(&matt("Ochre wall", [0.75, 0.50, 0.18]));
    let right = glb.add_material(&matt("Blue wall", [0.16, 0.30, 0.55]));
    let ceiling = glb.add_material(&matt("Ceiling", [0.80, 0.80, 0.78]));
    // 3.2 m wide, 2.4 m high, 2.6 m deep, open towards +z.
    let (x, y, back, front) = (1.6, 2.4, -1.2, 1.4);
    let p = dvec3;
    let walls = [
        (
            "Floor",
            quad(
                p(-x, 0.0, front),
                p(x, 0.0, front),
                p(x, 0.0, back),
                p(-x, 0.0, back),
            ),
            floor,
            1.2,
        ),
        (
            "Ceiling",
            quad(p(-x, y, back), p(x, y, back), p(x, y, front), p(-x, y, front)),
            ceiling,
            1.0,
        ),
        (
            "Back wall",
            quad(p(-x, 0.0, back), p(x, 0.0, back), p(x, y, back), p(-x, y, back)),
            brick,
            0.8,
        ),
        (
            "Left wall",
            quad(
                p(-x, 0.0, front),
                p(-x, 0.0, back),
                p(-x, y, back),
                p(-x, y, front),
            ),
            left,
            1.0,
        ),
        (
            "Right wall",
            quad(p(x, 0.0, back), p(x, 0.0, front), p(x, y, front), p(x, y, back)),
            right,
            1.0,
        ),
    ];
    for (name, mesh, material, tile) in walls {
        let mesh = glb.add_mesh(name, &[(&with_normals(&tiled(mesh, tile), 10.0), material)]);
        glb.add_node(name, mesh, Placement::HERE);
    }
}

/// The table of objects.
pub fn table() -> Glb {
    let mut glb = Glb::new();
    let planks = glb.add_texture("planks", &pattern::planks(256));
    add_room(&mut glb, TextureRef::new(planks));

    // The table's top turns and shrinks the floor's boards.
    let turned = TextureRef {
        texture: planks,
        transform: Some(([0.25, 0.1], 0.5 * PI, [1.6, 1.6])),
    };
    let top = glb.add_material(&Material {
        base_color_texture: Some(turned),
        roughness: 0.25,
        ..matt("Table top", [0.92, 0.80, 0.66])
    });
    let dark = glb.add_material(&Material {
        roughness: 0.4,
        ..matt("Dark wood", [0.16, 0.08, 0.045])
    });
    let board = with_normals(
        &cuboid(dvec3(-0.85, TOP - 0.04, -0.45), dvec3(0.85, TOP, 0.45)),
        10.0,
    );
    let board = glb.add_mesh("Table top", &[(&board, top)]);
    glb.add_node("Table top", board, Placement::HERE);
    let post = glb.add_mesh("Leg", &[(&leg(), dark)]);
    for (x, z) in [(-0.78, -0.38), (0.78, -0.38), (0.78, 0.38), (-0.78, 0.38)] {
        glb.add_node("Leg", post, Placement::at(x, 0.0, z));
    }

    let mut metal = |name, rgb: [f64; 3], roughness| {
        glb.add_material(&Material {
            metallic: 1.0,
            roughness,
            ..matt(name, rgb)
        })
    };
    let chrome = metal("Chrome", [0.55, 0.556, 0.554], 0.04);
    let gold = metal("Gold", [1.0, 0.766, 0.336], 0.25);
    let brass = metal("Brushed brass", [0.88, 0.70, 0.38], 0.5);
    let mut glossy = |name, rgb: [f64; 3], roughness| {
        glb.add_material(&Material {
            roughness,
            ..matt(name, rgb)
        })
    };
    let ceramic = glossy("Blue ceramic", [0.06, 0.14, 0.45], 0.12);
    let porcelain = glossy("Porcelain", [0.85, 0.84, 0.80], 0.2);
    let orange = glossy("Orange", [0.85, 0.33, 0.04], 0.45);
    let lime = glossy("Lime", [0.38, 0.58, 0.06], 0.4);
    let paper = glossy("Paper", [0.82, 0.78, 0.66], 1.0);
    let glaze = glossy("Glaze", [1.0, 1.0, 1.0], 0.15);
    let black = glossy("Black lacquer", [0.02, 0.02, 0.022], 0.1);

    let ball = sphere(0.09, 48);
    let chrome_ball = glb.add_mesh("Chrome sphere", &[(&with_normals(&ball, 60.0), chrome)]);
    glb.add_node("Chrome sphere", chrome_ball, Placement::at(0.10, TOP, 0.02));
    let small = glb.add_recolored("Brass sphere", chrome_ball, &[brass]);
    glb.add_node("Brass sphere", small, Placement::at(0.33, TOP, 0.24).scaled(0.45));
    let small = glb.add_recolored("Lacquer sphere", chrome_ball, &[black]);
    glb.add_node(
        "Lacquer sphere",
        small,
        Placement::at(-0.10, TOP, 0.30).scaled(0.5),
    );

    let worn_color = TextureRef::new(glb.add_texture("worn paint", &pattern::worn_color(128)));
    let worn_metal = TextureRef::new(glb.add_texture("worn metal", &pattern::worn_metal(128)));
    let worn = glb.add_material(&Material {
        base_color_texture: Some(worn_color),
        metallic: 1.0,
        metallic_roughness_texture: Some(worn_metal),
        ..matt("Worn paint", [1.0; 3])
    });
    let small = glb.add_recolored("Worn sphere", chrome_ball, &[worn]);
    glb.add_node(
        "Worn sphere",
        small,
        Placement::at(0.55, TOP, -0.10).turned(140.0),
    );

    let knot = glb.add_mesh("Torus knot", &[(&torus_knot(), gold)]);
    glb.add_node("Torus knot", knot, Placement::at(-0.64, TOP, 0.06).turned(25.0));
    // The mirror image of the knot, in brass: a node of negative scale.
    let mirrored = glb.add_recolored("Mirrored knot", knot, &[brass]);
    let place = Placement::at(0.70, TOP, 0.22).turned(-30.0);
    glb.add_node(
        "Mirrored knot",
        mirrored,
        Placement {
            scale: dvec3(-0.7, 0.7, 0.7),
            ..place
        },
    );

    let pot = glb.add_mesh("Teapot", &[(&teapot(), ceramic)]);
    glb.add_node("Teapot", pot, Placement::at(-0.29, TOP, -0.06).turned(-25.0));
    let dish = glb.add_mesh("Bowl", &[(&bowl(), porcelain)]);
    glb.add_node("Bowl", dish, Placement::at(0.36, TOP, -0.02));
    let fruit = glb.add_mesh("Orange", &[(&with_normals(&sphere(0.04, 24), 60.0), orange)]);
    let green = glb.add_recolored("Lime", fruit, &[lime]);
    for (mesh, x, y, z, scale) in [
        (fruit, 0.33, 0.040, 0.01, 1.0),
        (fruit, 0.40, 0.042, -0.03, 0.98),
        (green, 0.385, 0.046, 0.045, 0.85),
        (fruit, 0.34, 0.044, -0.065, 0.95),
        (green, 0.365, 0.100, -0.015, 0.85),
    ] {
        glb.add_node("Fruit", mesh, Placement::at(x, TOP + y, z).scaled(scale));
    }

    let dents = TextureRef::new(glb.add_texture("hammered normals", &pattern::hammered_normal(256)));
    let copper = glb.add_material(&Material {
        metallic: 1.0,
        roughness: 0.28,
        normal_texture: Some(dents),
        ..matt("Hammered copper", [0.955, 0.60, 0.46])
    });
    let disc = glb.add_mesh("Hammered plate", &[(&plate(), copper)]);
    // Standing on its rim, leaning back at 72° against nothing but its stand.
    let lean = glam::DQuat::from_rotation_y(0.35) * glam::DQuat::from_rotation_x(72f64.to_radians());
    let place = Placement {
        rotation: lean,
        ..Placement::at(-0.58, TOP + 0.193, -0.26)
    };
    glb.add_node("Hammered plate", disc, place);

    let cover = TextureRef::new(glb.add_texture("book cover", &pattern::book_cover(128)));
    let cloth = glb.add_material(&Material {
        base_color_texture: Some(cover),
        roughness: 0.7,
        ..matt("Book cloth", [1.0; 3])
    });
    let (boards, pages) = book();
    let volume = glb.add_mesh("Book", &[(&boards, cloth), (&pages, paper)]);
    glb.add_node("Book", volume, Placement::at(-0.36, TOP, 0.27).turned(18.0));
    glb.add_node("Book", volume, Placement::at(0.10, TOP, -0.24).turned(80.0));
    let urn = glb.add_mesh("Vase", &[(&vase(), glaze)]);
    glb.add_node("Vase", urn, Placement::at(0.10, TOP + 0.04, -0.25));

    // A folding screen of lattice behind the objects: cut-out alpha, seen from both sides.
    let slats = TextureRef::new(glb.add_texture("lattice", &pattern::lattice(128)));
    let slats = glb.add_material(&Material {
        base_color_texture: Some(slats),
        alpha: Alpha::Mask(0.5),
        double_sided: true,
        ..matt("Lattice", [1.0; 3])
    });
    let panel = |x: f64, fold: f64| {
        let q = quad(
            dvec3(0.0, 0.0, 0.0),
            dvec3(0.24, 0.0, 0.0),
            dvec3(0.24, 0.48, 0.0),
            dvec3(0.0, 0.48, 0.0),
        );
        moved(crate::mesh::turned(tiled(q, 0.24), fold), dvec3(x, 0.0, 0.0))
    };
    let screen = with_normals(
        &join(&[panel(0.0, 20.0), panel(0.24 * 0.9397 + 0.01, -20.0)]),
        5.0,
    );
    let screen = glb.add_mesh("Lattice screen", &[(&screen, slats)]);
    glb.add_node("Lattice screen", screen, Placement::at(0.30, TOP, -0.30));

    // A bell of smoked glass (coverage 0.3) over a lime.
    let glass = glb.add_material(&Material {
        base_color: [0.20, 0.30, 0.28, 0.3],
        roughness: 0.05,
        alpha: Alpha::Blend,
        double_sided: true,
        ..matt("Smoked glass", [0.0; 3])
    });
    let bell = smooth_profile(
        &[
            (0.075, 0.0),
            (0.075, 0.07),
            (0.068, 0.11),
            (0.04, 0.145),
            (0.0, 0.155),
        ],
        4,
    );
    let knob = mapped(sphere(0.012, 12), |p| p + dvec3(0.0, 0.153, 0.0));
    let bell = glb.add_mesh(
        "Glass bell",
        &[(&with_normals(&join(&[lathe(&bell, 40, 1.0), knob]), 60.0), glass)],
    );
    glb.add_node("Glass bell", bell, Placement::at(0.62, TOP, 0.06).scaled(1.0));
    glb.add_node("Fruit", green, Placement::at(0.62, TOP, 0.06));

    // A clock whose dial glows: an emissive texture.
    let dial = TextureRef::new(glb.add_texture("dial", &pattern::glowing_dial(128)));
    let dial = glb.add_material(&Material {
        emission: [2.0, 5.0, 3.0],
        emissive_texture: Some(dial),
        roughness: 0.3,
        ..matt("Dial", [0.03, 0.03, 0.035])
    });
    let mut face = quad(
        dvec3(-0.06, 0.02, 0.0301),
        dvec3(0.06, 0.02, 0.0301),
        dvec3(0.06, 0.14, 0.0301),
        dvec3(-0.06, 0.14, 0.0301),
    );
    face.uvs
        .iter_mut()
        .for_each(|t| *t = dvec2(t.x / 0.12, 1.0 + t.y / 0.12));
    let body = cuboid(dvec3(-0.07, 0.0, -0.03), dvec3(0.07, 0.155, 0.03));
    let clock = glb.add_mesh(
        "Clock",
        &[
            (&with_normals(&body, 10.0), dark),
            (&with_normals(&face, 10.0), dial),
        ],
    );
    glb.add_node("Clock", clock, Placement::at(-0.02, TOP, -0.33).turned(8.0));

    glb.add_camera(
        "Camera",
        dvec3(0.12, 1.42, 1.75),
        dvec3(0.03, 0.84, -0.10),
        36.0,
        16.0 / 9.0,
    );
    glb
}

/// A panel with a small globe; a spot that sweeps; the room with a window around.
pub fn sequences() -> Vec<(&'static str, Vec<u8>)> {
    let panel = json!({ "name": "panel", "type": "rect", "center": [0.2, 2.38, 0.1],
        "edge_u": [0.9, 0.0, 0.0], "edge_v": [0.0, 0.0, 0.5], "radiance": [24.0, 23.0, 21.0] });
    let globe = json!({ "name": "globe", "type": "sphere", "center": [-0.95, 1.25, 0.1], "radius": 0.05,
        "radiance": [75.0, 52.0, 28.0] });
    let sweep = [(0, json!([-0.35, -1.0, -0.45])), (23, json!([0.35, -1.0, -0.40]))];
    let spot = json!({ "name": "spot", "type": "spot", "position": [0.0, 2.2, 0.8], "direction": keys("linear", &sweep),
        "inner_angle_deg": 14, "outer_angle_deg": 24, "intensity": [40.0, 38.0, 34.0] });
    let glow = json!({ "name": "dial", "type": "emissive", "material": "Dial", "scale": 1 });
    let surroundings = json!({ "name": "room", "type": "environment", "file": "window.hdr", "scale": 2.0,
        "rotation_deg": 0 });
    let fill = point("fill", json!([1.2, 1.9, 1.2]), [0.4, 0.5, 0.7]);
    vec![
        (
            "table.lights.json",
            sequence(1, None, &[panel, globe, glow.clone()]),
        ),
        ("table_spot.lights.json", sequence(24, None, &[spot, fill, glow])),
        ("table_window.lights.json", sequence(1, None, &[surroundings])),
        ("table_materials.json", MATERIAL_EDITS.as_bytes().to_vec()),
    ]
}

/// Edits of the table's materials over the 24 frames of its spot light: every model, keys, a bump map, a texture
/// taken away. Texture 0 of an asset is the bricks' colour.
const MATERIAL_EDITS: &str = r#"{ "relight_materials": 1, "edits": [
  { "material": "Blue ceramic", "model": "phong", "base_color": [0.30, 0.03, 0.03], "specular": 0.25,
    "exponent": {"keys": [[0, 30], [23, 400]]} },
  { "material": "Hammered copper", "model": "ward", "base_color": [0.05, 0.03, 0.02], "specular": [0.85, 0.55, 0.42],
    "normal_texture": null, "roughness_u": 0.25, "roughness_v": 0.6, "rotation_deg": 30 },
  { "material": "Chrome", "roughness": {"keys": [[0, 0.05], [23, 0.5]], "interpolation": "linear"} },
  { "material": "Porcelain", "model": "lambert", "base_color": [0.20, 0.45, 0.25] },
  { "material": "Brick", "base_color_texture": null, "base_color": 0.7, "normal_texture": null,
    "bump_texture": 0, "bump_scale": 0.006 } ] }
"#;
