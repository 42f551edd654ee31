//! EXT_lights_image_based of hand-made files. Independent truth: the extension's text, and colours of single texels by hand.
#![cfg(feature = "gltf")]

mod gltf_support;

use glam::Vec3;
use gltf_support::Doc;
use relight_scene::image::{Image8, encode_png};
use relight_scene::light::{EnvironmentMap, LightKind};
use relight_scene::scene::Scene;
use relight_scene::sequence::{parse_sequence, sequence_to_json, stage_from_json, stage_to_json};
use serde_json::{Value, json};
use std::path::Path;

/// Six faces of one texel each, told apart by colour: red, green, blue, each of +X, +Y, +Z four times as bright as of −X, −Y, −Z.
fn faces() -> [[u8; 4]; 6] {
    [
        [255, 0, 0, 64],
        [255, 0, 0, 255],
        [0, 255, 0, 64],
        [0, 255, 0, 255],
        [0, 0, 255, 64],
        [0, 0, 255, 255],
    ]
}

fn png(side: usize, texel: [u8; 4]) -> Vec<u8> {
    let mut rgba8 = vec![texel; side * side];
    // A whole image without alpha would be written as one of three channels.
    if texel[3] == 255 {
        rgba8[0][3] = 254;
    }
    let image = Image8 {
        width: side,
        height: side,
        rgba8,
    };
    encode_png("t", &image).unwrap()
}

/// The triangle, with a light of these images; `light` may be changed.
fn lit(images: &[Vec<u8>]) -> Doc {
    let mut doc = Doc::triangle();
    doc.set("/images", json!([]));
    let indices: Vec<usize> = (images.iter())
        .map(|image| {
            let view = doc.view(image);
            doc.push("/images", json!({ "bufferView": view }))
        })
        .collect();
    doc.set("/extensionsUsed", json!(["EXT_lights_image_based"]));
    doc.set("/extensionsRequired", json!(["EXT_lights_image_based"]));
    let light = json!({ "name": "sky", "irradianceCoefficients": [], "specularImageSize": 1, "specularImages": [indices] });
    doc.set(
        "/extensions",
        json!({ "EXT_lights_image_based": { "lights": [light] } }),
    );
    doc.set(
        "/scenes/0/extensions",
        json!({ "EXT_lights_image_based": { "light": 0 } }),
    );
    doc
}

fn six() -> Vec<Vec<u8>> {
    faces().map(|texel| png(1, texel)).to_vec()
}

fn set(doc: &mut Doc, key: &str, value: Value) {
    doc.json["extensions"]["EXT_lights_image_based"]["lights"][0][key] = value;
}

/// The environment of a scene: its name, map and scale.
fn environment(scene: &Scene) -> (&str, &EnvironmentMap, Vec3) {
    let [light] = scene.sequence.lights.as_slice() else {
        panic!("{:?}", scene.sequence.lights.len());
    };
    let LightKind::Environment { maps, scale, .. } = &light.kind else {
        panic!("no environment");
    };
    (&light.name, maps.only().unwrap(), scale.at(0.0))
}

/// Radiance from a direction.
fn from(map: &EnvironmentMap, d: Vec3) -> Vec3 {
    map.at(relight_scene::environment::uv_from_direction(d))
}

fn noted(scene: &Scene, part: &str) {
    assert!(
        scene.notes.iter().any(|note| note.contains(part)),
        "{part}: {:?}",
        scene.notes
    );
}

fn complaint(doc: &Doc) -> String {
    doc.import().unwrap_err().to_string()
}

/// Truth: the order of the faces and 255/64 by hand; half floats keep three digits.
#[test]
fn each_face_shines_from_where_it_is() {
    let mut doc = lit(&six());
    set(&mut doc, "intensity", json!(3));
    let scene = doc.scene();
    let (name, map, scale) = environment(&scene);
    assert_eq!((name, scale), ("sky", Vec3::splat(3.0)));
    let bright = 255.0 / 64.0;
    for (d, color) in [
        (Vec3::X, Vec3::X * bright),
        (Vec3::NEG_X, Vec3::X),
        (Vec3::Y, Vec3::Y * bright),
        (Vec3::NEG_Y, Vec3::Y),
        (Vec3::Z, Vec3::Z * bright),
        (Vec3::NEG_Z, Vec3::Z),
    ] {
        let found = from(map, d);
        assert!(
            (found - color).abs().max_element() < 5e-3 * bright,
            "{d}: {found}"
        );
    }
    noted(
        &scene,
        "lights[0] is an environment map of 64 × 32 pixels, of faces of 1 × 1",
    );
    // A quarter turn about +Y takes +Z to +X.
    let half = std::f64::consts::FRAC_1_SQRT_2;
    // Not of unit length, as exporters round.
    set(&mut doc, "rotation", json!([0, half * 1.1, 0, half * 1.1]));
    let scene = doc.scene();
    let map = environment(&scene).1;
    assert!((from(map, Vec3::X) - Vec3::Z * bright).abs().max_element() < 5e-3 * bright);
    assert!((from(map, Vec3::Z) - Vec3::X).abs().max_element() < 5e-3 * bright);
}

/// What an asset holds, and what a sequence is written as, has the map in it.
#[test]
fn the_map_is_in_the_text_and_comes_back_the_same() {
    let scene = lit(&six()).scene();
    let (cameras, sequence) = stage_from_json(&stage_to_json(&scene.cameras, &scene.sequence)).unwrap();
    assert_eq!((cameras, &sequence), (scene.cameras.clone(), &scene.sequence));
    let text = sequence_to_json(&scene.sequence);
    assert!(
        text.contains("\"file\": \"data:image/x-exr;base64,"),
        "{}",
        &text[..200]
    );
    assert_eq!(
        parse_sequence(&text, Path::new("."), "t").unwrap(),
        scene.sequence
    );
    // Damaged, it is told without its megabyte.
    for damaged in [
        text.replace("base64,", "base64,!"),
        text.replace("base64,", "base64,AAAA"),
    ] {
        let message = parse_sequence(&damaged, Path::new("."), "t")
            .unwrap_err()
            .to_string();
        assert!(
            message.contains("lights[0].file: the map in the text"),
            "{message}"
        );
        assert!(message.len() < 400, "{message}");
    }
}

/// JPEG and PNG of three channels hold plain colours: sRGB's middle grey is 0.2159.
#[test]
fn images_without_alpha_are_plain_colours() {
    let plain = |texel| {
        let image = Image8 {
            width: 1,
            height: 1,
            rgba8: vec![texel],
        };
        encode_png("t", &image).unwrap()
    };
    let scene = lit(&vec![plain([128, 128, 128, 255]); 6]).scene();
    let found = from(environment(&scene).1, Vec3::Y);
    assert!(
        (found - Vec3::splat(0.2159)).abs().max_element() < 3e-4,
        "{found}"
    );
}

#[test]
fn a_light_that_no_shown_scene_has_is_noted() {
    let mut doc = lit(&six());
    doc.set("/scenes", json!([{ "nodes": [0] }, { "nodes": [0], "extensions": { "EXT_lights_image_based": { "light": 0 } } }]));
    let scene = doc.scene();
    assert!(scene.sequence.lights.is_empty());
    noted(&scene, "the scene has none of the file's 1 lights");
    doc.set("/scene", json!(1));
    let scene = doc.scene();
    assert_eq!(environment(&scene).0, "sky");
    // Of two the scene's is taken, and what is wrong with the other is only noted.
    let other = json!({ "specularImages": [[0]] });
    doc.push("/extensions/EXT_lights_image_based/lights", other);
    let scene = doc.scene();
    noted(&scene, "the scene has lights[0] of the file's 2");
    noted(
        &scene,
        "EXT_lights_image_based.lights[1].specularImages[0]: must be six indices",
    );
}

#[test]
fn names_differ_from_other_lights() {
    let mut doc = lit(&six());
    doc.json["extensions"]["KHR_lights_punctual"] = json!({ "lights": [{ "type": "point" }] });
    doc.push(
        "/nodes",
        json!({ "name": "sky", "extensions": { "KHR_lights_punctual": { "light": 0 } } }),
    );
    doc.set("/scenes/0/nodes", json!([0, 1]));
    let names: Vec<String> = (doc.scene().sequence.lights.iter())
        .map(|light| light.name.clone())
        .collect();
    assert_eq!(names, ["sky", "sky.1"]);
    set(&mut doc, "name", Value::Null);
    let names: Vec<String> = (doc.scene().sequence.lights.iter())
        .map(|light| light.name.clone())
        .collect();
    assert_eq!(names, ["sky", "environment"]);
}

#[test]
fn what_is_odd_but_clear_is_read_with_a_note() {
    let mut texels = faces();
    texels[2][3] = 0;
    let mut doc = lit(&texels.map(|texel| png(2, texel)));
    for odd in [
        json!(7),
        json!([[1, 2], [3]]),
        json!(vec![[1e300, 0.0, 0.0]; 9]),
        json!(vec![[0, 0, 0]; 9]),
    ] {
        set(&mut doc, "irradianceCoefficients", odd);
        let scene = doc.scene();
        noted(&scene, "since its irradianceCoefficients don't tell");
        noted(&scene, "texels with a divisor of 0, taken as 1/255: 4");
        noted(
            &scene,
            "specularImageSize of lights[0] is 1, but its faces have 2",
        );
        let found = from(environment(&scene).1, Vec3::Y);
        assert!((found.y - 255.0).abs() < 1.0, "{found}");
    }
    set(&mut doc, "intensity", json!(0));
    assert_eq!(environment(&doc.scene()).2, Vec3::ZERO);
}

#[test]
fn what_is_wrong_is_told_with_its_place() {
    let refused = |change: &dyn Fn(&mut Doc), said: &[&str]| {
        let mut doc = lit(&six());
        change(&mut doc);
        let message = complaint(&doc);
        for part in said {
            assert!(message.contains(part), "{part}: {message}");
        }
    };
    let light = "extensions.EXT_lights_image_based.lights[0]";
    let field = |key: &'static str, value: Value, said: &str| {
        refused(
            &|doc| set(doc, key, value.clone()),
            &[&format!("{light}.{key}"), said],
        );
    };
    field(
        "specularImages",
        json!([[0, 1, 2, 3, 4]]),
        "must be six indices of images",
    );
    field(
        "specularImages",
        json!([[0, 1, 2, 3, 4, 9]]),
        "is 9, but there are only 6 images",
    );
    field(
        "specularImages",
        json!([[0, 1, 2, 3, 4, -1]]),
        "must be a non-negative integer",
    );
    field("specularImages", json!([]), "must hold at least one level");
    field("specularImages", json!(3), "must be an array");
    field("specularImages", json!([3]), "must be an array");
    field("intensity", json!(-1), "must be a number of at least 0");
    field(
        "intensity",
        json!(1e20),
        "must be a number of at least 0, up to 1e15",
    );
    field("intensity", json!("NaN"), "must be a finite number");
    field("rotation", json!([0, 0, 0, 0]), "must be a unit quaternion");
    field(
        "rotation",
        json!([0, 0, 0, "NaN"]),
        "must be an array of 4 finite numbers",
    );
    field("rotation", json!([1e200, 0, 0, 0]), "must be a unit quaternion");
    let scene = |light: Value| {
        move |doc: &mut Doc| {
            doc.set("/scenes/0/extensions", json!({ "EXT_lights_image_based": light }));
        }
    };
    refused(
        &scene(json!({ "light": 1 })),
        &[
            "scenes[0].extensions.EXT_lights_image_based.light",
            "is 1, but there are only 1 lights",
        ],
    );
    refused(
        &scene(json!({})),
        &["scenes[0].extensions.EXT_lights_image_based.light", "is missing"],
    );
    refused(
        &|doc| {
            doc.json.as_object_mut().unwrap().remove("extensions");
        },
        &[
            "scenes[0].extensions.EXT_lights_image_based.light",
            "there are only 0 lights",
        ],
    );
    // Images of other sizes, none at all, and one too large, which its head says.
    let image = |bytes: Vec<u8>| {
        let mut images = six();
        images[3] = bytes;
        complaint(&lit(&images))
    };
    let message = image(png(2, [1, 2, 3, 4]));
    assert!(
        message.contains("lights[0].specularImages[0][3]: has 2 × 2 pixels"),
        "{message}"
    );
    let message = image(b"no image".to_vec());
    assert!(message.contains("images[3]: is neither a PNG"), "{message}");
    let whole = png(1, [1, 2, 3, 4]);
    let message = image(whole[..whole.len() / 2].to_vec());
    assert!(message.contains("images[3]: no whole Png image"), "{message}");
    let message = image(png(4097, [1, 2, 3, 4]));
    assert!(
        message.contains("images[3]: the number of pixels is 16785409, over the limit"),
        "{message}"
    );
}

/// Seeds of the fuzz corpus `gltf`: a light of six images.
#[test]
#[ignore = "writes into the corpus"]
fn write_the_seeds() {
    let mut doc = lit(&six());
    set(
        &mut doc,
        "irradianceCoefficients",
        json!(vec![[0.5, 0.25, 0.125]; 9]),
    );
    set(&mut doc, "rotation", json!([0, 0.6, 0, 0.8]));
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus/gltf");
    std::fs::write(folder.join("image_light"), doc.glb()).unwrap();
}
