//! What people's files have although glTF 2.0 forbids it, or allows it and few write it: read, and said where the file
//! is wrong. The truth is the same scene written properly.
#![cfg(feature = "gltf")]

mod gltf_support;

use glam::{DVec3, Vec3};
use gltf_support::{Doc, PNG, import_bytes};
use relight_scene::gltf::{ImportOptions, import};
use relight_scene::light::LightKind;
use relight_scene::scene::Scene;
use relight_scene::sequence::{read_sequence, read_sequence_at};
use serde_json::{Value, json};

/// Where the instances are, in their order.
fn places(scene: &Scene) -> Vec<Vec3> {
    let place = |i: &relight_scene::scene::Instance| Vec3::from(i.world_from_mesh.translation);
    scene.instances.iter().map(place).collect()
}

fn noted(scene: &Scene, part: &str) {
    assert!(
        scene.notes.iter().any(|note| note.contains(part)),
        "{part}: {:?}",
        scene.notes
    );
}

/// A triangle with a camera and a lamp beside it.
fn stage() -> Doc {
    let mut doc = Doc::triangle();
    doc.set(
        "/cameras",
        json!([{ "type": "perspective", "perspective": { "yfov": 1.0, "znear": 0.1 } }]),
    );
    doc.set(
        "/extensions",
        json!({ "KHR_lights_punctual": { "lights": [{ "type": "point" }] } }),
    );
    doc.set(
        "/nodes",
        json!([{ "mesh": 0 }, { "camera": 0, "name": "eye" }, lamp()]),
    );
    doc.set("/scenes", json!([{ "nodes": [0, 1, 2] }]));
    doc.set("/materials", json!([{}]));
    doc.set("/meshes/0/primitives/0/material", json!(0));
    doc
}

fn lamp() -> Value {
    json!({ "name": "lamp", "extensions": { "KHR_lights_punctual": { "light": 0 } } })
}

fn visible(visible: bool) -> Value {
    json!({ "KHR_node_visibility": { "visible": visible } })
}

fn at(x: f32, children: &[usize]) -> Value {
    json!({ "translation": [x, 0, 0], "children": children, "mesh": 0 })
}

#[test]
fn each_node_is_drawn_once_per_path() {
    // Scene, nodes with what they add to x and their children, and where that puts triangles.
    let cases: [(&[usize], &[Value], &[f32]); 6] = [
        // As it should be.
        (
            &[0],
            &[at(1.0, &[1, 2]), at(10.0, &[]), at(20.0, &[])],
            &[1.0, 11.0, 21.0],
        ),
        // A child beside its parent, which is not in the scene, and which is.
        (&[1], &[at(1.0, &[1]), at(10.0, &[])], &[10.0]),
        (&[0, 1], &[at(1.0, &[1]), at(10.0, &[])], &[1.0, 11.0, 10.0]),
        // Several nested ones.
        (
            &[2, 1, 0],
            &[at(1.0, &[1]), at(10.0, &[2]), at(100.0, &[])],
            &[100.0, 10.0, 110.0, 1.0, 11.0, 111.0],
        ),
        // Two parents, two deep.
        (
            &[0, 1],
            &[at(1.0, &[2]), at(2.0, &[2]), at(10.0, &[3]), at(100.0, &[])],
            &[1.0, 11.0, 111.0, 2.0, 12.0, 112.0],
        ),
        // The same path listed twice.
        (&[0, 0], &[at(1.0, &[1, 1]), at(10.0, &[])], &[1.0, 11.0]),
    ];
    for (i, (roots, nodes, expected)) in cases.into_iter().enumerate() {
        let mut doc = Doc::triangle();
        doc.set("/nodes", json!(nodes))
            .set("/scenes/0/nodes", json!(roots));
        let scene = doc.scene();
        let x: Vec<f32> = places(&scene).iter().map(|p| p.x).collect();
        assert_eq!(x, expected, "case {i}");
        assert_eq!(scene.notes.is_empty(), i == 0, "case {i}: {:?}", scene.notes);
    }
}

#[test]
fn lights_cameras_and_their_animations_follow_every_path() {
    let mut doc = stage();
    let times = doc.floats(&[0.0, 1.0], "SCALAR");
    let values = doc.floats(&[0., 0., 0., 24., 0., 0.], "VEC3");
    doc.set(
        "/nodes/0",
        json!({ "mesh": 0, "translation": [0, 5, 0], "children": [2] }),
    );
    doc.set(
        "/animations",
        json!([{ "samplers": [{ "input": times, "output": values }],
            "channels": [{ "sampler": 0, "target": { "node": 2, "path": "translation" } }] }]),
    );
    let scene = doc.scene();
    let names: Vec<&str> = scene.sequence.lights.iter().map(|l| l.name.as_str()).collect();
    assert_eq!(names, ["lamp", "lamp.1"]);
    let heights = scene.sequence.lights.iter().map(|light| match &light.kind {
        LightKind::Point { position, .. } => position.at(12.0),
        other => panic!("{other:?}"),
    });
    let heights: Vec<Vec3> = heights.collect();
    assert_eq!(heights, [Vec3::new(12.0, 5.0, 0.0), Vec3::new(12.0, 0.0, 0.0)]);
}

#[test]
fn circles_of_nodes_are_refused_where_they_are_shown() {
    for (roots, refused) in [(json!([0]), false), (json!([0, 1]), true), (json!([2]), true)] {
        let mut doc = Doc::triangle();
        doc.set(
            "/nodes",
            json!([at(0.0, &[]), at(0.0, &[2]), at(0.0, &[3]), at(0.0, &[1])]),
        );
        doc.set("/scenes/0/nodes", roots);
        let result = doc.import();
        assert_eq!(result.is_err(), refused);
        if let Err(error) = result {
            assert!(error.to_string().contains("ancestor of itself"), "{error}");
        }
    }
}

#[test]
fn hidden_nodes_hide_all_below_but_cameras() {
    let nodes = json!([
        { "mesh": 0, "translation": [1, 0, 0], "extensions": visible(true), "children": [1] },
        { "mesh": 0, "translation": [1, 0, 0], "extensions": visible(false), "children": [2, 3, 4] },
        { "mesh": 0, "translation": [1, 0, 0], "extensions": visible(true), "children": [5] },
        lamp(), { "camera": 0 }, { "mesh": 0 },
        { "mesh": 0, "translation": [7, 0, 0], "extensions": { "KHR_node_visibility": {} } },
    ]);
    let mut doc = stage();
    doc.set("/nodes", nodes).set("/scenes/0/nodes", json!([0, 6]));
    for key in ["/extensionsUsed", "/extensionsRequired"] {
        doc.set(key, json!(["KHR_node_visibility"]));
    }
    let scene = doc.scene();
    assert_eq!(places(&scene), [Vec3::X, Vec3::X * 7.0]);
    assert_eq!((scene.sequence.lights.len(), scene.cameras.len()), (0, 1));
    noted(&scene, "KHR_node_visibility hides, left out: 5");
    // What is broken and hidden is not in the way.
    doc.push(
        "/meshes",
        json!({ "primitives": [{ "attributes": { "POSITION": 99 } }] }),
    );
    doc.set("/nodes/5/mesh", json!(1));
    assert_eq!(doc.scene().instances.len(), 2);
}

#[test]
fn integers_may_be_written_as_floats() {
    /// Every integer with a fraction of zero, or with an exponent.
    fn floats(text: &str, write: fn(&str) -> String) -> String {
        let (mut out, mut number, mut quoted) = (String::new(), String::new(), false);
        for c in text.chars() {
            quoted ^= c == '"';
            if c.is_ascii_digit() && !quoted {
                number.push(c);
                continue;
            }
            if !number.is_empty() {
                out.push_str(&write(&std::mem::take(&mut number)));
            }
            out.push(c);
        }
        out
    }
    let mut doc = stage();
    let indices = doc.accessor(&[0, 1, 2], 5121, 3, "SCALAR");
    let image = doc.view(PNG);
    doc.set("/bufferViews/0/byteStride", json!(12));
    doc.set("/images", json!([{ "bufferView": image }]))
        .set("/samplers", json!([{ "wrapS": 33071, "magFilter": 9728 }]));
    doc.set("/textures", json!([{ "source": 0, "sampler": 0 }]));
    doc.set(
        "/materials",
        json!([{ "normalTexture": { "index": 0, "texCoord": 0 } }]),
    );
    let primitive = json!({ "attributes": { "POSITION": 0 }, "indices": indices, "material": 0, "mode": 4 });
    doc.set("/meshes/0/primitives/0", primitive);
    doc.set("/animations", json!([]));
    // Without numbers of other kinds, which would lose their meaning in this test.
    doc.set("/cameras/0/perspective", json!({ "yfov": 1, "znear": 1 }));
    let expected = doc.scene();
    let text = serde_json::to_string(&doc.json).unwrap();
    for write in [
        |n: &str| format!("{n}.0"),
        |n: &str| format!("{n}e0"),
        |n: &str| format!("{n}.00E+0"),
    ] {
        let scene = import_bytes(
            "scene.glb",
            &gltf_support::glb(floats(&text, write).as_bytes(), &doc.bin),
        );
        let scene = scene.unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(
            (&scene.meshes, &scene.textures),
            (&expected.meshes, &expected.textures)
        );
        assert_eq!(
            (&scene.sequence, &scene.notes),
            (&expected.sequence, &expected.notes)
        );
    }
    for bad in ["4.5", "-1.0", "1e300", "18446744073709551616.0"] {
        let mut doc = Doc::triangle();
        doc.set("/accessors/0/count", serde_json::from_str(bad).unwrap());
        let error = doc.import().unwrap_err().to_string();
        assert!(
            error.contains("accessors[0].count: must be a non-negative integer"),
            "{error}"
        );
    }
}

#[test]
fn unused_broken_parts_refuse_nothing() {
    let bad = 99;
    let broken: &[(&str, Value)] = &[
        (
            "/accessors",
            json!({ "bufferView": bad, "componentType": 5126, "count": 1, "type": "VEC3" }),
        ),
        (
            "/accessors",
            json!({ "componentType": 1, "count": -1, "type": "VEC9", "sparse": 3 }),
        ),
        ("/accessors", json!(7)),
        ("/bufferViews", json!({ "buffer": bad, "byteLength": 4 })),
        ("/bufferViews", json!({ "buffer": 0, "byteLength": 1_000_000 })),
        ("/buffers", json!({ "byteLength": 10, "uri": "missing.bin" })),
        ("/buffers", json!({ "byteLength": 1u64 << 50, "uri": "data:,a" })),
        ("/buffers", json!({})),
        (
            "/materials",
            json!({ "alphaMode": "SOLID", "normalTexture": { "index": bad } }),
        ),
        (
            "/materials",
            json!({ "normalTexture": { "index": 1 }, "emissiveTexture": { "index": 2 } }),
        ),
        ("/images", json!({ "uri": "missing.png" })),
        ("/images", json!({})),
        ("/textures", json!({ "source": bad, "sampler": bad })),
        ("/textures", json!({ "source": 1 })),
        ("/textures", json!({ "source": 0 })),
        ("/samplers", json!({ "wrapS": 1 })),
        (
            "/meshes",
            json!({ "primitives": [{ "attributes": { "POSITION": bad }, "mode": 9 }] }),
        ),
        ("/meshes", json!({ "primitives": 3 })),
        (
            "/nodes",
            json!({ "mesh": bad, "children": [bad], "matrix": [1], "camera": bad, "skin": bad }),
        ),
        ("/nodes", json!({ "children": [0], "rotation": [0, 0, 0, 0] })),
        ("/cameras", json!({ "type": "fisheye" })),
        (
            "/extensions/KHR_lights_punctual/lights",
            json!({ "type": "area", "intensity": -1 }),
        ),
        ("/skins", json!({ "joints": [bad], "inverseBindMatrices": bad })),
        ("/scenes", json!({ "nodes": [bad] })),
        (
            "/animations",
            json!({ "samplers": [{ "input": bad, "output": bad }],
            "channels": [{ "sampler": 0, "target": { "node": 0, "path": "translation" } }] }),
        ),
        (
            "/animations",
            json!({ "samplers": [], "channels": [{ "sampler": 5, "target": { "node": bad, "path": "scale" } }] }),
        ),
        (
            "/animations",
            json!({ "channels": [{}, { "target": { "path": "pointer", "node": 0 } }] }),
        ),
    ];
    let whole = || {
        let mut doc = stage();
        for key in ["images", "textures", "samplers", "skins", "animations"] {
            doc.set(&format!("/{key}"), json!([]));
        }
        doc
    };
    let expected = whole().scene();
    let mut all = whole();
    for (list, part) in broken {
        let mut doc = whole();
        doc.push(list, part.clone());
        let scene = doc.import().unwrap_or_else(|e| panic!("{list} {part}: {e}"));
        assert_eq!(
            (&scene.meshes, &scene.instances),
            (&expected.meshes, &expected.instances),
            "{list} {part}"
        );
        assert_eq!(
            (&scene.cameras, &scene.sequence),
            (&expected.cameras, &expected.sequence),
            "{list} {part}"
        );
        all.push(list, part.clone());
    }
    let scene = all.scene();
    assert_eq!((scene.meshes, scene.cameras), (expected.meshes, expected.cameras));
    let notes = scene.notes.join("\n");
    for part in [
        "accessors[1].bufferView: is 99",
        "materials[1].alphaMode",
        "images[0]",
        "nodes[3]",
        "cameras[1].type",
    ] {
        assert!(notes.contains(part), "{part}: {notes}");
    }
}

#[test]
fn broken_parts_that_are_shown_refuse_with_their_place() {
    let mut doc = stage();
    doc.push(
        "/accessors",
        json!({ "bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC3" }),
    );
    doc.push("/bufferViews", json!({ "buffer": 1, "byteLength": 36 }));
    doc.push("/buffers", json!({ "byteLength": 36, "uri": "missing.bin" }));
    doc.set("/meshes/0/primitives/0/attributes/NORMAL", json!(1));
    let error = doc.import().unwrap_err().to_string();
    assert!(error.contains("buffers[1].uri: names missing.bin"), "{error}");
    doc.set("/bufferViews/1/buffer", json!(2));
    let error = doc.import().unwrap_err().to_string();
    assert!(
        error.contains("bufferViews[1].buffer: is 2, but there are only 2 buffers"),
        "{error}"
    );
    // So many that they are not kept word by word.
    let broken = json!({ "componentType": 5126, "count": 3, "type": "VEC9" });
    doc.json["accessors"]
        .as_array_mut()
        .unwrap()
        .extend(vec![broken; 20_000]);
    assert!(doc.import().is_err());
    doc.set("/meshes/0/primitives/0/attributes/NORMAL", json!(20_000));
    let error = doc.import().unwrap_err().to_string();
    assert!(
        error.contains("accessors[20000]: is broken, as thousands"),
        "{error}"
    );
    doc.set("/meshes/0/primitives/0/attributes", json!({ "POSITION": 0 }));
    noted(
        &doc.scene(),
        "other broken accessors that nothing shown uses: 19996",
    );
}

#[test]
fn empty_accessors_and_primitives_are_no_geometry() {
    let mut doc = Doc::triangle();
    let empty = doc.push(
        "/accessors",
        json!({ "bufferView": 0, "componentType": 5126, "count": 0, "type": "VEC3" }),
    );
    let none = doc.push(
        "/accessors",
        json!({ "bufferView": 77, "componentType": 5123, "count": 0.0, "type": "SCALAR",
        "sparse": { "count": 0 } }),
    );
    doc.push(
        "/meshes",
        json!({ "primitives": [
        { "attributes": { "POSITION": empty, "NORMAL": empty }, "indices": none },
        { "attributes": { "POSITION": empty } }, { "attributes": { "POSITION": 0 }, "indices": none }] }),
    );
    doc.push("/nodes", json!({ "mesh": 1 }));
    doc.set("/scenes/0/nodes", json!([0, 1]));
    // As if there were no normals.
    doc.set("/meshes/0/primitives/0/attributes/NORMAL", json!(empty));
    let scene = doc.scene();
    assert_eq!((scene.meshes.len(), scene.instances.len()), (1, 1));
    assert_eq!(scene.meshes, Doc::triangle().scene().meshes);
    for part in [
        "accessors of 0 elements: 2",
        "primitives of 0 vertices left out: 2",
        "attributes of 0 elements",
    ] {
        noted(&scene, part);
    }
}

#[test]
fn strides_outside_of_the_rules_mean_what_they_say() {
    let expected = Doc::triangle().scene().meshes;
    let mut doc = Doc::triangle();
    doc.set("/bufferViews/0/byteStride", json!(0));
    let scene = doc.scene();
    assert_eq!(scene.meshes, expected);
    noted(&scene, "byteStride that is not 4 to 252: 1");
    // Indices of two bytes, two bytes apart; vertices a kilobyte apart.
    let mut doc = Doc::triangle();
    let indices = doc.accessor(&[0, 0, 1, 0, 2, 0], 5123, 3, "SCALAR");
    doc.set("/bufferViews/1/byteStride", json!(2));
    let mut wide = vec![0; 2 * 1024 + 12];
    for (i, vertex) in [[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
        .iter()
        .enumerate()
    {
        let bytes: Vec<u8> = vertex.iter().flat_map(|x| x.to_le_bytes()).collect();
        wide[i * 1024..i * 1024 + 12].copy_from_slice(&bytes);
    }
    let positions = doc.accessor(&wide, 5126, 3, "VEC3");
    doc.set("/bufferViews/2/byteStride", json!(1024));
    doc.set(
        "/meshes/0/primitives/0",
        json!({ "attributes": { "POSITION": positions }, "indices": indices }),
    );
    assert_eq!(doc.scene().meshes, expected);
}

#[test]
fn null_is_absent() {
    let mut doc = stage();
    let expected = doc.scene();
    doc.set("/scene", Value::Null)
        .set("/materials", json!([null]))
        .set("/skins", Value::Null);
    doc.set("/nodes/0/name", Value::Null)
        .set("/nodes/0/skin", Value::Null)
        .set("/nodes/0/matrix", Value::Null);
    doc.set("/nodes/0/children", json!([null]))
        .set("/nodes/0/extensions", json!({ "KHR_lights_punctual": null }));
    doc.set("/accessors/0/sparse", Value::Null)
        .set("/accessors/0/byteOffset", Value::Null);
    doc.set("/bufferViews/0/byteStride", Value::Null)
        .set("/cameras/0/name", Value::Null);
    doc.set("/meshes/0/primitives/0/indices", Value::Null)
        .set("/extras", Value::Null);
    doc.push("/meshes/0/primitives", Value::Null);
    doc.push("/nodes", Value::Null);
    doc.push("/scenes/0/nodes", Value::Null);
    let scene = doc.scene();
    assert_eq!(
        (&scene.meshes, &scene.instances),
        (&expected.meshes, &expected.instances)
    );
    assert_eq!(
        (&scene.cameras, &scene.sequence),
        (&expected.cameras, &expected.sequence)
    );
    noted(&scene, "null written for what is absent");
}

#[test]
fn numbers_that_are_none_are_refused_where_they_matter() {
    let text = |matrix: &str, min: &str| {
        let mut doc = Doc::triangle();
        doc.set("/nodes/0/matrix", json!("MATRIX"))
            .set("/accessors/0/min", json!("MIN"));
        let text = doc
            .json
            .to_string()
            .replace("\"MATRIX\"", matrix)
            .replace("\"MIN\"", min);
        import_bytes("scene.glb", &gltf_support::glb(text.as_bytes(), &doc.bin))
    };
    let matrix = |x: &str| format!("[1,0,0,0, 0,1,0,0, 0,0,1,0, {x},0,0,1]");
    for x in [
        "NaN",
        "null",
        "-nan(ind)",
        "Infinity",
        "1e999",
        "\"4\"",
        "-1.#IND",
    ] {
        let error = text(&matrix(x), "[0,0,0]").unwrap_err().to_string();
        assert!(
            error.contains("nodes[0].matrix: must be an array of 16 finite numbers"),
            "{error}"
        );
        assert!(
            error.contains("at [12]") && error.contains("export it again"),
            "{error}"
        );
    }
    // Bounds of accessors are not read.
    let scene = text(&matrix("2"), "[NaN,-inf,null]").unwrap();
    assert_eq!(places(&scene), [Vec3::X * 2.0]);
    noted(&scene, "NaN or infinite numbers");
}

#[test]
fn names_in_latin_1_and_texts_in_utf_16_are_read() {
    let mut doc = stage();
    doc.set("/nodes/1/name", json!("K\u{fc}che \u{2192}"));
    let uri = format!("data:;base64,{}", {
        use base64::Engine;
        base64::engine::general_purpose::STANDARD.encode(&doc.bin)
    });
    doc.set("/buffers/0/uri", json!(uri));
    let text = doc.json.to_string();
    assert_eq!(
        import_bytes("scene.gltf", text.as_bytes()).unwrap().cameras[0].name,
        "Küche →"
    );
    // Some programs write some names in UTF-8 and others not.
    let mut latin = text.replace("\u{fc}", "\u{1}").into_bytes();
    latin.iter_mut().filter(|b| **b == 1).for_each(|b| *b = 0xfc);
    let scene = import_bytes("scene.gltf", &latin).unwrap();
    assert_eq!(scene.cameras[0].name, "Küche →");
    noted(&scene, "Latin-1");
    for mark in [0xfeffu16, 0xfffe] {
        let words = std::iter::once(0xfeff).chain(text.encode_utf16());
        let bytes: Vec<u8> = words
            .flat_map(|w| {
                if mark == 0xfeff {
                    w.to_le_bytes()
                } else {
                    w.to_be_bytes()
                }
            })
            .collect();
        let scene = import_bytes("scene.gltf", &bytes).unwrap();
        assert_eq!(scene.cameras[0].name, "Küche →");
        noted(&scene, "UTF-16");
    }
}

/// A room of small squares with a camera and a lamp in it, all under one root with a translation or a matrix.
fn far_room(root: Value) -> Doc {
    let mut doc = stage();
    let (mut corners, mut indices) = (Vec::new(), Vec::new());
    for i in 0..100u8 {
        let (x, z) = (f32::from(i % 10) - 5.0, f32::from(i / 10) - 5.0);
        for (dx, dz) in [(0.0, 0.0), (0.75, 0.0), (0.75, 0.75), (0.0, 0.75)] {
            corners.extend([x + dx, 0.1 * f32::from(i % 7), z + dz]);
        }
        let first = u16::from(i) * 4;
        indices.extend(
            [0, 2, 1, 0, 3, 2]
                .map(|k| first + k)
                .iter()
                .flat_map(|k| k.to_le_bytes()),
        );
    }
    let positions = doc.floats(&corners, "VEC3");
    let indices = doc.accessor(&indices, 5123, 600, "SCALAR");
    doc.set(
        "/meshes/0/primitives/0",
        json!({ "attributes": { "POSITION": positions }, "indices": indices }),
    );
    doc.set(
        "/nodes",
        json!([
            { "mesh": 0, "rotation": [0, 0.6, 0, 0.8] },
            { "camera": 0, "translation": [0.25, 1.5, 4.5] },
            { "translation": [0.125, 2.5, 0], "extensions": lamp()["extensions"].clone() },
            root,
        ]),
    );
    doc.set("/nodes/3/children", json!([0, 1, 2]))
        .set("/scenes/0/nodes", json!([3]));
    doc
}

/// All corners in the file's coordinates less `from`, and where camera and lamp are.
fn places_less(scene: &Scene, from: DVec3) -> (Vec<DVec3>, DVec3, DVec3) {
    let back = |p: Vec3| p.as_dvec3() + (scene.offset - from);
    let corners = scene.instances.iter().flat_map(|i| {
        let mesh = &scene.meshes[i.mesh as usize];
        mesh.positions
            .iter()
            .map(|p| back(i.world_from_mesh.transform_point3(*p)))
    });
    let LightKind::Point { position, .. } = &scene.sequence.lights[0].kind else {
        panic!("{:?}", scene.sequence.lights)
    };
    (
        corners.collect(),
        back(scene.cameras[0].position.at(0.0)),
        back(position.at(0.0)),
    )
}

#[test]
fn scenes_far_from_the_origin_are_the_same_scenes() {
    let near = far_room(json!({})).scene();
    assert_eq!(near.offset, DVec3::ZERO);
    let near = places_less(&near, DVec3::ZERO);
    let matrix = |[x, y, z]: [f64; 3]| json!({ "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, x, y, z, 1] });
    for at in [
        [4e5, 0.0, 0.0],
        [4_000_000.25, 0.5, -4e6],
        [6.4e6, 6.4e6, 6.4e6],
        [0.0, 0.0, -1e7],
        [1e12, 0.0, -1e12],
    ] {
        for root in [json!({ "translation": at }), matrix(at)] {
            let scene = far_room(root).scene();
            noted(&scene, "far from its origin and is moved by");
            let far = places_less(&scene, at.into());
            // f64 resolves a tenth of a millimetre at 10¹² m.
            let most = 1e-6 + 2e-16 * DVec3::from(at).length();
            assert!(
                far.0.iter().zip(&near.0).all(|(a, b)| a.distance(*b) < most),
                "{at:?}"
            );
            assert!(
                far.1.distance(near.1) < most && far.2.distance(near.2) < most,
                "{at:?}"
            );
            let middle = scene.offset - DVec3::from(at);
            assert!(middle.length() < 200.0, "{at:?}: {middle}");
            assert_eq!(scene.offset, scene.offset.round(), "round numbers");
        }
    }
}

#[test]
fn stray_objects_and_wide_grounds_leave_the_middle_sharp() {
    let stray = json!({ "mesh": 1, "translation": [1e8, 0, 0] });
    let ground = json!({ "mesh": 1, "scale": [1e8, 1e8, 1e8], "rotation": [1, 0, 0, 1] });
    for (other, x) in [(&stray, 0.0), (&stray, 4e6), (&ground, 0.0), (&ground, 3e7)] {
        let mut doc = far_room(json!({ "translation": [x, 0, 0] }));
        doc.push(
            "/meshes",
            json!({ "primitives": [{ "attributes": { "POSITION": 0 } }] }),
        );
        doc.push("/nodes", other.clone());
        doc.set("/scenes/0/nodes", json!([4, 3]));
        let scene = doc.scene();
        assert_eq!(scene.instances.len(), 2, "nothing is lost");
        let room = places_less(&scene, DVec3::new(x, 0.0, 0.0));
        let near = places_less(&far_room(json!({})).scene(), DVec3::ZERO);
        let corners = room.0.iter().rev().zip(near.0.iter().rev()).take(400);
        assert!(
            corners.clone().count() == 400 && corners.into_iter().all(|(a, b)| a.distance(*b) < 1e-5),
            "{x}"
        );
    }
}

#[test]
fn sequences_are_given_in_the_files_coordinates() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("far.json");
    let text = r#"{ "relight_sequence": 1, "frames": 2,
        "camera": { "position": [4000000.125, 1.5, -9.25], "look_at": { "keys": [[0, [4000001, 1, 0]], [1, [4e6, 1, 0.5]]] },
                    "up": [0, 1, 0], "vfov_deg": 60 },
        "lights": [
        { "name": "a", "type": "point", "position": { "keys": [[0, [4000000.5, 2, 3]], [1, [3999999.75, 2, 3]]],
          "interpolation": "step" }, "intensity": [1, 1, 1] },
        { "name": "b", "type": "rect", "center": [4000002.0625, 0, 0], "edge_u": [1, 0, 0], "edge_v": [0, 1, 0], "radiance": [1, 1, 1] },
        { "name": "c", "type": "sphere", "center": [4000003, 0, 0], "radius": 0.5, "radiance": [1, 1, 1] },
        { "name": "d", "type": "directional", "direction": [0, -1, 0], "irradiance": [1, 1, 1] } ] }"#;
    std::fs::write(&file, text).unwrap();
    let sequence = read_sequence_at(&file, DVec3::new(4e6, 0.0, -10.0)).unwrap();
    // The same, written by somebody who subtracts in his head.
    let near = r#"{ "relight_sequence": 1, "frames": 2,
        "camera": { "position": [0.125, 1.5, 0.75], "look_at": { "keys": [[0, [1, 1, 10]], [1, [0, 1, 10.5]]] },
                    "up": [0, 1, 0], "vfov_deg": 60 },
        "lights": [
        { "name": "a", "type": "point", "position": { "keys": [[0, [0.5, 2, 13]], [1, [-0.25, 2, 13]]],
          "interpolation": "step" }, "intensity": [1, 1, 1] },
        { "name": "b", "type": "rect", "center": [2.0625, 0, 10], "edge_u": [1, 0, 0], "edge_v": [0, 1, 0], "radiance": [1, 1, 1] },
        { "name": "c", "type": "sphere", "center": [3, 0, 10], "radius": 0.5, "radiance": [1, 1, 1] },
        { "name": "d", "type": "directional", "direction": [0, -1, 0], "irradiance": [1, 1, 1] } ] }"#;
    std::fs::write(&file, near).unwrap();
    assert_eq!(sequence, read_sequence(&file).unwrap());
    assert_eq!(sequence, read_sequence_at(&file, DVec3::ZERO).unwrap());
}

/// A `.glb` whose chunks say and have what they are told: JSON padded to a multiple of 4 or not, padding counted or not.
fn odd_glb(doc: &Doc, pad: bool, count: bool, spare: usize, header: i64) -> Vec<u8> {
    let mut json = doc.json.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4) + spare, b' ');
    let mut bytes = b"glTF\x02\0\0\0\0\0\0\0".to_vec();
    for (kind, chunk) in [(b"JSON", &json), (b"BIN\0", &doc.bin)] {
        let padding = if pad {
            chunk.len().next_multiple_of(4) - chunk.len()
        } else {
            0
        };
        let said = if count { chunk.len() + padding } else { chunk.len() };
        bytes.extend((said as u32).to_le_bytes());
        bytes.extend(kind);
        bytes.extend(chunk);
        bytes.resize(bytes.len() + padding, 0);
    }
    let length = (bytes.len() as i64 + header) as u32;
    bytes[8..12].copy_from_slice(&length.to_le_bytes());
    bytes
}

#[test]
fn chunks_without_padding_are_read() {
    let mut doc = Doc::triangle();
    let expected = doc.scene().meshes;
    // The binary chunk has no round length either.
    doc.view(&[1]);
    for spare in 0..4 {
        for (pad, count, header) in [
            (false, false, 0),
            (true, false, 0),
            (true, true, 0),
            // The header counts padding that was not written, or not the padding that was.
            (false, false, 3),
            (true, true, -3),
        ] {
            let bytes = odd_glb(&doc, pad, count, spare, header);
            let scene =
                import_bytes("scene.glb", &bytes).unwrap_or_else(|e| panic!("{spare} {pad} {count}: {e}"));
            assert_eq!(scene.meshes, expected);
            if !(pad && count && header == 0) {
                noted(&scene, "chunks are not padded");
            } else {
                assert!(scene.notes.is_empty(), "{:?}", scene.notes);
            }
        }
    }
}

#[test]
fn git_lfs_pointers_are_called_so() {
    let pointer = "version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n";
    for name in ["scene.glb", "scene.gltf"] {
        let error = import_bytes(name, pointer.as_bytes()).unwrap_err().to_string();
        assert!(error.contains("git lfs pull"), "{error}");
    }
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.bin"), pointer).unwrap();
    std::fs::write(folder.path().join("a.png"), pointer).unwrap();
    let file = folder.path().join("scene.gltf");
    let mut doc = Doc::triangle();
    doc.set("/images", json!([{ "uri": "a.png" }]))
        .set("/textures", json!([{ "source": 0 }]));
    doc.set("/materials", json!([{ "normalTexture": { "index": 0 } }]))
        .set("/meshes/0/primitives/0/material", json!(0));
    for (pointer, value) in [
        ("/buffers/0/uri", json!("a.bin")),
        ("/buffers/0/byteLength", json!(36)),
    ] {
        doc.set(pointer, value);
    }
    std::fs::write(&file, doc.json.to_string()).unwrap();
    let error = import(&file, &ImportOptions::default()).unwrap_err().to_string();
    assert!(
        error.contains("buffers[0].uri: names a.bin, which is a Git LFS pointer"),
        "{error}"
    );
    assert!(
        error.contains("images[0]: names a.png, which is a Git LFS pointer"),
        "{error}"
    );
}
