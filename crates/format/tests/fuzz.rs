//! The fuzz targets of the asset file, on any toolchain and for a fixed number of inputs. Longer:
//! `RELIGHT_FUZZ_SECONDS=60 cargo test --release -p relight-format --test fuzz -- --nocapture`.

// Reason: it measures.
#![allow(clippy::disallowed_methods)]

#[path = "../../../fuzz/targets/assets.rs"]
mod assets;
mod common;
#[path = "../../../fuzz/targets/mutate.rs"]
mod mutate;

use common::assets::wide_asset;
use common::{sections_of, small_asset};
use mutate::write_seed;
use relight_format::{Asset, write_asset};

/// A function to be fed with any bytes.
pub type Target = fn(&[u8]);

/// Inputs per target: a few seconds for all.
const ROUNDS: usize = 1500;

#[test]
fn nothing_panics_or_hangs() {
    for (name, count) in mutate::feed_all(&assets::all(), ROUNDS) {
        println!("{name}: {count} inputs");
    }
}

/// Writes the seeds that corpora started from; `cargo fuzz cmin` then makes them minimal.
#[test]
#[ignore = "writes the first inputs of the corpora"]
fn write_the_seeds() {
    for (name, asset) in [
        ("small", small_asset()),
        ("wide", wide_asset()),
        ("empty", Asset::default()),
    ] {
        let file = write_asset(&asset).unwrap();
        if name != "wide" {
            write_seed("container", name, &file);
        }
        for section in sections_of(&file) {
            let raw = section.raw();
            let kind = relight_format::layout::Kind::from_number(section.kind).unwrap();
            // Longer ones would only slow the fuzzer down.
            if raw.len() <= 4096 {
                write_seed(kind.name(), name, &raw);
            }
        }
    }
    for i in 0..8u8 {
        let data: Vec<u8> = (0..400u32)
            .map(|k| (k.wrapping_mul(2_654_435_761) >> (8 + i)) as u8)
            .collect();
        write_seed("round_trip", &format!("seed_{i}"), &data);
    }
}
