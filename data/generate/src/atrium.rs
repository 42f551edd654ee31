//! The atrium: a courtyard of five by three bays under the open sky, with arcades on two storeys, galleries behind them,
//! a fountain, curtains and banners. The scene of the demo.
//!
//! The columns' axes stand on a rectangle of 15 m × 9 m (bays of 3 m), the galleries are 3.2 m deep, the walls end at
//! 10.3 m. Long side along x. Everything that repeats is one mesh drawn by many nodes.

use crate::columns::{arch_wall, archivolt, balustrade, column, pedestal, pier};
use crate::furnishing::{banner, curtain, fountain, sculpture, topiary, urn, water};
use crate::glb::{Glb, Material, Placement, TextureRef, matt};
use crate::mesh::{Mesh, cuboid, join, moulding_inside, quad, tiled, with_normals};
use crate::sequence::{keys, point, sequence};
use crate::texture;
use glam::dvec3;
use serde_json::{Value, json};

/// Half the rectangle of the columns' axes, metres.
const COURT: (f64, f64) = (7.5, 4.5);
/// Half the rectangle of the outer walls.
const OUTER: (f64, f64) = (10.7, 7.7);
/// Thickness of the arcades' walls.
const ARCADE: f64 = 0.5;
/// Height of the galleries' floor over the courtyard's.
const STEP: f64 = 0.15;
/// Springing of the lower arches, the upper floor, springing of the upper arches, top of the walls.
const LOWER_SPRING: f64 = 3.45;
const UPPER_FLOOR: f64 = 5.35;
const UPPER_SPRING: f64 = 8.45;
const TOP: f64 = 10.3;
/// Radius of the columns: the abaci, 2.6 radii wide, leave an opening of 2.36 m and 2.48 m.
const LOWER_RADIUS: f64 = 0.245;
const UPPER_RADIUS: f64 = 0.20;
/// Metres that one repetition of the stone textures covers.
const TILE: f64 = 2.0;

/// A horizontal ring between two rectangles of half-sizes, facing up or down.
fn ring(inner: (f64, f64), outer: (f64, f64), y: f64, up: bool) -> Mesh {
    let mut parts = vec![];
    let corner = |r: (f64, f64), k: usize| {
        let (sx, sz) = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)][k % 4];
        dvec3(sx * r.0, y, sz * r.1)
    };
    for k in 0..4 {
        let (a, b, c, d) = (
            corner(outer, k),
            corner(outer, k + 1),
            corner(inner, k + 1),
            corner(inner, k),
        );
        let mut part = if up { quad(d, c, b, a) } else { quad(a, b, c, d) };
        part.uvs = part.positions.iter().map(|p| glam::dvec2(p.x, p.z)).collect();
        parts.push(part);
    }
    join(&parts)
}

/// The places of the sixteen bays, as (middle x, middle z, degrees that turn +z towards the courtyard).
fn bays() -> Vec<(f64, f64, f64)> {
    let mut out = vec![];
    for k in 0..5 {
        let x = 3.0 * f64::from(k) - 6.0;
        out.extend([(x, -COURT.1, 0.0), (x, COURT.1, 180.0)]);
    }
    for k in 0..3 {
        let z = 3.0 * f64::from(k) - 3.0;
        out.extend([(-COURT.0, z, 90.0), (COURT.0, z, -90.0)]);
    }
    out
}

/// The places of the twelve columns, with the same turn; the four corners have piers.
fn column_places() -> Vec<(f64, f64, f64)> {
    let mut out = vec![];
    for x in [-4.5, -1.5, 1.5, 4.5] {
        out.extend([(x, -COURT.1, 0.0), (x, COURT.1, 180.0)]);
    }
    for z in [-1.5, 1.5] {
        out.extend([(-COURT.0, z, 90.0), (COURT.0, z, -90.0)]);
    }
    out
}

const CORNERS: [(f64, f64); 4] = [(-7.5, -4.5), (7.5, -4.5), (7.5, 4.5), (-7.5, 4.5)];

struct Palette {
    ashlar: usize,
    trim: usize,
    marble: usize,
    court: usize,
    gallery: usize,
    plaster: usize,
    dado: usize,
    painted: usize,
    wood: usize,
    roof: usize,
    crimson: usize,
    blue: usize,
    ochre: usize,
    gold: usize,
    water: usize,
    bronze: usize,
    clay: usize,
    leaf: usize,
}

fn palette(glb: &mut Glb) -> Palette {
    let stone = TextureRef::new(glb.add_texture("stone", &texture::stone(256)));
    let marble = TextureRef::new(glb.add_texture("marble", &texture::marble(256)));
    let ashlar = TextureRef::new(glb.add_texture("ashlar", &texture::ashlar(512)));
    let tiles = TextureRef::new(glb.add_texture("tiles", &texture::octagon_tiles(512)));
    let fabric = TextureRef::new(glb.add_texture("damask", &texture::damask(256)));
    let mut textured = |name, rgb, t: TextureRef| {
        glb.add_material(&Material {
            base_color_texture: Some(t),
            ..matt(name, rgb)
        })
    };
    let ashlar = textured("Ashlar", [0.94, 0.84, 0.68], ashlar);
    let trim = textured("Limestone", [0.96, 0.90, 0.78], stone);
    let marble = textured("Marble", [0.93, 0.90, 0.84], marble);
    let gallery = textured("Terracotta floor", [0.66, 0.40, 0.27], stone);
    let plaster = textured("Plaster", [0.96, 0.80, 0.55], stone);
    let dado = textured("Red dado", [0.62, 0.17, 0.10], stone);
    let painted = textured("Painted ceiling", [0.36, 0.50, 0.62], stone);
    let roof = textured("Roof", [0.62, 0.32, 0.20], stone);
    let clay = textured("Clay", [0.72, 0.36, 0.20], stone);
    let mut cloth = |name, rgb| {
        let material = Material {
            base_color_texture: Some(fabric),
            double_sided: true,
            ..matt(name, rgb)
        };
        glb.add_material(&material)
    };
    let crimson = cloth("Crimson cloth", [0.78, 0.06, 0.06]);
    let blue = cloth("Blue cloth", [0.07, 0.17, 0.62]);
    let ochre = cloth("Ochre cloth", [0.92, 0.52, 0.08]);
    Palette {
        ashlar,
        trim,
        marble,
        court: glb.add_material(&Material {
            base_color_texture: Some(tiles),
            roughness: 0.6,
            ..matt("Tiles", [0.95, 0.95, 0.95])
        }),
        gallery,
        plaster,
        dado,
        painted,
        wood: glb.add_material(&Material {
            roughness: 0.7,
            ..matt("Wood", [0.20, 0.115, 0.06])
        }),
        roof,
        crimson,
        blue,
        ochre,
        gold: glb.add_material(&Material {
            double_sided: true,
            ..matt("Gold trim", [0.85, 0.60, 0.20])
        }),
        water: glb.add_material(&Material {
            roughness: 0.1,
            ..matt("Water", [0.05, 0.16, 0.17])
        }),
        bronze: glb.add_material(&Material {
            roughness: 0.45,
            ..matt("Patina", [0.30, 0.46, 0.38])
        }),
        clay,
        leaf: glb.add_material(&matt("Leaf", [0.14, 0.27, 0.06])),
    }
}

/// Floors, ceilings, outer walls, cornices: what is built once.
fn add_shell(glb: &mut Glb, m: &Palette) {
    let (inner, axis) = ((COURT.0 - 0.5 * ARCADE, COURT.1 - 0.5 * ARCADE), COURT);
    let kerb = (COURT.0 - 0.42, COURT.1 - 0.42);
    let court = {
        let (x, z) = kerb;
        let mut floor = quad(
            dvec3(-x, 0.0, z),
            dvec3(x, 0.0, z),
            dvec3(x, 0.0, -z),
            dvec3(-x, 0.0, -z),
        );
        floor.uvs = floor.positions.iter().map(|p| glam::dvec2(p.x, p.z)).collect();
        floor
    };
    let lower_wall = [(0.0, 1.25), (0.0, UPPER_FLOOR - 0.35)];
    let upper_wall = [(0.0, UPPER_FLOOR + 1.15), (0.0, TOP - 0.35)];
    let walls = |profile: &[(f64, f64)]| moulding_inside(OUTER.0, OUTER.1, profile);
    let rail = |y: f64| {
        [
            (0.0, y),
            (0.03, y + 0.01),
            (0.05, y + 0.05),
            (0.05, y + 0.09),
            (0.02, y + 0.12),
            (0.0, y + 0.12),
        ]
    };
    let skirting = |y: f64| [(0.04, y), (0.04, y + 0.16), (0.02, y + 0.2), (0.0, y + 0.2)];
    let crown = |y: f64| {
        [
            (0.0, y - 0.30),
            (0.03, y - 0.28),
            (0.03, y - 0.2),
            (0.10, y - 0.08),
            (0.14, y - 0.06),
            (0.14, y),
        ]
    };
    // The cornices towards the courtyard: architrave, cyma, corona; (projection from the wall's face, height).
    let cornice = |y: f64| {
        [
            (0.0, y - 0.42),
            (0.03, y - 0.40),
            (0.03, y - 0.30),
            (0.06, y - 0.28),
            (0.06, y - 0.20),
            (0.11, y - 0.14),
            (0.19, y - 0.11),
            (0.19, y - 0.04),
            (0.23, y - 0.02),
            (0.23, y),
            (0.0, y),
        ]
    };
    let frieze = |y: f64| {
        [
            (0.0, y - 0.72),
            (0.04, y - 0.70),
            (0.04, y - 0.63),
            (0.0, y - 0.60),
        ]
    };
    let parts: [(&str, Mesh, usize); 10] = [
        ("Courtyard floor", court, m.court),
        (
            "Kerb",
            join(&[
                moulding_inside(kerb.0, kerb.1, &[(0.0, 0.0), (0.0, STEP - 0.02), (-0.02, STEP)]),
                ring(
                    (kerb.0 + 0.02, kerb.1 + 0.02),
                    (COURT.0 + 0.42, COURT.1 + 0.42),
                    STEP,
                    true,
                ),
            ]),
            m.trim,
        ),
        (
            "Lower gallery floor",
            ring((COURT.0 + 0.42, COURT.1 + 0.42), OUTER, STEP, true),
            m.gallery,
        ),
        (
            "Upper gallery floor",
            ring(inner, OUTER, UPPER_FLOOR, true),
            m.gallery,
        ),
        (
            "Ceilings",
            join(&[
                ring(axis, OUTER, UPPER_FLOOR - 0.35, false),
                ring(axis, OUTER, TOP - 0.35, false),
            ]),
            m.painted,
        ),
        ("Roof", ring(inner, OUTER, TOP, true), m.roof),
        (
            "Walls",
            join(&[walls(&lower_wall), walls(&upper_wall)]),
            m.plaster,
        ),
        (
            "Dado",
            join(&[
                walls(&[(0.0, STEP + 0.2), (0.0, 1.25)]),
                walls(&[(0.0, UPPER_FLOOR + 0.2), (0.0, UPPER_FLOOR + 1.15)]),
            ]),
            m.dado,
        ),
        (
            "Gallery mouldings",
            join(&[
                walls(&skirting(STEP)),
                walls(&rail(1.25)),
                walls(&crown(UPPER_FLOOR - 0.35)),
                walls(&skirting(UPPER_FLOOR)),
                walls(&rail(UPPER_FLOOR + 1.15)),
                walls(&crown(TOP - 0.35)),
            ]),
            m.trim,
        ),
        (
            "Cornices",
            join(&[
                moulding_inside(inner.0, inner.1, &cornice(UPPER_FLOOR)),
                moulding_inside(inner.0, inner.1, &cornice(TOP)),
                moulding_inside(inner.0, inner.1, &frieze(UPPER_FLOOR)),
                moulding_inside(inner.0, inner.1, &frieze(TOP)),
            ]),
            m.trim,
        ),
    ];
    for (name, mesh, material) in parts {
        let mesh = glb.add_mesh(name, &[(&with_normals(&tiled(mesh, TILE), 20.0), material)]);
        glb.add_node(name, mesh, Placement::HERE);
    }
}

/// Arches, columns, balustrades, pilasters with beams: what repeats.
fn add_arcades(glb: &mut Glb, m: &Palette) {
    let finish = |mesh: Mesh| tiled(mesh, TILE);
    let mut bay = |name: &str, r: f64, spring: f64, base: f64, top: f64| {
        // An arch's mesh starts at its storey's floor, so that its node has a height of its own.
        let wall = finish(arch_wall(1.5, ARCADE, r, spring - base, top - base, 20));
        let ring = finish(archivolt(r, spring - base, 0.5 * ARCADE, 20));
        glb.add_mesh(name, &[(&wall, m.ashlar), (&ring, m.trim)])
    };
    let lower_arch = bay(
        "Lower arch",
        1.5 - 1.30 * LOWER_RADIUS,
        LOWER_SPRING,
        0.0,
        UPPER_FLOOR,
    );
    let upper_arch = bay(
        "Upper arch",
        1.5 - 1.30 * UPPER_RADIUS,
        UPPER_SPRING,
        UPPER_FLOOR,
        TOP,
    );
    let mut single =
        |name: &str, mesh: Mesh, material: usize| glb.add_mesh(name, &[(&finish(mesh), material)]);
    let pedestal_height = 0.95;
    let upper_height = UPPER_SPRING - UPPER_FLOOR - pedestal_height;
    let lower = single(
        "Lower column",
        column(LOWER_SPRING - STEP, LOWER_RADIUS, Some(18), 0),
        m.marble,
    );
    let upper = single(
        "Upper column",
        column(upper_height, UPPER_RADIUS, None, 24),
        m.marble,
    );
    let lower_pier = single("Lower pier", pier(LOWER_SPRING - STEP, LOWER_RADIUS), m.trim);
    let upper_pier = single("Upper pier", pier(upper_height, UPPER_RADIUS), m.trim);
    let stand = single("Pedestal", pedestal(pedestal_height, UPPER_RADIUS), m.trim);
    let rail = single("Balustrade", balustrade(1.5 - 1.42 * UPPER_RADIUS, 7), m.trim);

    // A pilaster on the outer wall and a beam from it to the arcade, seen from the column: z from the axis outwards.
    let depth = OUTER.0 - COURT.0;
    let bay_rib = |height: f64| {
        let w = 0.22;
        let block = |y0: f64, y1: f64, more: f64| {
            cuboid(
                dvec3(-w - more, y0, -depth),
                dvec3(w + more, y1, -depth + 0.10 + more),
            )
        };
        let pilaster = join(&[
            block(0.0, 0.22, 0.04),
            block(0.22, height - 0.85, 0.0),
            block(height - 0.85, height - 0.78, 0.03),
            block(height - 0.78, height - 0.62, 0.0),
            block(height - 0.62, height - 0.50, 0.03),
            block(height - 0.50, height - 0.38, 0.07),
        ]);
        let beam = cuboid(dvec3(-0.15, height - 0.38, -depth), dvec3(0.15, height, -0.2));
        (with_normals(&pilaster, 10.0), with_normals(&beam, 10.0))
    };
    let mut rib = |name: &str, height: f64| {
        let (pilaster, beam) = bay_rib(height);
        glb.add_mesh(
            name,
            &[(&tiled(pilaster, TILE), m.trim), (&tiled(beam, TILE), m.wood)],
        )
    };
    let lower_rib = rib("Lower rib", UPPER_FLOOR - 0.35 - STEP);
    let upper_rib = rib("Upper rib", TOP - 0.35 - UPPER_FLOOR);

    for (x, z, turn) in bays() {
        let place = Placement::at(x, 0.0, z).turned(turn);
        let up = Placement::at(0.0, UPPER_FLOOR, 0.0);
        glb.add_group(
            "Bay",
            place,
            &[(lower_arch, Placement::HERE), (upper_arch, up), (rail, up)],
        );
    }
    for (x, z, turn) in column_places() {
        let place = Placement::at(x, 0.0, z).turned(turn);
        let children = [
            (lower, Placement::at(0.0, STEP, 0.0)),
            (stand, Placement::at(0.0, UPPER_FLOOR, 0.0)),
            (upper, Placement::at(0.0, UPPER_FLOOR + pedestal_height, 0.0)),
            (lower_rib, Placement::at(0.0, STEP, 0.0)),
            (upper_rib, Placement::at(0.0, UPPER_FLOOR, 0.0)),
        ];
        glb.add_group("Column", place, &children);
    }
    for (x, z) in CORNERS {
        let children = [
            (lower_pier, Placement::at(0.0, STEP, 0.0)),
            (stand, Placement::at(0.0, UPPER_FLOOR, 0.0)),
            (upper_pier, Placement::at(0.0, UPPER_FLOOR + pedestal_height, 0.0)),
        ];
        glb.add_group("Corner", Placement::at(x, 0.0, z), &children);
    }
}

/// Curtains, banners, the fountain, urns with clipped trees, doors.
fn add_furnishing(glb: &mut Glb, m: &Palette) {
    let (cloth, trim, rod) = curtain(LOWER_SPRING - STEP - 0.10);
    let crimson = glb.add_mesh(
        "Crimson curtain",
        &[(&cloth, m.crimson), (&trim, m.gold), (&rod, m.wood)],
    );
    let blue = glb.add_recolored("Blue curtain", crimson, &[m.blue, m.gold, m.wood]);
    let ochre = glb.add_recolored("Ochre curtain", crimson, &[m.ochre, m.gold, m.wood]);
    let hung = [
        (-3.0, -COURT.1, 0.0, crimson),
        (3.0, -COURT.1, 0.0, crimson),
        (0.0, COURT.1, 180.0, blue),
        (-6.0, COURT.1, 180.0, ochre),
        (6.0, COURT.1, 180.0, ochre),
        (COURT.0, -3.0, -90.0, blue),
        (COURT.0, 3.0, -90.0, blue),
        (-COURT.0, 0.0, 90.0, crimson),
    ];
    for (x, z, turn, mesh) in hung {
        glb.add_node("Curtain", mesh, Placement::at(x, STEP, z).turned(turn));
    }

    let (cloth, trim) = banner();
    let blue = glb.add_mesh("Blue banner", &[(&cloth, m.blue), (&trim, m.gold)]);
    let crimson = glb.add_recolored("Crimson banner", blue, &[m.crimson, m.gold]);
    let ochre = glb.add_recolored("Ochre banner", blue, &[m.ochre, m.gold]);
    let hung = [
        (-6.0, -COURT.1, 0.0, ochre),
        (0.0, -COURT.1, 0.0, blue),
        (6.0, -COURT.1, 0.0, ochre),
        (-3.0, COURT.1, 180.0, crimson),
        (3.0, COURT.1, 180.0, crimson),
        (COURT.0, 0.0, -90.0, crimson),
    ];
    for (x, z, turn, mesh) in hung {
        glb.add_node(
            "Banner",
            mesh,
            Placement::at(x, UPPER_FLOOR + 0.96, z).turned(turn),
        );
    }

    let mesh = glb.add_mesh(
        "Fountain",
        &[
            (&tiled(fountain(), TILE), m.marble),
            (&water(), m.water),
            (&tiled(sculpture(), TILE), m.bronze),
        ],
    );
    glb.add_node("Fountain", mesh, Placement::HERE);

    let potted = glb.add_mesh("Urn", &[(&tiled(urn(), 1.0), m.clay), (&topiary(), m.leaf)]);
    for (x, z) in [
        (-4.5, -3.3),
        (-1.5, -3.3),
        (1.5, -3.3),
        (4.5, -3.3),
        (-4.5, 3.3),
        (-1.5, 3.3),
        (1.5, 3.3),
        (4.5, 3.3),
    ] {
        let scale = if x * x < 4.0 { 1.0 } else { 1.2 };
        glb.add_node(
            "Urn",
            potted,
            Placement::at(x, 0.0, z).turned(40.0 * x).scaled(scale),
        );
    }

    // Double doors in the middle of both ends: boards in a stone frame, seen along −x from the wall at x = 0.
    let board = |z0: f64, z1: f64, y0: f64, y1: f64, x: f64| cuboid(dvec3(-x, y0, z0), dvec3(0.0, y1, z1));
    let mut leaves = vec![board(-0.8, 0.8, 0.0, 2.7, 0.03)];
    for side in [-0.8, 0.0] {
        leaves.extend([
            board(side + 0.03, side + 0.11, 0.03, 2.67, 0.06),
            board(side + 0.69, side + 0.77, 0.03, 2.67, 0.06),
        ]);
        for y in [0.03, 0.85, 1.7, 2.57] {
            leaves.push(board(side + 0.11, side + 0.69, y, y + 0.10, 0.055));
        }
    }
    let frame = [
        board(-1.02, -0.8, 0.0, 2.7, 0.12),
        board(0.8, 1.02, 0.0, 2.7, 0.12),
        board(-1.02, 1.02, 2.7, 2.95, 0.12),
        board(-1.14, 1.14, 2.95, 3.07, 0.22),
    ];
    let door = glb.add_mesh(
        "Door",
        &[
            (&with_normals(&tiled(join(&leaves), TILE), 10.0), m.wood),
            (&with_normals(&tiled(join(&frame), TILE), 10.0), m.trim),
        ],
    );
    glb.add_node("Door", door, Placement::at(OUTER.0, STEP, 0.0));
    glb.add_node("Door", door, Placement::at(-OUTER.0, STEP, 0.0).turned(180.0));
}

/// The atrium of the demo.
pub fn atrium() -> Glb {
    let mut glb = Glb::new();
    let materials = palette(&mut glb);
    add_shell(&mut glb, &materials);
    add_arcades(&mut glb, &materials);
    add_furnishing(&mut glb, &materials);
    glb.add_camera(
        "Camera",
        dvec3(-6.9, 2.0, 1.9),
        dvec3(0.0, 2.75, -0.2),
        58.0,
        16.0 / 9.0,
    );
    glb.add_camera(
        "Gallery",
        dvec3(-7.75, 7.25, 0.3),
        dvec3(2.0, 4.0, -0.3),
        60.0,
        16.0 / 9.0,
    );
    glb
}

/// A torch carried through the arcades; the sun passing over; a lamp that stands still; a day of sun and sky.
pub fn sequences() -> Vec<(&'static str, Vec<u8>)> {
    // Along the court before the crimson curtains, round the fountain and back under the blue ones.
    let path = [
        (0, json!([-4.6, 2.2, -2.4])),
        (6, json!([-0.2, 2.6, -3.0])),
        (12, json!([4.8, 2.4, -1.2])),
        (18, json!([3.4, 3.0, 2.6])),
        (23, json!([-0.6, 2.6, 3.1])),
    ];
    let torch = point("torch", keys("cubic", &path), [62.0, 36.0, 15.0]);
    let lantern = point("lantern", json!([8.9, 7.6, 0.0]), [6.0, 9.0, 16.0]);
    // The sun's way from the east (+x) over the south (+z): degrees of azimuth from +x towards +z, and of height.
    let sun = |azimuth: f64, height: f64| {
        let (a, h) = (azimuth.to_radians(), height.to_radians());
        dvec3(h.cos() * a.cos(), h.sin(), h.cos() * a.sin())
    };
    let rounded = |d: glam::DVec3| -> Value {
        d.to_array()
            .iter()
            .map(|x| json!((x * 1e4).round() / 1e4))
            .collect()
    };
    let stops = [
        (0, 20.0, 48.0),
        (12, 75.0, 62.0),
        (23, 130.0, 66.0),
        (35, 170.0, 52.0),
    ];
    let travel: Vec<(u32, Value)> = stops.iter().map(|&(f, a, h)| (f, rounded(-sun(a, h)))).collect();
    let towards: Vec<(u32, Value)> = stops.iter().map(|&(f, a, h)| (f, rounded(sun(a, h)))).collect();
    let directional = json!({ "name": "sun", "type": "directional", "direction": keys("linear", &travel),
        "irradiance": [20.0, 18.0, 15.0] });
    let sky = json!({ "name": "sky", "type": "environment", "file": "sky.hdr", "scale": 1.0 });
    let day = json!({ "name": "day", "type": "sun_sky", "turbidity": 3, "sun_direction": keys("linear", &towards), "scale": 1.0 });
    vec![
        (
            "atrium.lights.json",
            sequence(24, Some(json!({ "node": "Camera" })), &[torch, lantern]),
        ),
        ("atrium_sun.lights.json", sequence(36, None, &[directional, sky])),
        (
            "atrium_point.lights.json",
            sequence(
                1,
                None,
                &[point("lamp", json!([0.5, 6.5, 0.8]), [80.0, 76.0, 68.0])],
            ),
        ),
        ("atrium_day.lights.json", sequence(36, None, &[day])),
    ]
}
