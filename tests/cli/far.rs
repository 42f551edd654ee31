//! Scenes far from their origin, and lights with names that files can't have.

use crate::stage::{SQUARE, bake_json, folder, gltf, json, relight};
use relight_scene::image::{Layers, read_exr};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

const COARSE: [&str; 6] = ["--levels", "2", "--sender-levels", "1", "--coarse-radius", "0.5"];

/// Bakes a square at x under a root node; the JSON that the bake prints, and the asset.
fn bake(folder: &Path, x: f64) -> (Value, PathBuf) {
    let scene = gltf(folder, &SQUARE);
    let mut document: Value = serde_json::from_slice(&std::fs::read(&scene).unwrap()).unwrap();
    document["nodes"]
        .as_array_mut()
        .unwrap()
        .push(json!({ "translation": [x, 0, 0], "children": [0, 1] }));
    document["scenes"][0]["nodes"] = json!([2]);
    std::fs::write(&scene, document.to_string()).unwrap();
    let asset = folder.join("a.relight");
    (bake_json(&scene, &asset, &COARSE), asset)
}

/// Plays under a lamp, seen by a camera, both given in the file's coordinates.
fn play(folder: &Path, asset: &Path, x: f64, name: &str) -> (Layers, String) {
    let lights = folder.join("lights.json");
    let sequence = json!({
        "relight_sequence": 1,
        "camera": { "position": [x + 0.25, 0.5, 3], "look_at": [x, 0, 0], "vfov_deg": 50 },
        "lights": [{ "name": name, "type": "point", "position": [x - 0.5, 0.25, 1], "intensity": [1, 2, 3] },
            { "name": format!("{name}'"), "type": "point", "position": [x + 0.5, 0.25, 1], "intensity": [3, 2, 1] }],
    });
    std::fs::write(&lights, sequence.to_string()).unwrap();
    let file = folder.join("f.exr");
    let output = relight()
        .args([
            "play",
            "--size",
            "24x24",
            "--float",
            "--layers",
            "beauty,depth,lights",
            "--lights",
        ])
        .arg(&lights)
        .arg(asset)
        .arg("-o")
        .arg(&file)
        .assert()
        .success()
        .get_output()
        .clone();
    let said = String::from_utf8(output.stderr).unwrap();
    (read_exr(&file, &Default::default()).unwrap(), said)
}

#[test]
fn a_scene_far_from_its_origin_plays_as_the_same_scene_near_it() {
    let (near, far) = (folder(), folder());
    let x = 4e6;
    let (near_said, near_asset) = bake(near.path(), 0.0);
    let (far_said, far_asset) = bake(far.path(), x);
    assert_eq!(near_said["settings"].get("offset"), None);
    assert_eq!(far_said["settings"]["offset"], "4000000 0 0");
    assert!(
        far_said["notes"].to_string().contains("far from its origin"),
        "{}",
        far_said["notes"]
    );
    let (near_frame, _) = play(near.path(), &near_asset, 0.0, "lamp");
    let (far_frame, _) = play(far.path(), &far_asset, x, "lamp");
    assert_eq!(near_frame, far_frame);
    assert!(
        near_frame
            .rgb("beauty")
            .unwrap()
            .pixels
            .iter()
            .any(|p| p[0] > 0.0)
    );

    let inspected = relight()
        .arg("inspect")
        .arg("--json")
        .arg(&far_asset)
        .output()
        .unwrap();
    assert_eq!(json(&inspected.stdout)["settings"]["offset"], "4000000 0 0");
    let exported = |folder: &Path, asset: &Path| {
        let mut export = relight();
        export
            .args(["export", "--what", "points"])
            .arg(asset)
            .arg("-o")
            .arg(folder);
        export.assert().success();
        std::fs::read(folder.join("positions.npy")).unwrap()
    };
    let (near, far) = (
        exported(near.path(), &near_asset),
        exported(far.path(), &far_asset),
    );
    assert!(
        near.starts_with(b"\x93NUMPY\x01\0\x76\0{'descr': '<f4'")
            && far.starts_with(b"\x93NUMPY\x01\0\x76\0{'descr': '<f8'")
    );
    let near = near[128..]
        .chunks_exact(4)
        .map(|b| f64::from(f32::from_le_bytes(b.try_into().unwrap())));
    let far = far[128..]
        .chunks_exact(8)
        .map(|b| f64::from_le_bytes(b.try_into().unwrap()));
    let near: Vec<f64> = near
        .enumerate()
        .map(|(i, v)| if i % 3 == 0 { v + x } else { v })
        .collect();
    assert_eq!(near, far.collect::<Vec<f64>>());
}

/// Where a place far from the origin is given, it is one of the file, too; and the advice to give one is in its coordinates.
#[test]
fn viewpoints_are_in_the_coordinates_of_the_file() {
    let (near, far) = (folder(), folder());
    let x = 4e6;
    let (_, near_asset) = bake(near.path(), 0.0);
    bake(far.path(), x);
    let again = |folder: &Path, x: f64| {
        let place = format!("--viewpoint={},0.5,-2", x + 0.5);
        let asset = folder.join("b.relight");
        let said = bake_json(
            &folder.join("scene.gltf"),
            &asset,
            &[&COARSE[..], &[&place]].concat(),
        );
        (said, asset)
    };
    let (near_said, near_again) = again(near.path(), 0.0);
    let (far_said, far_again) = again(far.path(), x);
    assert_eq!(near_said["settings"]["viewpoints"], "0.5,0.5,-2");
    assert_eq!(far_said["settings"]["viewpoints"], "4000000.5,0.5,-2");
    assert_eq!(near_said["points"], far_said["points"]);
    let points = |asset: &Path| {
        let read = |asset| relight_format::read_file(asset, &Default::default()).unwrap();
        read(asset)
            .points
            .into_iter()
            .map(|l| l.positions)
            .collect::<Vec<_>>()
    };
    assert_eq!(points(&near_again), points(&far_again));
    // A place behind the square makes a difference.
    assert_ne!(points(&near_again), points(&near_asset));
}

#[test]
fn lights_of_any_name_get_layers() {
    let folder = folder();
    let (_, asset) = bake(folder.path(), 0.0);
    let long = format!("key/left \u{1f4a1} {}", "x".repeat(300));
    let (frame, said) = play(folder.path(), &asset, 0.0, &long);
    let lights: Vec<&str> = (frame.layers.iter())
        .filter_map(|l| l.name.strip_prefix("light."))
        .collect();
    assert_eq!(lights.len(), 2, "{lights:?}");
    assert!(
        lights
            .iter()
            .all(|name| name.starts_with("key_left \u{1f4a1} xxx") && name.len() <= 247)
    );
    assert!(
        lights.contains(&&*format!("{}~1", long[..245].replace('/', "_"))),
        "{lights:?}"
    );
    assert_eq!(
        said.matches("has a name that no layer can have").count(),
        2,
        "{said}"
    );
}

#[test]
fn a_name_that_no_file_can_have_is_told_before_the_work() {
    let folder = folder();
    let (_, asset) = bake(folder.path(), 0.0);
    let lights = folder.path().join("lights.json");
    let lamp = json!({ "name": "lamp", "type": "point", "position": [0, 0, 1], "intensity": [1, 1, 1] });
    std::fs::write(
        &lights,
        json!({ "relight_sequence": 1, "lights": [lamp] }).to_string(),
    )
    .unwrap();
    let name = format!("{}.exr", "x".repeat(300));
    let output = relight()
        .args(["play", "--lights"])
        .args([&lights, &asset])
        .arg("-o")
        .arg(folder.path().join(&name))
        .output()
        .unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(
        !output.status.success() && said.contains("cannot be a file's name"),
        "{said}"
    );
}
