//! Targets of what relight reads besides assets: scenes, images, lighting sequences, material edits.

use super::Target;
use relight_scene::gltf::{ImportError, ImportOptions, import};
use relight_scene::image::{
    EnvironmentMap, ImageError, Limits, decode_environment, decode_exr, decode_hdr, decode_ldr,
};
use relight_scene::material::Material;
use relight_scene::material_edits::parse_material_edits;
use relight_scene::photometry::Photometry;
use relight_scene::scene::Scene;
use relight_scene::sequence::{Sequence, parse_sequence, sequence_to_json, stage_from_json};
use relight_scene::weather::Weather;
use std::path::Path;
use std::sync::OnceLock;

/// Images of a few kilobytes need no more.
const LIMITS: Limits = Limits {
    max_pixels: 1 << 20,
    max_bytes: 32 << 20,
    max_file_bytes: 1 << 20,
};

/// The targets of this module.
pub fn all() -> Vec<(&'static str, Target)> {
    vec![
        ("gltf", gltf),
        ("meshopt", meshopt),
        ("draco", draco),
        ("ktx2", ktx2),
        ("hdr", hdr),
        ("exr", exr),
        ("texture", texture),
        ("sequence", sequence),
        ("ies", ies),
        ("weather", weather),
        ("material_edits", material_edits),
    ]
}

/// Any bytes as a photometric file: finite light of at least 0, no more than its peak in all directions, or an error.
pub fn ies(data: &[u8]) {
    let text: String = data.iter().map(|&byte| char::from(byte)).collect();
    let Ok(lamp) = Photometry::parse(&text) else {
        return;
    };
    // The light of some hundred thousand directions, which are looked up while it is read.
    let most = 4.0 * std::f64::consts::PI * lamp.peak();
    assert!(
        lamp.lumens() >= 0.0 && lamp.lumens() <= most * 1.001,
        "{}",
        lamp.lumens()
    );
}

/// Any bytes as a weather file: finite light of at least 0 and a unit vector to the sun at any hour, or an error; an excerpt reads as the
/// whole does.
pub fn weather(data: &[u8]) {
    let text: String = data.iter().map(|&byte| char::from(byte)).collect();
    let Ok(weather) = Weather::parse(&text) else {
        return;
    };
    for hours in [0.0, 12.25, 4140.5, 8759.9] {
        let (daylight, sun) = weather.at(hours);
        assert!(daylight.direct_normal >= 0.0 && daylight.diffuse_horizontal >= 0.0);
        assert!((sun.length() - 1.0).abs() < 1e-9);
        if weather.check(hours, hours + 1.0).is_ok() {
            let excerpt = weather.excerpt(&text, hours, hours + 1.0);
            let again = Weather::parse(&excerpt).expect("an excerpt reads");
            let (of_excerpt, _) = again.at(hours);
            assert!((of_excerpt.direct_normal - daylight.direct_normal).abs() < 1e-6);
        }
    }
}

/// Any bytes as a `.glb` or `.gltf`: a scene whose indices are in range, or an error; and no caught panic either.
pub fn gltf(data: &[u8]) {
    static FOLDER: OnceLock<tempfile::TempDir> = OnceLock::new();
    let folder = FOLDER.get_or_init(|| tempfile::tempdir().expect("a folder for the file that is imported"));
    // By thread, as tests feed targets side by side.
    let file = folder
        .path()
        .join(format!("{:?}.glb", std::thread::current().id()));
    std::fs::write(&file, data).expect("a file that is imported");
    match import(&file, &ImportOptions::default()) {
        Ok(scene) => {
            for mesh in &scene.meshes {
                let vertices = mesh.positions.len();
                assert!(mesh.triangles.iter().flatten().all(|&i| (i as usize) < vertices));
                assert!((mesh.material as usize) < scene.materials.len());
                assert!(mesh.positions.iter().all(|p| p.is_finite()));
            }
            assert!(
                scene
                    .instances
                    .iter()
                    .all(|i| (i.mesh as usize) < scene.meshes.len())
            );
        }
        Err(ImportError::Internal { message, .. }) => panic!("the importer panicked: {message}"),
        Err(_) => {}
    }
}

/// Any bytes as a compressed stream, of the mode, filter, stride and count that the first five say: a scene or an error.
pub fn meshopt(data: &[u8]) {
    let Some((&[mode, filter, stride, low, high], stream)) = data.split_first_chunk() else {
        return;
    };
    // More elements take time and tell no more.
    let (count, strides) = (
        u16::from_le_bytes([low, high]) % 1024,
        [4, 8, 12, 16, 32, 64, 2, 4],
    );
    let stride: usize = strides[usize::from(stride) % strides.len()];
    let mode = ["ATTRIBUTES", "TRIANGLES", "INDICES"][usize::from(mode) % 3];
    let filter = ["NONE", "OCTAHEDRAL", "QUATERNION", "EXPONENTIAL", "COLOR"][usize::from(filter) % 5];
    // Four vertices that a stream of indices joins, else vertices that it is itself, as bytes.
    let corners = [[0f32, 0., 0.], [1., 0., 0.], [0., 1., 0.], [1., 1., 1.]].as_flattened();
    let mut bin: Vec<u8> = corners.iter().flat_map(|x| x.to_le_bytes()).collect();
    let (start, length, size) = (bin.len(), stream.len(), stride * usize::from(count));
    bin.extend(stream);
    let whole = bin.len();
    let attributes = match mode {
        "ATTRIBUTES" => r#""attributes":{"POSITION":1,"COLOR_0":2}"#,
        _ => r#""attributes":{"POSITION":0},"indices":3"#,
    };
    let index = if stride == 2 { 5123 } else { 5125 };
    let json = format!(
        r#"{{"asset":{{"version":"2.0"}},"nodes":[{{"mesh":0}}],"meshes":[{{"primitives":[{{{attributes}}}]}}],
        "buffers":[{{"byteLength":{whole}}},{{"byteLength":{size}}}],
        "bufferViews":[{{"buffer":0,"byteLength":48}},{{"buffer":1,"byteLength":{size},"byteStride":{stride},
          "extensions":{{"KHR_meshopt_compression":{{"buffer":0,"byteOffset":{start},"byteLength":{length},
          "byteStride":{stride},"count":{count},"mode":"{mode}","filter":"{filter}"}}}}}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3"}},
          {{"bufferView":1,"componentType":5120,"count":{count},"type":"VEC3"}},
          {{"bufferView":1,"componentType":5121,"count":{count},"type":"VEC4"}},
          {{"bufferView":1,"componentType":{index},"count":{count},"type":"SCALAR"}}]}}"#
    );
    gltf(&glb(json.as_bytes(), &bin));
}

/// Any bytes as a compressed primitive of 16 vertices and 54 indices, as those of the corpus have: a scene or an error.
pub fn draco(data: &[u8]) {
    let length = data.len();
    let json = format!(
        r#"{{"asset":{{"version":"2.0"}},"nodes":[{{"mesh":0}}],"meshes":[{{"primitives":[{{
          "attributes":{{"POSITION":0,"NORMAL":1,"TEXCOORD_0":2,"COLOR_0":3}},"indices":4,
          "extensions":{{"KHR_draco_mesh_compression":{{"bufferView":0,
            "attributes":{{"POSITION":0,"NORMAL":1,"TEXCOORD_0":2,"COLOR_0":3}}}}}}}}]}}],
        "buffers":[{{"byteLength":{length}}}],"bufferViews":[{{"buffer":0,"byteLength":{length}}}],
        "accessors":[{{"componentType":5126,"count":16,"type":"VEC3"}},{{"componentType":5126,"count":16,"type":"VEC3"}},
          {{"componentType":5126,"count":16,"type":"VEC2"}},
          {{"componentType":5121,"count":16,"type":"VEC4","normalized":true}},
          {{"componentType":5123,"count":54,"type":"SCALAR"}}]}}"#
    );
    gltf(&glb(json.as_bytes(), data));
}

/// Any bytes as a KTX 2.0 texture: a scene or an error. Sizes above 256 texels are cut, which take time and tell no more.
pub fn ktx2(data: &[u8]) {
    let mut data = data.to_vec();
    for size in [20, 24] {
        for high in data.iter_mut().skip(size + 1).take(3) {
            *high = 0;
        }
    }
    let length = data.len();
    let start = data.len().next_multiple_of(4);
    data.resize(start, 0);
    data.extend(
        [0f32, 0., 0., 1., 0., 0., 0., 1., 0.]
            .iter()
            .flat_map(|x| x.to_le_bytes()),
    );
    let whole = data.len();
    let json = format!(
        r#"{{"asset":{{"version":"2.0"}},"nodes":[{{"mesh":0}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0,"TEXCOORD_0":1}},"material":0}}]}}],
        "materials":[{{"normalTexture":{{"index":0}}}}],"images":[{{"bufferView":0}}],
        "textures":[{{"extensions":{{"KHR_texture_basisu":{{"source":0}}}}}}],
        "buffers":[{{"byteLength":{whole}}}],
        "bufferViews":[{{"buffer":0,"byteLength":{length}}},{{"buffer":0,"byteOffset":{start},"byteLength":36}}],
        "accessors":[{{"bufferView":1,"componentType":5126,"count":3,"type":"VEC3"}},
          {{"bufferView":1,"componentType":5126,"count":3,"type":"VEC2"}}]}}"#
    );
    gltf(&glb(json.as_bytes(), &data));
}

/// Joins chunks to a `.glb`.
fn glb(json: &[u8], bin: &[u8]) -> Vec<u8> {
    let size = |chunk: &[u8]| (chunk.len() as u32).to_le_bytes();
    [
        &b"glTF\x02\0\0\0"[..],
        &(28 + json.len() as u32 + bin.len() as u32).to_le_bytes(),
        &size(json),
        b"JSON",
        json,
        &size(bin),
        b"BIN\0",
        bin,
    ]
    .concat()
}

fn check_map(read: Result<EnvironmentMap, ImageError>) {
    if let Ok(map) = read {
        let pixels = &map.image.pixels;
        assert_eq!(pixels.len(), map.image.width * map.image.height);
    }
}

/// Any bytes as a Radiance picture, also behind its magic.
pub fn hdr(data: &[u8]) {
    for bytes in [
        data.to_vec(),
        [b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n", data].concat(),
    ] {
        check_map(decode_environment("fuzz.hdr", &bytes, &LIMITS));
        if let Ok(image) = decode_hdr("fuzz.hdr", &bytes, &LIMITS) {
            assert_eq!(image.pixels.len(), image.width * image.height);
        }
    }
}

/// Any bytes as an OpenEXR file.
pub fn exr(data: &[u8]) {
    check_map(decode_environment("fuzz.exr", data, &LIMITS));
    let _ = decode_exr("fuzz.exr", data, &LIMITS);
}

/// Any bytes as a PNG, JPEG or WebP. A JPEG of a few bytes may fill any size, which takes time and tells no more.
pub fn texture(data: &[u8]) {
    let limits = Limits {
        max_pixels: 1 << 16,
        ..LIMITS
    };
    if let Ok(image) = decode_ldr("fuzz.png", data, &limits) {
        assert_eq!(image.rgba8.len(), image.width * image.height);
    }
}

/// Any bytes as a lighting sequence and as an asset's stage; one that is read can be written and read again.
pub fn sequence(data: &[u8]) {
    let text = String::from_utf8_lossy(data);
    let _ = stage_from_json(&text);
    // Maps are named, not read, here.
    if let Ok(sequence) = parse_sequence(&text, Path::new("nowhere"), "fuzz.json") {
        let written = sequence_to_json(&sequence);
        let again = parse_sequence(&written, Path::new("nowhere"), "again.json");
        assert!(again.is_ok(), "{:?} from {written}", again.err());
    }
}

/// Any bytes as material edits of a scene of three materials.
pub fn material_edits(data: &[u8]) {
    let named = |name: &str| Material {
        name: name.into(),
        ..Material::default()
    };
    let scene = Scene {
        meshes: Vec::new(),
        instances: Vec::new(),
        materials: ["Chrome", "Brick", "Porcelain"].map(named).into(),
        textures: Vec::new(),
        cameras: Vec::new(),
        sequence: Sequence {
            frames: 24,
            fps: 24.0,
            camera: None,
            lights: Vec::new(),
        },
        ..Scene::default()
    };
    let text = String::from_utf8_lossy(data);
    if let Ok(edits) = parse_material_edits(&text, &scene, "fuzz.json") {
        for frame in [0.0, 0.5, 23.0] {
            let edited = edits.at(frame, &scene.materials);
            assert_eq!(edited.len(), 3);
        }
    }
}
