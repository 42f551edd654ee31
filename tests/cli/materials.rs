//! `relight play --materials`: edits show in every integrator as predicted, and wrong ones are refused.

use crate::stage::{TINY, complaint, cornell, data, folder, names, relight, sequence};
use relight_scene::image::{FloatImage, read_exr};
use std::path::{Path, PathBuf};

/// A point light of 1 W/sr within the Cornell box.
const LIGHT: &str = r#"{"relight_sequence": 1, "frames": 3, "lights": [{"name": "l", "type": "point",
    "position": [0.25, 0.4, 0.15], "intensity": [1, 1, 1]}]}"#;

fn edits(folder: &Path, edits: &str) -> PathBuf {
    let text = format!(r#"{{"relight_materials": 1, "edits": [{edits}]}}"#);
    sequence(folder, "edits.json", &text)
}

/// Plays frame `frame` of the box by LIGHT and returns a layer.
fn layer(folder: &Path, integrator: &str, changes: Option<&str>, frame: u32, layer: &str) -> FloatImage {
    layer_of(cornell(), folder, integrator, changes, frame, layer)
}

/// The same, of another asset.
fn layer_of(
    asset: &Path,
    folder: &Path,
    integrator: &str,
    changes: Option<&str>,
    frame: u32,
    layer: &str,
) -> FloatImage {
    let lights = sequence(folder, "l.json", LIGHT);
    let output = folder.join("f.exr");
    let mut command = relight();
    command.arg("play").arg(asset).arg("-o").arg(&output);
    command.args([
        "--size",
        "32x32",
        "--spp",
        "4",
        "--float",
        "--integrator",
        integrator,
    ]);
    command.args([
        "--layers",
        "direct,indirect,albedo",
        "--frames",
        &format!("{frame}-{frame}"),
    ]);
    command.arg("--lights").arg(lights);
    if let Some(changes) = changes {
        command.arg("--materials").arg(edits(folder, changes));
    }
    command.assert().success();
    read_exr(&output, &Default::default())
        .unwrap()
        .rgb(layer)
        .unwrap()
}

/// Direct light on a matt surface is in proportion to its base colour: half the colour, half the light, pixel by
/// pixel, where only that material is seen. The point light makes no noise.
#[test]
fn half_the_base_colour_is_half_the_direct_light() {
    let folder = folder();
    for integrator in ["transfer", "brute", "path"] {
        let direct = |base: f32| {
            let edit = format!(r#"{{"material": "White", "model": "lambert", "base_color": {base}}}"#);
            layer(folder.path(), integrator, Some(&edit), 0, "direct")
        };
        let (full, half) = (direct(0.6), direct(0.3));
        let (mut halved, mut same, mut dark) = (0, 0, 0);
        for (a, b) in full.pixels.iter().zip(&half.pixels) {
            dark += usize::from(a[1] == 0.0 && b[1] == 0.0);
            let ratio = b[1] / a[1].max(1e-20);
            halved += usize::from((ratio - 0.5).abs() < 1e-3);
            same += usize::from((ratio - 1.0).abs() < 1e-3);
        }
        // Back wall, floor, ceiling and blocks are white; the side walls are not; edges show both.
        assert!(halved > 400 && same > 100, "{integrator}: {halved} {same}");
        assert!(halved + same + dark > 900, "{integrator}: {halved} {same} {dark}");
    }
}

/// What bounces follows, too: the transfer's indirect light at half the white walls' reflectance is what the path
/// tracer finds. Tolerance: this bake errs by 2 % in the mean (the smaller one of the other tests by up to 6, depending on
/// where its points fall), the path tracer's noise is below.
#[test]
fn indirect_light_follows_the_edited_albedo() {
    let folder = folder();
    let asset = folder.path().join("c.relight");
    let mut bake = relight();
    bake.arg("bake").arg(data("cornell.glb")).arg("-o").arg(&asset);
    bake.args(["--preset", "draft", "--levels", "3"])
        .assert()
        .success();
    let mean = |integrator: &str, changes: Option<&str>| {
        let image = layer_of(&asset, folder.path(), integrator, changes, 0, "indirect");
        image.pixels.iter().map(|p| f64::from(p[1])).sum::<f64>() / image.pixels.len() as f64
    };
    let edit = r#"{"material": "White", "model": "lambert", "base_color": 0.35}"#;
    let (before, after) = (mean("transfer", None), mean("transfer", Some(edit)));
    assert!(after < 0.4 * before, "{after} of {before}");
    let truth = mean("path", Some(edit)) / mean("path", None);
    assert!(
        (after / before / truth - 1.0).abs() < 0.03,
        "{} instead of {truth}",
        after / before
    );
}

/// A standing camera's fragments follow keys from frame to frame, as a frame played alone has them.
#[test]
fn keys_move_from_frame_to_frame() {
    let folder = folder();
    let edit = r#"{"material": "White", "base_color": {"keys": [[0, 0.2], [2, 0.8]]}, "model": "lambert"}"#;
    let lights = sequence(folder.path(), "l.json", LIGHT);
    relight()
        .arg("play")
        .arg(cornell())
        .arg("-o")
        .arg(folder.path().join("s_####.exr"))
        .args([
            "--size",
            "32x32",
            "--spp",
            "4",
            "--float",
            "--layers",
            "direct,indirect,albedo",
        ])
        .arg("--lights")
        .arg(lights)
        .arg("--materials")
        .arg(edits(folder.path(), edit))
        .assert()
        .success();
    for (frame, base) in [(0, 0.2f32), (1, 0.5), (2, 0.8)] {
        let read = read_exr(
            &folder.path().join(format!("s_000{frame}.exr")),
            &Default::default(),
        )
        .unwrap();
        let albedo = read.rgb("albedo").unwrap();
        let hits = albedo
            .pixels
            .iter()
            .filter(|p| (p[0] - base).abs() < 1e-5)
            .count();
        assert!(hits > 400, "frame {frame}: {hits} pixels of reflectance {base}");
        for name in ["direct", "indirect"] {
            let alone = layer(folder.path(), "transfer", Some(edit), frame, name);
            assert_eq!(
                read.rgb(name).unwrap().pixels,
                alone.pixels,
                "{name} of frame {frame}"
            );
        }
    }
}

#[test]
fn edits_without_effect_change_no_byte() {
    let folder = folder();
    let frame = |name: &str, changes: Option<PathBuf>| {
        let output = folder.path().join(name);
        let mut command = relight();
        command
            .arg("play")
            .arg(cornell())
            .arg("-o")
            .arg(&output)
            .args(["--size", "16x16"]);
        if let Some(changes) = changes {
            command.arg("--materials").arg(changes);
        }
        command.assert().success();
        std::fs::read(output).unwrap()
    };
    assert!(frame("a.exr", None) == frame("b.exr", Some(edits(folder.path(), ""))));
}

fn refused(asset: &Path, changes: &str) -> String {
    let folder = folder();
    let text = complaint(
        relight()
            .arg("play")
            .arg(asset)
            .arg("-o")
            .arg(folder.path().join("f.exr"))
            .args(["--size", "8x8"])
            .arg("--materials")
            .arg(edits(folder.path(), changes)),
        1,
    );
    assert_eq!(names(folder.path()), ["edits.json"]);
    text
}

#[test]
fn wrong_edits_are_answered_with_the_path_of_the_field_and_what_is_known() {
    let cases = [
        (r#"{"material": "Marble"}"#, "edits[0].material", "\"White\""),
        (
            r#"{"material": "White", "model": "velvet"}"#,
            "edits[0].model",
            "ward",
        ),
        (
            r#"{"material": "White", "gloss": 1}"#,
            "edits[0].gloss",
            "base_color",
        ),
        (
            r#"{"material": "White", "exponent": 1}"#,
            "edits[0].exponent",
            "metallic_roughness",
        ),
        (
            r#"{"material": "White", "roughness": 2}"#,
            "edits[0].roughness",
            "from 0 to 1",
        ),
        (
            r#"{"material": "White", "alpha_mode": "BLEND"}"#,
            "edits[0].alpha_mode",
            "bake again",
        ),
        (
            r#"{"material": "White", "base_color_texture": 0}"#,
            "edits[0].base_color_texture",
            "none",
        ),
        (r#"{"material": "#, "line 1", "not valid JSON"),
    ];
    for (changes, place, hint) in cases {
        let text = refused(cornell(), changes);
        assert!(
            text.contains("edits.json") && text.contains(place) && text.contains(hint),
            "{text}"
        );
    }
    let folder = folder();
    let text = complaint(
        relight()
            .arg("play")
            .arg(cornell())
            .arg("-o")
            .arg(folder.path().join("f.exr"))
            .args(["--materials", "gone.json"]),
        1,
    );
    assert!(text.contains("gone.json"), "{text}");
}

#[test]
fn what_a_bake_has_fixed_or_left_out_is_named_with_its_option() {
    let folder = folder();
    let bake = |name: &str, more: &[&str]| {
        let asset = folder.path().join(name);
        relight()
            .arg("bake")
            .arg(data("cornell.glb"))
            .arg("-o")
            .arg(&asset)
            .args(TINY)
            .args(more)
            .assert()
            .success();
        asset
    };
    let solved = bake("solved.relight", &["--solution"]);
    for (field, changes) in [
        ("base_color", r#"{"material": "White", "base_color": 0.1}"#),
        ("model", r#"{"material": "White", "model": "phong"}"#),
    ] {
        let text = refused(&solved, changes);
        assert!(
            text.contains(&format!("edits[0].{field}")) && text.contains("--solution"),
            "{text}"
        );
    }
    let matt = bake("matt.relight", &["--lambert"]);
    assert!(refused(&matt, r#"{"material": "White", "base_color": 0.1}"#).contains("--lambert"));
    let moving = data("cornell_moving.lights.json");
    let dark = bake("dark.relight", &["--lights", moving.to_str().unwrap()]);
    let text = {
        let edits = edits(folder.path(), r#"{"material": "White", "emission": 1}"#);
        complaint(
            relight()
                .arg("play")
                .arg(&dark)
                .arg("--lights")
                .arg(&moving)
                .arg("-o")
                .arg(folder.path().join("f_####.exr"))
                .arg("--materials")
                .arg(edits),
            1,
        )
    };
    assert!(
        text.contains("edits[0].emission") && text.contains("--keep emission"),
        "{text}"
    );
}
