//! `relight play --daylight-coefficients`.

use crate::stage::{complaint, cornell, data, folder, json, relight, sequence, yard};
use relight_scene::image::{Layers, read_exr};
use std::path::Path;

/// A sunny hour, one of clouds, and one of the night.
fn hours(folder: &Path) -> std::path::PathBuf {
    let mut tape = "place Zurich_CHE\nlatitude 47.38\nlongitude -8.57\ntime_zone -15\nsite_elevation 569\nweather_data_file_units 1\n".to_owned();
    // Between the hours that are asked for there must be no gap.
    for hour in 0..14 {
        let light = match hour {
            12 => "820 110",
            13 => "0 310",
            _ => "0 0",
        };
        tape += &format!("6 21 {hour}.500 {light}\n");
    }
    std::fs::write(folder.join("city.wea"), tape).unwrap();
    sequence(
        folder,
        "june.json",
        r#"{ "relight_sequence": 1, "frames": 3, "lights": [ { "name": "june", "type": "weather", "file": "city.wea",
            "day": "06-21", "hours": { "keys": [[0, 12.5], [1, 13.5], [2, 0.5]], "interpolation": "step" } } ] }"#,
    )
}

fn layers(path: &Path) -> Layers {
    read_exr(path, &Default::default()).unwrap()
}

/// Truth: Radiance's gendaymtx for the same hours (pyradiance 1.3.1): its 145 patches (-m 1) times their
/// projected solid angles; a level white surface sends back the irradiance over π.
#[test]
fn a_yard_is_as_bright_as_the_patches_of_radiance_make_it() {
    let folder = folder();
    let (asset, lights) = (yard(folder.path()), hours(folder.path()));
    let (count, sun) = ("145", 429.591);
    let output = relight()
        .arg("play")
        .arg(&asset)
        .arg("--lights")
        .arg(&lights)
        .arg("-o")
        .arg(folder.path().join("f_##.exr"))
        .args(["--size", "12x12", "--spp", "16", "--float", "--json", "--layers"])
        .args([
            "beauty,emission,direct,indirect",
            "--daylight-coefficients",
            count,
        ])
        .assert()
        .success()
        .get_output()
        .clone();
    let said = json(&output.stdout);
    assert_eq!(said["daylight"]["patches"], count.parse::<u64>().unwrap());
    assert_eq!(said["daylight"]["images"], said["daylight"]["patches"]);
    assert!(said["daylight"]["bytes"].as_u64().unwrap() > 0);
    assert!(said["once_per_shot"]["patches"].as_f64().unwrap() > 0.0);
    for frame in said["frames"].as_array().unwrap() {
        let time = |name: &str| frame[name].as_f64().unwrap();
        assert!(time("total") > 0.0 && time("sky") >= 0.0 && time("sum") >= 0.0 && time("write") > 0.0);
    }
    for (frame, irradiance) in [79.874 + sun, 204.815, 0.0].into_iter().enumerate() {
        let file = folder.path().join(format!("f_{frame:02}.exr"));
        let found = layers(&file).rgb("direct").unwrap();
        let luminance = |p: &[f32; 3]| f64::from(0.2126 * p[0] + 0.7152 * p[1] + 0.0722 * p[2]);
        let mean = found.pixels.iter().map(luminance).sum::<f64>() / found.pixels.len() as f64;
        let truth = irradiance / std::f64::consts::PI;
        // The sky at middles of patches instead of its means, and the noise of 12 × 12 pixels.
        assert!(
            (mean - truth).abs() <= 0.02 * truth,
            "{count}, {frame}: {mean}, {truth}"
        );
        let bytes = std::fs::read(&file).unwrap();
        assert!(bytes.windows(15).any(|text| text == b"relightDaylight"));
    }
}

#[test]
fn frames_are_the_same_for_any_number_of_threads_and_their_beauty_is_the_sum_of_its_layers() {
    let folder = folder();
    let lights = hours(folder.path());
    let played = |threads: &str, wanted: &str| {
        let mut play = relight();
        play.arg("play")
            .arg(cornell())
            .arg("--lights")
            .arg(&lights)
            .arg("-o")
            .arg(folder.path().join("t_#.exr"));
        play.args([
            "--size", "20x20", "--spp", "4", "--float", "--frames", "0-1", "--png", "--force",
        ]);
        play.args([
            "--daylight-coefficients",
            "145",
            "--threads",
            threads,
            "--layers",
            wanted,
        ]);
        play.assert().success();
        (0..2)
            .map(|frame| std::fs::read(folder.path().join(format!("t_{frame}.exr"))).unwrap())
            .collect::<Vec<_>>()
    };
    let all = "beauty,emission,direct,indirect,background,normal";
    assert!(played("1", all) == played("3", all), "threads change bytes");
    let frame = layers(&folder.path().join("t_0.exr"));
    let [beauty, emission, direct, indirect] =
        ["beauty", "emission", "direct", "indirect"].map(|name| frame.rgb(name).unwrap().pixels);
    for (i, pixel) in beauty.iter().enumerate() {
        for channel in 0..3 {
            let sum = emission[i][channel] + direct[i][channel] + indirect[i][channel];
            assert!((pixel[channel] - sum).abs() <= 1e-6 * sum.abs());
        }
    }
    played("2", "beauty");
    let alone = layers(&folder.path().join("t_0.exr")).rgb("beauty").unwrap();
    for (a, b) in alone.pixels.iter().flatten().zip(beauty.iter().flatten()) {
        // Halves of patches, rounded once instead of three times.
        assert!((a - b).abs() <= 0.002 * b.abs() + 1e-4, "{a} {b}");
    }
    assert!(folder.path().join("t_1.png").exists());
}

#[test]
fn what_is_no_sum_of_patches_is_refused_in_words() {
    let folder = folder();
    let lights = hours(folder.path());
    let lamps = sequence(
        folder.path(),
        "lamps.json",
        r#"{ "relight_sequence": 1, "lights": [ { "name": "day", "type": "sun_sky", "sun_direction": [0, 1, 1] },
            { "name": "lamp", "type": "point", "position": [0, 1, 0], "intensity": [1, 1, 1] }, { "name": "glow", "type": "emissive" } ] }"#,
    );
    let none = sequence(
        folder.path(),
        "none.json",
        r#"{ "relight_sequence": 1, "lights": [] }"#,
    );
    let dolly = sequence(
        folder.path(),
        "dolly.json",
        r#"{ "relight_sequence": 1, "frames": 2, "lights": [ { "name": "day", "type": "sun_sky", "sun_direction": [0, 1, 1] } ],
            "camera": { "position": { "keys": [[0, [0, 0.3, 1]], [1, [0.1, 0.3, 1]]] }, "look_at": [0.2, 0.2, 0], "vfov_deg": 40 } }"#,
    );
    let edits = folder.path().join("edits.json");
    std::fs::write(
        &edits,
        r#"{ "relight_materials": 1, "edits": [ { "material": "White", "roughness": { "keys": [[0, 0.4], [1, 0.5]] } } ] }"#,
    )
    .unwrap();
    let mut wrong = relight();
    wrong
        .arg("play")
        .arg(cornell())
        .args(["-o", "r.exr", "--daylight-coefficients", "100"]);
    let output = wrong.assert().code(2).get_output().clone();
    assert!(String::from_utf8_lossy(&output.stderr).contains("a sky has 145, 577 or 2305 patches"));
    let said = |lights: &Path, count: &str, more: &[&str], code: i32| {
        let mut play = relight();
        play.arg("play")
            .arg(cornell())
            .arg("--lights")
            .arg(lights)
            .arg("-o")
            .arg(folder.path().join("r_#.exr"));
        play.args(["--daylight-coefficients", count]).args(more);
        let said = complaint(&mut play, code);
        assert!(!folder.path().join("r_0.exr").exists());
        said
    };
    let edits = edits.to_str().unwrap();
    for (said, expected) in [
        (
            said(&lamps, "145", &[], 2),
            "but there is lamp, of type point and 1 other light; play those in a sequence of their own",
        ),
        (
            said(&data("cornell_moving.lights.json"), "145", &[], 2),
            "makes light of suns and skies alone",
        ),
        (
            said(&none, "145", &[], 2),
            "the sequence has none: add a light of type weather or sun_sky",
        ),
        (
            said(&dolly, "145", &[], 2),
            "this camera moves: choose another with --camera",
        ),
        (
            said(&lights, "145", &["--materials", edits], 2),
            "--materials has keys",
        ),
        (
            said(&lights, "145", &["--layers", "beauty,lights"], 2),
            "makes no layers lights",
        ),
        (
            said(&lights, "145", &["--layers", "nodes"], 2),
            "makes no layers nodes",
        ),
        (
            said(&lights, "2305", &["--size", "8000x8000"], 1),
            "choose fewer patches, a smaller image, or the beauty alone",
        ),
    ] {
        assert!(said.contains(expected), "{said}\nlacks\n{expected}");
    }
}
