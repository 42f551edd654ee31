//! A scene's own environment (EXT_lights_image_based): kept by a bake, and shines as the same map from a file.

use crate::stage::{TINY, data, edited, folder, inspect_json, relight, sequence};
use relight_scene::environment::direction_from_uv;
use relight_scene::image::{
    BEAUTY, ExrHeader, FloatImage, Image8, Layers, Limits, encode_png, read_exr, write_exr,
};
use serde_json::json;
use std::path::{Path, PathBuf};

/// Radiance from a direction, by which all six faces, their corners and edges differ: brighter above, redder to the right, bluer in front.
fn sky(d: [f64; 3]) -> [f64; 3] {
    let length = d.iter().map(|x| x * x).sum::<f64>().sqrt();
    let [x, y, z] = d.map(|x| x / length);
    [
        1.0 + 0.6 * x + 0.3 * y * z,
        1.0 + 0.8 * y + 0.1 * x * z,
        1.0 - 0.6 * z + 0.2 * x * y,
    ]
}

/// Pixels along a face.
const SIDE: usize = 64;

/// A face's image with the lowest row first, as Babylon.js has them; directions by the table of cube maps in OpenGL's specification.
fn face(face: usize) -> Vec<u8> {
    let texel = |i: usize| {
        let along = |n: usize| (n as f64 + 0.5) / SIDE as f64 * 2.0 - 1.0;
        let (s, t) = (along(i % SIDE), along(SIDE - 1 - i / SIDE));
        let d = match face {
            0 => [1.0, -t, -s],
            1 => [-1.0, -t, s],
            2 => [s, 1.0, t],
            3 => [s, -1.0, -t],
            4 => [s, -t, 1.0],
            _ => [-s, -t, -1.0],
        };
        // D is a third, so that nothing is above 1.
        let [r, g, b] = sky(d).map(|v| ((v / 3.0).powf(1.0 / 2.2) * 255.0).round() as u8);
        [r, g, b, 85]
    };
    let image = Image8 {
        width: SIDE,
        height: SIDE,
        rgba8: (0..SIDE * SIDE).map(texel).collect(),
    };
    encode_png("face", &image).unwrap()
}

/// The Cornell box without its front, under a sky turned by 90° about +Y with intensity 0.5.
fn scene(folder: &Path) -> PathBuf {
    let path = folder.join("lit.glb");
    edited(&data("cornell.glb"), &path, |document| {
        for face_index in 0..6 {
            std::fs::write(folder.join(format!("face{face_index}.png")), face(face_index)).unwrap();
        }
        document["images"] = (0..6).map(|i| json!({ "uri": format!("face{i}.png") })).collect();
        let half = std::f64::consts::FRAC_1_SQRT_2;
        document["extensions"] = json!({ "EXT_lights_image_based": { "lights": [{
        "name": "outside", "intensity": 0.5, "rotation": [0, half, 0, half], "specularImageSize": SIDE,
        "specularImages": [[0, 1, 2, 3, 4, 5]],
        "irradianceCoefficients": [[3.54, 3.54, 3.54], [0, 1.64, 0], [0, 0, -1.23], [1.23, 0, 0], [0, 0, 0.18], [0.27, 0, 0], [0, 0, 0], [0, 0.09, 0], [0, 0, 0]]
    }] } });
        document["extensionsUsed"] = json!(["EXT_lights_image_based"]);
        document["extensionsRequired"] = json!(["EXT_lights_image_based"]);
        document["scenes"][0]["extensions"] = json!({ "EXT_lights_image_based": { "light": 0 } });
        // Its lamp stays dark, so that the sky alone shines.
        for material in document["materials"].as_array_mut().unwrap() {
            material.as_object_mut().unwrap().remove("emissiveFactor");
            material.as_object_mut().unwrap().remove("extensions");
        }
    });
    path
}

/// A sequence of the same sky as a map of its own, made without the faces: 128 × 64 pixels of the sky in their directions, turned back by 90°.
fn as_file(folder: &Path) -> PathBuf {
    let (width, height) = (128, 64);
    let pixel = |i: usize| {
        let uv = [
            ((i % width) as f32 + 0.5) / width as f32,
            ((i / width) as f32 + 0.5) / height as f32,
        ];
        let [x, y, z] = direction_from_uv(uv).to_array().map(f64::from);
        // What the turn takes to (x, y, z): +Z to +X, +X to −Z.
        sky([-z, y, x]).map(|v| v as f32)
    };
    let mut layers = Layers::new(width, height);
    layers.push_rgb(BEAUTY, &(0..width * height).map(pixel).collect::<Vec<_>>());
    write_exr(&folder.join("sky.exr"), &layers, &ExrHeader::new(), true).unwrap();
    let text = json!({ "relight_sequence": 1, "lights": [{ "name": "outside", "type": "environment", "file": "sky.exr", "scale": 0.5 }] });
    sequence(folder, "sky.json", &text.to_string())
}

fn played(asset: &Path, lights: Option<&Path>, integrator: &str) -> FloatImage {
    let frame = asset.with_extension("exr");
    let mut play = relight();
    play.arg("play").arg(asset).arg("-o").arg(&frame);
    if let Some(lights) = lights {
        play.arg("--lights").arg(lights);
    }
    play.args([
        "--size",
        "32x32",
        "--float",
        "--spp",
        "8",
        "--integrator",
        integrator,
    ])
    .assert()
    .success();
    read_exr(&frame, &Limits::default())
        .unwrap()
        .rgb("beauty")
        .unwrap()
}

/// Summed differences over the sum of the second.
fn apart(a: &FloatImage, b: &FloatImage) -> f64 {
    let (mut off, mut sum) = (0.0, 0.0);
    for (a, b) in a.pixels.iter().flatten().zip(b.pixels.iter().flatten()) {
        off += f64::from((a - b).abs());
        sum += f64::from(*b);
    }
    assert!(sum > 0.0);
    off / sum
}

/// Truth: the same sky from a file that was made without cube or rotation. The maps differ by 8 bits a texel, and the samples by that; a sky
/// that lies otherwise (mirrored, upside down, turned the other way) is further away, as the last lines show.
#[test]
fn a_scenes_own_sky_shines_as_the_same_map_from_a_file() {
    let folder = folder();
    let (scene, lights) = (scene(folder.path()), as_file(folder.path()));
    let asset = folder.path().join("lit.relight");
    let cuts = ["--cuts", "environment", "--sigma", "0.2"];
    (relight()
        .arg("bake")
        .arg(&scene)
        .arg("-o")
        .arg(&asset)
        .args(TINY)
        .args(cuts))
    .assert()
    .success();
    let told = inspect_json(&asset);
    assert_eq!(told["names"]["lights"], json!(["outside"]));
    let notes = told["notes"].to_string();
    assert!(
        notes.contains("lights[0] is an environment map of 256 × 128 pixels")
            && notes.contains("agree best (cosine 1.00)"),
        "{notes}"
    );
    for integrator in ["transfer", "path", "cuts"] {
        let own = played(&asset, None, integrator);
        let other = played(&asset, Some(&lights), integrator);
        let found = apart(&own, &other);
        assert!(found < 0.02, "{integrator}: {found}");
        let turned = sequence(
            folder.path(),
            "turned.json",
            &std::fs::read_to_string(&lights)
                .unwrap()
                .replace("\"scale\":0.5", "\"scale\":0.5,\"rotation_deg\":90"),
        );
        let wrong = apart(&own, &played(&asset, Some(&turned), integrator));
        assert!(wrong > 0.05, "{integrator}: {wrong} of a sky turned by 90°");
    }
}
