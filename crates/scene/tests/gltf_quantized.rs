//! KHR_mesh_quantization in hand-made files. Independent truth: the same scene in floats, whose values the extension's
//! rules give (an integer stands for itself, a normalised one for max(c / most, −1)), and the transforms worked out by hand.
#![cfg(feature = "gltf")]

mod gltf_support;

use glam::{Vec2, Vec3, vec3};
use gltf_support::Doc;
use relight_scene::scene::Scene;
use serde_json::json;

const PRIMITIVE: &str = "/meshes/0/primitives/0";
const ATTRIBUTES: &str = "/meshes/0/primitives/0/attributes";

/// A component type: its number in glTF, its bytes, the lowest integer and the greatest.
type Kind = (u32, usize, i32, i32);
const I8: Kind = (5120, 1, -128, 127);
const U8: Kind = (5121, 1, 0, 255);
const I16: Kind = (5122, 2, -32768, 32767);
const U16: Kind = (5123, 2, 0, 65535);

/// Every type that the extension adds for positions and coordinates, normalised and plain.
const ALL: [(Kind, bool); 8] = [
    (I8, false),
    (I8, true),
    (U8, false),
    (U8, true),
    (I16, false),
    (I16, true),
    (U16, false),
    (U16, true),
];

/// Appends integers as the extension lays them out: elements on multiples of four bytes.
fn integers(doc: &mut Doc, values: &[i32], width: usize, kind: Kind, normalized: bool) -> usize {
    let (component, size, low, high) = kind;
    let mut bytes = Vec::new();
    for element in values.chunks(width) {
        for x in element {
            assert!((low..=high).contains(x));
            bytes.extend(&x.to_le_bytes()[..size]);
        }
        bytes.resize(bytes.len().next_multiple_of(4), 0);
    }
    let count = values.len() / width;
    let accessor = doc.accessor(&bytes, component, count, &format!("VEC{width}"));
    let view = doc.json["accessors"][accessor]["bufferView"].as_u64().unwrap();
    doc.json["bufferViews"][view as usize]["byteStride"] = (bytes.len() / count).into();
    doc.json["accessors"][accessor]["normalized"] = normalized.into();
    accessor
}

/// What an integer stands for.
fn meant(x: i32, kind: Kind, normalized: bool) -> f32 {
    match normalized {
        true => (x as f32 / kind.3 as f32).max(-1.0),
        false => x as f32,
    }
}

fn quantized() -> Doc {
    let mut doc = Doc::triangle();
    doc.set("/extensionsUsed", json!(["KHR_mesh_quantization"]));
    doc.set("/extensionsRequired", json!(["KHR_mesh_quantization"]));
    doc
}

fn world(scene: &Scene) -> Vec<Vec3> {
    let placed = scene.instances.iter().flat_map(|instance| {
        let mesh = &scene.meshes[instance.mesh as usize];
        (mesh.positions.iter()).map(|p| instance.world_from_mesh.transform_point3(*p))
    });
    placed.collect()
}

fn assert_close(found: &[Vec3], expected: &[Vec3], what: &str) {
    assert_eq!(found.len(), expected.len(), "{what}");
    let size = expected.iter().fold(1.0, |most: f32, p| most.max(p.length()));
    for (f, e) in found.iter().zip(expected) {
        assert!(f.abs_diff_eq(*e, 1e-5 * size), "{what}: {found:?}\n{expected:?}");
    }
}

/// Nine integers of a triangle that reaches both ends of the type.
fn corners(kind: Kind) -> [i32; 9] {
    let (_, _, low, high) = kind;
    [low, low, 3, high, low, 3, low, high, 50]
}

fn positions_of(kind: Kind, normalized: bool) -> Vec<Vec3> {
    let meant = corners(kind).map(|x| meant(x, kind, normalized));
    meant.chunks(3).map(Vec3::from_slice).collect()
}

#[test]
fn positions_and_coordinates_are_of_every_integer_type() {
    for (kind, normalized) in ALL {
        let what = format!("{kind:?} {normalized}");
        let mut doc = quantized();
        let positions = integers(&mut doc, &corners(kind), 3, kind, normalized);
        let (_, _, low, high) = kind;
        let uvs = integers(&mut doc, &[low, high, 7, 9, high, 0], 2, kind, normalized);
        doc.set(
            ATTRIBUTES,
            json!({ "POSITION": positions, "TEXCOORD_0": uvs, "TEXCOORD_1": uvs }),
        );
        // The transform that an encoder puts before a mesh.
        doc.set("/nodes/0/scale", json!([2, 2, 2]));
        doc.set("/nodes/0/translation", json!([1, 0, 0]));
        let scene = doc.scene();
        let expected: Vec<Vec3> = positions_of(kind, normalized)
            .iter()
            .map(|p| 2.0 * *p + Vec3::X)
            .collect();
        assert_close(&world(&scene), &expected, &what);
        let uvs = [(low, high), (7, 9), (high, 0)]
            .map(|(u, v)| Vec2::new(meant(u, kind, normalized), meant(v, kind, normalized)));
        assert_eq!(scene.meshes[0].uvs, [uvs, uvs], "{what}");
    }
}

#[test]
fn normals_and_tangents_are_of_both_signed_types() {
    for kind in [I8, I16] {
        let mut doc = quantized();
        let high = kind.3;
        // Unit length only up to rounding, and once at the lowest integer, which is −1 as well.
        let (leg, low) = ((0.6 * high as f32) as i32, kind.2);
        let normals = integers(&mut doc, &[0, 0, high, 0, leg, leg, 0, 0, low], 3, kind, true);
        let tangents = integers(
            &mut doc,
            &[high, 0, 0, high, high, 0, 0, -high, leg, leg, 0, low],
            4,
            kind,
            true,
        );
        doc.set(
            ATTRIBUTES,
            json!({ "POSITION": 0, "NORMAL": normals, "TANGENT": tangents }),
        );
        let mesh = &doc.scene().meshes[0];
        let half = std::f32::consts::FRAC_1_SQRT_2;
        assert_close(
            &mesh.normals,
            &[Vec3::Z, vec3(0.0, half, half), -Vec3::Z],
            "normals",
        );
        let found: Vec<Vec3> = mesh.tangents.iter().map(|t| t.truncate()).collect();
        assert_close(&found, &[Vec3::X, Vec3::X, vec3(half, half, 0.0)], "tangents");
        let signs: Vec<f32> = mesh.tangents.iter().map(|t| t.w).collect();
        assert_eq!(signs, [1.0, -1.0, -1.0]);
    }
}

/// An encoder puts what undoes the integers' scale into the inverse bind matrices, and the node has no part.
#[test]
fn skinned_meshes_are_of_every_integer_type() {
    for (kind, normalized) in ALL {
        let mut doc = quantized();
        let positions = integers(&mut doc, &corners(kind), 3, kind, normalized);
        let joints = doc.accessor(&[0; 12], 5121, 3, "VEC4");
        let weights = doc.floats(&[1., 0., 0., 0.].repeat(3), "VEC4");
        doc.set(
            ATTRIBUTES,
            json!({ "POSITION": positions, "JOINTS_0": joints, "WEIGHTS_0": weights }),
        );
        let scale = glam::Mat4::from_scale_rotation_translation(
            Vec3::splat(0.5),
            glam::Quat::IDENTITY,
            vec3(0.0, 0.0, 4.0),
        );
        let bind = doc.floats(&scale.to_cols_array(), "MAT4");
        doc.json["accessors"][bind]["count"] = 1.into();
        doc.set(
            "/nodes",
            json!([{ "mesh": 0, "skin": 0, "scale": [9, 9, 9] }, { "translation": [0, 5, 0] }]),
        );
        doc.set("/scenes/0/nodes", json!([0, 1]));
        doc.set("/skins", json!([{ "joints": [1], "inverseBindMatrices": bind }]));
        let expected: Vec<Vec3> = positions_of(kind, normalized)
            .iter()
            .map(|p| 0.5 * *p + vec3(0.0, 5.0, 4.0))
            .collect();
        assert_close(&world(&doc.scene()), &expected, &format!("{kind:?} {normalized}"));
    }
}

#[test]
fn displacements_of_morph_targets_are_of_the_signed_types() {
    for (kind, normalized) in [(I8, false), (I8, true), (I16, false), (I16, true)] {
        let what = format!("{kind:?} {normalized}");
        let mut doc = quantized();
        let high = kind.3;
        let positions = integers(&mut doc, &corners(kind), 3, kind, normalized);
        let normals = integers(&mut doc, &[0, 0, high].repeat(3), 3, kind, true);
        let lift = integers(&mut doc, &[-5, 0, high, 0, 0, 0, 0, 7, 0], 3, kind, normalized);
        let tilt = integers(&mut doc, &[high, 0, 0].repeat(3), 3, kind, true);
        doc.set(ATTRIBUTES, json!({ "POSITION": positions, "NORMAL": normals }));
        doc.set(
            &format!("{PRIMITIVE}/targets"),
            json!([{ "POSITION": lift, "NORMAL": tilt }]),
        );
        doc.set("/meshes/0/weights", json!([0.5]));
        let scene = doc.scene();
        let one = |x: i32| meant(x, kind, normalized);
        let lifts = [vec3(one(-5), 0.0, one(high)), Vec3::ZERO, vec3(0.0, one(7), 0.0)];
        let expected: Vec<Vec3> = (positions_of(kind, normalized).iter().zip(lifts))
            .map(|(p, lift)| *p + 0.5 * lift)
            .collect();
        assert_close(&world(&scene), &expected, &what);
        let tilted = vec3(0.5, 0.0, 1.0).normalize();
        assert_close(&scene.meshes[0].normals, &[tilted; 3], &what);
    }
}

#[test]
fn instances_place_quantised_meshes() {
    for (kind, normalized) in ALL {
        let mut doc = quantized();
        let positions = integers(&mut doc, &corners(kind), 3, kind, normalized);
        doc.set(ATTRIBUTES, json!({ "POSITION": positions }));
        let translation = doc.floats(&[1., 2., 3., 0., 0., 1.], "VEC3");
        doc.set("/nodes/0/scale", json!([3, 3, 3]));
        doc.set(
            "/nodes/0/extensions",
            json!({ "EXT_mesh_gpu_instancing": { "attributes": { "TRANSLATION": translation } } }),
        );
        let expected: Vec<Vec3> = [vec3(1., 2., 3.), Vec3::Z]
            .iter()
            .flat_map(|t| {
                positions_of(kind, normalized)
                    .into_iter()
                    .map(move |p| 3.0 * (p + t))
            })
            .collect();
        assert_close(&world(&doc.scene()), &expected, &format!("{kind:?} {normalized}"));
    }
}

/// What neither glTF nor the extension allows for an attribute has no meaning.
#[test]
fn other_types_are_refused_by_place() {
    for (key, kind, width) in [("NORMAL", U8, 3), ("TANGENT", U16, 4), ("TEXCOORD_0", I8, 3)] {
        let mut doc = quantized();
        let accessor = integers(&mut doc, &vec![1; 3 * width], width, kind, true);
        doc.set(&format!("{ATTRIBUTES}/{key}"), accessor.into());
        let error = doc.import().unwrap_err().to_string();
        let place = format!(
            "meshes[0].primitives[0].attributes.{key}: uses accessors[{accessor}], which has the wrong"
        );
        assert!(error.contains(&place), "{error}");
    }
}
