//! The reference renders that lie beside the repository: they read, their means are those that their notes state, and
//! HDR-FLIP agrees with NVIDIA's tool on them. The folder is `../shared` seen from the repository's root, or what the
//! environment variable RELIGHT_SHARED names; without it these tests say so and check nothing.

use relight_scene::image::{BEAUTY, FloatImage, Limits, flip, metrics, read_environment, read_exr};
use std::path::{Path, PathBuf};

fn shared() -> Option<PathBuf> {
    let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared");
    let folder = std::env::var_os("RELIGHT_SHARED").map_or_else(beside, PathBuf::from);
    if folder.join("reference").is_dir() {
        return Some(folder);
    }
    eprintln!(
        "SKIPPED: no folder `reference` in {}; set RELIGHT_SHARED",
        folder.display()
    );
    None
}

fn beauty(path: &Path) -> FloatImage {
    read_exr(path, &Limits::default()).unwrap().rgb(BEAUTY).unwrap()
}

/// Truth: the notes beside each image (`NAME.json`), written by the renderer that made it: size and mean per channel.
#[test]
fn every_reference_image_reads_with_the_size_and_mean_its_notes_state() {
    let Some(folder) = shared() else { return };
    let mut images = 0;
    for entry in std::fs::read_dir(folder.join("reference")).unwrap() {
        let path = entry.unwrap().path();
        let Some(name) = path.file_name().unwrap().to_str().unwrap().strip_suffix(".json") else {
            continue;
        };
        if name.ends_with(".lights") {
            continue;
        }
        let notes: serde_json::Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
        for part in ["full", "indirect"] {
            let image = beauty(&path.with_file_name(format!("{name}.{part}.exr")));
            check_notes(&notes, part, &image, name);
            images += 1;
        }
    }
    assert!(images >= 2, "a reference folder without images");
}

/// Truth: PyPI's flip-evaluator 1.7, `evaluate(full, indirect, "HDR")`. It rounds to f32 at every step, in another
/// order than we do: 1e-4 of the mean (7e-6 found).
#[test]
fn hdr_flip_agrees_with_nvidias_tool_on_reference_renders() {
    let Some(folder) = shared() else { return };
    for (name, expected) in [
        ("sponza_dabrovic_point", 0.438_845_962),
        ("stanford_bunny_env", 0.938_387_513),
        ("modern_hall_emissive", 0.577_569_008),
        ("sibenik_points", 0.375_978_261),
    ] {
        let path = |part: &str| folder.join(format!("reference/{name}.{part}.exr"));
        let (full, indirect) = (beauty(&path("full")), beauty(&path("indirect")));
        let found = flip::flip_hdr(&indirect, &full).unwrap().mean;
        println!(
            "{name}: FLIP {found:.6}, the tool's {expected:.6}, relative {:+.1e}",
            found / expected - 1.0
        );
        assert!(
            (found / expected - 1.0_f64).abs() < 1e-3,
            "{name}: {found}, the tool's {expected}"
        );
        let all = metrics::compare(&full, &full).unwrap();
        assert_eq!((all.relmse, all.flip), (0.0, 0.0));
    }
}

#[test]
fn the_environment_maps_beside_the_scenes_read_without_repair() {
    let Some(folder) = shared() else { return };
    let Ok(maps) = std::fs::read_dir(folder.join("scenes/env")) else {
        return;
    };
    for map in maps {
        let path = map.unwrap().path();
        if path.extension().is_some_and(|e| e == "hdr") {
            let map = read_environment(&path, &Limits::default()).unwrap();
            assert_eq!(
                (map.image.width, map.image.height, map.repaired),
                (1024, 512, 0),
                "{}",
                path.display()
            );
        }
    }
}

fn check_notes(notes: &serde_json::Value, part: &str, image: &FloatImage, name: &str) {
    assert_eq!(
        notes["size"],
        format!("{}x{}", image.width, image.height),
        "{name}"
    );
    for k in 0..3 {
        let mean = image.pixels.iter().map(|p| f64::from(p[k])).sum::<f64>() / image.pixels.len() as f64;
        let stated = notes[part]["mean"][k].as_f64().unwrap();
        // The notes have six digits, the files half floats, off by at most 2⁻¹² of a value on average.
        assert!(
            (mean / stated - 1.0).abs() < 2.5e-4,
            "{name} {part}, channel {k}: {mean}, not {stated}"
        );
    }
}
