//! The development scenes load as their README describes them. Independent truth: the counts and cameras in
//! the README of the folder, which come from trimesh, pygltflib and the glTF validator.

// Reason: it measures.
#![allow(clippy::disallowed_methods)]
#![cfg(feature = "gltf")]

use relight_scene::gltf::{ImportOptions, import};
use std::path::PathBuf;

/// File, triangles with every instance drawn, primitives drawn by nodes (counted in
/// the JSON with Python), materials,
/// eye, direction, vertical field of view in degrees.
type Row = (&'static str, usize, usize, usize, [f32; 3], [f32; 3], f32);
const SCENES: [Row; 10] = [
    (
        "sponza_dabrovic",
        66_445,
        37,
        19,
        [-10.2, 1.9, 0.6],
        [0.98, 0.16, -0.09],
        55.0,
    ),
    (
        "sponza_crytek",
        262_267,
        25,
        25,
        [-10.5, 1.8, -0.6],
        [0.98, 0.20, 0.04],
        58.0,
    ),
    (
        "sibenik",
        73_564,
        14,
        14,
        [-15.8, -12.0, 0.6],
        [0.99, 0.13, -0.04],
        60.0,
    ),
    (
        "modern_hall",
        31_087,
        32,
        21,
        [6.91, 1.65, 2.55],
        [-0.90, 0.0, -0.44],
        43.0,
    ),
    (
        "pbr_table",
        186_845,
        22,
        16,
        [0.1, 1.45, 1.75],
        [-0.06, -0.31, -0.95],
        38.0,
    ),
    (
        "damaged_helmet",
        15_452,
        1,
        1,
        [2.28, 0.81, 3.07],
        [-0.56, -0.20, -0.80],
        40.0,
    ),
    (
        "water_bottle",
        4_510,
        1,
        1,
        [0.23, 0.12, 0.39],
        [-0.50, -0.25, -0.83],
        40.0,
    ),
    (
        "metal_rough_spheres",
        1_040_409,
        123,
        // 98 and the default material, since 25 primitives name none.
        99,
        [0.0047, 0.0040, 0.0111],
        [-0.15, -0.10, -0.98],
        40.0,
    ),
    (
        "stanford_bunny",
        69_453,
        2,
        2,
        [0.09, 0.18, 0.35],
        [-0.23, -0.28, -0.93],
        40.0,
    ),
    (
        "armadillo",
        86_484,
        2,
        2,
        [0.24, 0.28, 0.64],
        [-0.28, -0.19, -0.94],
        40.0,
    ),
];

fn shared_scenes() -> Option<PathBuf> {
    let beside = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared");
    let shared = std::env::var_os("RELIGHT_SHARED").map_or(beside, PathBuf::from);
    let scenes = shared.join("scenes");
    if !scenes.is_dir() {
        eprintln!(
            "skipped: {} is not there (set RELIGHT_SHARED to the shared folder)",
            scenes.display()
        );
        return None;
    }
    Some(scenes)
}

#[test]
fn the_development_scenes_load() {
    let Some(folder) = shared_scenes() else { return };
    for (name, triangles, nodes, materials, eye, direction, vfov) in SCENES {
        let start = std::time::Instant::now();
        let scene = import(&folder.join(format!("{name}.glb")), &ImportOptions::default()).expect(name);
        let ms = start.elapsed().as_secs_f64() * 1e3;
        let drawn = |i: &relight_scene::scene::Instance| scene.meshes[i.mesh as usize].triangles.len();
        let (drawn, vertices): (usize, usize) = (
            scene.instances.iter().map(drawn).sum(),
            scene.meshes.iter().map(|m| m.positions.len()).sum(),
        );
        eprintln!(
            "{name}: {drawn} triangles, {} instances of {} meshes with {vertices} vertices, {} textures, {ms:.1} ms {:?}",
            scene.instances.len(),
            scene.meshes.len(),
            scene.textures.len(),
            scene.notes,
        );
        assert_eq!(drawn, triangles, "{name}: triangles");
        assert_eq!(scene.instances.len(), nodes, "{name}: instances");
        assert_eq!(scene.materials.len(), materials, "{name}: materials");
        // The README rounds: half a unit of its last digit.
        let camera = scene.cameras[0].at(0.0);
        let round = if eye.iter().any(|x| *x != 0.0 && x.abs() < 0.05) {
            0.000_06
        } else {
            0.06
        };
        assert!(
            (camera.position - glam::Vec3::from(eye)).abs().max_element() < round,
            "{name}: eye"
        );
        assert!(
            (camera.forward - glam::Vec3::from(direction)).abs().max_element() < 0.006,
            "{name}: direction"
        );
        assert!(
            (camera.tan_half_vfov.atan().to_degrees() * 2.0 - vfov).abs() < 0.51,
            "{name}: field of view"
        );
        assert_eq!(scene.cameras[0].name, "Camera");
    }
}

#[test]
fn what_is_in_the_development_scenes() {
    use relight_scene::material::AlphaMode;
    let Some(folder) = shared_scenes() else { return };
    let load = |name: &str| import(&folder.join(name), &ImportOptions::default()).expect(name);
    let crytek = load("sponza_crytek.glb");
    let masked = |m: &&relight_scene::material::Material| m.alpha_mode == AlphaMode::Mask { cutoff: 0.5 };
    assert_eq!(crytek.materials.iter().filter(masked).count(), 3);
    assert!(crytek.materials.iter().all(|m| m.double_sided));
    assert_eq!(crytek.textures.len(), 24);
    let glass = load("sibenik.glb");
    let glass = glass
        .materials
        .iter()
        .find(|m| m.name == "staklo_crveno")
        .expect("red glass");
    assert_eq!((glass.alpha_mode, glass.base_color.w), (AlphaMode::Blend, 0.8));
    let hall = load("modern_hall.glb");
    let emission: Vec<f32> = hall
        .materials
        .iter()
        .map(|m| m.emission.max_element())
        .filter(|e| *e > 0.0)
        .collect();
    assert_eq!(emission.len(), 13);
    assert!(emission.iter().all(|e| (1.45..=4.65).contains(e)), "{emission:?}");
    let is_pane = |m: &relight_scene::material::Material| matches!(m.alpha_mode, AlphaMode::Pane { .. });
    assert!(hall.materials.iter().any(is_pane));
    let table = load("pbr_table.glb");
    let lamp = table
        .materials
        .iter()
        .find(|m| m.emission.x > 10.0)
        .expect("ceiling lamp");
    assert!(
        (lamp.emission - glam::Vec3::new(18.0, 16.0, 13.0))
            .abs()
            .max_element()
            < 1e-4
    );
    assert_eq!(table.sequence.lights.len(), 1);
    assert_eq!(table.sequence.lights[0].name, "emissive");
    // Three avocados share one mesh, as do the table's four legs and two walls (counted in
    // the JSON with Python).
    assert_eq!(table.instances.len(), table.meshes.len() + 2 + 3 + 1);
    let helmet = load("damaged_helmet.glb");
    let m = &helmet.materials[0];
    assert!(
        m.normal_texture.is_some() && m.emission_texture.is_some() && m.metallic_roughness_texture.is_some()
    );
}

#[test]
fn our_own_scenes_load_without_notes() {
    // Unlike the shared folder these are part of the repository; their generator knows nothing of this importer.
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../data");
    let mut found = 0;
    for entry in std::fs::read_dir(folder).expect("data/") {
        let path = entry.expect("entry").path();
        if !path.extension().is_some_and(|e| e == "glb" || e == "gltf") {
            continue;
        }
        let start = std::time::Instant::now();
        let scene = import(&path, &ImportOptions::default()).unwrap_or_else(|e| panic!("{e}"));
        let triangles: usize = scene.meshes.iter().map(|m| m.triangles.len()).sum();
        eprintln!(
            "{}: {triangles} triangles, {} lights, {:.1?}",
            path.display(),
            scene.sequence.lights.len(),
            start.elapsed()
        );
        assert_eq!(scene.notes, [""; 0], "{}", path.display());
        assert!(triangles > 0);
        found += 1;
    }
    assert!(found > 0, "no scene in data/");
}
