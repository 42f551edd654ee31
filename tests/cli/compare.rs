//! `relight compare`.

use crate::stage::{complaint, folder, json, relight};
use relight_scene::image::{ExrHeader, Layers, write_exr};
use std::path::{Path, PathBuf};

/// Writes an image of 8 × 8 equal pixels.
fn flat(folder: &Path, name: &str, layer: &str, value: f32) -> PathBuf {
    let mut layers = Layers::new(8, 8);
    layers.push_rgb(layer, &[[value; 3]; 64]);
    let path = folder.join(name);
    write_exr(&path, &layers, &ExrHeader::new(), true).unwrap();
    path
}

#[test]
fn equal_images_are_equal() {
    let folder = folder();
    let a = flat(folder.path(), "a.exr", "beauty", 0.5);
    let output = relight()
        .arg("compare")
        .args([&a, &a])
        .args(["--json", "--max-relmse", "0"])
        .assert()
        .success()
        .get_output()
        .clone();
    let said = json(&output.stdout);
    assert_eq!(said["layers"]["beauty"]["relmse"], 0.0);
    assert_eq!(said["layers"]["beauty"]["psnr_db"], serde_json::Value::Null);
    assert_eq!(said["passed"], true);
}

/// 1.1 against 1: a squared difference of 0.01 relative to 1 + 0.01 · 1, and a bias of 10 %.
#[test]
fn errors_are_what_their_formulas_say_and_bounds_are_kept() {
    let folder = folder();
    let a = flat(folder.path(), "a.exr", "beauty", 1.1);
    let b = flat(folder.path(), "b.exr", "beauty", 1.0);
    let run = |more: &[&str]| relight().arg("compare").args([&a, &b]).args(more).assert();
    let said = json(&run(&["--json"]).success().get_output().stdout.clone());
    let relmse = said["layers"]["beauty"]["relmse"].as_f64().unwrap();
    // 1.1 in f32 is off by 2e-8.
    assert!((relmse - 0.01 / 1.01).abs() < 1e-6, "{relmse}");
    assert!((said["layers"]["beauty"]["bias"].as_f64().unwrap() - 0.1).abs() < 1e-6);
    run(&["--max-relmse", "0.0100"]).success();
    let said = json(
        &run(&["--max-relmse", "0.0098", "--json"])
            .code(3)
            .get_output()
            .stdout
            .clone(),
    );
    assert_eq!(said["passed"], false);
    run(&["--max-relmse", "-1"]).code(2);
}

/// A wall of which a quarter is brighter and darker by a tenth in turns, beside a steady one. Truth by hand: means of 1, second differences
/// of 0.4 for a quarter of the pixels, a squared difference of 0.01 there relative to 1.01.
#[test]
fn sequences_are_compared_frame_by_frame_and_flicker_is_told() {
    let folder = folder();
    for frame in 0..6 {
        let jumping = if frame % 2 == 0 { 1.1 } else { 0.9 };
        let mut layers = Layers::new(8, 8);
        let pixels: Vec<[f32; 3]> = (0..64).map(|i| [if i < 16 { jumping } else { 1.0 }; 3]).collect();
        layers.push_rgb("indirect", &pixels);
        let path = folder.path().join(format!("a_{frame:04}.exr"));
        write_exr(&path, &layers, &ExrHeader::new(), true).unwrap();
        flat(folder.path(), &format!("b_{frame:04}.exr"), "indirect", 1.0);
    }
    let run = |a: &str, b: &str| {
        let mut command = relight();
        command
            .arg("compare")
            .args([a, b].map(|name| folder.path().join(name)))
            .arg("--json");
        command
    };
    let said = json(
        &run("a_####.exr", "b_%04d.exr")
            .assert()
            .success()
            .get_output()
            .stdout
            .clone(),
    );
    let layer = &said["layers"]["indirect"];
    assert_eq!(said["frames"], 6);
    let near = |value: &serde_json::Value, truth: f64, tolerance: f64| {
        let value = value.as_f64().unwrap();
        assert!((value - truth).abs() <= tolerance * truth, "{value}, not {truth}");
    };
    near(&layer["relmse"], 0.25 * 0.01 / 1.01, 1e-4);
    // A step of the percentiles' histogram.
    for flicker in ["flicker", "difference_flicker"] {
        assert_eq!(layer[flicker]["median"], 0.0);
        near(&layer[flicker]["p99"], 0.4, 0.04);
    }
    assert_eq!(layer["reference_flicker"]["p999"], 0.0);
    std::fs::remove_file(folder.path().join("b_0003.exr")).unwrap();
    let said = complaint(&mut run("a_####.exr", "b_####.exr"), 1);
    assert!(
        said.contains("b_0003.exr") && said.contains("is missing"),
        "{said}"
    );
    let said = complaint(&mut run("a_####.exr", "b_0001.exr"), 1);
    assert!(said.contains("one is a sequence"), "{said}");
    let said = complaint(&mut run("c_####.exr", "b_####.exr"), 1);
    assert!(said.contains("no file has such a name"), "{said}");
}

#[test]
fn layers_are_compared_by_name_or_with_the_only_one() {
    let folder = folder();
    let a = flat(folder.path(), "a.exr", "indirect", 1.0);
    let b = flat(folder.path(), "b.exr", "beauty", 1.0);
    let text = complaint(relight().arg("compare").args([&a, &b]), 1);
    assert!(
        text.contains("indirect") && text.contains("beauty") && text.contains("--layer"),
        "{text}"
    );
    relight()
        .arg("compare")
        .args([&a, &b])
        .args(["--layer", "indirect", "--max-relmse", "0"])
        .assert()
        .success();
    let text = complaint(
        relight()
            .arg("compare")
            .args([&a, &b])
            .args(["--layer", "direct"]),
        1,
    );
    assert!(text.contains("direct"), "{text}");
}

#[test]
fn sizes_must_agree() {
    let folder = folder();
    let a = flat(folder.path(), "a.exr", "beauty", 1.0);
    let mut layers = Layers::new(4, 4);
    layers.push_rgb("beauty", &[[1.0; 3]; 16]);
    let b = folder.path().join("b.exr");
    write_exr(&b, &layers, &ExrHeader::new(), true).unwrap();
    complaint(relight().arg("compare").args([&a, &b]), 1);
}

#[test]
fn black_images_are_said_to_be_black_and_nothing_is_null() {
    let folder = folder();
    let light = flat(folder.path(), "light.exr", "beauty", 0.5);
    let black = flat(folder.path(), "black.exr", "beauty", 0.0);
    for (image, reference, said, relative) in [
        (&light, &black, "is black: nothing is relative to it", false),
        (&black, &light, "black.exr is black", true),
        (&black, &black, "is black in both images", true),
    ] {
        let mut compare = relight();
        let run = compare
            .arg("compare")
            .args([image, reference])
            .arg("--json")
            .assert()
            .success();
        let output = run.get_output().clone();
        let words = String::from_utf8(output.stderr).unwrap();
        assert!(words.contains(said), "{words}");
        let text = String::from_utf8(output.stdout.clone()).unwrap();
        assert!(!text.contains("null"), "{text}");
        let layer = &json(&output.stdout)["layers"]["beauty"];
        assert_eq!(layer["image_is_black"], image == &black);
        assert_eq!(layer["reference_is_black"], reference == &black);
        assert_eq!(layer["relmse"].is_number(), relative, "{text}");
        // Whatever is asked for, light is not as good as black.
        let mut compare = relight();
        compare
            .arg("compare")
            .args([image, reference])
            .args(["--max-relmse", "1e9"]);
        compare.assert().code(if relative { 0 } else { 3 });
    }
}
