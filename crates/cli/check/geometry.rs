//! Triangles that are thin, flat, double, broken, few or none.

use super::case::{Case, Measure, Measured};
use super::sanity::sane;
use super::shapes::{LAMP, cuboid, faces, join, matt, point, quad, room, scene};
use super::stage::{SIZE, Stage, at_points, coarse, difference, mean, quick, seeds_apart};
use crate::output;
use crate::signals;
use glam::Vec3;
use relight_bake::error::BakeError;
use relight_scene::gltf::{ImportOptions, import};
use relight_scene::scene::{Mesh, Scene};
use relight_scene::traced::Shading;
use serde_json::json;

/// A closed box of one albedo, and what is added to its triangles.
fn walls(add: impl Fn(&mut Mesh)) -> Scene {
    let mut mesh = cuboid(Vec3::NEG_ONE, Vec3::ONE, true);
    add(&mut mesh);
    scene(
        vec![(mesh, matt(Vec3::splat(0.6)))],
        Vec3::new(0.5, 0.4, 0.8),
        Vec3::new(-0.2, -0.3, -0.4),
    )
}

const SAME: &str = "the same surface: twice what another seed changes, measured beside it";

/// The box with more triangles on or within its walls against the plain one.
fn same_as_plain(stage: &Stage, other: Scene) -> Measured {
    let tracks = [point(LAMP, 1.0)];
    let plain = stage.picture(walls(|_| {}), &coarse(), &tracks)?;
    let bound = seeds_apart(stage, || walls(|_| {}), &coarse(), &tracks, &plain)?;
    let lit = stage.picture(other, &coarse(), &tracks)?;
    let mut measures = sane(&lit);
    measures.extend([
        Measure::new(
            "direct light",
            difference(&lit.direct, &plain.direct),
            1e-3,
            "the same surface: pixels at its edges alone may see another triangle",
        ),
        Measure::new(
            "indirect light",
            difference(&lit.indirect, &plain.indirect),
            bound,
            SAME,
        ),
    ]);
    Ok(measures)
}

/// Each face split into a thousand triangles of 2 m by 2 mm, of which every other one shrinks to a millionth.
fn slivers() -> Scene {
    let mut mesh = Mesh::default();
    for face in faces(Vec3::NEG_ONE, Vec3::ONE, true) {
        let [a, b, d, c] = [0, 1, 2, 3].map(|i| face.positions[i]);
        let mut at = 0.0f32;
        for i in 0..500 {
            // Wide and needle-thin strips in turn.
            let end = if i == 499 {
                1.0
            } else {
                at + if i % 2 == 0 { 4e-3 } else { 1e-6 }
            };
            let end = end.min(1.0);
            let strip = [a.lerp(b, at), a.lerp(b, end), d.lerp(c, end), d.lerp(c, at)];
            join(&mut mesh, &quad(strip, 1));
            at = end;
        }
    }
    scene(
        vec![(mesh, matt(Vec3::splat(0.6)))],
        Vec3::new(0.5, 0.4, 0.8),
        Vec3::new(-0.2, -0.3, -0.4),
    )
}

/// A glTF file of the box in which the triangles `broken` have vertices that are no numbers.
fn through_gltf(stage: &Stage) -> Measured {
    let mut mesh = cuboid(Vec3::NEG_ONE, Vec3::ONE, true);
    for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let first = mesh.positions.len() as u32;
        mesh.positions
            .extend([Vec3::new(value, 0.0, 0.0), Vec3::Y, Vec3::splat(value)]);
        mesh.triangles.push([first, first + 1, first + 2]);
        mesh.triangles.push([0, 1, first]);
    }
    stage.at("scene: import");
    let folder = output::scratch().map_err(|e| e.to_string())?;
    let file = folder.path().join("broken.glb");
    let whole = signals::whole();
    std::fs::write(&file, glb(&mesh)).map_err(|e| e.to_string())?;
    drop(whole);
    let mut imported = import(&file, &ImportOptions::default()).map_err(|e| e.to_string())?;
    imported.materials = vec![matt(Vec3::splat(0.6))];
    let clean = walls(|_| {});
    imported.cameras = clean.cameras;
    same_as_plain(stage, imported)
}

/// A binary glTF file of one mesh.
fn glb(mesh: &Mesh) -> Vec<u8> {
    let mut bin: Vec<u8> = Vec::new();
    mesh.positions
        .iter()
        .flat_map(|p| p.to_array())
        .for_each(|x| bin.extend(x.to_le_bytes()));
    let positions = bin.len();
    mesh.triangles
        .iter()
        .flatten()
        .for_each(|i| bin.extend(i.to_le_bytes()));
    let (vertices, indices) = (mesh.positions.len(), mesh.triangles.len() * 3);
    // 5126: float; 5125: unsigned int.
    let root = json!({
        "asset": { "version": "2.0" },
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0 }],
        "materials": [{}],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 1, "material": 0 }] }],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "count": vertices, "type": "VEC3",
              "min": [-1.0, -1.0, -1.0], "max": [1.0, 1.0, 1.0] },
            { "bufferView": 1, "componentType": 5125, "count": indices, "type": "SCALAR" },
        ],
        "bufferViews": [
            { "buffer": 0, "byteLength": positions },
            { "buffer": 0, "byteOffset": positions, "byteLength": bin.len() - positions },
        ],
        "buffers": [{ "byteLength": bin.len() }],
    });
    let mut text = root.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut out = b"glTF".to_vec();
    out.extend(2u32.to_le_bytes());
    out.extend(((28 + text.len() + bin.len()) as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", &text), (b"BIN\0", &bin)] {
        out.extend((chunk.len() as u32).to_le_bytes());
        out.extend(kind);
        out.extend(chunk);
    }
    out
}

/// Vertices that are no numbers in a scene that no importer has cleaned: refused, not baked into a broken file.
fn broken_in_memory(stage: &Stage) -> Measured {
    let mut broken = walls(|_| {});
    broken.meshes[0].positions[0].x = f32::NAN;
    let asset = stage.asset(broken, Shading::Lambert, &coarse());
    let kept = match asset {
        Err(_) => 0,
        Ok(asset) => usize::from(relight_format::write_asset(&asset).is_ok()),
    };
    Ok(vec![Measure::none(
        "broken files written",
        kept,
        "a file holds finite numbers only",
    )])
}

/// One triangle in the open, and what lights it from both sides.
fn one_triangle(stage: &Stage) -> Measured {
    let mesh = Mesh {
        positions: vec![Vec3::ZERO, Vec3::X, Vec3::Z],
        triangles: vec![[0, 2, 1]],
        ..Mesh::default()
    };
    let scene = scene(
        vec![(mesh, matt(Vec3::splat(0.8)))],
        Vec3::new(0.3, 1.0, 0.3),
        Vec3::new(0.3, 0.0, 0.3001),
    );
    let player = stage.player(scene, &coarse())?;
    let shot = stage.shot(&player, SIZE)?;
    let lit = stage.lit(&player, &shot, &[point(Vec3::new(0.3, 0.5, 0.3), 1.0)])?;
    let mut measures = sane(&lit);
    let seen = shot.seen.hits.iter().flatten().count();
    let bare = lit.indirect.iter().filter(|v| **v != Vec3::ZERO).count();
    measures.extend([
        Measure::none(
            "pixels with indirect light",
            bare,
            "one plane lights nothing else",
        ),
        Measure::none(
            "pixels of it that are not lit",
            seen - lit_count(&lit.direct),
            "it faces the lamp",
        ),
        Measure::none(
            "triangle not seen",
            usize::from(seen == 0),
            "the camera looks at it",
        ),
    ]);
    Ok(measures)
}

fn lit_count(values: &[Vec3]) -> usize {
    values.iter().filter(|v| v.max_element() > 0.0).count()
}

/// Scenes that have nothing to light: typed errors or black images.
fn nothing(stage: &Stage) -> Measured {
    let eye = Vec3::new(0.0, 0.0, 5.0);
    let empty = stage.asset(scene(Vec::new(), eye, Vec3::ZERO), Shading::Lambert, &coarse());
    let flat = Mesh {
        positions: vec![Vec3::ZERO; 3],
        triangles: vec![[0, 1, 2]],
        ..Mesh::default()
    };
    let grey = || matt(Vec3::splat(0.5));
    let dots = stage.asset(
        scene(vec![(flat, grey())], eye, Vec3::ZERO),
        Shading::Lambert,
        &coarse(),
    );
    let named = |result: &Result<_, BakeError>| {
        usize::from(!matches!(result, Err(BakeError::NothingReachable { .. })))
    };
    // A quad behind the camera: importance finds it, the image doesn't.
    let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| Vec3::new(x, y, 9.0));
    let behind = quad(corners, 1);
    let scene = scene(vec![(behind, grey())], eye, Vec3::ZERO);
    let lit = stage.picture(scene, &coarse(), &[point(Vec3::new(0.0, 0.0, 7.0), 1.0)])?;
    let shown = lit_count(&lit.direct) + lit_count(&lit.indirect) + lit_count(&lit.emission);
    let mut measures = sane(&lit);
    measures.extend([
        Measure::none(
            "empty scene not refused by name",
            named(&empty),
            "nothing is reachable",
        ),
        Measure::none(
            "triangle of no area not refused by name",
            named(&dots),
            "nothing is reachable",
        ),
        Measure::none("lit pixels where nothing is seen", shown, "the camera looks away"),
    ]);
    Ok(measures)
}

/// Light behind a closed wall, over light before it; `thickness` of the wall between two rooms, metres.
fn thin_wall(stage: &Stage, thickness: f32) -> Measured {
    let mut rooms = cuboid(
        Vec3::new(-2.0, -1.0, -1.0),
        Vec3::new(-thickness / 2.0, 1.0, 1.0),
        true,
    );
    join(
        &mut rooms,
        &cuboid(
            Vec3::new(thickness / 2.0, -1.0, -1.0),
            Vec3::new(2.0, 1.0, 1.0),
            true,
        ),
    );
    let scene = scene(
        vec![(rooms, matt(Vec3::splat(0.6)))],
        Vec3::new(1.7, 0.5, 0.8),
        Vec3::new(0.2, -0.5, -0.5),
    );
    let mut params = quick();
    // Points in both rooms.
    params.viewpoints = vec![Vec3::new(1.7, 0.5, 0.8), Vec3::new(-1.7, 0.5, 0.8)];
    let player = stage.player(scene, &params)?;
    let light = at_points(stage, &player, &[point(Vec3::new(-1.0, 0.3, 0.0), 1.0)])?;
    let transfer = player.prepared.transfer.as_ref().ok_or("no points")?;
    let side = |far: bool| -> Vec<Vec3> {
        (light.indirect.iter().zip(&transfer.finest.positions))
            .filter(|(_, p)| (p.x < 0.0) == far)
            .map(|(e, _)| *e)
            .collect()
    };
    let lit = mean(&side(true)).x;
    let worst = side(false)
        .iter()
        .map(|e| e.abs().max_element())
        .fold(0.0, f32::max);
    Ok(vec![
        Measure::new(
            "mean light behind the wall",
            mean(&side(false)).abs().max_element() / lit,
            1e-4,
            "share of the lit room's mean; nothing is interpolated through a wall",
        ),
        Measure::new(
            "brightest place behind the wall",
            f64::from(worst) / lit,
            1e-3,
            "share of the lit room's mean",
        ),
    ])
}

/// All of them.
pub fn cases() -> Vec<Case> {
    let mut cases = vec![
        Case::new("geometry/slivers", true, "walls of needles are walls", |stage| {
            same_as_plain(stage, slivers())
        }),
        Case::new(
            "geometry/zero-area",
            false,
            "triangles without area change nothing",
            |stage| {
                let degenerate = |mesh: &mut Mesh| {
                    for i in 0..8u32 {
                        mesh.triangles.push([i, i, i + 1]);
                        mesh.triangles.push([i, i, i]);
                    }
                    let first = mesh.positions.len() as u32;
                    mesh.positions
                        .extend([Vec3::ZERO, Vec3::splat(0.25), Vec3::splat(0.5)]);
                    mesh.triangles.push([first, first + 1, first + 2]);
                };
                same_as_plain(stage, walls(degenerate))
            },
        ),
        Case::new(
            "geometry/duplicates",
            false,
            "every triangle twice is the same surface",
            |stage| same_as_plain(stage, walls(|mesh| mesh.triangles.extend(mesh.triangles.clone()))),
        ),
        Case::new(
            "geometry/coincident",
            true,
            "sheets back to back in one place are the same surface",
            |stage| {
                let back = |mesh: &mut Mesh| {
                    let flipped: Vec<[u32; 3]> = mesh.triangles.iter().map(|&[a, b, c]| [a, c, b]).collect();
                    mesh.triangles.extend(flipped);
                };
                same_as_plain(stage, walls(back))
            },
        ),
        Case::new(
            "geometry/not-finite",
            true,
            "triangles with NaN and infinite vertices are left out",
            through_gltf,
        ),
        Case::new(
            "geometry/not-finite/in-memory",
            false,
            "a scene that no importer cleaned makes no broken file",
            broken_in_memory,
        ),
        Case::new(
            "geometry/one-triangle",
            true,
            "one triangle is lit and lights nothing",
            one_triangle,
        ),
        Case::new(
            "geometry/nothing",
            true,
            "no surface, or none in view: an error or black",
            nothing,
        ),
        Case::new(
            "geometry/levels",
            false,
            "one level, twelve levels, two rays: light that is a number",
            levels,
        ),
    ];
    for thickness in [0.05f32, 0.01, 1e-4] {
        cases.push(Case::new(
            format!("geometry/thin-wall/{thickness}"),
            thickness == 0.01,
            "no light behind a closed wall, however thin",
            move |stage| thin_wall(stage, thickness),
        ));
    }
    cases
}

/// Bakes at the ends of what parameters allow.
fn levels(stage: &Stage) -> Measured {
    let mut measures = Vec::new();
    for (name, levels, sender_levels, radius, rays) in [
        ("one level", 1, 1, 0.3, 128),
        ("twelve levels", 12, 12, 90.0, 16),
        ("two rays", 3, 2, 0.5, 2),
        ("disks wider than the room", 2, 2, 50.0, 64),
    ] {
        let params = relight_bake::params::BakeParams {
            levels,
            sender_levels,
            coarse_radius: Some(radius),
            rays,
            ..quick()
        };
        let player = stage.player(room(), &params)?;
        let shot = stage.shot(&player, SIZE)?;
        let lit = stage.lit(&player, &shot, &[point(LAMP, 1.0)])?;
        measures.extend(
            sane(&lit)
                .into_iter()
                .filter(|m| m.bound == 0.0)
                .map(|m| Measure {
                    what: format!("{name}: {}", m.what),
                    ..m
                }),
        );
    }
    Ok(measures)
}
