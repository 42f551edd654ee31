//! What is committed in `data/` is what the generator writes, and what it writes is sound: every `.glb` is parsed again
//! here, from its bytes, by code that shares nothing with the writer.

use glam::{DMat4, DQuat, DVec3};
use relight_data_generate::File;
use serde_json::Value;
use std::collections::HashMap;
use std::path::Path;
use std::sync::OnceLock;

/// What the generator makes, made once for all tests.
fn files() -> &'static [File] {
    static FILES: OnceLock<Vec<File>> = OnceLock::new();
    FILES.get_or_init(relight_data_generate::files)
}

struct Part {
    node: String,
    positions: Vec<DVec3>,
    normals: Vec<DVec3>,
    triangles: Vec<[usize; 3]>,
    world_from_part: DMat4,
}

struct Parsed {
    json: Value,
    bin: Vec<u8>,
    parts: Vec<Part>,
    cameras: Vec<(String, DMat4)>,
}

fn u32_at(bytes: &[u8], at: usize) -> usize {
    u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize
}

fn list(v: &Value) -> Vec<f64> {
    v.as_array()
        .map_or(vec![], |a| a.iter().map(|x| x.as_f64().unwrap()).collect())
}

/// The values of an accessor as f64, after checking that it lies within its view and that view within the buffer.
fn accessor(json: &Value, bin: &[u8], index: usize) -> (Vec<f64>, usize) {
    let a = &json["accessors"][index];
    let view = &json["bufferViews"][a["bufferView"].as_u64().unwrap() as usize];
    let width = match a["type"].as_str().unwrap() {
        "SCALAR" => 1,
        "VEC2" => 2,
        "VEC3" => 3,
        other => panic!("unexpected type {other}"),
    };
    let (size, read): (usize, fn(&[u8]) -> f64) = match a["componentType"].as_u64().unwrap() {
        5123 => (2, |b| f64::from(u16::from_le_bytes(b.try_into().unwrap()))),
        5125 => (4, |b| f64::from(u32::from_le_bytes(b.try_into().unwrap()))),
        5126 => (4, |b| f64::from(f32::from_le_bytes(b.try_into().unwrap()))),
        other => panic!("unexpected component {other}"),
    };
    let count = a["count"].as_u64().unwrap() as usize;
    let (start, length) = (
        view["byteOffset"].as_u64().unwrap() as usize,
        view["byteLength"].as_u64().unwrap() as usize,
    );
    assert_eq!(count * width * size, length, "accessor {index} fills its view");
    assert_eq!(start % 4, 0, "view of accessor {index} is aligned");
    let values: Vec<f64> = bin[start..start + length].chunks_exact(size).map(read).collect();
    assert!(values.iter().all(|v| v.is_finite()), "accessor {index} is finite");
    (values, width)
}

fn vec3s(values: &[f64]) -> Vec<DVec3> {
    values.chunks_exact(3).map(DVec3::from_slice).collect()
}

fn parse(bytes: &[u8]) -> Parsed {
    assert_eq!(&bytes[..4], b"glTF");
    assert_eq!((u32_at(bytes, 4), u32_at(bytes, 8)), (2, bytes.len()));
    let text = u32_at(bytes, 12);
    assert_eq!(&bytes[16..20], b"JSON");
    let json: Value = serde_json::from_slice(&bytes[20..20 + text]).unwrap();
    let at = 20 + text;
    assert_eq!(&bytes[at + 4..at + 8], b"BIN\0");
    let bin = bytes[at + 8..].to_vec();
    assert_eq!((u32_at(bytes, at), text % 4, bin.len() % 4), (bin.len(), 0, 0));
    assert_eq!(
        json["buffers"][0]["byteLength"].as_u64().unwrap() as usize,
        bin.len()
    );
    let mut out = Parsed {
        json,
        bin,
        parts: vec![],
        cameras: vec![],
    };
    for root in list(&out.json["scenes"][0]["nodes"]) {
        visit(&mut out, root as usize, DMat4::IDENTITY);
    }
    out
}

fn visit(out: &mut Parsed, node: usize, world_from_parent: DMat4) {
    let json = out.json["nodes"][node].clone();
    let vector = |key: &str, default: DVec3| match list(&json[key]) {
        v if v.is_empty() => default,
        v => DVec3::from_slice(&v),
    };
    let rotation = list(&json["rotation"]);
    let rotation = if rotation.is_empty() {
        DQuat::IDENTITY
    } else {
        DQuat::from_slice(&rotation)
    };
    assert!(
        (rotation.length() - 1.0).abs() < 1e-6,
        "node {node} has a unit rotation"
    );
    let local = DMat4::from_scale_rotation_translation(
        vector("scale", DVec3::ONE),
        rotation,
        vector("translation", DVec3::ZERO),
    );
    let world = world_from_parent * local;
    if json["camera"].is_u64() {
        out.cameras
            .push((json["name"].as_str().unwrap().to_string(), world));
    }
    if let Some(mesh) = json["mesh"].as_u64() {
        for primitive in out.json["meshes"][mesh as usize]["primitives"]
            .as_array()
            .unwrap()
            .clone()
        {
            let name = json["name"].as_str().unwrap_or_default().to_string();
            let part = read_part(&out.json, &out.bin, &primitive, name, world);
            out.parts.push(part);
        }
    }
    for child in list(&json["children"]) {
        visit(out, child as usize, world);
    }
}

fn read_part(json: &Value, bin: &[u8], primitive: &Value, node: String, world_from_part: DMat4) -> Part {
    let index = |key: &str| primitive["attributes"][key].as_u64().map(|i| i as usize);
    let at = index("POSITION").unwrap();
    let positions = vec3s(&accessor(json, bin, at).0);
    let (low, high) = positions
        .iter()
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), &p| {
            (l.min(p), h.max(p))
        });
    assert_eq!(list(&json["accessors"][at]["min"]), low.to_array());
    assert_eq!(list(&json["accessors"][at]["max"]), high.to_array());
    let normals = vec3s(&accessor(json, bin, index("NORMAL").unwrap()).0);
    assert_eq!(normals.len(), positions.len());
    // Six digits: the normals are rounded to 2⁻²⁰ per component.
    assert!(
        normals.iter().all(|n| (n.length() - 1.0).abs() < 2e-6),
        "normals have unit length"
    );
    for (key, width) in [("TEXCOORD_0", 2), ("COLOR_0", 3)] {
        if let Some(i) = index(key) {
            let (values, w) = accessor(json, bin, i);
            assert_eq!((values.len(), w), (positions.len() * width, width), "{key}");
        }
    }
    let material = primitive["material"].as_u64().unwrap() as usize;
    let material = &json["materials"].as_array().unwrap()[material];
    let textured = material.to_string().contains("\"index\"");
    assert!(
        !textured || index("TEXCOORD_0").is_some(),
        "{material} needs texture coordinates"
    );
    let indices = accessor(json, bin, primitive["indices"].as_u64().unwrap() as usize).0;
    assert!(
        indices.iter().all(|&i| (i as usize) < positions.len()),
        "indices are in range"
    );
    let triangles = indices
        .chunks_exact(3)
        .map(|t| [t[0] as usize, t[1] as usize, t[2] as usize])
        .collect();
    Part {
        node,
        positions,
        normals,
        triangles,
        world_from_part,
    }
}

fn corners(part: &Part, t: &[usize; 3]) -> [DVec3; 3] {
    t.map(|i| part.world_from_part.transform_point3(part.positions[i]))
}

fn scenes() -> Vec<(&'static str, Parsed)> {
    let glbs = files().iter().filter(|f| f.name.ends_with(".glb"));
    glbs.map(|f| (f.name, parse(&f.bytes))).collect()
}

/// Distance at which a ray meets a triangle (Möller and Trumbore), if it does.
fn hit(p: [DVec3; 3], origin: DVec3, direction: DVec3) -> Option<f64> {
    let (e, f) = (p[1] - p[0], p[2] - p[0]);
    let h = direction.cross(f);
    let s = (origin - p[0]) / e.dot(h);
    let q = s.cross(e);
    let (u, v, t) = (s.dot(h), direction.dot(q), f.dot(q));
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0).then_some(t)
}

#[test]
fn regenerated_files_equal_the_committed_ones() {
    let folder = tempfile::tempdir().unwrap();
    let status = std::process::Command::new(env!("CARGO_BIN_EXE_relight-data-generate"))
        .arg(folder.path())
        .output();
    assert!(status.unwrap().status.success());
    let committed = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    for File { name, .. } in files() {
        let (new, old) = (
            std::fs::read(folder.path().join(name)).unwrap(),
            std::fs::read(committed.join(name)).unwrap(),
        );
        assert!(
            new == old,
            "{name} differs: run `cargo run --release -p relight-data-generate` and commit data/"
        );
    }
}

#[test]
fn all_files_together_stay_under_ten_megabytes() {
    let total: usize = files().iter().map(|f| f.bytes.len()).sum();
    assert!(total < 10_000_000, "{total} bytes");
}

#[test]
fn normals_agree_with_the_winding() {
    for (name, scene) in scenes() {
        for part in &scene.parts {
            for t in &part.triangles {
                let p = t.map(|i| part.positions[i]);
                let face = (p[1] - p[0]).cross(p[2] - p[0]);
                assert!(face.length() > 0.0, "{name}: a triangle without area at {}", p[0]);
                assert!(
                    t.iter().all(|&i| part.normals[i].dot(face) > 0.0),
                    "{name}: a normal against its face at {}",
                    p[0]
                );
            }
        }
    }
}

#[test]
fn cameras_stand_before_geometry() {
    for (name, scene) in scenes() {
        assert!(
            scene.cameras.iter().any(|c| c.0 == "Camera"),
            "{name} has a node named Camera"
        );
        for (camera, world) in &scene.cameras {
            let (eye, direction) = (world.w_axis.truncate(), -world.z_axis.truncate());
            let near = scene
                .parts
                .iter()
                .flat_map(|part| part.triangles.iter().map(|t| corners(part, t)))
                .filter_map(|p| hit(p, eye, direction))
                .fold(f64::INFINITY, f64::min);
            // Neither into the void nor with the nose at a wall.
            assert!(
                near > 0.05 && near.is_finite(),
                "{name}: {camera} meets geometry at {near}"
            );
        }
    }
}

/// The enclosures: each edge, by position, runs once in each direction, so no light leaks and no face is turned over.
#[test]
fn furnaces_and_the_two_rooms_are_closed() {
    for (name, scene) in scenes() {
        // What stands in the two rooms is no part of their shell.
        let shell = |part: &&Part| name != "two_rooms.glb" || part.node == "Rooms";
        if !name.starts_with("furnace") && name != "two_rooms.glb" {
            continue;
        }
        let mut edges: HashMap<[[u64; 3]; 2], i32> = HashMap::new();
        let key = |p: DVec3| p.to_array().map(|x| (x + 0.0).to_bits());
        for part in scene.parts.iter().filter(shell) {
            for t in &part.triangles {
                let p = corners(part, t).map(key);
                for k in 0..3 {
                    *edges.entry([p[k], p[(k + 1) % 3]]).or_default() += 1;
                }
            }
        }
        for ([a, b], count) in &edges {
            assert_eq!(
                (*count, edges.get(&[*b, *a])),
                (1, Some(&1)),
                "{name}: an open edge"
            );
        }
    }
}

#[test]
fn furnace_spheres_are_round_to_a_thousandth() {
    for (name, scene) in scenes() {
        if name != "furnace_sphere.glb" && name != "furnace_varying.glb" {
            continue;
        }
        for part in &scene.parts {
            for t in &part.triangles {
                let p = corners(part, t);
                let middle = (p[0] + p[1] + p[2]) / 3.0;
                assert!((middle.length() - 1.0).abs() < 1e-3, "{name}: {middle}");
                for (corner, &i) in p.iter().zip(t) {
                    // Positions and normals are each rounded to 2^-20 per component.
                    let off = (part.normals[i] + *corner).length();
                    assert!(off < 4e-6, "{name}: normals look at the centre, {off}");
                }
            }
        }
    }
}

#[test]
fn the_atrium_has_fifty_thousand_triangles_and_open_sky() {
    let (_, atrium) = scenes().into_iter().find(|s| s.0 == "atrium.glb").unwrap();
    let triangles = || {
        atrium
            .parts
            .iter()
            .flat_map(|part| part.triangles.iter().map(|t| corners(part, t)))
    };
    assert!(triangles().count() >= 50_000);
    let up = triangles()
        .filter_map(|p| hit(p, DVec3::new(3.01, 5.0, 1.02), DVec3::Y))
        .count();
    assert_eq!(up, 0, "the courtyard is open to the sky");
}

#[test]
fn sequences_are_json_and_name_materials_and_files_that_exist() {
    let all: Vec<&File> = files().iter().collect();
    let materials: Vec<String> = scenes()
        .iter()
        .flat_map(|(_, s)| s.json["materials"].as_array().unwrap().clone())
        .map(|m| m["name"].as_str().unwrap().to_string())
        .collect();
    let mut seen = 0;
    for file in all.iter().filter(|f| f.name.ends_with(".lights.json")) {
        let json: Value = serde_json::from_slice(&file.bytes).unwrap();
        assert_eq!(json["relight_sequence"], 1, "{}", file.name);
        for light in json["lights"].as_array().unwrap() {
            seen += 1;
            if let Some(needed) = light["file"].as_str() {
                assert!(all.iter().any(|f| f.name == needed), "{}: {needed}", file.name);
            }
            if let Some(material) = light["material"].as_str() {
                assert!(
                    materials.iter().any(|m| m == material),
                    "{}: {material}",
                    file.name
                );
            }
        }
    }
    assert!(seen > 0);
}

/// The features that the table promises, counted in its JSON.
#[test]
fn the_table_uses_every_material_feature() {
    let (_, table) = scenes().into_iter().find(|s| s.0 == "table.glb").unwrap();
    let text = table.json.to_string();
    for feature in [
        "baseColorTexture",
        "metallicRoughnessTexture",
        "normalTexture",
        "emissiveTexture",
        "KHR_texture_transform",
        "KHR_materials_emissive_strength",
        "COLOR_0",
        "\"MASK\"",
        "\"BLEND\"",
        "doubleSided",
    ] {
        assert!(text.contains(feature), "{feature}");
    }
    assert!(
        table.parts.iter().any(|p| p.world_from_part.determinant() < 0.0),
        "a mirrored node"
    );
}

#[test]
fn images_are_png_that_decode_to_at_most_512_pixels() {
    for (name, scene) in scenes() {
        for image in scene.json["images"].as_array().unwrap_or(&vec![]) {
            let view = &scene.json["bufferViews"][image["bufferView"].as_u64().unwrap() as usize];
            let at = view["byteOffset"].as_u64().unwrap() as usize;
            let bytes = &scene.bin[at..at + view["byteLength"].as_u64().unwrap() as usize];
            let decoded = image::load_from_memory_with_format(bytes, image::ImageFormat::Png).unwrap();
            assert!(
                decoded.width() <= 512 && decoded.height() <= 512,
                "{name}: {image}"
            );
        }
    }
}

/// The orientation of the maps: a direction is looked up at u = atan2(d.x, −d.z)/2π, v = acos(d.y)/π.
#[test]
fn environment_maps_decode_and_the_window_is_in_front_of_the_table() {
    for file in files().iter().filter(|f| f.name.ends_with(".hdr")) {
        let map = image::load_from_memory_with_format(&file.bytes, image::ImageFormat::Hdr)
            .unwrap()
            .to_rgb32f();
        assert!(
            map.pixels()
                .all(|p| p.0.iter().all(|c| c.is_finite() && *c >= 0.0)),
            "{}",
            file.name
        );
        if file.name != "window.hdr" {
            continue;
        }
        // The mean direction of the radiance, weighted by solid angle up to a constant.
        let mut mean = DVec3::ZERO;
        for (x, y, p) in map.enumerate_pixels() {
            let u = (f64::from(x) + 0.5) / f64::from(map.width()) * std::f64::consts::TAU;
            let v = (f64::from(y) + 0.5) / f64::from(map.height()) * std::f64::consts::PI;
            let d = DVec3::new(u.sin() * v.sin(), v.cos(), -u.cos() * v.sin());
            mean += d * v.sin() * f64::from(p.0[1]);
        }
        // The table's room is open towards +Z.
        assert!(mean.normalize().z > 0.4 && mean.y > 0.0, "{mean}");
    }
}

#[test]
fn the_readme_lists_every_file_and_the_right_triangle_counts() {
    let readme = include_str!("../../README.md");
    for file in files() {
        let Some(row) = readme
            .lines()
            .find(|line| line.starts_with('|') && line.contains(&format!("`{}`", file.name)))
        else {
            panic!("data/README.md has no row for {}", file.name);
        };
        if file.name.ends_with(".glb") {
            let count: usize = parse(&file.bytes).parts.iter().map(|p| p.triangles.len()).sum();
            let written = row.split('|').nth(2).unwrap().trim().replace(',', "");
            assert_eq!(written, count.to_string(), "{} in data/README.md", file.name);
        }
    }
}

/// A second opinion: the validation of the `gltf` crate.
#[test]
fn the_gltf_crate_accepts_every_scene() {
    for file in files().iter().filter(|f| f.name.ends_with(".glb")) {
        let gltf = gltf::Gltf::from_slice(&file.bytes).unwrap_or_else(|e| panic!("{}: {e}", file.name));
        assert!(
            gltf.blob.is_some() && gltf.default_scene().is_some(),
            "{}",
            file.name
        );
        assert_eq!(gltf.extensions_required().count(), 0, "{}", file.name);
    }
}
