//! Measured lamps (IES LM-63): they shine as their files say, in every integrator that knows them.

use crate::stage::{complaint, cornell, folder, gltf, relight, sequence};
use relight_scene::image::{Layers, Limits, read_exr};
use std::path::Path;

/// 100 cd all around.
const EVEN: &str = "IESNA:LM-63-1995\nTILT=NONE\n1 1000 1 2 1 1 2 0 0 0\n1 1 60\n0 180\n0\n100 100\n";
/// 100 cd to below, 0 from 45° on.
const DOWN: &str = "IES:LM-63-2019\r\nTILT=NONE\r\n1 -1 0.5 4 1 1 2 0 0 0\r\n1 1 60\r\n0 44.9 45 180\r\n0\r\n200 200 0 0\r\n";

fn play(asset: &Path, lights: &Path, integrator: &str) -> Layers {
    lit(asset, Some(lights), &lights.with_extension("exr"), integrator)
}

/// A frame by the asset's own lights or others.
fn lit(asset: &Path, lights: Option<&Path>, frame: &Path, integrator: &str) -> Layers {
    let mut play = relight();
    play.arg("play").arg(asset).arg("-o").arg(frame);
    if let Some(lights) = lights {
        play.arg("--lights").arg(lights);
    }
    play.args(["--size", "32x32", "--float", "--spp", "4"])
        .args(["--integrator", integrator])
        .assert()
        .success();
    read_exr(frame, &Limits::default()).unwrap()
}

/// The lamp in the Cornell box, of a type with these fields.
fn lamp(fields: &str) -> String {
    format!(
        r#"{{ "relight_sequence": 1, "lights": [ {{ "name": "lamp", "position": [0.25, 0.3, 0.2], {fields} }} ] }}"#
    )
}

/// Truth: `brute`, a shadow ray to every lamp; with an asset's points as virtual lights, indirect light is there, too.
#[test]
fn many_light_methods_know_measured_lamps() {
    let folder = folder();
    std::fs::write(folder.path().join("down.ies"), DOWN).unwrap();
    let fields = r#""type": "ies", "file": "down.ies", "direction": [0.3, -2, 0.1], "scale": 0.01"#;
    let lights = sequence(folder.path(), "down.json", &lamp(fields));
    let truth = play(cornell(), &lights, "brute").rgb("direct").unwrap();
    for integrator in ["lightcuts", "pixelcuts"] {
        let found = play(cornell(), &lights, integrator).rgb("direct").unwrap();
        let (mut off, mut sum) = (0.0, 0.0);
        for (a, b) in found.pixels.iter().flatten().zip(truth.pixels.iter().flatten()) {
            off += f64::from((a - b).abs());
            sum += f64::from(*b);
        }
        // Other rays through the pixels.
        assert!(sum > 0.0 && off < 0.05 * sum, "{integrator}: {off} of {sum}");
    }
}

/// Truth: point and spot lights, whose intensities are those of the files by the factor.
#[test]
fn lamps_shine_as_the_lights_that_they_were_measured_like() {
    let folder = folder();
    std::fs::write(folder.path().join("even.ies"), EVEN).unwrap();
    std::fs::write(folder.path().join("down.ies"), DOWN).unwrap();
    let file = |name: &str, fields: &str| sequence(folder.path(), name, &lamp(fields));
    let even = file(
        "even.json",
        r#""type": "ies", "file": "even.ies", "scale": [0.01, 0.02, 0.03]"#,
    );
    let point = file("point.json", r#""type": "point", "intensity": [1, 2, 3]"#);
    let down = file(
        "down.json",
        r#""type": "ies", "file": "down.ies", "direction": [0, -2, 0], "scale": 0.01"#,
    );
    let spot = file(
        "spot.json",
        r#""type": "spot", "direction": [0, -1, 0], "intensity": [1, 1, 1], "inner_angle_deg": 44.9, "outer_angle_deg": 45"#,
    );
    for integrator in ["transfer", "brute", "path"] {
        for (measured, plain) in [(&even, &point), (&down, &spot)] {
            let [a, b] =
                [measured, plain].map(|lights| play(cornell(), lights, integrator).rgb("beauty").unwrap());
            let (mut off, mut sum) = (0.0, 0.0);
            for (a, b) in a.pixels.iter().flatten().zip(b.pixels.iter().flatten()) {
                off += f64::from((a - b).abs());
                sum += f64::from(*b);
            }
            // The ramps at the cone's edge differ.
            assert!(sum > 0.0 && off < 5e-3 * sum, "{integrator}: {off} of {sum}");
        }
    }
}

#[test]
fn wrong_files_are_told() {
    let folder = folder();
    let frame = folder.path().join("f.exr");
    let run = |text: &str, more: &[&str]| {
        let lights = sequence(folder.path(), "l.json", text);
        let mut play = relight();
        play.arg("play")
            .arg(cornell())
            .arg("--lights")
            .arg(lights)
            .args(["--size", "8x8", "-o"]);
        play.arg(&frame).args(more);
        play
    };
    let fields = r#""type": "ies", "file": "lamp.ies""#;
    let text = complaint(&mut run(&lamp(fields), &[]), 1);
    assert!(
        text.contains("lights[0].file: ") && text.contains("lamp.ies: cannot be read"),
        "{text}"
    );
    for (from, to, said) in [
        ("100 100", "100 -100", "lamp.ies: line 7: a candela value is -100"),
        (" 2 1 1 2 ", " 0 1 1 2 ", "the number of vertical angles is 0"),
        ("100 100", "100", "the file is cut off"),
        ("TILT=NONE", "", "is it one?"),
    ] {
        std::fs::write(folder.path().join("lamp.ies"), EVEN.replace(from, to)).unwrap();
        let text = complaint(&mut run(&lamp(fields), &[]), 1);
        assert!(
            text.contains("l.json: lights[0].file: ") && text.contains(said),
            "{text}"
        );
    }
    let tilted = EVEN.replace("TILT=NONE", "TILT=lamp.tlt");
    std::fs::write(folder.path().join("lamp.ies"), tilted).unwrap();
    let text = complaint(&mut run(&lamp(fields), &[]), 1);
    assert!(
        text.contains("lamp.ies: TILT=lamp.tlt: ") && text.contains("put the file beside this one"),
        "{text}"
    );
}

/// Truth: the same lamp, darkened by `scale`.
#[test]
fn lamps_that_burn_darker_as_they_are_tilted() {
    let folder = folder();
    std::fs::write(folder.path().join("even.ies"), EVEN).unwrap();
    std::fs::write(folder.path().join("TILT.TXT"), "1\n3\n0 60 90\n1 0.8 0.7\n").unwrap();
    let tilted = EVEN.replace("TILT=NONE", "TILT=TILT.TXT");
    std::fs::write(folder.path().join("tilted.ies"), tilted).unwrap();
    let aimed = |file: &str, scale: f64| {
        let fields = format!(
            r#""type": "ies", "file": "{file}.ies", "direction": [0, -1, -1.7320508], "scale": {scale}"#
        );
        let lights = sequence(folder.path(), &format!("{file}.json"), &lamp(&fields));
        play(cornell(), &lights, "brute").rgb("direct").unwrap()
    };
    let [tilted, darker] = [aimed("tilted", 0.01), aimed("even", 0.008)];
    let mut sum = 0.0;
    for (a, b) in tilted.pixels.iter().flatten().zip(darker.pixels.iter().flatten()) {
        assert!((a - b).abs() <= 1e-5 * b, "{a} {b}");
        sum += b;
    }
    assert!(sum > 0.0);
}

/// A lamp of a scene is kept in the asset, whatever became of its file. Truth: the same lamp in a sequence.
#[test]
fn lamps_of_scenes_are_in_their_assets() {
    let folder = folder();
    let square = crate::stage::SQUARE;
    let scene = gltf(folder.path(), &square);
    let text = std::fs::read_to_string(&scene).unwrap();
    let mut document: serde_json::Value = serde_json::from_str(&text).unwrap();
    document["extensionsUsed"] = serde_json::json!(["EXT_lights_ies"]);
    document["extensions"] = serde_json::json!({ "EXT_lights_ies": { "lights": [{ "uri": "lamp.ies" }] } });
    document["nodes"][1]["extensions"] =
        serde_json::json!({ "EXT_lights_ies": { "light": 0, "multiplier": 0.02, "color": [1, 0.5, 0.25] } });
    std::fs::write(&scene, document.to_string()).unwrap();
    let file = folder.path().join("lamp.ies");
    std::fs::write(&file, DOWN).unwrap();
    let asset = folder.path().join("a.relight");
    let mut bake = relight();
    bake.arg("bake")
        .arg(&scene)
        .arg("-o")
        .arg(&asset)
        .args(crate::stage::TINY);
    let said = bake.assert().success().get_output().stderr.clone();
    // ∫ I dω of 100 cd within 45°: 2π (1 − cos 45°) × 100 = 184 lm.
    let said = String::from_utf8(said).unwrap();
    assert!(said.contains("gives 184 lm, 100 cd at most"), "{said}");
    std::fs::remove_file(&file).unwrap();
    let lights = sequence(
        folder.path(),
        "same.json",
        &format!(
            r#"{{ "relight_sequence": 1, "lights": [ {{ "name": "Front", "type": "ies", "file": {}, "position": [0, 0, 3],
               "direction": [0, 0, -1], "scale": [0.02, 0.01, 0.005] }} ] }}"#,
            serde_json::json!(DOWN)
        ),
    );
    let own = lit(&asset, None, &folder.path().join("own.exr"), "brute")
        .rgb("direct")
        .unwrap();
    let same = play(&asset, &lights, "brute").rgb("direct").unwrap();
    assert!(own.pixels.iter().flatten().any(|&v| v > 0.0));
    assert_eq!(own.pixels, same.pixels);
}
