//! Instances, skins and morph targets of hand-made glTF files. Independent truth: the glTF 2.0 specification and
//! EXT_mesh_gpu_instancing, worked out by hand.
#![cfg(feature = "gltf")]

mod gltf_support;

use glam::{Mat4, Quat, Vec3, vec3};
use gltf_support::Doc;
use relight_scene::scene::Scene;
use serde_json::json;

const PRIMITIVE: &str = "/meshes/0/primitives/0";
const ATTRIBUTES: &str = "/meshes/0/primitives/0/attributes";

/// World positions of every instance's vertices, in order.
fn world(scene: &Scene) -> Vec<Vec3> {
    let placed = scene.instances.iter().flat_map(|instance| {
        let mesh = &scene.meshes[instance.mesh as usize];
        (mesh.positions.iter()).map(|p| instance.world_from_mesh.transform_point3(*p))
    });
    placed.collect()
}

fn assert_close(found: &[Vec3], expected: &[Vec3], tolerance: f32) {
    assert_eq!(found.len(), expected.len());
    for (f, e) in found.iter().zip(expected) {
        assert!(f.abs_diff_eq(*e, tolerance), "{found:?}\n{expected:?}");
    }
}

/// Places the triangle under a node that is moved by (10, 0, 0) and scaled by 2.
fn instanced(attributes: serde_json::Value, mut doc: Doc) -> Doc {
    doc.set("/nodes/0/translation", json!([10, 0, 0]));
    doc.set("/nodes/0/scale", json!([2, 2, 2]));
    doc.set(
        "/nodes/0/extensions",
        json!({ "EXT_mesh_gpu_instancing": { "attributes": attributes } }),
    );
    doc.set("/extensionsRequired", json!(["EXT_mesh_gpu_instancing"]));
    doc
}

#[test]
fn instances_are_placed_before_the_nodes_transform() {
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let rotations: [[f32; 4]; 2] = [[0.0, 0.0, half, half], [0.0, 0.0, 0.0, 1.0]];
    let expected = [
        // A quarter turn about z, then (1, 2, 3), then times 2 and 10 along x.
        vec3(12., 4., 6.),
        vec3(12., 6., 6.),
        vec3(10., 4., 6.),
        // Thrice as large.
        vec3(10., 0., 2.),
        vec3(16., 0., 2.),
        vec3(10., 6., 2.),
    ];
    // Floats, normalised bytes and normalised shorts, and bytes without `normalized`: a rotation has any length.
    for (component, normalized) in [(5126, false), (5120, true), (5122, true), (5120, false)] {
        let mut doc = Doc::triangle();
        let translation = doc.floats(&[1., 2., 3., 0., 0., 1.], "VEC3");
        let scale = doc.floats(&[1., 1., 1., 3., 3., 3.], "VEC3");
        let bytes: Vec<u8> = (rotations.iter().flatten())
            .flat_map(|x| match component {
                5126 => x.to_le_bytes().to_vec(),
                5120 => ((x * 127.0).round() as i8).to_le_bytes().to_vec(),
                _ => ((x * 32767.0).round() as i16).to_le_bytes().to_vec(),
            })
            .collect();
        let rotation = doc.accessor(&bytes, component, 2, "VEC4");
        doc.json["accessors"][rotation]["normalized"] = normalized.into();
        let ids = doc.floats(&[7., 8.], "SCALAR");
        let attributes =
            json!({ "TRANSLATION": translation, "ROTATION": rotation, "SCALE": scale, "_ID": ids });
        let scene = instanced(attributes, doc).scene();
        assert_eq!(scene.meshes.len(), 1);
        assert_close(&world(&scene), &expected, 1e-4);
    }
}

#[test]
fn instances_need_no_more_than_one_attribute_and_agree_in_number() {
    let mut doc = Doc::triangle();
    let scale = doc.floats(&[1., 1., 1., 0., 0., 0., 2., 2., 2.], "VEC3");
    let scene = instanced(json!({ "SCALE": scale }), doc.clone()).scene();
    // The second is scaled to nothing.
    assert_eq!(scene.instances.len(), 2);
    assert_close(&world(&scene)[4..5], &[vec3(14., 0., 0.)], 1e-6);

    let translation = doc.floats(&[0.; 6], "VEC3");
    let attributes = json!({ "TRANSLATION": translation, "SCALE": scale });
    let error = instanced(attributes, doc.clone())
        .import()
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("EXT_mesh_gpu_instancing.attributes.SCALE: has 3 elements"),
        "{error}"
    );
    let error = instanced(json!({ "ROTATION": scale }), doc)
        .import()
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("attributes.ROTATION: uses accessors[1], which has no 4"),
        "{error}"
    );
}

/// The triangle, skinned by two joints: node 1 at (0, 5, 0) and node 2 at (0, 0, 7), turned by 90° about z.
fn skinned(joints: &[u8], weights: &[f32]) -> Doc {
    let mut doc = Doc::triangle();
    let joints = doc.accessor(joints, 5121, 3, "VEC4");
    let weights = doc.floats(weights, "VEC4");
    doc.json["meshes"][0]["primitives"][0]["attributes"]["JOINTS_0"] = joints.into();
    doc.json["meshes"][0]["primitives"][0]["attributes"]["WEIGHTS_0"] = weights.into();
    let half = std::f32::consts::FRAC_1_SQRT_2;
    doc.set(
        "/nodes",
        json!([
            { "mesh": 0, "skin": 0, "translation": [100, 100, 100], "scale": [9, 9, 9] },
            { "translation": [0, 5, 0] },
            { "translation": [0, 0, 7], "rotation": [0, 0, half, half] },
        ]),
    );
    doc.set("/scenes/0/nodes", json!([0, 1, 2]));
    doc.set("/skins", json!([{ "joints": [1, 2] }]));
    doc
}

#[test]
fn skinned_vertices_are_where_their_joints_take_them_and_not_their_node() {
    let joints = [0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0];
    // The third vertex half by each, with weights that sum to 2.
    let weights = [1., 0., 0., 0., 1., 0., 0., 0., 1., 1., 0., 0.];
    let doc = skinned(&joints, &weights);
    let scene = doc.scene();
    let second = (vec3(0., 6., 0.) + vec3(-1., 0., 7.)) / 2.0;
    assert_close(
        &world(&scene),
        &[vec3(0., 5., 0.), vec3(0., 1., 7.), second],
        1e-6,
    );

    // Inverse bind matrices that undo the joints leave the mesh as it is, however far off the joints are.
    let mut bound = doc.clone();
    let turned = Mat4::from_rotation_translation(
        Quat::from_rotation_z(std::f32::consts::FRAC_PI_2),
        vec3(0., 0., 7.),
    );
    let binds = [
        Mat4::from_translation(vec3(0., 5., 0.)).inverse(),
        turned.inverse(),
    ];
    let bytes: Vec<u8> = (binds.iter().flat_map(|m| m.to_cols_array()))
        .flat_map(f32::to_le_bytes)
        .collect();
    let accessor = bound.accessor(&bytes, 5126, 2, "MAT4");
    bound.set("/skins/0/inverseBindMatrices", accessor.into());
    assert_close(&world(&bound.scene()), &[Vec3::ZERO, Vec3::X, Vec3::Y], 1e-6);
}

#[test]
fn normals_of_skins_turn_with_them_and_a_second_set_of_joints_counts() {
    let mut doc = skinned(&[1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0], &[0.0; 12]);
    let normals = doc.floats(&[1., 0., 0., 1., 0., 0., 1., 0., 0.], "VEC3");
    let joints = doc.accessor(
        &[0, 0, 1, 0]
            .repeat(3)
            .iter()
            .flat_map(|j: &u8| [*j, 0])
            .collect::<Vec<_>>(),
        5123,
        3,
        "VEC4",
    );
    let weights = doc.accessor(&[0, 0, 255, 0].repeat(3), 5121, 3, "VEC4");
    doc.json["accessors"][weights]["normalized"] = true.into();
    for (key, value) in [("NORMAL", normals), ("JOINTS_1", joints), ("WEIGHTS_1", weights)] {
        doc.set(&format!("{ATTRIBUTES}/{key}"), value.into());
    }
    let scene = doc.scene();
    assert_close(
        &world(&scene),
        &[vec3(0., 0., 7.), vec3(0., 1., 7.), vec3(-1., 0., 7.)],
        1e-6,
    );
    assert_close(&scene.meshes[0].normals, &[Vec3::Y; 3], 1e-6);
}

#[test]
fn broken_skins_are_told_by_place_unless_nothing_uses_them() {
    let weights = [1., 0., 0., 0., 1., 0., 0., 0., 1., 0., 0., 0.];
    let error = skinned(&[2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0], &weights).import();
    let error = error.unwrap_err().to_string();
    assert!(
        error.contains("meshes[0].primitives[0].attributes: names joint 2 at vertex 0"),
        "{error}"
    );
    let mut doc = skinned(&[0; 12], &weights);
    doc.set("/skins/0/joints", json!([77]));
    let error = doc.import().unwrap_err().to_string();
    assert!(error.contains("skins[0].joints"), "{error}");
    doc.json["nodes"][0].as_object_mut().unwrap().remove("skin");
    assert_eq!(
        doc.scene().instances[0].world_from_mesh.translation,
        glam::Vec3A::splat(100.0)
    );
}

#[test]
fn morph_targets_count_by_the_nodes_weights_else_the_meshs() {
    let mut doc = Doc::triangle();
    let lift = doc.floats(&[0., 0., 1.].repeat(3), "VEC3");
    let normals = doc.floats(&[0., 0., 1.].repeat(3), "VEC3");
    let tilt = doc.floats(&[1., 0., 0.].repeat(3), "VEC3");
    let uvs = doc.floats(&[0.; 6], "VEC2");
    let shift = doc.floats(&[0.25, 0.5].repeat(3), "VEC2");
    // Of the second target's positions only vertex 1 is stored: sparse over nothing.
    let (at, to) = (
        doc.view(&[1]),
        doc.view(&[4f32, 0., 0.].map(f32::to_le_bytes).concat()),
    );
    let sparse = doc.push(
        "/accessors",
        json!({ "componentType": 5126, "count": 3, "type": "VEC3", "sparse": {
            "count": 1, "indices": { "bufferView": at, "componentType": 5121 }, "values": { "bufferView": to } } }),
    );
    doc.set(
        ATTRIBUTES,
        json!({ "POSITION": 0, "NORMAL": normals, "TEXCOORD_0": uvs }),
    );
    doc.set(
        &format!("{PRIMITIVE}/targets"),
        json!([{ "POSITION": lift, "NORMAL": tilt, "TEXCOORD_0": shift }, { "POSITION": sparse }]),
    );
    doc.set("/meshes/0/weights", json!([1, 0.5]));
    doc.push("/nodes", json!({ "mesh": 0, "weights": [0, 0] }));
    doc.push("/nodes", json!({ "mesh": 0, "weights": [-2, 0] }));
    doc.set("/scenes/0/nodes", json!([0, 1, 2]));
    let scene = doc.scene();
    let shown = world(&scene);
    assert_close(
        &shown[..3],
        &[vec3(0., 0., 1.), vec3(3., 0., 1.), vec3(0., 1., 1.)],
        1e-6,
    );
    assert_close(&shown[3..6], &[Vec3::ZERO, Vec3::X, Vec3::Y], 0.0);
    assert_close(
        &shown[6..],
        &[vec3(0., 0., -2.), vec3(1., 0., -2.), vec3(0., 1., -2.)],
        1e-6,
    );
    let tilted = vec3(1.0, 0.0, 1.0).normalize();
    assert_close(&scene.meshes[0].normals, &[tilted; 3], 1e-6);
    assert_eq!(scene.meshes[0].uvs[0], [glam::vec2(0.25, 0.5); 3]);
}
