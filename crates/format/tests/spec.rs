//! SPEC.md and the code say the same: the tables of kinds, fields and constants are read from the page and compared
//! with the layout module, and the page's example file is decoded and written again.

mod common;

use relight_format::layout::{self, Codec, Kind, entry, header};
use relight_format::*;

const SPEC: &str = include_str!("../SPEC.md");

/// The rows of the table that follows a marker line, as trimmed cells without backticks.
fn table(marker: &str) -> Vec<Vec<String>> {
    let after = SPEC
        .split_once(marker)
        .unwrap_or_else(|| panic!("SPEC.md has no {marker}"))
        .1;
    after
        .lines()
        .skip_while(|line| !line.starts_with('|'))
        .take_while(|line| line.starts_with('|'))
        .skip(2) // head and rule
        .map(|line| {
            line.trim_matches('|')
                .split('|')
                .map(|cell| cell.trim().replace('`', ""))
                .collect()
        })
        .collect()
}

fn number(cell: &str) -> u64 {
    match cell.strip_prefix("0x") {
        Some(hex) => u64::from_str_radix(&hex.replace(' ', ""), 16).unwrap(),
        None => cell.parse().unwrap_or_else(|_| panic!("no number: {cell}")),
    }
}

#[test]
fn the_table_of_kinds_is_the_codes() {
    let rows = table("<!-- table: kinds -->");
    let stated: Vec<_> = rows
        .iter()
        .map(|row| {
            (
                number(&row[0]) as u32,
                row[1].clone(),
                number(&row[2]) as u16,
                row[3] == "yes",
            )
        })
        .collect();
    let actual: Vec<_> = Kind::ALL
        .iter()
        .map(|k| (*k as u32, k.name().to_string(), k.version(), k.required()))
        .collect();
    assert_eq!(stated, actual);
}

#[test]
fn the_table_of_codecs_is_the_codes() {
    let stated: Vec<_> = table("<!-- table: codecs -->")
        .iter()
        .map(|row| (number(&row[0]) as u32, row[1].clone()))
        .collect();
    let actual: Vec<_> = [Codec::Stored, Codec::Zstd]
        .iter()
        .map(|c| (*c as u32, c.name().to_string()))
        .collect();
    assert_eq!(stated, actual);
    assert_eq!(
        Codec::from_number(stated.len() as u32),
        None,
        "no codec beyond the table"
    );
}

#[test]
fn the_fields_of_header_and_entry_are_the_codes() {
    let offsets = |marker: &str| -> Vec<(String, usize)> {
        table(marker)
            .iter()
            .map(|row| (row[2].clone(), number(&row[0]) as usize))
            .collect()
    };
    let named = |fields: &[(&str, usize)]| -> Vec<(String, usize)> {
        fields
            .iter()
            .map(|(name, offset)| (name.to_string(), *offset))
            .collect()
    };
    let fields = [
        ("magic", header::MAGIC),
        ("byte_order_mark", header::BYTE_ORDER_MARK),
        ("version", header::VERSION),
        ("file_bytes", header::FILE_BYTES),
        ("table_offset", header::TABLE_OFFSET),
        ("section_count", header::SECTION_COUNT),
        ("reserved", header::RESERVED),
        ("table_checksum", header::TABLE_CHECKSUM),
        ("header_checksum", header::HEADER_CHECKSUM),
    ];
    assert_eq!(offsets("<!-- table: header -->"), named(&fields));
    let fields = [
        ("kind", entry::KIND),
        ("version", entry::VERSION),
        ("flags", entry::FLAGS),
        ("codec", entry::CODEC),
        ("needs", entry::NEEDS),
        ("offset", entry::OFFSET),
        ("stored_bytes", entry::STORED_BYTES),
        ("raw_bytes", entry::RAW_BYTES),
        ("checksum", entry::CHECKSUM),
    ];
    assert_eq!(offsets("<!-- table: entry -->"), named(&fields));
    // Fields lie end to end: each offset is the last one and its size.
    for (marker, total) in [
        ("<!-- table: header -->", layout::HEADER_BYTES),
        ("<!-- table: entry -->", layout::ENTRY_BYTES),
    ] {
        let mut end = 0;
        for row in table(marker) {
            assert_eq!(number(&row[0]), end);
            end += match row[1].as_str() {
                "u8[8]" | "u64" => 8,
                "u32" => 4,
                "u16" => 2,
                other => panic!("type {other}"),
            };
        }
        assert_eq!(end, total);
    }
}

#[test]
fn the_constants_are_the_codes() {
    let actual = [
        ("specification version", u64::from(layout::SPEC_VERSION)),
        ("magic", u64::from_be_bytes(layout::MAGIC)),
        ("byte order mark", u64::from(layout::BYTE_ORDER_MARK)),
        ("header bytes", layout::HEADER_BYTES),
        ("entry bytes", layout::ENTRY_BYTES),
        ("required flag", u64::from(layout::FLAG_REQUIRED)),
        ("most sections", u64::from(layout::MAX_SECTIONS)),
        ("most raw bytes per stored byte", layout::MAX_RATIO),
        ("most bytes of records", layout::MAX_RECORD_BYTES as u64),
        ("most sets of texture coordinates", layout::MAX_UV_SETS as u64),
    ];
    let stated: Vec<_> = table("<!-- table: constants -->")
        .iter()
        .map(|row| (row[0].clone(), number(&row[1])))
        .collect();
    assert_eq!(stated, actual.map(|(name, value)| (name.to_string(), value)));
}

#[test]
fn the_settings_that_readers_mind_are_the_codes() {
    let rows = table("<!-- table: settings -->");
    let stated: Vec<_> = rows.iter().map(|row| row[0].as_str()).collect();
    assert_eq!(stated, layout::setting::ALL);
    let values = |name: &str| &rows.iter().find(|row| row[0] == name).unwrap()[1];
    for (name, value) in [
        (layout::setting::BOUNCES, layout::setting::CONVERGED),
        (layout::setting::SOLUTION, layout::setting::BAKED),
        (layout::setting::OWN_LIGHTS, layout::setting::LEFT_OUT),
        (layout::setting::EMISSION, layout::setting::LEFT_OUT),
    ] {
        assert!(values(name).contains(value), "{name}");
    }
}

/// The asset that SPEC.md section 9 spells out in bytes.
fn example() -> Asset {
    Asset {
        provenance: Provenance {
            tool_version: "spec".into(),
            source_hash: 1,
            seed: 2,
            ..Provenance::default()
        },
        stage: Stage { json: "{}".into() },
        points: vec![Level {
            disk_radius: 1.0,
            widenings: Vec::new(),
            support_radius: 1.5,
            positions: vec![[0.0, 0.0, 0.0], [2.0, 0.0, -1.0]],
            normals: vec![[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            albedo: vec![[0.5, 0.5, 0.5], [1.0, 0.0, 0.5]],
        }],
        senders: Some(Senders {
            counts: vec![2],
            leaf_of_point: vec![1, 1],
            importance: vec![64, 3],
            parents: vec![],
        }),
        transfer: Some(Links {
            receivers: 2,
            senders: 2,
            row_offsets: vec![0, 1, 2],
            columns: vec![1, 0],
            vectors: vec![[0.5, 0.0, -0.25], [-1.0, 0.125, 0.0]],
        }),
        bounce: Some(BounceLinks {
            level: 0,
            matrix: WeightRows {
                rows: 2,
                row_offsets: vec![0, 2, 2],
                columns: vec![0, 1],
                weights: vec![0.25, 0.5],
                row_sums: vec![0.75, 0.0],
            },
        }),
        ..Asset::default()
    }
}

/// Bytes of the example: lines of `offset  hex bytes  what`, inside the fence after the marker.
fn example_bytes() -> Vec<u8> {
    let after = SPEC
        .split_once("<!-- example -->")
        .expect("SPEC.md has an example")
        .1;
    let fence = after.split("```").nth(1).expect("the example stands in a fence");
    let mut bytes = Vec::new();
    for line in fence.lines().skip(1).filter(|line| !line.trim().is_empty()) {
        let mut words = line.split_whitespace();
        let offset = usize::from_str_radix(words.next().unwrap_or(""), 16).expect("a hexadecimal offset");
        assert_eq!(offset, bytes.len(), "offset of the line: {line}");
        let two_digits = |word: &&str| word.len() == 2 && word.chars().all(|c| c.is_ascii_hexdigit());
        // The words after a semicolon explain.
        let data = words.take_while(|word| !word.starts_with(';'));
        bytes.extend(
            data.inspect(|w| assert!(two_digits(w), "{line}"))
                .map(|w| u8::from_str_radix(w, 16).unwrap()),
        );
    }
    bytes
}

#[test]
fn the_example_file_decodes_and_is_what_we_write() {
    let bytes = example_bytes();
    let read = read_asset(&bytes, &Limits::default()).unwrap();
    let mut expected = example();
    expected.points = expected.points.iter().map(quantised_level).collect();
    if let Some(bounce) = &mut expected.bounce {
        bounce.matrix = quantised_weights(&bounce.matrix);
    }
    assert_eq!(read, expected);
    // Exact by the choice of the numbers: all of them lie on the grids, but an albedo of 1/2.
    assert_eq!(read.transfer, example().transfer);
    assert_eq!(read.points[0].positions, example().points[0].positions);
    assert_eq!(write_asset(&example()).unwrap(), bytes);
}

/// Writes the example's bytes for whoever edits SPEC.md: `cargo test -p relight-format --test spec -- --ignored --nocapture`.
#[test]
#[ignore = "a tool for editing SPEC.md"]
fn print_the_example() {
    for (i, line) in write_asset(&example()).unwrap().chunks(16).enumerate() {
        let hex: Vec<_> = line.iter().map(|byte| format!("{byte:02x}")).collect();
        println!("{:04x}  {}", i * 16, hex.join(" "));
    }
}
