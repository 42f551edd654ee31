//! Geometry, placement and materials of hand-made glTF files. Independent truth: the glTF 2.0 specification,
//! worked out by hand.
#![cfg(feature = "gltf")]

mod gltf_support;

use std::f32::consts::FRAC_1_SQRT_2 as SQRT_HALF;

use base64::Engine;
use glam::{Vec2, Vec3, Vec4, vec2, vec3};
use gltf_support::{Doc, PNG, import_bytes};
use relight_scene::gltf::{ImportError, ImportOptions, import};
use relight_scene::light::LightKind;
use relight_scene::material::{AlphaMode, Material, Wrap};
use serde_json::json;

const ATTRIBUTES: &str = "/meshes/0/primitives/0/attributes";
const PRIMITIVE: &str = "/meshes/0/primitives/0";

fn has_note(scene: &relight_scene::scene::Scene, part: &str) -> bool {
    scene.notes.iter().any(|note| note.contains(part))
}

#[test]
fn all_containers_hold_the_same_scene() {
    let doc = Doc::triangle();
    let glb = doc.scene();
    assert_eq!(glb.meshes[0].positions, [Vec3::ZERO, Vec3::X, Vec3::Y]);
    assert_eq!(glb.meshes[0].triangles, [[0, 1, 2]]);
    assert_eq!(glb.materials, [Material::default()]);
    assert!(glb.notes.is_empty() && glb.meshes[0].normals.is_empty());

    let base64 = base64::engine::general_purpose::STANDARD.encode(&doc.bin);
    let mut data_uri = doc.clone();
    data_uri.json["buffers"][0]["uri"] = format!("data:application/octet-stream;base64,{base64}").into();
    let text = serde_json::to_vec(&data_uri.json).unwrap();
    assert_eq!(import_bytes("scene.gltf", &text).unwrap().meshes, glb.meshes);

    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("a b")).unwrap();
    std::fs::write(folder.path().join("a b/mesh.bin"), &doc.bin).unwrap();
    let mut file_uri = doc.clone();
    file_uri.json["buffers"][0]["uri"] = "./a%20b/mesh.bin".into();
    let path = folder.path().join("scene.gltf");
    std::fs::write(&path, serde_json::to_vec(&file_uri.json).unwrap()).unwrap();
    assert_eq!(
        import(&path, &ImportOptions::default()).unwrap().meshes,
        glb.meshes
    );
}

#[cfg(unix)]
#[test]
fn links_out_of_the_folder_are_refused() {
    let (inside, outside) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    std::fs::write(outside.path().join("secret"), [0; 36]).unwrap();
    std::os::unix::fs::symlink(outside.path().join("secret"), inside.path().join("mesh.bin")).unwrap();
    let mut doc = Doc::triangle();
    doc.json["buffers"][0]["uri"] = "mesh.bin".into();
    let path = inside.path().join("scene.gltf");
    std::fs::write(&path, serde_json::to_vec(&doc.json).unwrap()).unwrap();
    let error = import(&path, &ImportOptions::default()).unwrap_err().to_string();
    assert!(
        error.contains("buffers[0].uri: is a link out of the scene's folder"),
        "{error}"
    );
}

#[test]
fn indices_of_every_width_strips_and_fans_make_the_same_fronts() {
    // A unit square; every way of joining it has its front towards +Z.
    let square = [0., 0., 0., 1., 0., 0., 0., 1., 0., 1., 1., 0.];
    let cases: [(u32, Vec<u8>, usize, u32); 5] = [
        (5121, vec![0, 1, 2, 2, 1, 3], 6, 4),
        (
            5123,
            [0u16, 1, 2, 2, 1, 3]
                .iter()
                .flat_map(|i| i.to_le_bytes())
                .collect(),
            6,
            4,
        ),
        (
            5125,
            [0u32, 1, 2, 2, 1, 3]
                .iter()
                .flat_map(|i| i.to_le_bytes())
                .collect(),
            6,
            4,
        ),
        (5121, vec![0, 1, 2, 3], 4, 5),
        (5121, vec![0, 1, 3, 2], 4, 6),
    ];
    for (component, bytes, count, mode) in cases {
        let mut doc = Doc::triangle();
        let positions = doc.floats(&square, "VEC3");
        let indices = doc.accessor(&bytes, component, count, "SCALAR");
        doc.set(&format!("{ATTRIBUTES}/POSITION"), positions.into());
        doc.set(&format!("{PRIMITIVE}/indices"), indices.into());
        doc.set(&format!("{PRIMITIVE}/mode"), mode.into());
        let scene = doc.scene();
        let mesh = &scene.meshes[0];
        assert_eq!(mesh.triangles.len(), 2);
        let area = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| mesh.positions[v as usize]);
            (b - a).cross(c - a) * 0.5
        };
        assert!(
            mesh.triangles.iter().all(|t| area(t) == vec3(0.0, 0.0, 0.5)),
            "mode {mode}: {:?}",
            mesh.triangles
        );
    }
}

#[test]
fn unindexed_strips_and_fans_follow_the_specification() {
    // Section 3.7.2.1: strip pi = {vi, vi+(1+i%2), vi+(2-i%2)}, fan pi = {vi+1, vi+2, v0}.
    for (mode, expected) in [
        (5, [[0, 1, 2], [1, 3, 2], [2, 3, 4]]),
        (6, [[1, 2, 0], [2, 3, 0], [3, 4, 0]]),
    ] {
        let mut doc = Doc::triangle();
        let positions = doc.floats(
            &[0., 0., 0., 1., 0., 0., 2., 1., 0., 1., 2., 0., 0., 2., 0.],
            "VEC3",
        );
        doc.set(&format!("{ATTRIBUTES}/POSITION"), positions.into());
        doc.set(&format!("{PRIMITIVE}/mode"), mode.into());
        assert_eq!(doc.scene().meshes[0].triangles, expected);
    }
}

#[test]
fn points_and_lines_are_skipped_with_a_note() {
    let mut doc = Doc::triangle();
    doc.push(
        "/meshes/0/primitives",
        json!({ "attributes": { "POSITION": 0 }, "mode": 0 }),
    );
    doc.push(
        "/meshes/0/primitives",
        json!({ "attributes": { "POSITION": 0 }, "mode": 3 }),
    );
    let scene = doc.scene();
    assert_eq!(scene.meshes.len(), 1);
    assert!(has_note(
        &scene,
        "points or lines left out, since only triangles are surfaces: 2"
    ));
}

#[test]
fn sparse_accessors_replace_elements() {
    for with_base in [true, false] {
        let mut doc = Doc::triangle();
        let indices = doc.view(&[1, 2]);
        let values: Vec<u8> = [5f32, 6., 7., 8., 9., 10.]
            .iter()
            .flat_map(|x| x.to_le_bytes())
            .collect();
        let values = doc.view(&values);
        doc.json["accessors"][0]["sparse"] = json!({
            "count": 2, "indices": { "bufferView": indices, "componentType": 5121 },
            "values": { "bufferView": values },
        });
        if !with_base {
            doc.json["accessors"][0]
                .as_object_mut()
                .unwrap()
                .remove("bufferView");
        }
        let positions = &doc.scene().meshes[0].positions;
        assert_eq!(positions[..], [Vec3::ZERO, vec3(5., 6., 7.), vec3(8., 9., 10.)]);
    }
}

#[test]
fn interleaved_attributes_are_read_with_their_stride() {
    let mut doc = Doc::triangle();
    let vertices: Vec<u8> = (0..3)
        .flat_map(|v| [v as f32, (v * v) as f32, 0.0, 0.0, 0.0, 2.0])
        .flat_map(|x: f32| x.to_le_bytes())
        .collect();
    let view = doc.view(&vertices);
    doc.json["bufferViews"][view]["byteStride"] = 24.into();
    for (name, offset) in [("POSITION", 0), ("NORMAL", 12)] {
        let accessor = json!({
            "bufferView": view, "byteOffset": offset, "componentType": 5126, "count": 3, "type": "VEC3"
        });
        let accessor = doc.push("/accessors", accessor);
        doc.set(&format!("{ATTRIBUTES}/{name}"), accessor.into());
    }
    let mesh = &doc.scene().meshes[0];
    assert_eq!(mesh.positions, [Vec3::ZERO, vec3(1., 1., 0.), vec3(2., 4., 0.)]);
    assert_eq!(mesh.normals, [Vec3::Z; 3], "unit length, though stored with 2");
}

#[test]
fn vertex_colours_of_all_kinds_are_linear_rgba() {
    let f = |values: &[f32]| values.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>();
    let u = |values: &[u16]| values.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>();
    let (rgb8, rgba8) = ([255, 0, 51, 0].repeat(3), [255, 0, 51, 128].repeat(3));
    let cases = [
        (5126, "VEC3", f(&[1.0, 0.0, 0.2].repeat(3)), 1.0, 0),
        (5126, "VEC4", f(&[1.0, 0.0, 0.2, 0.5].repeat(3)), 0.5, 0),
        (5121, "VEC3", rgb8, 1.0, 4),
        (5121, "VEC4", rgba8, 128.0 / 255.0, 0),
        (5123, "VEC3", u(&[65535, 0, 13107, 0].repeat(3)), 1.0, 8),
        (
            5123,
            "VEC4",
            u(&[65535, 0, 13107, 32768].repeat(3)),
            32768.0 / 65535.0,
            0,
        ),
    ];
    for (component, kind, bytes, alpha, stride) in cases {
        let mut doc = Doc::triangle();
        let colors = doc.accessor(&bytes, component, 3, kind);
        doc.json["accessors"][colors]["normalized"] = (component != 5126).into();
        if stride > 0 {
            doc.json["bufferViews"][colors]["byteStride"] = stride.into();
        }
        doc.set(&format!("{ATTRIBUTES}/COLOR_0"), colors.into());
        let colors = doc.scene().meshes[0].colors.clone();
        assert_eq!(colors.len(), 3);
        // 0.2 = 51/255 = 13107/65535 up to rounding.
        let expected = Vec4::new(1.0, 0.0, 0.2, alpha);
        assert!(
            colors.iter().all(|c| (*c - expected).abs().max_element() < 1e-7),
            "{component} {kind} {colors:?}"
        );
    }
}

#[test]
fn several_sets_of_coordinates_and_texture_transforms() {
    let mut doc = Doc::triangle();
    let uv0 = doc.floats(&[0., 0., 1., 0., 0., 1.], "VEC2");
    let uv1 = doc.accessor(&[0, 255, 0, 0, 51, 0, 0, 0, 255, 255, 0, 0], 5121, 3, "VEC2");
    doc.json["accessors"][uv1]["normalized"] = true.into();
    doc.json["bufferViews"][uv1]["byteStride"] = 4.into();
    doc.set(&format!("{ATTRIBUTES}/TEXCOORD_0"), uv0.into());
    doc.set(&format!("{ATTRIBUTES}/TEXCOORD_1"), uv1.into());
    doc.set(&format!("{PRIMITIVE}/material"), 0.into());
    let image = doc.view(PNG);
    doc.set(
        "/images",
        json!([{ "bufferView": image, "mimeType": "image/png", "name": "tiles" }]),
    );
    doc.set("/textures", json!([{ "source": 0 }]));
    let transform = json!({ "KHR_texture_transform": {
        "offset": [0.5, 0.25], "rotation": std::f32::consts::FRAC_PI_2, "scale": [2.0, 3.0], "texCoord": 1,
    }});
    doc.set(
        "/materials",
        json!([{
            "pbrMetallicRoughness": {
                "baseColorTexture": { "index": 0 }, "metallicRoughnessTexture": { "index": 0, "texCoord": 1 }
            },
            "normalTexture": { "index": 0, "scale": 0.5, "texCoord": 0, "extensions": transform },
            "emissiveTexture": { "index": 0 }, "emissiveFactor": [1, 1, 1],
            "extensions": { "KHR_materials_transmission":
                { "transmissionFactor": 0.5, "transmissionTexture": { "index": 0, "texCoord": 1 } } },
        }]),
    );
    doc.set("/extensionsRequired", json!(["KHR_texture_transform"]));
    let scene = doc.scene();
    let mesh = &scene.meshes[0];
    assert_eq!(mesh.uvs[0], [Vec2::ZERO, Vec2::X, Vec2::Y]);
    assert_eq!(mesh.uvs[1], [vec2(0.0, 1.0), vec2(51.0 / 255.0, 0.0), Vec2::ONE]);
    let m = &scene.materials[0];
    assert_eq!(m.base_color_texture.unwrap().uv_set, 0);
    assert_eq!(m.metallic_roughness_texture.unwrap().uv_set, 1);
    let passing = m.extensions.as_ref().unwrap().transmission_texture.unwrap();
    assert_eq!((passing.texture, passing.uv_set), (0, 1));
    let normal = m.normal_texture.unwrap();
    assert_eq!(
        (normal.uv_set, m.normal_scale),
        (1, 0.5),
        "the transform's texCoord wins"
    );
    // Scale, then rotate counter-clockwise as seen with v downwards, then shift: (1, 0) -> (2, 0) -> (0, -2)
    // -> (0.5, -1.75), and (0, 1) -> (0, 3) -> (3, 0) -> (3.5, 0.25).
    for (uv, expected) in [(Vec2::X, vec2(0.5, -1.75)), (Vec2::Y, vec2(3.5, 0.25))] {
        let mapped = normal.texture_from_mesh.transform_point2(uv);
        assert!((mapped - expected).abs().max_element() < 1e-6, "{mapped}");
    }
    // One image with one sampler is one texture, however often it is used.
    assert_eq!(scene.textures.len(), 1);
    assert_eq!(
        (scene.textures[0].name.as_str(), &scene.textures[0].encoded[..]),
        ("tiles", PNG)
    );
}

#[test]
fn samplers_and_missing_coordinates() {
    let mut doc = Doc::triangle();
    let uri = format!(
        "data:image/jpeg;base64,{}",
        base64::engine::general_purpose::STANDARD.encode(b"\xff\xd8\xff\xe0")
    );
    doc.set("/images", json!([{ "uri": uri }]));
    doc.set(
        "/samplers",
        json!([{ "wrapS": 33071, "wrapT": 33648, "magFilter": 9728, "minFilter": 9987 }, {}]),
    );
    doc.set(
        "/textures",
        json!([{ "source": 0, "sampler": 0 }, { "source": 0, "sampler": 1 }, { "source": 0 }]),
    );
    let material = json!({
        "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } },
        "normalTexture": { "index": 1 }, "emissiveTexture": { "index": 2 },
    });
    doc.set("/materials", json!([material]));
    doc.set(&format!("{PRIMITIVE}/material"), 0.into());
    let scene = doc.scene();
    let samplers: Vec<_> = scene.textures.iter().map(|t| (t.wrap, t.nearest)).collect();
    assert_eq!(
        samplers,
        [
            ([Wrap::Clamp, Wrap::Mirror], true),
            ([Wrap::Repeat, Wrap::Repeat], false)
        ]
    );
    assert_eq!(scene.meshes[0].uvs, [[Vec2::ZERO; 3]]);
    assert!(has_note(&scene, "without the texture coordinates they need"));
}

#[test]
fn nodes_share_meshes_multiply_transforms_and_may_mirror() {
    let mut doc = Doc::triangle();
    doc.set(
        "/nodes",
        json!([
            { "children": [1, 2], "translation": [10, 0, 0], "scale": [2, 2, 2] },
            { "mesh": 0, "translation": [0, 1, 0], "rotation": [0, 0, SQRT_HALF, SQRT_HALF] },
            { "mesh": 0, "matrix": [-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 3, 0, 0, 1] },
        ]),
    );
    let scene = doc.scene();
    assert_eq!((scene.meshes.len(), scene.instances.len()), (1, 2));
    let world = |i: usize, p: Vec3| scene.instances[i].world_from_mesh.transform_point3(p);
    // x -> turned to y -> moved up by 1 -> doubled -> moved by 10.
    assert!((world(0, Vec3::X) - vec3(10.0, 4.0, 0.0)).abs().max_element() < 1e-5);
    assert!((world(1, Vec3::X) - vec3(14.0, 0.0, 0.0)).abs().max_element() < 1e-5);
    assert!(scene.instances[1].world_from_mesh.matrix3.determinant() < 0.0);
}

#[test]
fn equal_primitives_of_different_meshes_are_one_mesh() {
    let mut doc = Doc::triangle();
    doc.push(
        "/meshes",
        json!({ "primitives": [{ "attributes": { "POSITION": 0 } }] }),
    );
    doc.push("/nodes", json!({ "mesh": 1 }));
    doc.set("/scenes/0/nodes", json!([0, 1]));
    let scene = doc.scene();
    assert_eq!((scene.meshes.len(), scene.instances.len()), (1, 2));
}

#[test]
fn scales_of_zero_flatten_or_hide() {
    let mut doc = Doc::triangle();
    doc.set("/nodes/0/scale", json!([1, 1, 0]));
    doc.set("/nodes/0/translation", json!([0, 0, 4]));
    doc.push("/nodes", json!({ "mesh": 0, "scale": [0, 0, 0] }));
    doc.push("/nodes", json!({ "mesh": 0, "scale": [1e-6, 1e-6, 1e-6] }));
    doc.set("/scenes/0/nodes", json!([0, 1, 2]));
    let scene = doc.scene();
    assert_eq!(scene.instances.len(), 2);
    let flat = &scene.meshes[scene.instances[0].mesh as usize];
    assert_eq!(
        flat.positions,
        [vec3(0., 0., 4.), vec3(1., 0., 4.), vec3(0., 1., 4.)]
    );
    assert!(
        scene.instances[1].world_from_mesh.matrix3.determinant() > 0.0,
        "small is not flat"
    );
    assert!(has_note(&scene, "scaled to nothing left out: 1"));
}

#[test]
fn the_default_scene_is_shown() {
    let mut doc = Doc::triangle();
    doc.push("/nodes", json!({ "mesh": 0 }));
    doc.set("/scenes", json!([{ "nodes": [0] }, { "nodes": [1, 0] }]))
        .set("/scene", 1.into());
    let scene = doc.scene();
    assert_eq!(scene.instances.len(), 2);
    assert!(has_note(&scene, "scenes[1] is imported; the file has 2 scenes"));
    // Without any scene, all roots are.
    let mut doc = Doc::triangle();
    doc.json.as_object_mut().unwrap().remove("scenes");
    doc.json.as_object_mut().unwrap().remove("scene");
    assert_eq!(doc.scene().instances.len(), 1);
}

#[test]
fn materials_have_the_values_of_the_file() {
    let mut doc = Doc::triangle();
    doc.set(
        "/materials",
        json!([
            { "name": "Neon", "emissiveFactor": [1.0, 0.5, 0.25], "doubleSided": true,
              "pbrMetallicRoughness": { "baseColorFactor": [0.1, 0.2, 0.3, 0.4], "metallicFactor": 0.25, "roughnessFactor": 0.75 },
              "extensions": { "KHR_materials_emissive_strength": { "emissiveStrength": 8 } } },
            { "alphaMode": "MASK", "alphaCutoff": 0.25 }, { "alphaMode": "MASK" }, { "alphaMode": "BLEND" },
            { "extensions": { "KHR_materials_unlit": {} } },
            { "pbrMetallicRoughness": { "baseColorFactor": [2, 0, 0, 1] } },
            { "extensions": { "KHR_materials_transmission": { "transmissionFactor": 0.9 } } },
            { "alphaMode": "BLEND", "extensions": { "KHR_materials_transmission": { "transmissionFactor": 1 },
              "KHR_materials_volume": { "thicknessFactor": 4, "attenuationDistance": 1, "attenuationColor": [1, 0.5, 0.25] } } },
            { "extensions": { "KHR_materials_transmission": {} } },
        ]),
    );
    doc.set(&format!("{PRIMITIVE}/material"), 0.into());
    let required = json!([
        "KHR_materials_unlit",
        "KHR_materials_emissive_strength",
        "KHR_materials_transmission"
    ]);
    doc.set("/extensionsRequired", required);
    let scene = doc.scene();
    let neon = Material {
        name: "Neon".into(),
        base_color: Vec4::new(0.1, 0.2, 0.3, 0.4),
        metallic: 0.25,
        roughness: 0.75,
        emission: vec3(8.0, 4.0, 2.0),
        double_sided: true,
        ..Material::default()
    };
    assert_eq!(scene.materials[0], neon);
    let alpha: Vec<AlphaMode> = scene.materials[1..4].iter().map(|m| m.alpha_mode).collect();
    assert_eq!(
        alpha,
        [
            AlphaMode::Mask { cutoff: 0.25 },
            AlphaMode::Mask { cutoff: 0.5 },
            AlphaMode::Blend
        ]
    );
    assert!(scene.materials[4].unlit && !scene.materials[0].unlit);
    assert_eq!(scene.materials[5].base_color, Vec4::new(1.0, 0.0, 0.0, 1.0));
    assert!(has_note(&scene, "base colour factors out of range, clamped: 1"));
    // Solid glass: after a metre 0.5 and 0.25 are left.
    let panes = [6, 7, 8].map(|i| (scene.materials[i].alpha_mode, scene.materials[i].base_color));
    let pane = |transmission| AlphaMode::Pane { transmission };
    assert_eq!(
        panes,
        [
            (pane(0.9), Vec4::ONE),
            (pane(1.0), Vec4::ONE),
            (AlphaMode::Opaque, Vec4::ONE)
        ]
    );
    let e = scene.materials[7].extensions.as_ref().unwrap();
    assert_eq!(e.thickness, 4.0);
    let left = (-e.absorption).exp();
    assert!((left - vec3(1.0, 0.5, 0.25)).abs().max_element() < 1e-6, "{left}");
    let note = "transmitting materials with alpha, which is ignored: 1";
    assert!(has_note(&scene, note), "{:?}", scene.notes);
    let [light] = &scene.sequence.lights[..] else {
        panic!("one light")
    };
    assert!(light.name == "emissive" && matches!(light.kind, LightKind::Emissive { material: None, .. }));
}

#[test]
fn vertices_that_are_not_finite_lose_their_triangles() {
    let mut doc = Doc::triangle();
    let nan = f32::NAN;
    let positions = [
        0.,
        0.,
        0.,
        1.,
        0.,
        0.,
        0.,
        1.,
        0.,
        nan,
        0.,
        0.,
        0.,
        f32::INFINITY,
        0.,
        1.,
        1.,
        1.,
    ];
    let positions = doc.floats(&positions, "VEC3");
    let indices = doc.accessor(&[0, 1, 2, 0, 1, 3, 4, 1, 2, 2, 1, 5], 5121, 12, "SCALAR");
    doc.set(&format!("{ATTRIBUTES}/POSITION"), positions.into());
    doc.set(&format!("{PRIMITIVE}/indices"), indices.into());
    let scene = doc.scene();
    assert_eq!(scene.meshes[0].triangles, [[0, 1, 2], [2, 1, 5]]);
    assert!(scene.meshes[0].positions.iter().all(|p| p.is_finite()));
    assert!(has_note(&scene, "vertices that are not finite dropped: 2"));
}

#[test]
fn normals_without_direction_are_replaced() {
    let mut doc = Doc::triangle();
    let normals = doc.floats(&[0., 0., -3., 0., 0., 0., f32::NAN, 0., 1.], "VEC3");
    doc.set(&format!("{ATTRIBUTES}/NORMAL"), normals.into());
    let scene = doc.scene();
    assert_eq!(scene.meshes[0].normals, [Vec3::NEG_Z, Vec3::Z, Vec3::Z]);
    assert!(has_note(&scene, "normals without a direction"));
    let zero = doc.floats(&[0.0; 9], "VEC3");
    doc.set(&format!("{ATTRIBUTES}/NORMAL"), zero.into());
    assert!(doc.scene().meshes[0].normals.is_empty(), "flat");
}

#[test]
fn triangles_without_area_stay_and_are_counted() {
    let mut doc = Doc::triangle();
    let indices = doc.accessor(&[0, 1, 2, 0, 1, 1], 5121, 6, "SCALAR");
    doc.set(&format!("{PRIMITIVE}/indices"), indices.into());
    let scene = doc.scene();
    assert_eq!(scene.meshes[0].triangles.len(), 2);
    assert!(has_note(&scene, "triangles without area, kept: 1"));
}

#[test]
fn files_without_geometry_say_so() {
    let mut no_mesh = Doc::triangle();
    no_mesh.set("/nodes", json!([{}]));
    let mut not_shown = Doc::triangle();
    not_shown.set("/scenes/0/nodes", json!([]));
    let mut points = Doc::triangle();
    points.set(&format!("{PRIMITIVE}/mode"), 0.into());
    let mut infinite = Doc::triangle();
    let positions = infinite.floats(&[f32::INFINITY; 9], "VEC3");
    infinite.set(&format!("{ATTRIBUTES}/POSITION"), positions.into());
    for doc in [no_mesh, not_shown, points, infinite] {
        let error = doc.import().unwrap_err();
        assert!(matches!(error, ImportError::NoGeometry { .. }), "{error}");
        assert!(
            error
                .to_string()
                .contains("scene.glb: there is no triangle to light"),
            "{error}"
        );
    }
}

#[test]
fn required_extensions_are_named_with_a_way_out() {
    for (name, tool) in [
        ("EXT_texture_avif", "gltf-transform png"),
        ("ACME_unheard_of", "drop it from extensionsRequired"),
    ] {
        let mut doc = Doc::triangle();
        doc.set("/extensionsRequired", json!([name, "KHR_materials_unlit"]));
        let error = doc.import().unwrap_err();
        assert!(
            matches!(error, ImportError::UnsupportedExtensions { .. }),
            "{error}"
        );
        assert!(
            error.to_string().contains(name) && error.to_string().contains(tool),
            "{error}"
        );
    }
    for name in ["dispersion", "diffuse_transmission"] {
        let name = format!("KHR_materials_{name}");
        let mut doc = Doc::triangle();
        doc.set("/extensionsRequired", json!([name]));
        assert!(has_note(&doc.scene(), &name));
    }
}
