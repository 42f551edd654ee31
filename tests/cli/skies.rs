//! Weather, and a sky for each frame, as commands play them.

use crate::stage::{complaint, folder, relight, sequence, yard};
use relight_scene::image::{BEAUTY, ExrHeader, FloatImage, Layers, Limits, read_exr, write_exr};
use std::path::Path;

/// Mean luminance of the direct light of each frame.
fn played(asset: &Path, lights: &Path, integrator: &str) -> Vec<f64> {
    let frames = lights.with_extension("#.exr");
    let mut play = relight();
    play.arg("play")
        .arg(asset)
        .arg("--lights")
        .arg(lights)
        .arg("-o")
        .arg(&frames);
    play.args([
        "--size",
        "24x24",
        "--float",
        "--force",
        "--spp",
        "64",
        "--integrator",
        integrator,
    ])
    .assert()
    .success();
    (0..3)
        .map(|frame| {
            let file = lights.with_extension(format!("{frame}.exr"));
            let direct = read_exr(&file, &Limits::default())
                .unwrap()
                .rgb("direct")
                .unwrap();
            let luminance = |p: &[f32; 3]| f64::from(0.2126 * p[0] + 0.7152 * p[1] + 0.0722 * p[2]);
            direct.pixels.iter().map(luminance).sum::<f64>() / direct.pixels.len() as f64
        })
        .collect()
}

/// Truth: Radiance's gendaymtx for the same hours (pyradiance 1.3.1, `-m 4`): irradiance of the ground by the sky, and the sun's disc of
/// 0.533° times the sine of its height.
#[test]
fn weather_lights_a_yard_as_radiance_says() {
    let folder = folder();
    let asset = yard(folder.path());
    let tape = "place Zurich_CHE\nlatitude 47.38\nlongitude -8.57\ntime_zone -15\nsite_elevation 569\n\
                weather_data_file_units 1\n6 21 12.500 820 110\n6 21 13.500 0 310\n";
    std::fs::write(folder.path().join("city.wea"), tape).unwrap();
    let lights = sequence(
        folder.path(),
        "june.json",
        r#"{ "relight_sequence": 1, "frames": 3, "lights": [ { "name": "june", "type": "weather", "file": "city.wea",
            "day": "06-21", "hours": { "keys": [[0, 12.5], [1, 13.5]] } } ] }"#,
    );
    let disc = 6.977e6 * 6.796_71e-5;
    let truth = [80.311 + disc * 0.913_999, 205.936];
    for integrator in ["transfer", "path"] {
        let found = played(&asset, &lights, integrator);
        for (frame, found) in found.iter().enumerate() {
            let truth = truth[frame.min(1)] / std::f64::consts::PI;
            // The patches of a sky of 2305, and the noise of 24 × 24 pixels.
            assert!(
                (found / truth - 1.0).abs() < 0.02,
                "{integrator}, frame {frame}: {found}, {truth}"
            );
        }
    }
}

/// Truth: an even sky of radiance L lights a level white surface to a radiance of L.
#[test]
fn each_frame_has_the_sky_of_its_number() {
    let folder = folder();
    let asset = yard(folder.path());
    for (number, radiance) in [(0, 1.0f32), (1, 3.0), (2, 0.5)] {
        let image = FloatImage {
            width: 8,
            height: 4,
            pixels: vec![[radiance; 3]; 32],
        };
        let file = folder.path().join(format!("sky_{number:02}.exr"));
        let layers = Layers::from_image(BEAUTY, &image);
        write_exr(&file, &layers, &ExrHeader::default(), true).unwrap();
    }
    let lights = sequence(
        folder.path(),
        "lapse.json",
        r#"{ "relight_sequence": 1, "frames": 3, "lights": [ { "name": "sky", "type": "environment", "file": "sky_##.exr" } ] }"#,
    );
    for integrator in ["transfer", "path", "lightcuts"] {
        let found = played(&asset, &lights, integrator);
        for (found, truth) in found.iter().zip([1.0, 3.0, 0.5]) {
            assert!(
                (found / truth - 1.0).abs() < 0.03,
                "{integrator}: {found}, {truth}"
            );
        }
    }
    // None of the maps may be written over.
    let mut play = relight();
    play.arg("play")
        .arg(&asset)
        .arg("--lights")
        .arg(&lights)
        .arg("-o")
        .arg(folder.path().join("sky_##.exr"));
    play.args(["--size", "8x8", "--force"]);
    let said = complaint(&mut play, 1);
    assert!(
        said.contains("sky_00.exr") && said.contains("is read by this command"),
        "{said}"
    );
}
