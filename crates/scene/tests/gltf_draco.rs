//! KHR_draco_mesh_compression. Independent truth: two streams that Google's encoder (draco3dgltf, npm) wrote of a grid which
//! the test makes again.
#![cfg(feature = "gltf")]

mod gltf_support;

use base64::Engine;
use gltf_support::Doc;
use relight_scene::gltf::ImportError;
use relight_scene::scene::Mesh;
use serde_json::json;

const NAME: &str = "KHR_draco_mesh_compression";

/// 4 × 4 vertices: positions (0) of 12 bits, normals (1), coordinates (2) of 10 bits, colours (3) of bytes; 18 triangles.
const EDGEBREAKER: &str = "\
    RFJBQ08CAgEBAAAAEBIDEgIABu/T6lOtGv8BEf8Ca0H/AmtB/wJrQQT/AAAAAAABAAACAAABAAkDAAACAQEJAwABAwEDCQIAAgIB\
    AgIEAAMBAQEBAA0DAQwfASgDAQwFANjYX4qquqpWpaqpCgAAoKpUBQAAqQIAwKoAAIBVAQAgVQAAWBUAAFQFAABWAQAgVQAAQBUA\
    AJAqAAAAAAD/DwAAAAAAAAAAAAAAAAAAAABAQAwAAwEBAYABAT7/9wECAwC/k/8AAAB/AAAACAEBAQALAwE0HwEMBAC+v4Gqrqpq\
    qgCoCgAAAAAAAAD/AwAAAAAAAAAAAAAAAIA/CgEBAQAIAwE0DwEIAQQEAJ2fjRSoIUCdAACgAgAAAAAAAAAAAAAA/wAAAA==";
/// The same without a walk over edges.
const SEQUENTIAL: &str = "\
    RFJBQ08CAgEAAAASEAEAAQQBBQQBAgUCBgUCAwYDBwYEBQgFCQgFBgkGCgkGBwoHCwoICQwJDQwJCg0KDg0KCw4LDw4BBAAJAwAA\
    AQkDAAEDCQIAAgICBAADAgMCAQABAQANAwEEJwE8AwAgi1BVAAAAVQUAAFBVAAAAAVBVAFBVAFAVVQUAVlFVAFAVAVDV/1NVALAq\
    VQUAqlJVALAqAVDV/1dVAABAVQUAAFRVAPA/AAAAAP8PAAAAAwEBAYABAT7/9wECAwC/k/8AAAB/AAAAAAEBAQGrBQEcAwEG////\
    /////////5sBHggALXxErIUzggAAAAD/AwAAAAEBAQE8AR4BAQEMAQM/AQxLAQNHAQMTQL2D8+7gscDqIhAU1o7RMA4kZwAAAAD/\
    AAAAAAAAAAAAAAAAAAAAAABAQAwIAAAAAAAAAAAAAIA/Cg==";

fn bytes(stream: &str) -> Vec<u8> {
    base64::engine::general_purpose::STANDARD.decode(stream).unwrap()
}

/// The grid by column and row.
struct Vertex {
    position: [f32; 3],
    uv: [f32; 2],
    color: [f32; 4],
}

fn vertex(x: u32, y: u32) -> Vertex {
    let byte = |value: u32| value as f32 / 255.0;
    Vertex {
        position: [x as f32, y as f32, (x * y) as f32 / 4.0],
        uv: [x as f32 / 3.0, y as f32 / 3.0],
        color: [byte(10 * x), byte(20 * y), byte(x + y), 1.0],
    }
}

fn grid(stream: &[u8]) -> Doc {
    let mut doc = Doc::triangle();
    let view = doc.view(stream);
    doc.set(
        "/accessors",
        json!([
            { "componentType": 5126, "count": 16, "type": "VEC3" },
            { "componentType": 5126, "count": 16, "type": "VEC3" },
            { "componentType": 5126, "count": 16, "type": "VEC2" },
            { "componentType": 5121, "count": 16, "type": "VEC4", "normalized": true },
            { "componentType": 5123, "count": 54, "type": "SCALAR" },
        ]),
    );
    doc.set(
        "/meshes/0/primitives/0",
        json!({
            "attributes": { "POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2, "COLOR_0": 3 }, "indices": 4,
            "extensions": { NAME: { "bufferView": view,
                "attributes": { "POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2, "COLOR_0": 3 } } },
        }),
    );
    doc.set("/extensionsRequired", json!([NAME]));
    doc
}

/// Every triangle is one of the grid's, with its attributes, and none is missing.
fn is_the_grid(mesh: &Mesh) {
    assert_eq!(mesh.triangles.len(), 18);
    let place = |v: u32| {
        let p = mesh.positions[v as usize];
        let (x, y) = (p.x.round() as u32, p.y.round() as u32);
        let expected = vertex(x, y);
        // Quantised: 3 / 2¹² of a position, 1 / 2¹⁰ of a coordinate.
        assert!(p.abs_diff_eq(expected.position.into(), 1e-3), "{p}");
        assert!(mesh.uvs[0][v as usize].abs_diff_eq(expected.uv.into(), 1e-3));
        assert!(mesh.normals[v as usize].abs_diff_eq(glam::Vec3::Z, 0.02));
        assert!(mesh.colors[v as usize].abs_diff_eq(expected.color.into(), 1.01 / 255.0));
        y * 4 + x
    };
    let turned = |t: [u32; 3]| {
        let least = (0..3).min_by_key(|&i| t[i]).unwrap();
        [0, 1, 2].map(|i| t[(least + i) % 3])
    };
    let mut found: Vec<_> = mesh.triangles.iter().map(|t| turned(t.map(place))).collect();
    found.sort();
    let quad = |i: u32| {
        let v = i / 3 * 4 + i % 3;
        [[v, v + 1, v + 4], turned([v + 1, v + 5, v + 4])]
    };
    let mut expected: Vec<_> = (0..9).flat_map(quad).collect();
    expected.sort();
    assert_eq!(found, expected);
}

#[test]
fn both_codings_come_back_within_the_quantisation() {
    for stream in [EDGEBREAKER, SEQUENTIAL] {
        let scene = grid(&bytes(stream)).scene();
        assert_eq!(scene.meshes.len(), 1);
        is_the_grid(&scene.meshes[0]);
        assert_eq!(scene.notes, Vec::<String>::new());
    }
}

#[test]
fn accessors_may_have_other_types_than_the_stream_and_attributes_may_be_left_out() {
    let mut doc = grid(&bytes(EDGEBREAKER));
    // As KHR_mesh_quantization has it: whole metres.
    doc.set("/accessors/0/componentType", json!(5121));
    doc.set("/accessors/4/componentType", json!(5125));
    let extension = &mut doc.json["meshes"][0]["primitives"][0];
    for key in ["NORMAL", "TEXCOORD_0", "COLOR_0"] {
        extension["attributes"].as_object_mut().unwrap().remove(key);
    }
    let mesh = &doc.scene().meshes[0];
    assert_eq!(
        (mesh.triangles.len(), mesh.uvs.len(), mesh.colors.len()),
        (18, 0, 0)
    );
    let far = mesh.positions.iter().copied().reduce(glam::Vec3::max).unwrap();
    assert_eq!(far, glam::vec3(3.0, 3.0, 2.0));
}

#[test]
fn equal_primitives_are_one_mesh() {
    let mut doc = grid(&bytes(EDGEBREAKER));
    let again = doc.json["meshes"][0].clone();
    doc.push("/meshes", again);
    doc.push("/nodes", json!({ "mesh": 1, "translation": [9, 0, 0] }));
    doc.set("/scenes/0/nodes", json!([0, 1]));
    let scene = doc.scene();
    assert_eq!((scene.meshes.len(), scene.instances.len()), (1, 2));
}

/// What stands beside for those who cannot decode is the same scene, without a decoder's rounding.
#[test]
fn what_is_there_without_compression_is_read() {
    let mut doc = grid(&[1, 2, 3]);
    let positions = doc.floats(&[0., 0., 0., 1., 0., 0., 0., 1., 0.], "VEC3");
    let indices = doc.accessor(&[0, 1, 2], 5121, 3, "SCALAR");
    let primitive = "/meshes/0/primitives/0";
    doc.set(
        &format!("{primitive}/attributes"),
        json!({ "POSITION": positions }),
    );
    doc.set(&format!("{primitive}/indices"), indices.into());
    assert_eq!(doc.scene().meshes[0].positions.len(), 3);
}

#[test]
fn what_is_wrong_is_told_by_place() {
    let extension = format!("/meshes/0/primitives/0/extensions/{NAME}");
    let place = format!("meshes[0].primitives[0].extensions.{NAME}: its stream");
    let only = format!("POSITION: has its data in {NAME} only, which needs a bufferView");
    for (pointer, value, what) in [
        (
            "/accessors/4/count",
            json!(57),
            format!("{place} has 16 vertices and 54 indices, where the accessors declare 16 and 57"),
        ),
        ("/accessors/4/count", json!(3), format!("{place} is damaged")),
        (
            "/accessors/0/count",
            json!(15),
            "use accessors[1] with 16 elements".to_owned(),
        ),
        (
            "/accessors/0/count",
            json!(1u64 << 40),
            "buffers: decompress to".to_owned(),
        ),
        (
            &format!("{extension}/attributes/COLOR_0"),
            json!(7),
            format!("{place} has no attribute 7"),
        ),
        (
            &format!("{extension}/bufferView"),
            json!(9),
            "bufferViews[9]: is broken".to_owned(),
        ),
        (&format!("{extension}/bufferView"), json!("x"), only.clone()),
        (&format!("{extension}/attributes"), json!([]), only.clone()),
        ("/meshes/0/primitives/0/mode", json!(5), only),
    ] {
        let mut doc = grid(&bytes(EDGEBREAKER));
        doc.set(pointer, value);
        let error = doc.import().unwrap_err().to_string();
        assert!(error.contains(&what), "{what}: {error}");
    }
}

#[test]
fn damaged_streams_are_refused_or_give_as_many_triangles() {
    for text in [EDGEBREAKER, SEQUENTIAL] {
        let whole = bytes(text);
        for at in 0..whole.len() {
            let mut damaged = whole.clone();
            damaged[at] = damaged[at].wrapping_mul(37).wrapping_add(11);
            for stream in [&damaged[..], &whole[..at]] {
                match grid(stream).import() {
                    Ok(scene) => assert!(scene.meshes[0].triangles.len() <= 18),
                    Err(error) => assert!(!matches!(error, ImportError::Internal { .. }), "{error}"),
                }
            }
        }
    }
}
