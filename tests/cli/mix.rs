//! `relight mix`: intensities written back into the scene's file. What is in a copy is read by the importer.

use crate::stage::{complaint, data, folder, json, relight, sequence};
use glam::Vec3;
use relight_scene::gltf::{ImportOptions, import};
use relight_scene::light::LightKind;
use relight_scene::scene::Scene;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// A square under four lights: two nodes share a point light, a spot and a sun have their own.
fn scene(folder: &Path) -> PathBuf {
    let vertices: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let bytes: Vec<u8> = vertices
        .as_flattened()
        .iter()
        .flat_map(|v| v.to_le_bytes())
        .collect();
    std::fs::write(folder.join("triangle.bin"), &bytes).unwrap();
    let with_light = |name: Value, light: u32| json!({ "name": name, "translation": [0, 1, 2], "extensions": { "KHR_lights_punctual": { "light": light } } });
    let document = json!({
        "asset": { "version": "2.0" },
        "extensionsUsed": ["KHR_lights_punctual"],
        "extensions": { "KHR_lights_punctual": { "lights": [
            { "type": "point", "color": [1, 0.5, 0.25], "intensity": 8 },
            { "type": "spot", "name": "beam", "intensity": 3, "spot": { "outerConeAngle": 0.5 } },
            { "type": "directional", "intensity": 2 },
        ] } },
        "scenes": [{ "nodes": [0, 1, 2, 3, 4] }],
        "nodes": [
            { "mesh": 0, "name": "thing" },
            with_light(json!("lamp"), 0),
            with_light(json!("lamp"), 0),
            with_light(Value::Null, 1),
            with_light(json!("sun"), 2),
        ],
        "materials": [
            { "name": "glow", "emissiveFactor": [1, 0.5, 0] },
            { "name": "matt" },
        ],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "material": 0 }] }],
        "buffers": [{ "uri": "triangle.bin", "byteLength": bytes.len() }],
        "bufferViews": [{ "buffer": 0, "byteLength": bytes.len() }],
        "accessors": [{ "bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3, "min": [0, 0, 0], "max": [1, 1, 0] }],
    });
    // As exporters write it: no name rather than null.
    let text = document.to_string().replace("\"name\":null,", "");
    let path = folder.join("scene.gltf");
    std::fs::write(&path, text).unwrap();
    path
}

fn imported(path: &Path) -> Scene {
    import(path, &ImportOptions::default()).unwrap()
}

/// A light's strength at rest, by its name.
fn strength(scene: &Scene, name: &str) -> Vec3 {
    let light = scene.sequence.lights.iter().find(|light| light.name == name);
    match &light.unwrap_or_else(|| panic!("no light {name}")).kind {
        LightKind::Point { intensity, .. } | LightKind::Spot { intensity, .. } => intensity.at(0.0),
        LightKind::Directional { irradiance, .. } => irradiance.at(0.0),
        LightKind::Ies { scale, .. } => scale.at(0.0),
        LightKind::Rect { radiance, .. } => radiance.at(0.0),
        other => panic!("{other:?}"),
    }
}

fn close(found: Vec3, expected: [f32; 3]) -> bool {
    (found - Vec3::from(expected)).abs().max_element() <= 1e-6 * found.max_element().max(1.0)
}

/// Truth: the sequence.
#[test]
fn lights_of_the_copy_shine_as_the_sequence_says() {
    let folder = folder();
    let scene = scene(folder.path());
    let lights = sequence(
        folder.path(),
        "mix.json",
        &json!({ "relight_sequence": 1, "frames": 11, "lights": [
            { "name": "lamp", "type": "point", "position": [9, 9, 9], "intensity": { "keys": [[0, [0, 0, 0]], [10, [4, 2, 8]]] } },
            { "name": "lamp.1", "type": "point", "position": [0, 0, 0], "intensity": [0.1, 0.2, 0.3] },
            { "name": "sun", "type": "directional", "direction": [0, -1, 0], "irradiance": [3, 2, 1] },
            { "name": "panel", "type": "sphere", "center": [0, 0, 0], "radius": 1, "radiance": [1, 1, 1] },
            { "name": "glowing", "type": "emissive", "material": "glow", "scale": [3, 1, 1] },
        ] })
        .to_string(),
    );
    let copy = folder.path().join("copy.gltf");
    let mut run = relight();
    run.arg("mix")
        .arg(&scene)
        .arg("--lights")
        .arg(&lights)
        .args(["--frame", "5", "--json", "-o"])
        .arg(&copy);
    let said = json(&run.assert().success().get_output().stdout);
    assert_eq!(said["lights"], json!(["lamp", "lamp.1", "sun"]));
    assert_eq!(said["dark"], json!(["beam"]));
    assert_eq!(said["left_out"], json!(["panel"]));
    let mixed = imported(&copy);
    assert!(close(strength(&mixed, "lamp"), [2.0, 1.0, 4.0]));
    assert!(close(strength(&mixed, "lamp.1"), [0.1, 0.2, 0.3]));
    assert!(close(strength(&mixed, "sun"), [3.0, 2.0, 1.0]));
    assert!(close(strength(&mixed, "beam"), [0.0, 0.0, 0.0]));
    assert!(
        close(mixed.materials[0].emission, [3.0, 0.5, 0.0]),
        "{}",
        mixed.materials[0].emission
    );
    // All else is as it was: places, and the scene itself.
    let before = imported(&scene);
    assert_eq!(before.meshes, mixed.meshes);
    for (a, b) in before.sequence.lights.iter().zip(&mixed.sequence.lights) {
        assert_eq!(a.name, b.name);
        if let (LightKind::Point { position: a, .. }, LightKind::Point { position: b, .. }) =
            (&a.kind, &b.kind)
        {
            assert_eq!(a, b);
        }
    }
}

/// Truth: the sequence. Lights of all extensions are named in one row.
#[test]
fn photometric_lamps_and_area_lights_are_mixed_like_others() {
    let folder = folder();
    let path = scene(folder.path());
    let mut document: Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
    let file = "data:application/x-ies-lm-63,TILT=NONE%0A1 -1 1 2 1 1 2 0 0 0%0A1 1 9%0A0 90%0A0%0A50 0";
    document["extensions"]["EXT_lights_ies"] = json!({ "lights": [{ "uri": file }] });
    document["extensions"]["EXT_lights_area"] = json!({ "lights": [{ "type": "rect", "intensity": 5 }] });
    let nodes = document["nodes"].as_array_mut().unwrap();
    for extension in ["EXT_lights_ies", "EXT_lights_area", "EXT_lights_area"] {
        nodes.push(json!({ "name": "lamp", "extensions": { (extension): { "light": 0 } } }));
    }
    document["scenes"][0]["nodes"] = json!([0, 1, 2, 3, 4, 5, 6, 7]);
    document["extensionsUsed"] = json!(["KHR_lights_punctual", "EXT_lights_ies", "EXT_lights_area"]);
    std::fs::write(&path, document.to_string()).unwrap();
    let sides =
        json!({ "center": [0, 0, 0], "edge_u": [1, 0, 0], "edge_v": [0, 1, 0], "radiance": [3, 6, 0] });
    let named = |name: &str, kind: &str, mut light: Value| {
        (light["name"], light["type"]) = (json!(name), json!(kind));
        light
    };
    let lights = json!([
        named(
            "lamp.2",
            "ies",
            json!({ "file": "TILT=NONE\n1 -1 1 2 1 1 2 0 0 0\n1 1 9\n0 90\n0\n50 0", "position": [0, 0, 0], "scale": [4, 2, 1] })
        ),
        named("lamp.3", "rect", sides),
        named(
            "beam",
            "point",
            json!({ "position": [0, 0, 0], "intensity": [1, 1, 1] })
        ),
    ]);
    let lights = json!({ "relight_sequence": 1, "frames": 1, "lights": lights }).to_string();
    let lights = sequence(folder.path(), "mix.json", &lights);
    let copy = folder.path().join("copy.gltf");
    let mut run = relight();
    run.arg("mix").arg(&path).arg("--lights").arg(&lights);
    let said = json(
        &run.args(["--json", "-o"])
            .arg(&copy)
            .assert()
            .success()
            .get_output()
            .stdout,
    );
    assert_eq!(said["lights"], json!(["lamp.2", "lamp.3"]));
    assert_eq!(said["left_out"], json!(["beam"]), "a spot is no point light");
    let mixed = imported(&copy);
    assert!(close(strength(&mixed, "lamp.2"), [4.0, 2.0, 1.0]));
    assert!(close(strength(&mixed, "lamp.3"), [3.0, 6.0, 0.0]));
    assert!(
        close(strength(&mixed, "lamp.4"), [0.0; 3]),
        "it shared the other's"
    );
    assert!(close(strength(&mixed, "lamp"), [0.0; 3]));
}

/// Truth: the bytes of the source, and its emission.
#[test]
fn all_but_the_json_of_a_glb_stays_byte_by_byte() {
    let folder = folder();
    let source = data("cornell.glb");
    let text =
        r#"{ "relight_sequence": 1, "lights": [ { "name": "all", "type": "emissive", "scale": 0.5 } ] }"#;
    let lights = sequence(folder.path(), "half.json", text);
    let copy = folder.path().join("copy.glb");
    let mut run = relight();
    run.arg("mix")
        .arg(&source)
        .arg("--lights")
        .arg(&lights)
        .arg("-o")
        .arg(&copy)
        .assert()
        .success();
    let rest = |path: &Path| {
        let bytes = std::fs::read(path).unwrap();
        assert_eq!(
            bytes.len(),
            u32::from_le_bytes(bytes[8..12].try_into().unwrap()) as usize
        );
        let json = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
        assert!(json.is_multiple_of(4));
        bytes[20 + json..].to_vec()
    };
    assert_eq!(rest(&source), rest(&copy));
    let (before, after) = (imported(&source), imported(&copy));
    assert_eq!(before.meshes, after.meshes);
    let lit = before
        .materials
        .iter()
        .zip(&after.materials)
        .filter(|(a, _)| a.emission != Vec3::ZERO);
    let mut emissive = 0;
    for (a, b) in lit {
        assert!(
            close(b.emission, (a.emission * 0.5).to_array()),
            "{} {}",
            a.emission,
            b.emission
        );
        emissive += 1;
    }
    assert!(emissive > 0);
}

#[test]
fn what_cannot_be_mixed_is_told_and_nothing_is_lost() {
    let folder = folder();
    let scene = scene(folder.path());
    let stranger = r#"{ "relight_sequence": 1, "lights": [ { "name": "x", "type": "point", "position": [0, 0, 0], "intensity": [1, 1, 1] } ] }"#;
    let lights = sequence(folder.path(), "other.json", stranger);
    let mix = |scene: &Path, copy: &Path| {
        let mut run = relight();
        run.arg("mix")
            .arg(scene)
            .arg("--lights")
            .arg(&lights)
            .arg("-o")
            .arg(copy);
        run
    };
    let text = complaint(&mut mix(&scene, &folder.path().join("copy.gltf")), 1);
    assert!(
        text.contains("scene.gltf") && text.contains("(x)") && text.contains("lamp.1"),
        "{text}"
    );
    let text = complaint(&mut mix(&scene, &scene), 1);
    assert!(text.contains("is read by this command"), "{text}");
    let text = complaint(&mut mix(&scene, &folder.path().join("copy.glb")), 1);
    assert!(text.contains("must end in .gltf"), "{text}");
    let elsewhere = crate::stage::folder();
    let text = complaint(&mut mix(&scene, &elsewhere.path().join("copy.gltf")), 1);
    assert!(text.contains("triangle.bin"), "{text}");
    // Damaged scenes, of every length.
    let whole = std::fs::read(data("cornell.glb")).unwrap();
    let json = 20 + u32::from_le_bytes(whole[12..16].try_into().unwrap()) as usize;
    for length in [5, 11, 16, 20, json / 2, json - 1] {
        let cut = folder.path().join("cut.glb");
        std::fs::write(&cut, &whole[..length]).unwrap();
        let text = complaint(&mut mix(&cut, &folder.path().join("copy.glb")), 1);
        assert!(text.contains("cut.glb"), "{text}");
    }
    for (key, value) in [
        ("extensions", json!(3)),
        ("nodes", json!("x")),
        (
            "materials",
            json!([1, { "emissiveFactor": [1, 1, 1], "extensions": 3 }]),
        ),
    ] {
        let mut document: Value = serde_json::from_slice(&std::fs::read(&scene).unwrap()).unwrap();
        document[key] = value;
        let broken = folder.path().join("broken.gltf");
        std::fs::write(&broken, document.to_string()).unwrap();
        let output = mix(&broken, &folder.path().join("copy.gltf")).output().unwrap();
        assert_ne!(
            output.status.code(),
            Some(101),
            "{}",
            String::from_utf8_lossy(&output.stderr)
        );
    }
}
