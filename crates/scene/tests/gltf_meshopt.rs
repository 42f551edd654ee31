//! EXT_meshopt_compression and KHR_meshopt_compression in hand-made files. Independent truth: the same file without
//! compression; streams are written by two small encoders that follow the specification (meshoptimizer's own are tested
//! beside the decoder).
#![cfg(feature = "gltf")]

mod gltf_support;

use gltf_support::Doc;
use relight_scene::scene::Scene;
use serde_json::{Value, json};

const NAMES: [&str; 2] = ["EXT_meshopt_compression", "KHR_meshopt_compression"];

/// Attributes of up to 16 elements, version 1: every difference stored as it is.
fn attributes(elements: &[u8], stride: usize) -> Vec<u8> {
    let mut stream = vec![0xa1];
    stream.extend(vec![0xff; stride / 4]);
    for byte in 0..stride {
        for i in 0..elements.len() / stride {
            let before = if i == 0 {
                0
            } else {
                elements[(i - 1) * stride + byte]
            };
            let delta = elements[i * stride + byte].wrapping_sub(before);
            stream.push(if delta & 128 == 128 {
                !(delta << 1)
            } else {
                delta << 1
            });
        }
    }
    stream.extend(vec![0; (stride + stride / 4).max(24)]);
    stream
}

/// Triangles of indices below 64, every corner spelled out.
fn triangles(indices: &[u8]) -> Vec<u8> {
    let mut stream = vec![0xe1];
    stream.extend(vec![0xff; indices.len() / 3]);
    let mut last = 0i8;
    for triangle in indices.chunks(3) {
        stream.push(0xff);
        for &index in triangle {
            let delta = (index as i8).wrapping_sub(last);
            last = index as i8;
            stream.push(if delta < 0 { !(delta << 1) } else { delta << 1 } as u8);
        }
    }
    stream.extend([0; 16]);
    stream
}

/// Four corners of a square and their indices, not compressed.
fn square() -> (Vec<u8>, [u8; 6]) {
    let corners = [0f32, 0., 0., 1., 0., 0., 0., 1., 0., 1., 1., 0.5];
    (corners.map(f32::to_le_bytes).concat(), [0, 1, 2, 2, 1, 3])
}

/// A view of what `stream` decodes to, whose bytes without compression are said to be in buffer 1.
fn view(doc: &mut Doc, name: &str, stream: &[u8], stride: usize, count: usize, mode: &str) -> usize {
    let view = doc.view(stream);
    let length = stride * count;
    let mut part = doc.json["bufferViews"][view].clone();
    part["byteStride"] = stride.into();
    part["count"] = count.into();
    part["mode"] = mode.into();
    doc.json["bufferViews"][view] =
        json!({ "buffer": 1, "byteOffset": 8, "byteLength": length, "extensions": { name: part } });
    view
}

fn compressed(name: &str, placeholder: Value) -> Doc {
    let mut doc = Doc::triangle();
    let (corners, indices) = square();
    doc.push("/buffers", placeholder);
    let corners = view(&mut doc, name, &attributes(&corners, 12), 12, 4, "ATTRIBUTES");
    let indices = view(&mut doc, name, &triangles(&indices), 2, 6, "TRIANGLES");
    doc.set(
        "/accessors",
        json!([
            { "bufferView": corners, "componentType": 5126, "count": 4, "type": "VEC3" },
            { "bufferView": indices, "componentType": 5123, "count": 6, "type": "SCALAR" },
        ]),
    );
    doc.set("/meshes/0/primitives/0/indices", json!(1));
    doc.set("/extensionsRequired", json!([name]));
    doc
}

fn plain() -> Scene {
    let mut doc = Doc::triangle();
    let (corners, indices) = square();
    let corners = doc.accessor(&corners, 5126, 4, "VEC3");
    let indices = doc.accessor(&indices, 5121, 6, "SCALAR");
    doc.set("/meshes/0/primitives/0/attributes/POSITION", corners.into());
    doc.set("/meshes/0/primitives/0/indices", indices.into());
    doc.scene()
}

#[test]
fn compressed_views_are_read_whatever_stands_for_them() {
    for name in NAMES {
        for placeholder in [
            json!({ "byteLength": 1000, "extensions": { name: { "fallback": true } } }),
            json!({ "byteLength": 1000 }),
            // A file for those who cannot decompress: nobody here opens it.
            json!({ "byteLength": 1000, "uri": "missing.bin" }),
        ] {
            let scene = compressed(name, placeholder).scene();
            assert_eq!(scene.meshes, plain().meshes);
            assert_eq!(scene.notes, Vec::<String>::new());
        }
    }
}

#[test]
fn what_is_wrong_with_a_stream_is_told_by_place() {
    let name = NAMES[0];
    let doc = || compressed(name, json!({ "byteLength": 1000 }));
    let part = |view: usize| format!("/bufferViews/{view}/extensions/{name}");
    let mut cases = Vec::new();
    for (key, value, what) in [
        (
            "mode",
            json!("VERTICES"),
            "is VERTICES; it must be ATTRIBUTES, TRIANGLES or INDICES",
        ),
        ("filter", json!("ROUND"), "is ROUND; it must be NONE"),
        (
            "filter",
            json!("QUATERNION"),
            "byteStride: is 12, which ATTRIBUTES WITH FILTER QUATERNION cannot have",
        ),
        ("byteStride", json!(14), "byteStride: is 14"),
        ("buffer", json!(1), "buffers[1]: has no uri"),
        ("buffer", json!(2), "buffer: is 2, but there are only 2 buffers"),
        ("byteOffset", json!(100_000), "from 100000, but buffers[0] has"),
        (
            "count",
            json!(5),
            "bufferViews[1].byteLength: is 48, but its stream has count times byteStride",
        ),
        (
            "byteLength",
            json!(30),
            "its stream ends too early; copy the file or compress the scene again",
        ),
        (
            "byteLength",
            json!(10),
            "count: is more than a stream of 10 bytes can hold",
        ),
    ] {
        let mut doc = doc();
        doc.set(&format!("{}/{key}", part(1)), value);
        cases.push((doc, what));
    }
    let mut odd = doc();
    odd.set(&format!("{}/count", part(2)), json!(7));
    cases.push((odd, "count: is 7; triangles have a multiple of 3"));
    let mut other = doc();
    other.set(&format!("{}/mode", part(2)), json!("INDICES"));
    cases.push((other, "its stream starts with 0xe1, where indices have 0xd1"));
    for (doc, what) in cases {
        let error = doc.import().unwrap_err().to_string();
        assert!(error.contains(what), "{what}: {error}");
    }
}

#[test]
fn a_broken_stream_that_nothing_shows_refuses_nothing() {
    let mut doc = Doc::triangle();
    doc.push("/buffers", json!({ "byteLength": 1000 }));
    view(&mut doc, NAMES[1], &[0xa1; 40], 4, 4, "ATTRIBUTES");
    assert_eq!(doc.scene().meshes.len(), 1);
}

/// Streams of equal elements shrink to a thousandth, and views may share one.
#[test]
fn bombs_are_refused_before_anything_is_decompressed() {
    // A byte for each block of 256 elements that equal the one before.
    let count = 1 << 22;
    let mut stream = vec![0xa1];
    stream.extend(vec![0xaa; count / 256]);
    stream.extend([0; 24]);
    let mut doc = Doc::triangle();
    doc.push("/buffers", json!({ "byteLength": 1000 }));
    let first = view(&mut doc, NAMES[0], &stream, 4, count, "ATTRIBUTES");
    assert_eq!(doc.scene().meshes.len(), 1);
    for _ in 0..9 {
        let again = doc.json["bufferViews"][first].clone();
        doc.push("/bufferViews", again);
    }
    let error = doc.import().unwrap_err().to_string();
    assert!(
        error.contains("buffers: decompress to 167772160 bytes from"),
        "{error}"
    );

    let huge = u64::MAX / 8;
    doc.json["bufferViews"]
        .as_array_mut()
        .unwrap()
        .truncate(first + 1);
    let part = format!("/bufferViews/{first}/extensions/{}", NAMES[0]);
    doc.set(&format!("/bufferViews/{first}/byteLength"), json!(4 * huge));
    doc.set(&format!("{part}/count"), json!(huge));
    doc.set(
        "/meshes/0/primitives/0/attributes/COLOR_0",
        json!(doc.json["accessors"].as_array().unwrap().len()),
    );
    doc.push(
        "/accessors",
        json!({ "bufferView": first, "componentType": 5121, "count": 3, "type": "VEC4" }),
    );
    let error = doc.import().unwrap_err().to_string();
    assert!(error.contains("count: is more than a stream of"), "{error}");
}
