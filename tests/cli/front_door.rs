//! The example that an engine would copy makes the frames of `relight play`.

#[path = "../../crates/play/examples/smallest_player.rs"]
#[allow(dead_code, reason = "an example has a main of its own")]
mod smallest_player;

use crate::stage::{TINY, bake_json, cornell, data, folder, relight, sequence};
use relight_scene::image::{Layers, Limits, read_exr};
use std::path::Path;

/// Few lights, few points: fractions of a second.
const FEW: [&str; 4] = ["--cut-lights", "1024", "--sigma", "6"];

/// A lamp and a sky, so that each kind of cuts has something to do.
const LIGHTS: &str = r#"{ "relight_sequence": 1, "lights": [
    { "name": "lamp", "type": "point", "position": [0.2, 0.4, 0.1], "intensity": [0.3, 0.2, 0.1] },
    { "name": "sky", "type": "sun_sky", "turbidity": 3, "sun_direction": [0.3, 0.7, -0.4], "scale": [0.1, 0.1, 0.1] } ] }"#;

/// Every bit of the layers that both have written.
fn compare(asset: &Path, folder: &Path, said: &str) {
    let lights = sequence(folder, "lights.json", LIGHTS);
    let (played, copied) = (folder.join("played.exr"), folder.join("copied.exr"));
    let run = relight()
        .arg("play")
        .arg(asset)
        .arg("--lights")
        .arg(&lights)
        .arg("-o")
        .arg(&played)
        .args(["--size", "160x90", "--float"])
        .args(["--layers", "beauty,emission,direct,indirect"])
        .assert()
        .success();
    let words = String::from_utf8(run.get_output().stderr.clone()).unwrap();
    assert!(words.contains(said), "{words}");
    smallest_player::relight(asset, &lights, &copied).unwrap();
    let read = |file: &Path| -> Layers { read_exr(file, &Limits::default()).unwrap() };
    let (played, copied) = (read(&played), read(&copied));
    assert_eq!((played.width, played.height), (copied.width, copied.height));
    // Those asked for, and A.
    assert_eq!(played.layers.len(), 5);
    assert_eq!(played.layers.len(), copied.layers.len());
    for layer in &played.layers {
        let twin = copied.layer(&layer.name).unwrap();
        let bits = |data: &[f32]| data.iter().map(|v| v.to_bits()).collect::<Vec<u32>>();
        let may_be_dark = layer.name == "emission";
        assert!(
            may_be_dark || layer.data.iter().any(|v| *v != 0.0),
            "{} is dark",
            layer.name
        );
        assert!(bits(&layer.data) == bits(&twin.data), "{} differs", layer.name);
    }
}

#[test]
fn of_an_asset_with_transfer_the_example_makes_the_frame_of_play() {
    let folder = folder();
    compare(cornell(), folder.path(), "the asset has no visibility cuts");
}

#[test]
fn of_an_asset_with_cuts_of_the_first_bounce_the_example_makes_the_frame_of_play() {
    let folder = folder();
    let asset = folder.path().join("table.relight");
    let options = [&TINY[..], &FEW, &["--cuts", "indirect"]].concat();
    bake_json(&data("table.glb"), &asset, &options);
    compare(&asset, folder.path(), "its first bounce by visibility cuts");
}

#[test]
fn of_an_asset_with_cuts_alone_the_example_makes_the_frame_of_play() {
    let folder = folder();
    let asset = folder.path().join("table.relight");
    let options = [&TINY[..], &FEW, &["--cuts", "indirect"]].concat();
    bake_json(&data("table.glb"), &asset, &options);
    let bytes = std::fs::read(&asset).unwrap();
    let whole = relight_format::read_asset(&bytes, &relight_format::Limits::default()).unwrap();
    let alone = relight_format::Asset {
        transfer: None,
        bounce: None,
        solution: None,
        ..whole
    };
    std::fs::write(&asset, relight_format::write_asset(&alone).unwrap()).unwrap();
    compare(&asset, folder.path(), "its first bounce by visibility cuts");
}

#[test]
fn of_an_asset_with_transfer_and_cuts_of_environments_the_example_makes_the_frame_of_play() {
    let folder = folder();
    let asset = folder.path().join("table.relight");
    let options = [&TINY[..], &FEW, &["--cuts", "environment"]].concat();
    bake_json(&data("table.glb"), &asset, &options);
    compare(
        &asset,
        folder.path(),
        "direct light of environments by visibility cuts",
    );
}
