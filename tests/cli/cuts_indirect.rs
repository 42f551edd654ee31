//! Visibility cuts of surface samples: one bounce of any light.

use crate::stage::{TINY, bake_json, data, folder, json, mean, relight};
use relight_scene::image::{BEAUTY, FloatImage, Limits, read_exr};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use tempfile::TempDir;

const INDIRECT: [&str; 6] = ["--cuts", "indirect", "--cut-lights", "2048", "--sigma", "3"];

/// The Cornell box with cuts, baked once for all tests, and what the bake said.
fn cornell() -> (&'static Path, &'static Value) {
    static ASSET: OnceLock<(TempDir, PathBuf, Value)> = OnceLock::new();
    let (_, asset, said) = ASSET.get_or_init(|| {
        let folder = folder();
        let asset = folder.path().join("cornell.relight");
        let said = bake(&asset, &[]);
        (folder, asset, said)
    });
    (asset, said)
}

fn bake(asset: &Path, more: &[&str]) -> Value {
    bake_json(
        &data("cornell.glb"),
        asset,
        &[&TINY[..], &INDIRECT, more].concat(),
    )
}

/// A panel and a lamp.
const LIGHTS: &str = r#"{ "relight_sequence": 1, "lights": [
    { "name": "panel", "type": "rect", "center": [0.02, 0.275, 0.28], "edge_u": [0, 0.2, 0], "edge_v": [0, 0, 0.2],
      "radiance": [3, 9, 15] },
    { "name": "lamp", "type": "point", "position": [0.4, 0.45, 0.1], "intensity": [0.3, 0.2, 0.1] } ] }"#;

/// Plays; what was said, and its JSON.
fn play(asset: &Path, frame: &Path, more: &[&str]) -> (String, Value) {
    let lights = frame.with_extension("json");
    std::fs::write(&lights, LIGHTS).unwrap();
    let run = relight()
        .arg("play")
        .arg(asset)
        .arg("--lights")
        .arg(lights)
        .arg("-o")
        .arg(frame)
        .args(["--size", "48x48", "--float", "--json"])
        .args(more)
        .assert()
        .success();
    let words = String::from_utf8(run.get_output().stderr.clone()).unwrap();
    (words, json(&run.get_output().stdout))
}

fn layer(frame: &Path, name: &str) -> FloatImage {
    read_exr(frame, &Limits::default()).unwrap().rgb(name).unwrap()
}

/// Largest difference of two images, relative to the mean of the first.
fn difference(a: &FloatImage, b: &FloatImage) -> f64 {
    let pairs = a.pixels.iter().flatten().zip(b.pixels.iter().flatten());
    let largest = pairs.map(|(a, b)| f64::from(*a - *b).abs()).fold(0.0, f64::max);
    largest / mean(a)
}

#[test]
fn the_json_of_a_bake_says_that_the_cuts_are_indirect() {
    let (_, said) = cornell();
    let cuts = &said["cuts"];
    assert_eq!(
        (&cuts["mode"], &cuts["lights"]),
        (&"indirect".into(), &2048.into())
    );
    assert!(cuts["mean_length"].as_f64().unwrap() > 10.0);
    assert!(cuts["rms_error"].as_f64().unwrap() > 0.0);
    let settings = said["settings"].to_string();
    assert!(settings.contains("indirect"), "{settings}");
}

#[test]
fn one_bounce_by_cuts_is_that_of_paths() {
    let (asset, _) = cornell();
    let folder = folder();
    let frame = |name: &str, more: &[&str]| {
        let frame = folder.path().join(name);
        let (words, _) = play(asset, &frame, more);
        (layer(&frame, "indirect"), words)
    };
    let (cuts, words) = frame("cuts.exr", &["--integrator", "cuts"]);
    assert!(
        words.contains("one bounce of indirect light by visibility cuts"),
        "{words}"
    );
    let (path, _) = frame(
        "path.exr",
        &["--integrator", "path", "--spp", "256", "--max-bounces", "2"],
    );
    assert!(cuts.pixels.iter().flatten().all(|v| v.is_finite() && *v >= 0.0));
    // Sites 5 cm apart in a box of half a metre blur its corners.
    let ratio = mean(&cuts) / mean(&path);
    assert!((ratio - 1.0).abs() < 0.08, "{ratio}");
}

#[test]
fn auto_takes_the_first_bounce_by_cuts_says_so_and_lights_add_up() {
    let (asset, _) = cornell();
    let folder = folder();
    let (auto, transfer) = (folder.path().join("a.exr"), folder.path().join("t.exr"));
    let (words, said) = play(asset, &auto, &["--layers", "beauty,indirect,lights"]);
    assert!(
        words.contains("first bounce by visibility cuts where surfaces are not matt"),
        "{words}"
    );
    let times = &said["frames"][0];
    for key in ["illumination_cut", "shade", "merged_nodes_per_fragment"] {
        assert!(times[key].as_f64().unwrap() >= 0.0, "{key}");
    }
    let lights = read_exr(&auto, &Limits::default()).unwrap();
    let mut sum = vec![0.0f32; 3 * 48 * 48];
    for own in lights.layers.iter().filter(|l| l.name.starts_with("light.")) {
        let own = lights.rgb(&own.name).unwrap();
        sum.iter_mut()
            .zip(own.pixels.iter().flatten())
            .for_each(|(s, v)| *s += v);
    }
    let beauty = layer(&auto, BEAUTY);
    let largest = sum.iter().zip(beauty.pixels.iter().flatten());
    let largest = largest.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    // Illumination cuts differ from light to light.
    assert!(f64::from(largest) < 0.01 * mean(&beauty), "{largest}");

    // All bounces, counted once: as much light as by transfer alone.
    let (words, said) = play(asset, &transfer, &["--integrator", "transfer"]);
    assert!(
        words.contains("shadow rays; indirect light by transfer."),
        "{words}"
    );
    assert!(said["frames"][0].get("shade").is_none());
    let ratio = mean(&layer(&auto, "indirect")) / mean(&layer(&transfer, "indirect"));
    assert!((ratio - 1.0).abs() < 0.1, "{ratio}");
}

#[test]
fn matt_surfaces_are_left_to_transfer() {
    let folder = folder();
    let asset = folder.path().join("a.relight");
    bake(&asset, &["--lambert"]);
    let indirect = |integrator: &str| {
        let frame = folder.path().join(format!("{integrator}.exr"));
        let (_, said) = play(&asset, &frame, &["--integrator", integrator]);
        (layer(&frame, "indirect"), said)
    };
    let (auto, said) = indirect("auto");
    assert_eq!(said["frames"][0]["merged_nodes_per_fragment"], 0.0);
    assert_eq!(difference(&auto, &indirect("transfer").0), 0.0);
}

#[test]
fn indirect_cuts_do_not_depend_on_threads() {
    let (asset, _) = cornell();
    let folder = folder();
    let one = folder.path().join("one.relight");
    bake(&one, &["--threads", "1"]);
    assert!(
        std::fs::read(&one).unwrap() == std::fs::read(asset).unwrap(),
        "assets differ"
    );
    let bytes = |threads: &str| {
        let frame = folder.path().join(format!("{threads}.exr"));
        play(asset, &frame, &["--threads", threads, "--spp", "2"]);
        std::fs::read(frame).unwrap()
    };
    assert!(bytes("1") == bytes("2"), "frames differ");
}
