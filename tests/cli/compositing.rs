//! Frames as compositors take them: coverage, distances, cameras, Cryptomatte.
//!
//! Files are read by the `exr` crate, and Cryptomatte decoded by what its specification says, not by relight's own code.

use crate::stage::{folder, relight, sequence};
use exr::meta::attribute::{AttributeValue, SampleType};
use exr::prelude::{self as ex, ReadChannels, ReadLayers};
use serde_json::{Value, json};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Half the height of the image at distance 1, from the camera's yfov.
const TAN: f32 = 0.5;
const SIZE: usize = 48;

/// What a file holds: values by the channels' names, with their kinds, and attributes.
struct File {
    channels: HashMap<String, (SampleType, Vec<f32>)>,
    attributes: HashMap<String, AttributeValue>,
    part: ex::LayerAttributes,
}

fn read(path: &Path) -> File {
    let image = ex::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .pedantic()
        .from_file(path)
        .unwrap();
    let part = &image.layer_data[0];
    let channels = part.channel_data.list.iter().map(|channel| {
        let kind = match channel.sample_data {
            ex::FlatSamples::F16(_) => SampleType::F16,
            ex::FlatSamples::F32(_) => SampleType::F32,
            ex::FlatSamples::U32(_) => SampleType::U32,
        };
        let values = channel.sample_data.values_as_f32().collect();
        (channel.name.to_string(), (kind, values))
    });
    let others = part.attributes.other.iter();
    File {
        channels: channels.collect(),
        attributes: others
            .map(|(name, value)| (name.to_string(), value.clone()))
            .collect(),
        part: part.attributes.clone(),
    }
}

impl File {
    fn values(&self, channel: &str) -> &[f32] {
        match self.channels.get(channel) {
            Some((_, values)) => values,
            None => panic!("no channel {channel} in {:?}", self.channels.keys()),
        }
    }

    fn text(&self, attribute: &str) -> String {
        match &self.attributes[attribute] {
            AttributeValue::Text(text) => text.to_string(),
            other => panic!("{attribute}: {other:?}"),
        }
    }

    /// The matte of a name: its coverage in each pixel, as the specification has it decoded.
    fn matte(&self, kind: &str, name: &str) -> Vec<f32> {
        let of_kind = |(attribute, value): (&String, &AttributeValue)| {
            let key = attribute.strip_prefix("cryptomatte/")?.strip_suffix("/name")?;
            matches!(value, AttributeValue::Text(text) if text == kind).then(|| key.to_owned())
        };
        let key = self.attributes.iter().find_map(of_kind).unwrap();
        assert_eq!(self.text(&format!("cryptomatte/{key}/hash")), "MurmurHash3_32");
        assert_eq!(
            self.text(&format!("cryptomatte/{key}/conversion")),
            "uint32_to_float32"
        );
        let manifest = self.text(&format!("cryptomatte/{key}/manifest"));
        let manifest: HashMap<String, String> = serde_json::from_str(&manifest).unwrap();
        let id = f32::from_bits(u32::from_str_radix(&manifest[name], 16).unwrap());
        let mut matte = vec![0.0; SIZE * SIZE];
        for layer in 0..3 {
            for (id_channel, share) in [("r", "g"), ("b", "a")] {
                let channel = |c: &str| format!("{kind}{layer:02}.{c}");
                assert_eq!(self.channels[&channel(id_channel)].0, SampleType::F32);
                let ranks = (self.values(&channel(id_channel)).iter()).zip(self.values(&channel(share)));
                for (sum, (&found, &share)) in matte.iter_mut().zip(ranks) {
                    if found == id {
                        *sum += share;
                    }
                }
            }
        }
        matte
    }
}

/// Two squares side by side before nothing, 3 m before a camera: "left" and "right", of materials "red" and "blue"; the second one's node has
/// no name, but its mesh.
fn scene(folder: &Path) -> PathBuf {
    let square = |x: f32| {
        let [a, b] = [x, x + 0.9];
        [
            [a, -0.9, 0.0],
            [b, -0.9, 0.0],
            [b, 0.9, 0.0],
            [a, -0.9, 0.0],
            [b, 0.9, 0.0],
            [a, 0.9, 0.0f32],
        ]
    };
    let bytes: Vec<u8> = ([square(-0.9), square(0.0)].as_flattened().as_flattened().iter())
        .flat_map(|v| v.to_le_bytes())
        .collect();
    std::fs::write(folder.join("squares.bin"), &bytes).unwrap();
    let accessor = |x: f32, at: usize| {
        json!({ "bufferView": 0, "byteOffset": at, "componentType": 5126, "type": "VEC3", "count": 6,
            "min": [x, -0.9, 0.0], "max": [x + 0.9, 0.9, 0.0] })
    };
    let material = |name: &str, color: [f32; 4]| json!({ "name": name, "pbrMetallicRoughness": { "baseColorFactor": color, "metallicFactor": 0 } });
    let document = json!({
        "asset": { "version": "2.0" },
        "scenes": [{ "nodes": [0, 1, 2] }],
        "nodes": [
            { "mesh": 0, "name": "left" },
            { "mesh": 1 },
            { "name": "Front", "camera": 0, "translation": [0, 0, 3] },
        ],
        "cameras": [{ "type": "perspective", "perspective": { "yfov": 2.0 * TAN.atan(), "znear": 0.1 } }],
        "meshes": [
            { "primitives": [{ "attributes": { "POSITION": 0 }, "material": 0 }] },
            { "name": "right", "primitives": [{ "attributes": { "POSITION": 1 }, "material": 1 }] },
        ],
        "materials": [material("red", [0.7, 0.1, 0.1, 1.0]), material("blue", [0.1, 0.1, 0.7, 1.0])],
        "buffers": [{ "uri": "squares.bin", "byteLength": bytes.len() }],
        "bufferViews": [{ "buffer": 0, "byteLength": bytes.len() }],
        "accessors": [accessor(-0.9, 0), accessor(0.0, 72)],
    });
    let path = folder.join("squares.gltf");
    std::fs::write(&path, document.to_string()).unwrap();
    path
}

const LAYERS: &str = "beauty,emission,background,normal,depth,lights,cryptomatte";

/// Plays the squares under a lamp and an even sky by an integrator.
fn played(folder: &Path, asset: &Path, integrator: &str, lights: &str) -> PathBuf {
    let lights = sequence(folder, "lights.json", lights);
    let out = folder.join(format!("{integrator}.exr"));
    (relight().arg("play").arg(asset).arg("--lights").arg(lights))
        .args(["--integrator", integrator, "--layers", LAYERS, "--float"])
        .args(["--size", &format!("{SIZE}x{SIZE}"), "--force", "-o"])
        .arg(&out)
        .assert()
        .success();
    out
}

fn lights(folder: &Path) -> String {
    use relight_scene::image::{ExrHeader, FloatImage, Layers, write_exr};
    let even = FloatImage {
        width: 8,
        height: 4,
        pixels: vec![[0.5, 0.25, 0.125]; 32],
    };
    let map = Layers::from_image("beauty", &even);
    write_exr(&folder.join("even.exr"), &map, &ExrHeader::new(), true).unwrap();
    json!({ "relight_sequence": 1, "lights": [
        { "name": "key.left/1\n", "type": "point", "position": [0, 0, 1], "intensity": [1, 1, 1] },
        { "name": "sky", "type": "environment", "file": "even.exr" },
    ] })
    .to_string()
}

fn baked() -> (TempDir, PathBuf) {
    let folder = folder();
    let asset = folder.path().join("squares.relight");
    (relight()
        .arg("bake")
        .arg(scene(folder.path()))
        .arg("-o")
        .arg(&asset))
    .args(["--levels", "1", "--sender-levels", "1", "--coarse-radius", "0.3"])
    .assert()
    .success();
    (folder, asset)
}

/// Truth: the squares' corners in the image, the plane that they lie in, and the map's one colour.
#[test]
fn coverage_distances_and_background_are_those_of_the_scene() {
    let (folder, asset) = baked();
    for integrator in ["transfer", "path"] {
        let file = read(&played(folder.path(), &asset, integrator, &lights(folder.path())));
        let alpha = file.values("A");
        let side = 0.9 / (3.0 * TAN);
        let covered = alpha.iter().sum::<f32>() / alpha.len() as f32;
        assert!((covered - side * side).abs() < 0.01, "{integrator}: {covered}");
        for channel in ["depth.Z", "depth.ray"] {
            assert_eq!(file.channels[channel].0, SampleType::F32);
        }
        let (planar, along) = (file.values("depth.Z"), file.values("depth.ray"));
        let normals = ["normal.X", "normal.Y", "normal.Z"].map(|c| file.values(c));
        let [r, g, b] = ["R", "G", "B"].map(|c| file.values(c));
        let behind = ["background.R", "background.G", "background.B"].map(|c| file.values(c));
        for pixel in 0..SIZE * SIZE {
            let sky = [0.5, 0.25, 0.125];
            for (channel, sky) in behind.iter().zip(sky) {
                let expected = sky * (1.0 - alpha[pixel]);
                assert!((channel[pixel] - expected).abs() < 1e-3, "{integrator}: {pixel}");
            }
            if alpha[pixel] == 0.0 {
                let shown = [r[pixel], g[pixel], b[pixel]];
                assert!(
                    (0..3).all(|c| (shown[c] - sky[c]).abs() < 1e-6),
                    "{integrator}: {shown:?}"
                );
                assert_eq!(planar[pixel], 0.0);
                continue;
            }
            assert!(
                (planar[pixel] - 3.0).abs() < 1e-4,
                "{integrator}: {}",
                planar[pixel]
            );
            let length = normals.iter().map(|n| n[pixel] * n[pixel]).sum::<f32>();
            assert!((length - 1.0).abs() < 1e-4);
            let [x, y] = [pixel % SIZE, pixel / SIZE].map(|at| (2.0 * at as f32 + 1.0) / SIZE as f32 - 1.0);
            let expected = 3.0 * (1.0 + TAN * TAN * (x * x + y * y)).sqrt();
            // The ray that is kept may be half a pixel from the middle.
            assert!(
                (along[pixel] - expected).abs() < 0.03,
                "{} {expected}",
                along[pixel]
            );
        }
        // Scene alone is the beauty less its background, of which lights sum to the beauty.
        let key = file.values("light.key_left_1_.R");
        let of_sky = file.values("light.sky.R");
        for pixel in 0..SIZE * SIZE {
            let sum = key[pixel] + of_sky[pixel];
            assert!(
                (sum - r[pixel]).abs() <= 2e-4 * r[pixel].max(1.0),
                "{sum} {}",
                r[pixel]
            );
        }
    }
}

/// Truth: what the specification says, decoded here; squares are where `A` is.
#[test]
fn cryptomatte_tells_objects_and_materials_apart() {
    let (folder, asset) = baked();
    for integrator in ["transfer", "path"] {
        let file = read(&played(folder.path(), &asset, integrator, &lights(folder.path())));
        for (kind, names) in [
            ("CryptoObject", ["left", "right"]),
            ("CryptoMaterial", ["red", "blue"]),
        ] {
            let [left, right] = names.map(|name| file.matte(kind, name));
            let (mut sum, mut middle) = (0.0, 0);
            for pixel in 0..SIZE * SIZE {
                let x = pixel % SIZE;
                // They meet in the middle of the image, between two columns of pixels.
                assert!(if x < SIZE / 2 {
                    right[pixel] == 0.0
                } else {
                    left[pixel] == 0.0
                });
                middle += usize::from(left[pixel] > 0.0);
                sum += (left[pixel] + right[pixel] - file.values("A")[pixel]).abs();
            }
            assert!(middle > 100);
            // Of path `A` has rays of its own, four times as many.
            let allowed = if integrator == "transfer" { 1e-5 } else { 0.01 };
            assert!(
                sum / ((SIZE * SIZE) as f32) < allowed,
                "{integrator} {kind}: {sum}"
            );
        }
    }
}

/// Truth: the options and the scene.
#[test]
fn frames_say_who_made_them_and_who_looks() {
    let (folder, asset) = baked();
    let text = lights(folder.path());
    let out = played(folder.path(), &asset, "path", &text);
    let file = read(&out);
    assert_eq!(file.text("relightIntegrator"), "path");
    assert_eq!(file.attributes["relightSamples"], AttributeValue::I32(64));
    assert_eq!(file.text("cameraLabel"), "Front");
    assert!(file.text("relightBackground").contains("premultiplied"));
    let names: Value = serde_json::from_str(&file.text("relightLights")).unwrap();
    assert_eq!(names, json!({ "key_left_1_": "key.left/1\n" }));
    let vertical = file.part.vertical_field_of_view.unwrap().to_radians();
    assert!(((0.5 * vertical).tan() - TAN).abs() < 1e-5);
    let to_camera = file.part.world_to_camera.unwrap();
    // The camera looks along −Z from (0, 0, 3): z is turned around.
    assert_eq!(to_camera[12..], [0.0, 0.0, 3.0, 1.0]);
    assert_eq!((to_camera[0], to_camera[5], to_camera[10]), (1.0, 1.0, -1.0));
    let hash = file.text("relightSequenceHash");
    assert_eq!(hash.len(), 16);
    // The same lights, written otherwise, and others.
    let value: Value = serde_json::from_str(&text).unwrap();
    let spaced = format!("{value:#}");
    assert_eq!(
        read(&played(folder.path(), &asset, "path", &spaced)).text("relightSequenceHash"),
        hash
    );
    let brighter = text.replace("[1,1,1]", "[1,1,2]");
    assert_ne!(brighter, text);
    assert_ne!(
        read(&played(folder.path(), &asset, "path", &brighter)).text("relightSequenceHash"),
        hash
    );
    // What reads frames reads these.
    let compared = (relight().arg("compare").arg(&out).arg(&out).arg("--json"))
        .assert()
        .success();
    let said: Value = serde_json::from_slice(&compared.get_output().stdout).unwrap();
    let layers: Vec<&String> = said["layers"].as_object().unwrap().keys().collect();
    assert!(
        layers.iter().any(|l| *l == "depth") && layers.iter().any(|l| *l == "depth.ray"),
        "{layers:?}"
    );
    assert!(
        !layers.iter().any(|l| *l == "A" || l.starts_with("Crypto")),
        "{layers:?}"
    );
}
