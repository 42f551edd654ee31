//! `relight play`.

use crate::stage::{
    SQUARE, TINY_LIGHT, bake_json, complaint, cornell, data, folder, gltf, is_dark, json, names, relight,
    sequence,
};
use assert_cmd::Command;
use relight_scene::image::{FloatImage, Layers, decode_ldr, read_exr};
use std::path::Path;

const SIZE: [&str; 2] = ["--size", "32x32"];

fn play(output: &Path) -> Command {
    let mut command = relight();
    command
        .arg("play")
        .arg(cornell())
        .arg("-o")
        .arg(output)
        .args(SIZE);
    command
}

fn layers(path: &Path) -> Layers {
    read_exr(path, &Default::default()).unwrap()
}

fn moving() -> std::path::PathBuf {
    data("cornell_moving.lights.json")
}

#[test]
fn frames_are_named_by_number_and_written_with_their_layers() {
    let folder = folder();
    let output = play(&folder.path().join("new/f_####.exr"))
        .arg("--lights")
        .arg(moving())
        .args(["--frames", "2-8x3", "--png", "--json"])
        .assert()
        .success()
        .get_output()
        .clone();
    let said = json(&output.stdout);
    let frames = said["frames"].as_array().unwrap();
    assert_eq!(
        frames
            .iter()
            .map(|f| f["frame"].as_u64().unwrap())
            .collect::<Vec<_>>(),
        [2, 5, 8]
    );
    for key in [
        "total",
        "direct_points",
        "transfer",
        "flatten",
        "direct_pixels",
        "reconstruct",
        "write",
    ] {
        assert!(frames.iter().all(|f| f[key].as_f64().unwrap() >= 0.0), "{key}");
    }
    // What is done once per shot is apart from the frames. What lights a frame is within its total; it is written while the next
    // one is lit, but for the last.
    for key in ["load", "expose", "weigh"] {
        assert!(said["once_per_shot"][key].as_f64().unwrap() > 0.0, "{key}");
    }
    for (i, frame) in frames.iter().enumerate() {
        let beside = i + 1 < frames.len();
        let parts = frame
            .as_object()
            .unwrap()
            .iter()
            .filter(|p| *p.0 != "frame" && *p.0 != "total" && !(beside && *p.0 == "write"));
        let sum: f64 = parts.map(|p| p.1.as_f64().unwrap()).sum();
        let total = frame["total"].as_f64().unwrap();
        assert!(sum <= total, "{sum} of {total}");
    }
    let files = names(&folder.path().join("new"));
    assert_eq!(
        files,
        [
            "f_0002.exr",
            "f_0002.png",
            "f_0005.exr",
            "f_0005.png",
            "f_0008.exr",
            "f_0008.png"
        ]
    );
    let read = layers(&folder.path().join("new/f_0005.exr"));
    let mut found: Vec<&str> = read.layers.iter().map(|l| l.name.as_str()).collect();
    found.sort_unstable();
    assert_eq!(found, ["A", "beauty", "direct", "indirect"]);
    assert_eq!((read.width, read.height), (32, 32));
}

/// A lamp that is off in the first frame, in some unit: previews of both frames are exposed by the second, so that both units look
/// alike to a tenth of a stop, and what was chosen is said.
#[test]
fn previews_expose_themselves_once_for_all_frames() {
    let folder = folder();
    let stops = |unit: f64| {
        let lights = folder.path().join("lights.json");
        let text = format!(
            r#"{{"relight_sequence": 1, "frames": 2, "lights": [{{"name": "lamp", "type": "point", "position": [0.3, 0.4, 0.3],
                "intensity": {{"keys": [[0, [0, 0, 0]], [1, [{unit}, {unit}, {unit}]]], "interpolation": "step"}}}}]}}"#
        );
        std::fs::write(&lights, text).unwrap();
        let output = play(&folder.path().join("f_####.exr"))
            .arg("--lights")
            .arg(&lights)
            .args(["--png", "--json"])
            .assert()
            .success()
            .get_output()
            .clone();
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(said.matches("--exposure").count(), 1, "{said}");
        let stops = json(&output.stdout)["exposure_ev"].as_f64().unwrap();
        (stops, std::fs::read(folder.path().join("f_0001.png")).unwrap())
    };
    let ((small, first), (large, second)) = (stops(0.01), stops(0.01 * 4096.0));
    assert!((small - large - 12.0).abs() < 0.11, "{small} {large}");
    let mean = |png: &[u8]| {
        let shown = decode_ldr("preview", png, &Default::default()).unwrap().rgba8;
        shown.iter().map(|p| f64::from(p[1])).sum::<f64>() / shown.len() as f64
    };
    let (first, second) = (mean(&first), mean(&second));
    assert!(
        (first - second).abs() < 4.0 && (60.0..180.0).contains(&first),
        "{first} {second}"
    );
}

#[test]
fn several_frames_need_a_place_for_their_number() {
    let folder = folder();
    let text = complaint(
        play(&folder.path().join("f.exr")).arg("--lights").arg(moving()),
        2,
    );
    assert!(text.contains("####"), "{text}");
    let text = complaint(
        play(&folder.path().join("f.exr"))
            .arg("--lights")
            .arg(moving())
            .args(["--frames", "24"]),
        2,
    );
    assert!(text.contains("24 frames"), "{text}");
    play(&folder.path().join("f.exr"))
        .arg("--lights")
        .arg(moving())
        .args(["--frames", "23"])
        .assert()
        .success();
}

/// Emission, direct and indirect light add up to the beauty exactly: it is stored as their sum.
#[test]
fn layers_add_up_and_every_integrator_writes_the_same_ones() {
    let folder = folder();
    for integrator in ["transfer", "brute", "path"] {
        let frame = folder.path().join(format!("{integrator}.exr"));
        play(&frame)
            .args(["--integrator", integrator, "--spp", "4", "--float"])
            .args([
                "--layers",
                "beauty,emission,direct,indirect,albedo,normal,depth,lights",
            ])
            .assert()
            .success();
        let read = layers(&frame);
        let rgb = |name: &str| {
            read.rgb(name)
                .unwrap_or_else(|| panic!("{integrator} writes no {name}"))
        };
        let [beauty, emission, direct, indirect] = ["beauty", "emission", "direct", "indirect"].map(rgb);
        for i in 0..beauty.pixels.len() {
            for k in 0..3 {
                let sum = emission.pixels[i][k] + direct.pixels[i][k] + indirect.pixels[i][k];
                assert!(
                    (sum - beauty.pixels[i][k]).abs() <= 1e-6 * sum.abs().max(1e-6),
                    "{integrator}, pixel {i}"
                );
            }
        }
        assert_eq!(
            indirect.pixels.iter().all(|p| *p == [0.0; 3]),
            integrator == "brute"
        );
        // The box's own light is its emissive patch.
        let light = read.layers.iter().find(|l| l.name.starts_with("light.")).unwrap();
        assert!(light.data.iter().any(|v| *v > 0.0));
        assert!(
            rgb("albedo")
                .pixels
                .iter()
                .flatten()
                .all(|v| (0.0..=1.0).contains(v))
        );
        assert_eq!(read.layer("depth").unwrap().channels, 1);
    }
}

/// Truth: `brute` over the same points; and what the JSON says of both.
#[test]
fn pixelcuts_and_brute_force_light_by_the_same_points() {
    let folder = folder();
    let mut frames = Vec::new();
    for integrator in ["brute", "pixelcuts"] {
        let frame = folder.path().join(format!("{integrator}.exr"));
        let output = play(&frame)
            .args(["--integrator", integrator, "--spp", "1", "--float", "--json"])
            .args(["--area-samples", "20", "--vpls", "100"])
            .args(["--layers", "beauty,emission,direct,indirect,lights"])
            .assert()
            .success()
            .get_output()
            .clone();
        let printed = json(&output.stdout);
        let times = &printed["frames"][0];
        assert_eq!(
            (times["lights"].as_u64(), times["virtual_lights"].as_u64()),
            (Some(120), Some(100))
        );
        assert!(times["shadow_rays_per_pixel"].as_f64().unwrap() > 0.0);
        assert_eq!(times["nodes_per_pixel"].is_number(), integrator == "pixelcuts");
        frames.push(layers(&frame));
    }
    // The twenty are bright enough to get shadow rays at every pixel: the sums differ by rounding.
    for name in ["emission", "direct"] {
        let [brute, cuts] = [0, 1].map(|i| frames[i].rgb(name).unwrap().pixels);
        for (a, b) in brute.iter().flatten().zip(cuts.iter().flatten()) {
            assert!((a - b).abs() <= 1e-5 * a, "{name}: {b}, not {a}");
        }
    }
    let [brute, cuts] = [0, 1].map(|i| frames[i].rgb("indirect").unwrap());
    let sum = |image: &FloatImage| image.pixels.iter().flatten().map(|v| f64::from(*v)).sum::<f64>();
    assert!((sum(&cuts) / sum(&brute) - 1.0).abs() < 0.05);
    let text = complaint(play(&folder.path().join("f.exr")).args(["--vpls", "2"]), 2);
    assert!(
        text.contains("--integrator brute, lightcuts and pixelcuts"),
        "{text}"
    );
}

/// Whoever asks for many lights alone hears that none of them is indirect light.
#[test]
fn many_light_methods_say_whether_they_make_indirect_light() {
    let folder = folder();
    for integrator in ["brute", "lightcuts", "pixelcuts"] {
        for (vpls, sentence) in [
            ("0", "no indirect light"),
            ("9", "; indirect light of virtual lights."),
        ] {
            let mut frame = play(&folder.path().join(format!("{integrator}_{vpls}.exr")));
            frame.args(["--integrator", integrator, "--vpls", vpls]);
            let said = String::from_utf8(frame.assert().success().get_output().stderr.clone()).unwrap();
            assert!(said.contains(sentence), "{integrator}, {vpls}: {said}");
        }
    }
}

fn one_light(folder: &Path, name: &str, lights: &[([f32; 3], f32)]) -> FloatImage {
    let lights: Vec<String> = lights
        .iter()
        .enumerate()
        .map(|(i, (position, watts))| {
            format!(
                r#"{{"name": "l{i}", "type": "point", "position": {position:?}, "intensity": [{watts}, {watts}, {watts}]}}"#
            )
        })
        .collect();
    let text = format!(r#"{{"relight_sequence": 1, "lights": [{}]}}"#, lights.join(","));
    let lights = sequence(folder, "l.json", &text);
    let frame = folder.join(format!("{name}.exr"));
    play(&frame)
        .arg("--lights")
        .arg(lights)
        .arg("--float")
        .assert()
        .success();
    layers(&frame).rgb("beauty").unwrap()
}

/// Light adds up: a + 2b lit together is the sum of both alone, to 10⁻⁴ of each pixel; in what is nearly dark, to rounding of the
/// brightest.
#[test]
fn light_is_linear() {
    let folder = folder();
    let (a, b) = (([0.2, 0.4, 0.1], 1.0), ([0.45, 0.4, 0.15], 1.0));
    let left = one_light(folder.path(), "a", &[a]);
    let right = one_light(folder.path(), "b", &[b]);
    let both = one_light(folder.path(), "both", &[a, (b.0, 2.0)]);
    let brightest = both.pixels.iter().flatten().fold(0.0f32, |m, v| m.max(*v));
    for i in 0..both.pixels.len() {
        for k in 0..3 {
            let sum = left.pixels[i][k] + 2.0 * right.pixels[i][k];
            let tolerance = 1e-4 * sum.abs() + 1e-6 * brightest;
            assert!(
                (both.pixels[i][k] - sum).abs() <= tolerance,
                "pixel {i}: {} and {sum}",
                both.pixels[i][k]
            );
        }
    }
    assert!(brightest > 0.0);
}

#[test]
fn a_frame_depends_on_asset_lights_and_seed_not_on_threads() {
    let folder = folder();
    let bytes = |name: &str, more: &[&str]| {
        let frame = folder.path().join(name);
        play(&frame).args(more).assert().success();
        std::fs::read(frame).unwrap()
    };
    for integrator in ["transfer", "brute", "path"] {
        let run = |name: &str, more: &[&str]| {
            bytes(
                name,
                &[&["--integrator", integrator, "--spp", "2"], more].concat(),
            )
        };
        let one = run("one.exr", &["--threads", "1"]);
        assert!(
            one == run("two.exr", &["--threads", "2"]),
            "{integrator}: one and two threads differ"
        );
        // The box's light has an extent, so its samples depend on the seed; the header holds it in any case.
        assert!(
            one != run("seed.exr", &["--seed", "1"]),
            "{integrator}: the seed changes nothing"
        );
    }
}

#[test]
fn limits_of_paths_belong_to_the_path_tracer() {
    let folder = folder();
    let text = complaint(play(&folder.path().join("f.exr")).args(["--max-bounces", "2"]), 2);
    assert!(text.contains("bake --bounces"), "{text}");
    let frame = folder.path().join("one.exr");
    play(&frame)
        .args(["--integrator", "path", "--spp", "1", "--max-bounces", "1"])
        .assert()
        .success();
    assert!(is_dark(&layers(&frame), "indirect"));
}

#[test]
fn without_a_size_the_image_is_360_high_and_keeps_the_camera_s_shape() {
    let folder = folder();
    let frame = folder.path().join("f.exr");
    relight()
        .arg("play")
        .arg(cornell())
        .arg("-o")
        .arg(&frame)
        .args(["--integrator", "brute", "--spp", "1"])
        .assert()
        .success();
    assert_eq!(layers(&frame).height, 360);
}

/// A square that the scene's camera sees, and one 20 m behind it that a sequence's camera sees from the other side.
#[test]
fn what_an_asset_has_no_points_for_is_said_and_a_viewpoint_adds_them() {
    let folder = folder();
    let behind = SQUARE.map(|[x, y, z]| [-x, y, z - 20.0]);
    let scene = gltf(folder.path(), &[SQUARE, behind].concat());
    let text = r#"{ "relight_sequence": 1, "camera": { "position": [0, 0, -23], "look_at": [0, 0, 0], "vfov_deg": 30 },
        "lights": [ { "name": "lamp", "type": "point", "position": [0, 0, -22], "intensity": [1, 1, 1] } ] }"#;
    let behind = sequence(folder.path(), "behind.json", text);
    let front = sequence(folder.path(), "front.json", TINY_LIGHT);
    let said = |name: &str, more: &[&str], from_behind: bool| {
        let asset = folder.path().join(name);
        let radius = ["--levels", "2", "--sender-levels", "1", "--coarse-radius", "0.3"];
        bake_json(&scene, &asset, &[&radius, more].concat());
        let mut play = relight();
        play.arg("play").arg(&asset).args(SIZE).arg("--json").arg("-o");
        play.arg(folder.path().join("f.exr"));
        play.arg("--lights")
            .arg(if from_behind { &behind } else { &front });
        let output = play.assert().success().get_output().clone();
        let share = json(&output.stdout)["without_points"].as_f64().unwrap();
        (share, String::from_utf8(output.stderr).unwrap())
    };
    let (share, words) = said("front.relight", &[], true);
    assert!(share > 0.3, "{share}");
    assert!(
        words.contains("warning: ") && words.contains("--viewpoint=0,0,-23"),
        "{words}"
    );
    for from_behind in [true, false] {
        let (share, words) = said("both.relight", &["--viewpoint=0,0,-23"], from_behind);
        assert_eq!(share, 0.0, "{from_behind}: {words}");
        assert!(!words.contains("warning"), "{words}");
    }
}

/// Light is linear: what a lamp of 1 gives, times k, is what one of k gives, up to the largest that is read.
#[test]
fn the_largest_lights_are_right_and_larger_ones_are_refused() {
    let folder = folder();
    let frame = folder.path().join("f.exr");
    let lit = |intensity: &str| {
        let lights = TINY_LIGHT.replace(
            "[0.3, 0.2, 0.1]",
            &format!("[{intensity}, {intensity}, {intensity}]"),
        );
        let lights = sequence(folder.path(), "l.json", &lights);
        let mut play = play(&frame);
        play.arg("--lights")
            .arg(lights)
            .args(["--float", "--integrator", "transfer"]);
        play
    };
    lit("1").assert().success();
    let one = layers(&frame);
    lit("1e30").assert().success();
    let most = layers(&frame);
    for layer in ["direct", "indirect"] {
        let (one, most) = (one.rgb(layer).unwrap(), most.rgb(layer).unwrap());
        assert!(one.pixels.iter().flatten().any(|&v| v > 0.0));
        for (a, b) in one.pixels.iter().flatten().zip(most.pixels.iter().flatten()) {
            let (a, b) = (f64::from(*a), f64::from(*b) * 1e-30);
            assert!((a - b).abs() <= 1e-4 * a.max(1e-6), "{layer}: {a} {b}");
        }
    }
    let text = complaint(&mut lit("3e38"), 1);
    assert!(
        text.contains("expected a number from 0 to 1e30, found 3e38"),
        "{text}"
    );
}

/// Light sources without extent: as many as are asked for.
#[test]
fn the_numbers_of_points_are_options_and_rays_are_counted() {
    let folder = folder();
    let text = r#"{ "relight_sequence": 1, "lights": [
        { "name": "sky", "type": "sun_sky", "turbidity": 3, "sun_direction": [0.3, 0.7, -0.4] } ] }"#;
    let lights = sequence(folder.path(), "l.json", text);
    let run = |integrator: &str, more: &[&str]| {
        let mut play = play(&folder.path().join("f.exr"));
        play.arg("--lights")
            .arg(&lights)
            .args(["--json", "--integrator", integrator])
            .args(more);
        json(&play.assert().success().get_output().stdout)["frames"][0].clone()
    };
    let numbers = ["--sun-samples", "3", "--sky-samples", "50", "--vpls", "200"];
    let few = run("pixelcuts", &numbers);
    let lights_of = |frame: &serde_json::Value| {
        frame["lights"].as_u64().unwrap() - frame["virtual_lights"].as_u64().unwrap()
    };
    assert_eq!(few["virtual_lights"], 200);
    assert!((40..=53).contains(&lights_of(&few)), "{few}");
    assert!(few["shadow_rays_per_pixel"].as_f64().unwrap() > 0.0, "{few}");
    // Lightcuts take every point.
    let all = run("lightcuts", &numbers);
    assert!(all["virtual_lights"].as_u64().unwrap() > 200, "{all}");
    let text = complaint(play(&folder.path().join("f.exr")).args(["--sun-samples", "3"]), 2);
    assert!(text.contains("--sun-samples"), "{text}");
}
