//! The fuzz targets of scenes, images, sequences and material edits, on any toolchain and for a fixed number of inputs.
//! Longer: `RELIGHT_FUZZ_SECONDS=60 cargo test --release -p relight-scene --features gltf --test fuzz -- --nocapture`.
#![cfg(feature = "gltf")]
// Reason: it measures.
#![allow(clippy::disallowed_methods)]

#[path = "../../../fuzz/targets/mutate.rs"]
mod mutate;
#[path = "../../../fuzz/targets/readers.rs"]
mod readers;

use mutate::write_seed;
use relight_scene::image::{BEAUTY, ExrHeader, FloatImage, Image8, Layers, exr_write, ldr};
use std::path::Path;

/// A function to be fed with any bytes.
pub type Target = fn(&[u8]);

/// Inputs per target: a few seconds for all.
const ROUNDS: usize = 400;

#[test]
fn nothing_panics_or_hangs() {
    for (name, count) in mutate::feed_all(&readers::all(), ROUNDS) {
        println!("{name}: {count} inputs");
    }
}

/// Writes the seeds that corpora started from; `cargo fuzz cmin` then makes them minimal.
#[test]
#[ignore = "writes the first inputs of the corpora"]
fn write_the_seeds() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let data = |name: &str| std::fs::read(root.join("data").join(name)).unwrap();
    write_seed("gltf", "furnace_box", &data("furnace_box.glb"));
    write_seed("gltf", "cornell", &data("cornell.glb"));
    for entry in std::fs::read_dir(root.join("data")).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap();
        if name.ends_with(".lights.json") {
            write_seed("sequence", name, &std::fs::read(&path).unwrap());
        }
    }
    let edits = String::from_utf8(data("table_materials.json")).unwrap();
    // The target's scene has three of the table's materials.
    let edits = edits
        .replace("Blue ceramic", "Porcelain")
        .replace("Hammered copper", "Brick");
    write_seed("material_edits", "table", edits.as_bytes());
    let one = br#"{"relight_materials": 1, "edits": [{"material": "Chrome", "roughness": {"keys": [[0, 0.1], [9, 0.5]]}}]}"#;
    write_seed("material_edits", "one", one);
    let picture = |size: usize| FloatImage {
        width: size,
        height: size,
        pixels: (0..size * size)
            .map(|i| [i as f32, 0.5, 1e-3 * i as f32])
            .collect(),
    };
    for float in [false, true] {
        let mut layers = Layers::from_image(BEAUTY, &picture(6));
        layers.push_scalar("depth", &[1.5; 36]);
        let exr = exr_write::encode_exr("seed", &layers, &ExrHeader::new(), float)
            .unwrap()
            .0;
        write_seed("exr", if float { "float" } else { "half" }, &exr);
    }
    let image = Image8 {
        width: 5,
        height: 3,
        rgba8: (0..15).map(|i| [i, 2 * i, 9, 200]).collect(),
    };
    write_seed("texture", "png", &ldr::encode_png("seed", &image).unwrap());
    let mut jpeg = Vec::new();
    let samples: Vec<u8> = (0..16 * 8 * 3).map(|i| (i * 7) as u8).collect();
    image::codecs::jpeg::JpegEncoder::new(&mut jpeg)
        .encode(&samples, 16, 8, image::ExtendedColorType::Rgb8)
        .unwrap();
    write_seed("texture", "jpeg", &jpeg);
    for (name, width, height) in [("flat", 3, 2), ("runs", 16, 4)] {
        let mut hdr = Vec::new();
        let pixels: Vec<_> = (0..width * height)
            .map(|i| image::Rgb([(i / 5) as f32, 0.5, 2.0]))
            .collect();
        image::codecs::hdr::HdrEncoder::new(&mut hdr)
            .encode(&pixels, width, height)
            .unwrap();
        write_seed("hdr", name, &hdr);
    }
}
