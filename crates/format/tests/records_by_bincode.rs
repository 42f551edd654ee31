//! Records (SPEC 7.9) against a second implementation: bincode 2 with fixed-width little-endian numbers, which wrote them
//! before `format` did so itself.

mod common;

use common::{sections_of, small_asset};
use relight_format::{layout::Kind, write_asset};

/// A struct's fields follow each other, as a tuple's do.
#[test]
fn provenance_is_what_bincode_makes_of_it() {
    let mut asset = small_asset();
    asset.provenance.notes = vec![String::new(), "ünïcode, and a line\nbreak".into()];
    let p = asset.provenance.clone();
    let left_out: Vec<(String, String, u64)> = p
        .left_out
        .into_iter()
        .map(|l| (l.what, l.why, l.saved_bytes))
        .collect();
    let fields = (
        p.tool_version,
        p.settings,
        p.source_hash,
        p.seed,
        p.lambert,
        left_out,
        p.counts,
        p.notes,
    );
    let config = bincode::config::standard()
        .with_little_endian()
        .with_fixed_int_encoding();
    let expected = bincode::encode_to_vec(fields, config).unwrap();
    let sections = sections_of(&write_asset(&asset).unwrap());
    let section = sections
        .iter()
        .find(|s| s.kind == Kind::Provenance as u32)
        .unwrap();
    let raw = match section.codec {
        0 => section.stored.clone(),
        _ => zstd::bulk::decompress(&section.stored, section.raw_bytes as usize).unwrap(),
    };
    assert_eq!(raw, expected);
}
