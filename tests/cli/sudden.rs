//! Lights that do what lamps don't: they jump, blink, stand still for ever, pass through walls, turn over, set, and are 10⁶⁰ times
//! as strong as each other. In every integrator a frame is what it is by itself, whatever was before it.

use crate::stage::{bake_json, cornell, data, folder, is_dark, relight, sequence};
use relight_scene::image::{FloatImage, Layers, Limits, read_exr};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use tempfile::TempDir;

/// Those that light by lamps, with options that make them fast.
const INTEGRATORS: [&[&str]; 6] = [
    &["transfer"],
    &["brute"],
    &["lightcuts", "--vpls", "200"],
    &["pixelcuts", "--vpls", "200"],
    &["path"],
    &["lightcuts", "--vpls", "200", "--reconstruction", "on"],
];

const LAYERS: [&str; 4] = ["beauty", "emission", "direct", "indirect"];

/// Frames of a sequence, in 32 bits.
fn frames(asset: &Path, lights: &Path, integrator: &[&str], range: &str) -> Vec<Layers> {
    let folder = folder();
    relight()
        .arg("play")
        .arg(asset)
        .arg("--lights")
        .arg(lights)
        .arg("-o")
        .arg(folder.path().join("f_####.exr"))
        .args(["--frames", range, "--size", "8x8", "--float"])
        .args(["--layers", &LAYERS.join(",")])
        .arg("--integrator")
        .args(integrator)
        .assert()
        .success();
    let mut files: Vec<PathBuf> = (folder.path().read_dir().unwrap())
        .map(|file| file.unwrap().path())
        .collect();
    files.sort();
    let read = |file: &PathBuf| read_exr(file, &Limits::default()).unwrap();
    files.iter().map(read).collect()
}

fn pixels(layers: &Layers, name: &str) -> FloatImage {
    layers.rgb(name).unwrap()
}

fn same(a: &Layers, b: &Layers) -> bool {
    LAYERS
        .iter()
        .all(|name| pixels(a, name).pixels == pixels(b, name).pixels)
}

/// Every number is one, and light is there or not, but for what links that were left out take away.
fn assert_sane(frame: &Layers, about: &str) {
    for name in LAYERS {
        let image = pixels(frame, name);
        let values = image.pixels.as_flattened();
        let most = values.iter().fold(0.0f32, |most, &v| most.max(v));
        assert!(
            values.iter().all(|v| v.is_finite() && *v >= -1e-2 * most),
            "{about}: {name}"
        );
    }
}

/// Truth: each frame played alone, and the frame in which the lamp was the same before.
#[test]
fn a_lamp_that_jumps_blinks_and_passes_through_walls_leaves_no_trace() {
    let folder = folder();
    // Corners of the box, within its floor and its wall, in the box on the floor, and outside; and as it was.
    let text = r#"{ "relight_sequence": 1, "frames": 12, "lights": [ { "name": "lamp", "type": "point",
        "position": { "interpolation": "step", "keys": [[0, [0.1, 0.5, 0.1]], [1, [0.5, 0.05, 0.5]], [2, [0.1, 0.5, 0.1]],
            [3, [0.3, 0.0, 0.3]], [4, [0.0, 0.3, 0.3]], [5, [-0.2, 0.3, 0.3]], [6, [-50, 0.3, 0.3]], [7, [0.18, 0.1, 0.17]],
            [8, [0.1, 0.5, 0.1]]] },
        "intensity": { "interpolation": "step", "keys": [[0, [1, 1, 1]], [9, [0, 0, 0]], [10, [1, 1, 1]], [11, [0, 0, 0]]] } } ] }"#;
    let lights = sequence(folder.path(), "jumps.json", text);
    for integrator in INTEGRATORS {
        let all = frames(cornell(), &lights, integrator, "0-11");
        for (k, frame) in all.iter().enumerate() {
            assert_sane(frame, &format!("{integrator:?}, frame {k}"));
        }
        for k in [2, 8, 10] {
            assert!(same(&all[0], &all[k]), "{integrator:?}: frame {k} is not frame 0");
        }
        for k in [9, 11] {
            assert!(is_dark(&all[k], "beauty"), "{integrator:?}: frame {k} is lit");
        }
        for k in [1, 5, 7, 8] {
            let alone = frames(cornell(), &lights, integrator, &format!("{k}-{k}"));
            assert!(
                same(&alone[0], &all[k]),
                "{integrator:?}: frame {k} is another by itself"
            );
        }
    }
}

/// Truth: it doesn't move, also where keys say so.
#[test]
fn a_lamp_that_stands_still_for_a_thousand_frames_is_the_same_in_all() {
    let folder = folder();
    let lamp = |fields: &str| {
        let text = r#"{ "relight_sequence": 1, "frames": 1000, "lights": [ { "name": "lamp", FIELDS,
            "position": { "keys": [[0, [0.3, 0.4, 0.2]], [999, [0.3, 0.4, 0.2]]] } } ] }"#;
        text.replace("FIELDS", fields)
    };
    let point = sequence(
        folder.path(),
        "point.json",
        &lamp(r#""type": "point", "intensity": [1, 1, 1]"#),
    );
    let globe = sequence(
        folder.path(),
        "globe.json",
        &lamp(
            r#""type": "sphere", "radius": 0.03, "radiance": { "interpolation": "cubic", "keys": [[0, [9, 9, 9]], [500, [9, 9, 9]]] }"#,
        ),
    );
    let same_in_all = |lights: &Path, integrator: &[&str], range: &str, many: usize| {
        let all = frames(cornell(), lights, integrator, range);
        assert_eq!(all.len(), many);
        assert_sane(&all[0], &format!("{integrator:?}"));
        assert!(all.iter().all(|frame| same(frame, &all[0])), "{integrator:?}");
    };
    same_in_all(&point, &["transfer"], "0-999", 1000);
    for integrator in INTEGRATORS {
        same_in_all(&globe, integrator, "0-999x333", 4);
    }
}

/// The table with visibility cuts, coarse.
fn table() -> &'static Path {
    static ASSET: OnceLock<(TempDir, PathBuf)> = OnceLock::new();
    &ASSET
        .get_or_init(|| {
            let folder = folder();
            let asset = folder.path().join("table.relight");
            let coarse = ["--levels", "2", "--sender-levels", "1", "--coarse-radius", "0.1"];
            let cuts = ["--cuts", "environment", "--cut-lights", "1024", "--sigma", "6"];
            bake_json(&data("table.glb"), &asset, &[&coarse[..], &cuts].concat());
            (folder, asset)
        })
        .1
}

/// Ways to light by what is far away.
const DISTANT: [&[&str]; 7] = [
    &["auto"],
    &["cuts"],
    &["transfer"],
    &["brute"],
    &[
        "lightcuts",
        "--environment-samples",
        "300",
        "--sky-samples",
        "300",
        "--sun-samples",
        "4",
        "--vpls",
        "100",
    ],
    &[
        "pixelcuts",
        "--environment-samples",
        "300",
        "--sky-samples",
        "300",
        "--sun-samples",
        "4",
        "--vpls",
        "100",
    ],
    &["path"],
];

/// Truth: half a turn and another are none.
#[test]
fn a_map_that_turns_over_in_every_frame_is_one_of_two() {
    let folder = folder();
    std::fs::copy(data("window.hdr"), folder.path().join("window.hdr")).unwrap();
    let text = r#"{ "relight_sequence": 1, "frames": 3, "lights": [ { "name": "sky", "type": "environment", "file": "window.hdr",
        "rotation_deg": { "keys": [[0, 0], [2, 360]] } } ] }"#;
    let lights = sequence(folder.path(), "turns.json", text);
    for integrator in DISTANT {
        let all = frames(table(), &lights, integrator, "0-2");
        all.iter()
            .for_each(|frame| assert_sane(frame, &format!("{integrator:?}")));
        assert!(
            !is_dark(&all[0], "direct") && !same(&all[0], &all[1]),
            "{integrator:?}"
        );
        assert_close(&all[2], &all[0], 1e-3, &format!("{integrator:?}"));
    }
}

/// Mean difference of the beauty, relative to the mean.
fn assert_close(a: &Layers, b: &Layers, bound: f64, about: &str) {
    let (a, b) = (pixels(a, "beauty"), pixels(b, "beauty"));
    let values = || a.pixels.as_flattened().iter().zip(b.pixels.as_flattened());
    let off: f64 = values().map(|(a, b)| (f64::from(*a) - f64::from(*b)).abs()).sum();
    let all: f64 = values().map(|(_, b)| f64::from(*b).abs()).sum();
    assert!(off <= bound * all, "{about}: {} off", off / all);
}

/// Truth: a night is dark, and an evening has no light that was not there before. No step takes more than the steps before it suggest.
#[test]
fn a_sun_that_sets_takes_its_light_along() {
    let folder = folder();
    // From 6° above to 9° below the horizon, a degree and a half a frame.
    let keys: Vec<String> = (0..=10)
        .map(|k| {
            let height = (6.0 - 1.5 * f64::from(k)).to_radians();
            format!("[{k}, [0.3, {}, {}]]", height.tan() * 1.044, 1.0)
        })
        .collect();
    let text = format!(
        r#"{{ "relight_sequence": 1, "frames": 11, "lights": [ {{ "name": "day", "type": "sun_sky", "turbidity": 2,
        "sun_direction": {{ "keys": [{}] }} }} ] }}"#,
        keys.join(", ")
    );
    let lights = sequence(folder.path(), "evening.json", &text);
    for integrator in DISTANT {
        let all = frames(table(), &lights, integrator, "0-10");
        let means: Vec<f64> = (all.iter())
            .map(|frame| crate::stage::mean(&pixels(frame, "beauty")))
            .collect();
        all.iter()
            .for_each(|frame| assert_sane(frame, &format!("{integrator:?}")));
        assert!(means[0] > 0.0, "{integrator:?}");
        // Civil twilight ends at −6°.
        assert!(
            all[9..].iter().all(|frame| is_dark(frame, "beauty")),
            "{integrator:?}: {means:?}"
        );
        for pair in means.windows(2) {
            assert!(pair[1] <= 1.02 * pair[0], "{integrator:?}: {means:?}");
        }
    }
}

/// Truth: the one light alone.
#[test]
fn lights_that_are_0_or_next_to_nothing_add_nothing() {
    let folder = folder();
    let one = |strength: &str| {
        format!(
            r#"{{ "name": "one", "type": "point", "position": [0.25, 0.4, 0.2], "intensity": [{strength}, {strength}, {strength}] }}"#
        )
    };
    let all = |lights: &[String]| {
        format!(
            r#"{{ "relight_sequence": 1, "lights": [ {} ] }}"#,
            lights.join(", ")
        )
    };
    let dark = [
        r#"{ "name": "a", "type": "point", "position": [0.1, 0.4, 0.2], "intensity": [0, 0, 0] }"#,
        r#"{ "name": "b", "type": "spot", "position": [0.1, 0.4, 0.2], "direction": [0, -1, 0], "outer_angle_deg": 40, "intensity": [0, 0, 0] }"#,
        r#"{ "name": "c", "type": "directional", "direction": [0, -1, 0.2], "irradiance": [0, 0, 0] }"#,
        r#"{ "name": "d", "type": "rect", "center": [0.2, 0.5, 0.2], "edge_u": [0.1, 0, 0], "edge_v": [0, 0, 0.1], "radiance": [0, 0, 0] }"#,
        r#"{ "name": "e", "type": "sphere", "center": [0.2, 0.3, 0.2], "radius": 0.05, "radiance": [0, 0, 0] }"#,
        r#"{ "name": "f", "type": "sun_sky", "turbidity": 3, "sun_direction": [0, 1, 1], "scale": 0 }"#,
        r#"{ "name": "g", "type": "emissive", "scale": 0 }"#,
    ];
    let mut among_dark: Vec<String> = dark.iter().map(|light| (*light).to_owned()).collect();
    among_dark.insert(3, one("1"));
    let mut among_faint: Vec<String> = (0..100)
        .map(|k| {
            format!(
                r#"{{ "name": "faint {k}", "type": "point", "position": [{}, 0.3, 0.3], "intensity": [1e-30, 1e-30, 1e-30] }}"#,
                0.05 + 0.004 * f64::from(k)
            )
        })
        .collect();
    among_faint.insert(50, one("1e30"));
    let file = |name: &str, lights: &[String]| sequence(folder.path(), name, &all(lights));
    for (name, crowd, strength) in [("dark", among_dark, "1"), ("faint", among_faint, "1e30")] {
        let alone = file(&format!("{name}_one.json"), &[one(strength)]);
        let crowd = file(&format!("{name}.json"), &crowd);
        for integrator in INTEGRATORS {
            let [alone, crowd] =
                [&alone, &crowd].map(|lights| frames(cornell(), lights, integrator, "0-0").remove(0));
            let about = format!("{name}, {integrator:?}");
            assert_sane(&crowd, &about);
            // Paths choose among all lights by chance: other noise, of 64 samples.
            let bound = if integrator == ["path"] { 0.15 } else { 0.02 };
            assert_close(&crowd, &alone, bound, &about);
        }
    }
}
