//! Malformed glTF files: each gives an error that names the place, none a panic. Among them are those on
//! which the gltf crate 1.4 panics or silently drops geometry.
#![cfg(feature = "gltf")]
// Reason: it measures.
#![allow(clippy::disallowed_methods)]

mod gltf_support;

use gltf_support::{Doc, PNG, glb, import_bytes};
use relight_scene::gltf::{ImportError, ImportOptions, MAX_FAULTS, import};
use serde_json::{Value, json};

/// A valid file with one of everything.
fn everything() -> Doc {
    let mut doc = Doc::triangle();
    let indices = doc.accessor(&[0, 1, 2], 5121, 3, "SCALAR"); // accessor 1
    let uv = doc.floats(&[0., 0., 1., 0., 0., 1.], "VEC2"); // accessor 2
    let normals = doc.floats(&[0., 0., 1., 0., 0., 1., 0., 0., 1.], "VEC3"); // accessor 3
    let times = doc.floats(&[0.0, 1.0], "SCALAR"); // accessor 4
    let values = doc.floats(&[0., 0., 0., 1., 1., 1.], "VEC3"); // accessor 5
    let image = doc.view(PNG); // view 6
    let sparse_indices = doc.view(&[0, 2]); // view 7
    let sparse_values = doc.view(&[0; 16]); // view 8
    doc.json["accessors"][2]["sparse"] = json!({
        "count": 2, "indices": { "bufferView": sparse_indices, "componentType": 5121 },
        "values": { "bufferView": sparse_values },
    });
    doc.set(
        "/meshes/0/primitives/0",
        json!({
            "attributes": { "POSITION": 0, "TEXCOORD_0": uv, "NORMAL": normals },
            "indices": indices, "material": 0, "mode": 4,
        }),
    );
    doc.set(
        "/images",
        json!([{ "bufferView": image, "mimeType": "image/png" }]),
    );
    doc.set("/samplers", json!([{ "wrapS": 33071 }]));
    doc.set("/textures", json!([{ "source": 0, "sampler": 0 }]));
    doc.set(
        "/materials",
        json!([{
            "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } }, "normalTexture": { "index": 0 },
            "emissiveFactor": [1, 1, 1], "alphaMode": "MASK",
        }]),
    );
    doc.set(
        "/cameras",
        json!([{ "type": "perspective", "perspective": { "yfov": 1.0, "znear": 0.1 } }]),
    );
    doc.set(
        "/extensions",
        json!({ "KHR_lights_punctual": { "lights": [{ "type": "spot", "spot": {} }] } }),
    );
    doc.set(
        "/nodes",
        json!([
            { "mesh": 0 }, { "camera": 0, "children": [2] },
            { "extensions": { "KHR_lights_punctual": { "light": 0 } }, "rotation": [0, 0, 0, 1] },
        ]),
    );
    doc.set("/scenes", json!([{ "nodes": [0, 1] }]));
    doc.set(
        "/animations",
        json!([{
            "samplers": [{ "input": times, "output": values }],
            "channels": [{ "sampler": 0, "target": { "node": 1, "path": "translation" } }],
        }]),
    );
    doc
}

#[test]
fn the_file_that_the_others_break_is_valid() {
    let scene = everything().scene();
    assert_eq!(
        (scene.meshes.len(), scene.textures.len(), scene.cameras.len()),
        (1, 1, 1)
    );
    assert_eq!((scene.sequence.lights.len(), scene.sequence.frames), (2, 25));
}

/// JSON pointer, bad value, place in the message.
const BROKEN: &str = r#"
# The crate panics on the first six.
/images/0 | {"uri": "100%.png"} | images[0]
/images/0/bufferView | 99 | images[0].bufferView: is 99, but there are only 9 bufferViews
/images/0 | {} | images[0]: has neither a uri nor a bufferView
/meshes/0/primitives/0/indices | 4 | meshes[0].primitives[0].indices: uses accessors[4], which is no list of unsigned integers
/meshes/0/primitives/0/attributes/POSITION | 99 | meshes[0].primitives[0].attributes.POSITION: is 99
/buffers/0/uri | "%zz" | buffers[0].uri
# The crate drops geometry on these.
/accessors/0/bufferView | 99 | accessors[0].bufferView: is 99
/accessors/0/byteOffset | 4 | accessors[0]: needs 3 elements of 12 bytes
/accessors/0/count | 4 | accessors[0]: needs 4 elements
/bufferViews/0/byteOffset | 100000 | bufferViews[0]: covers 36 bytes from 100000
/bufferViews/0/byteLength | 18446744073709551615 | bufferViews[0]: covers
/bufferViews/0/buffer | 1 | bufferViews[0].buffer: is 1, but there are only 1 buffers
# Or reads any file of the machine.
/buffers/0/uri | "file:///etc/passwd" | buffers[0].uri: starts with the scheme "file:"
/buffers/0/uri | "../../etc/passwd" | buffers[0].uri: leads out of the scene's folder
/buffers/0/uri | "/etc/passwd" | buffers[0].uri: is an absolute path
/buffers/0/uri | "%2e%2e/secret" | buffers[0].uri: leads out
/images/0 | {"uri": "https://example.org/a.png"} | images[0]: starts with the scheme
/buffers/0/uri | "missing.bin" | buffers[0].uri: names missing.bin, which cannot be read
/buffers/0/uri | "data:;base64,!!" | buffers[0].uri: holds damaged base64
/buffers/0/byteLength | 1000000 | buffers[0].byteLength: is 1000000, but there are only
/buffers/0/byteLength | -1 | buffers[0].byteLength: must be a non-negative integer
# Node tree: the crate walks cycles forever.
/nodes/2/children | [1] | children: makes the node an ancestor of itself
/nodes/1/children | [7] | nodes[1].children[0]: is 7, but there are only 3 nodes
/scene | 3 | scene: is 3
/nodes/0/mesh | 1 | nodes[0].mesh: is 1, but there are only 1 meshes
/nodes/0/matrix | [1, 2, 3] | nodes[0].matrix: must be an array of 16 finite numbers
/nodes/2/rotation | [0, 0, 0, 0] | nodes[2].rotation: must be a unit quaternion
/nodes/0/scale | [1e300, 1, 1] | nodes[0].scale: must be an array of 3 finite numbers
# Accessors and primitives.
/accessors/0/type | "VEC9" | accessors[0].type: is "VEC9"
/accessors/0/componentType | 5124 | accessors[0].componentType: is 5124
/accessors/0/componentType | 5125 | attributes.POSITION: uses accessors[0], which has the wrong type
/accessors/0/count | 1.5 | accessors[0].count: must be a non-negative integer
/bufferViews/0/byteStride | 8 | accessors[0]: has elements of 12 bytes, more than the stride
/bufferViews/0/byteStride | 1000 | accessors[0]: needs 3 elements of 12 bytes, 1000 apart
/accessors/3/count | 2 | meshes[0].primitives[0].attributes: use accessors[3] with 2 elements
/meshes/0/primitives/0/mode | 7 | meshes[0].primitives[0].mode: is 7
/meshes/0/primitives/0/material | 5 | meshes[0].primitives[0].material: is 5
/meshes/0/primitives/0/attributes | [] | meshes[0].primitives[0].attributes: must be an object
/accessors/2/sparse/count | 9 | accessors[2].sparse.count: is 9
/accessors/2/sparse/indices/componentType | 5126 | accessors[2].sparse.indices.componentType
/accessors/2/sparse/values/byteOffset | 1 | accessors[2].sparse.values: needs 2 elements
/accessors/2/sparse/values | 3 | accessors[2].sparse.values: must be an object
/bufferViews/7/byteOffset | 0 | accessors[2].sparse.indices: element 1 is 0
# Materials, cameras, lights, animations.
/materials/0/alphaMode | "SOLID" | materials[0].alphaMode: is "SOLID"
/materials/0/normalTexture/index | 4 | materials[0].normalTexture.index: is 4
/materials/0/emissiveFactor | [1, 1] | materials[0].emissiveFactor: must be an array of 3
/textures/0/source | 4 | textures[0].source: is 4
/textures/0 | {"extensions": {"EXT_texture_avif": {"source": 0}}} | gltf-transform png
/samplers/0/wrapS | 1 | samplers[0].wrapS: is 1
/bufferViews/6/byteOffset | 0 | images[0]: is neither a PNG, a JPEG, a WebP nor a KTX2 image
/cameras/0/perspective/yfov | 0 | cameras[0].perspective.yfov: must be an angle
/cameras/0/type | "fisheye" | cameras[0].type
/extensions/KHR_lights_punctual/lights/0/type | "area" | extensions.KHR_lights_punctual.lights[0].type
/extensions/KHR_lights_punctual/lights/0/spot | {"innerConeAngle": 1} | lights[0].spot: needs 0 <=
/nodes/2/extensions/KHR_lights_punctual/light | 1 | nodes[2].extensions.KHR_lights_punctual.light: is 1
/animations/0/channels/0/sampler | 1 | animations[0].channels[0].sampler: is 1
/animations/0/samplers/0/output | 4 | animations[0].samplers[0].output: uses accessors[4]
/animations/0/samplers/0/output | 0 | animations[0].samplers[0].output: has 3 values for 2 keys
/animations/0/samplers/0/interpolation | "BEZIER" | animations[0].samplers[0].interpolation
# The whole file.
/asset/version | "1.0" | asset.version: is "1.0"
/asset | {} | asset.version: is missing
/meshes | {} | meshes: must be an array
/nodes/1 | 5 | nodes[1]: must be an object
/extensionsUsed | [1] | extensionsUsed[0]: must be a string
"#;

#[test]
fn every_broken_value_is_named() {
    let cases = BROKEN
        .lines()
        .filter(|line| !line.is_empty() && !line.starts_with('#'));
    assert!(cases.clone().count() >= 60);
    for case in cases {
        let [pointer, value, place] = case.splitn(3, " | ").collect::<Vec<_>>()[..] else {
            panic!("{case}");
        };
        let mut doc = everything();
        doc.set(pointer, serde_json::from_str(value).unwrap());
        let error = doc.import().expect_err(case);
        assert!(matches!(error, ImportError::Invalid { .. }), "{case}: {error}");
        assert!(error.to_string().contains(place), "{case}: {error}");
    }
}

#[test]
fn indices_and_times_are_checked_against_the_real_bytes() {
    let mut doc = everything();
    let bad = doc.accessor(&[0, 1, 3], 5121, 3, "SCALAR");
    doc.set("/meshes/0/primitives/0/indices", bad.into());
    let error = doc.import().unwrap_err().to_string();
    assert!(
        error.contains("meshes[0].primitives[0].indices: element 2 is 3, but there are only 3 vertices"),
        "{error}"
    );
    for times in [[1.0, 1.0], [0.0, f32::NAN], [-1.0, 0.0]] {
        let mut doc = everything();
        let bad = doc.floats(&times, "SCALAR");
        doc.set("/animations/0/samplers/0/input", bad.into());
        let error = doc.import().unwrap_err().to_string();
        assert!(
            error.contains("animations[0].samplers[0].input: holds times that don't rise"),
            "{error}"
        );
    }
}

#[test]
fn one_pass_reports_all_faults() {
    let mut doc = everything();
    doc.set("/materials/0/alphaMode", json!("SOLID"))
        .set("/scene", json!(3))
        .set("/nodes/1/rotation", json!([0, 0, 0, 0]));
    let ImportError::Invalid { faults, more, .. } = doc.import().unwrap_err() else {
        panic!()
    };
    let paths: Vec<&str> = faults.iter().map(|f| f.path.as_str()).collect();
    assert_eq!(
        (paths, more),
        (vec!["scene", "nodes[1].rotation", "materials[0].alphaMode"], 0)
    );
    for _ in 0..50 {
        let material = doc.push("/materials", json!({ "alphaMode": "SOLID" }));
        doc.push(
            "/meshes/0/primitives",
            json!({ "attributes": { "POSITION": 0 }, "material": material }),
        );
    }
    let ImportError::Invalid { faults, more, .. } = doc.import().unwrap_err() else {
        panic!()
    };
    assert_eq!((faults.len(), more), (MAX_FAULTS, 53 - MAX_FAULTS));
}

#[test]
fn what_is_no_gltf_file_says_so() {
    let whole = Doc::triangle().glb();
    let mut version = whole.clone();
    version[4] = 1;
    let mut length = whole.clone();
    length[8..12].fill(0xff);
    let mut chunk = whole.clone();
    chunk[12..16].fill(0xff);
    for (bytes, part) in [
        (&b""[..], "the file is empty"),
        (b"hello", "this is no glTF file"),
        (b"\x89PNG\r\n\x1a\n", "this is no glTF file"),
        (b"{", "JSON, line 1"),
        (b"{}", "asset: is missing"),
        (&[b'['; 5][..], "this is no glTF file"),
        (&version, "byte 4: this is glTF version 1"),
        (&length, "byte 8: the header says"),
        (&chunk, "byte 12: a chunk says"),
        (&glb(b"{\"asset\":", b""), "JSON, line 1"),
    ] {
        let error = import_bytes("scene.glb", bytes).unwrap_err().to_string();
        assert!(error.contains(part) && error.contains("scene.glb"), "{error}");
    }
    let nowhere = std::path::Path::new("no/such/scene.glb");
    assert!(matches!(
        import(nowhere, &ImportOptions::default()),
        Err(ImportError::Io { .. })
    ));
    let folder = tempfile::tempdir().unwrap();
    assert!(matches!(
        import(folder.path(), &ImportOptions::default()),
        Err(ImportError::Io { .. })
    ));
}

#[test]
fn bombs_are_refused_before_anything_is_allocated() {
    let start = std::time::Instant::now();
    let refused = |what: &str, doc: &Doc| {
        let error = doc.import().expect_err(what);
        assert!(
            matches!(error, ImportError::Invalid { .. } | ImportError::Json { .. }),
            "{what}: {error}"
        );
    };
    let mut huge = everything();
    huge.set("/accessors/0/count", json!(u64::MAX));
    refused("count", &huge);
    // Sparse positions without a view need no bytes for their zeros.
    let mut zeros = everything();
    let view = zeros.view(&[0; 16]);
    let sparse = json!({ "componentType": 5126, "type": "VEC3", "count": 4_000_000_000u64, "sparse": {
        "count": 1, "indices": { "bufferView": view, "componentType": 5125 }, "values": { "bufferView": view } } });
    let sparse = zeros.push("/accessors", sparse);
    zeros.set(
        "/meshes/0/primitives/0",
        json!({ "attributes": { "POSITION": sparse } }),
    );
    refused("zeros", &zeros);
    // Many primitives (of different materials, so that they don't merge) over the same allowed zeros.
    zeros.json["accessors"][sparse]["count"] = (1 << 22).into();
    zeros.set("/materials", json!(vec![json!({}); 1000]));
    let primitives: Vec<Value> = (0..1000)
        .map(|m| json!({ "attributes": { "POSITION": sparse }, "material": m }))
        .collect();
    zeros.set("/meshes/0/primitives", json!(primitives));
    refused("shared zeros", &zeros);
    // A million triangles, placed by a thousand nodes.
    let mut crowd = everything();
    let indices = crowd.accessor(&[0; 3_000_000], 5121, 3_000_000, "SCALAR");
    crowd.set("/meshes/0/primitives/0/indices", indices.into());
    let first = crowd.json["nodes"].as_array().unwrap().len();
    for _ in 0..1000 {
        crowd.push("/nodes", json!({ "mesh": 0 }));
    }
    crowd.set(
        "/scenes/0/nodes",
        json!((first..first + 1000).collect::<Vec<_>>()),
    );
    refused("crowd", &crowd);
    let mut buffer = everything();
    buffer.set("/buffers/0/byteLength", json!(1u64 << 40));
    refused("buffer", &buffer);
    let mut long = everything();
    let times = long.floats(&[0.0, 1e30], "SCALAR");
    long.set("/animations/0/samplers/0/input", times.into());
    refused("long animation", &long);
    // A chain of 200,000 nodes, and a diamond of 2^30 paths.
    let mut deep = everything();
    let chain: Vec<Value> = (0..200_000).map(|i| json!({ "children": [i + 1] })).collect();
    deep.set("/nodes", json!(chain));
    deep.push("/nodes", json!({ "mesh": 0 }));
    deep.set("/scenes/0/nodes", json!([0]))
        .set("/animations", json!([]));
    refused("deep nodes", &deep);
    let mut diamond = everything();
    let nodes: Vec<Value> = (0..30)
        .map(|i| json!({ "children": [2 * i + 2, 2 * i + 3] }))
        .collect();
    let mut pairs: Vec<Value> = nodes.iter().flat_map(|n| [n.clone(), n.clone()]).collect();
    pairs.extend([json!({ "mesh": 0 }), json!({ "mesh": 0 })]);
    diamond
        .set("/nodes", json!(pairs))
        .set("/scenes/0/nodes", json!([0]))
        .set("/animations", json!([]));
    refused("diamond", &diamond);
    let nested = [b"{\"asset\":".to_vec(), vec![b'['; 1_000_000]].concat();
    assert!(matches!(
        import_bytes("scene.gltf", &nested),
        Err(ImportError::Json { .. })
    ));
    // Generous: reading the largest of these files takes a fraction of a second.
    assert!(start.elapsed().as_secs() < 20, "{:?}", start.elapsed());
}

#[test]
fn truncations_and_mutations_never_panic() {
    let whole = everything().glb();
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("scene.glb");
    let check = |bytes: &[u8], what: String| {
        // Overwritten in place: some file systems flush a file that was truncated first.
        use std::io::Write;
        let options = std::fs::OpenOptions::new()
            .write(true)
            .create(true)
            .truncate(false)
            .open(&file);
        let mut out = options.unwrap();
        out.write_all(bytes).unwrap();
        out.set_len(bytes.len() as u64).unwrap();
        let result = import(&file, &ImportOptions::default());
        // An internal error is a caught panic or a disagreement with the crate: a bug.
        assert!(
            !matches!(result, Err(ImportError::Internal { .. })),
            "{what}: {}",
            result.unwrap_err()
        );
        result.is_ok()
    };
    for length in 0..whole.len() {
        assert!(
            !check(&whole[..length], format!("truncated to {length}")),
            "truncated to {length}"
        );
    }
    // Seeded xorshift: one to four bytes set to random values, or to characters that mean something in JSON.
    let mut state = 0x9E37_79B9_7F4A_7C15u64;
    let mut next = |below: usize| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state % below as u64) as usize
    };
    let mut accepted = 0;
    for round in 0..4000 {
        let mut bytes = whole.clone();
        for _ in 0..=next(4) {
            let at = next(bytes.len());
            bytes[at] = match next(3) {
                0 => next(256) as u8,
                _ => b"0123456789-{}[]\",:e."[next(20)],
            };
        }
        accepted += usize::from(check(&bytes, format!("mutation {round}")));
    }
    // Many mutations hit digits or data and leave a valid file: the test reaches past the parser.
    assert!((200..3900).contains(&accepted), "{accepted}");
}
