//! Files that are cut, flipped, forged or from the future are refused, and never harm the reader.

mod common;

use common::{Forged, forge, reseal_header, sections_of, small_asset};
use relight_format::*;

fn read(bytes: &[u8]) -> Result<Asset> {
    read_asset(bytes, &Limits::default())
}

/// The error's class and evidence.
fn fault(error: &FormatError) -> (&'static str, &Fault) {
    match error {
        FormatError::Invalid(fault) => ("invalid", fault),
        FormatError::Unsupported(fault) => ("unsupported", fault),
        FormatError::LimitExceeded(fault) => ("limit", fault),
        other => panic!("no fault: {other}"),
    }
}

#[test]
fn the_independent_writer_agrees_with_ours() {
    let bytes = write_asset(&small_asset()).unwrap();
    assert_eq!(forge(&sections_of(&bytes)), bytes);
}

#[test]
fn every_strict_prefix_is_refused() {
    let bytes = write_asset(&small_asset()).unwrap();
    for length in 0..bytes.len() {
        assert!(
            read(&bytes[..length]).is_err(),
            "{length} of {} bytes",
            bytes.len()
        );
        assert!(summarise(&bytes[..length]).is_err());
    }
}

#[test]
fn a_longer_file_is_refused() {
    let mut bytes = write_asset(&small_asset()).unwrap();
    bytes.push(0);
    assert!(read(&bytes).is_err());
}

#[test]
fn every_flipped_bit_is_refused() {
    let mut bytes = write_asset(&small_asset()).unwrap();
    for bit in 0..bytes.len() * 8 {
        bytes[bit / 8] ^= 1 << (bit % 8);
        assert!(read(&bytes).is_err(), "bit {bit}");
        bytes[bit / 8] ^= 1 << (bit % 8);
    }
    assert!(read(&bytes).is_ok());
}

/// Behind right checksums the decoders stand alone: any byte of any section's raw bytes replaced, and every raw prefix,
/// gives an error or a valid asset, never a panic.
#[test]
fn forged_contents_never_panic() {
    let sections = sections_of(&write_asset(&small_asset()).unwrap());
    for i in 0..sections.len() {
        let raw = sections[i].raw();
        let try_raw = |raw: &[u8]| {
            let mut sections = sections.clone();
            sections[i] = sections[i].with_raw(raw.to_vec());
            if let Ok(asset) = read(&forge(&sections)) {
                asset.validate().unwrap();
                write_asset(&asset).unwrap();
            }
        };
        for length in 0..raw.len() {
            try_raw(&raw[..length]);
        }
        for at in 0..raw.len() {
            for value in [0, 1, 3, 0x7f, 0x80, 0xff] {
                let mut changed = raw.clone();
                changed[at] = value;
                try_raw(&changed);
            }
        }
    }
}

fn with(extra: Forged) -> Vec<u8> {
    let mut sections = sections_of(&write_asset(&small_asset()).unwrap());
    sections.push(extra);
    forge(&sections)
}

#[test]
fn an_unknown_optional_section_is_skipped_but_still_checked() {
    let extra = Forged {
        flags: 0,
        codec: 77,
        needs: 9,
        ..Forged::new(1000, b"from the future".to_vec())
    };
    let mut bytes = with(extra);
    let expected = read(&write_asset(&small_asset()).unwrap()).unwrap();
    assert_eq!(read(&bytes).unwrap(), expected);
    let sections = summarise(&bytes).unwrap().sections;
    assert_eq!(sections.last().unwrap().name, "unknown_1000");
    let at = bytes.windows(6).position(|w| w == b"future").unwrap();
    bytes[at] ^= 1;
    assert_eq!(fault(&read(&bytes).unwrap_err()).0, "invalid");
}

#[test]
fn an_unknown_required_section_is_refused_with_the_version_it_needs() {
    let error = read(&with(Forged {
        needs: 9,
        ..Forged::new(1000, vec![1, 2, 3])
    }))
    .unwrap_err();
    assert_eq!(fault(&error).0, "unsupported");
    assert!(
        error.to_string().contains("needs a reader of format version 9"),
        "{error}"
    );
}

#[test]
fn newer_versions_of_known_sections_count_as_unknown() {
    let mut sections = sections_of(&write_asset(&small_asset()).unwrap());
    sections[9].version = 2;
    assert_eq!(
        read(&forge(&sections)).unwrap().estimates,
        None,
        "estimates are optional"
    );
    sections[5].version = 4;
    assert_eq!(fault(&read(&forge(&sections)).unwrap_err()).0, "unsupported");
}

#[test]
fn a_newer_container_is_refused_with_its_version() {
    let mut bytes = write_asset(&small_asset()).unwrap();
    let newer = layout::SPEC_VERSION + 1;
    bytes[12] = newer as u8;
    reseal_header(&mut bytes);
    let error = read(&bytes).unwrap_err();
    assert_eq!(fault(&error).0, "unsupported");
    assert!(
        error
            .to_string()
            .contains(&format!("needs a reader of format version {newer}")),
        "{error}"
    );
}

#[test]
fn what_is_no_asset_is_named_so() {
    for bytes in [
        &b""[..],
        b"glTF",
        b"PK\x03\x04 and more than fifty-six bytes of something else entirely",
    ] {
        let error = read(bytes).unwrap_err();
        assert!(error.to_string().contains("the magic"), "{error}");
    }
}

#[test]
fn bombs_are_refused_by_their_declared_length() {
    let zeros = vec![0; 1 << 20];
    let stored = zstd::bulk::compress(&zeros, 19).unwrap();
    assert!(
        stored.len() * 1024 < zeros.len(),
        "zstd packs zeros far tighter than any real section"
    );
    let bomb = |raw_bytes: u64| {
        let mut sections = sections_of(&write_asset(&small_asset()).unwrap());
        sections[4] = Forged {
            codec: 1,
            raw_bytes,
            stored: stored.clone(),
            ..sections[4].clone()
        };
        read(&forge(&sections)).unwrap_err()
    };
    assert_eq!(fault(&bomb(1 << 20)).0, "limit");
    assert_eq!(fault(&bomb(u64::MAX)).0, "limit");
    // A length that lies within the ratio does not fit the frame.
    assert_eq!(fault(&bomb(stored.len() as u64 * 1000)).0, "invalid");
}

#[test]
fn limits_hold() {
    let bytes = write_asset(&small_asset()).unwrap();
    let read = |limits: Limits| read_asset(&bytes, &limits);
    let all = Limits::default();
    for limits in [
        Limits {
            file_bytes: bytes.len() as u64 - 1,
            ..all
        },
        Limits {
            section_bytes: 100,
            ..all
        },
        Limits {
            total_bytes: 1000,
            ..all
        },
    ] {
        assert_eq!(fault(&read(limits).unwrap_err()).0, "limit");
    }
    assert!(
        read(Limits {
            file_bytes: bytes.len() as u64,
            ..all
        })
        .is_ok()
    );
}

/// Counts of 2³² − 1 elements with a few bytes behind them.
#[test]
fn declared_counts_without_bytes_are_refused() {
    let base = sections_of(&write_asset(&small_asset()).unwrap());
    for kind in [2u32, 3, 4, 6, 7, 8, 9, 10, 12, 13] {
        let mut sections = base.clone();
        let section = sections.iter_mut().find(|s| s.kind == kind).unwrap();
        *section = section.with_raw(vec![0xff; 64]);
        assert_eq!(
            fault(&read(&forge(&sections)).unwrap_err()).0,
            "invalid",
            "kind {kind}"
        );
    }
}

#[test]
fn tables_that_overlap_repeat_or_gape_are_refused() {
    let good = write_asset(&small_asset()).unwrap();
    let sections = sections_of(&good);
    let mut twice = sections.clone();
    twice.push(sections[9].clone());
    assert!(read(&forge(&twice)).is_err(), "a kind twice");
    assert!(read(&forge(&sections[1..])).is_err(), "no provenance");
    assert!(read(&forge(&[])).is_err(), "nothing");
    let mut swapped = sections.clone();
    swapped.swap(0, 1);
    assert!(read(&forge(&swapped)).is_err(), "provenance not first");
    // A section that starts a byte late, table checksum and header resealed.
    let table = u64::from_le_bytes(good[24..32].try_into().unwrap()) as usize;
    for (entry, delta) in [(1, 1i64), (1, -1), (9, 1)] {
        let mut bytes = good.clone();
        let at = table + 48 * entry + 16;
        let offset = i64::from_le_bytes(bytes[at..at + 8].try_into().unwrap()) + delta;
        bytes[at..at + 8].copy_from_slice(&offset.to_le_bytes());
        let checksum = xxhash_rust::xxh3::xxh3_64(&bytes[table..]);
        bytes[40..48].copy_from_slice(&checksum.to_le_bytes());
        reseal_header(&mut bytes);
        let error = read(&bytes).unwrap_err();
        assert_eq!(fault(&error).0, "invalid", "{error}");
    }
}

fn environment(order: Vec<u32>) -> LightTree {
    LightTree {
        lights: LightSamples::Environment { order },
    }
}

/// Puts a wall of lights in place of the environment, changed.
fn on_wall(asset: &mut Asset, change: impl Fn(&mut f32, &mut Vec<[f32; 3]>, &mut Vec<[f32; 3]>)) {
    let mut lights = common::wall();
    if let LightSamples::Surface {
        area,
        positions,
        normals,
    } = &mut lights
    {
        change(area, positions, normals);
    }
    asset.light_tree = Some(LightTree { lights });
}

fn separations(asset: &mut Asset) -> &mut Separations {
    asset.separations.as_mut().unwrap()
}

fn cuts(asset: &mut Asset) -> &mut Cuts {
    asset.cuts.as_mut().unwrap()
}

#[test]
fn structures_that_break_a_rule_are_not_written() {
    type Break = fn(&mut Asset);
    let breaks: [(&str, &str, Break); 48] = [
        ("geometry", "vertex indices", |a| {
            a.geometry.meshes[0].triangles[1][2] = 4
        }),
        ("geometry", "unit normals", |a| {
            a.geometry.meshes[0].normals.as_mut().unwrap()[0] = [0.0; 3]
        }),
        ("geometry", "finite positions", |a| {
            a.geometry.meshes[0].positions[0][1] = f32::INFINITY
        }),
        ("geometry", "mesh below", |a| a.geometry.instances[0].mesh = 1),
        ("geometry", "material below", |a| {
            a.geometry.meshes[0].material = 1
        }),
        ("materials", "texture below", |a| a.textures.clear()),
        ("materials", "finite", |a| a.materials[0].roughness = f32::NAN),
        ("points", "albedo", |a| a.points[0].albedo[1][0] = 1.01),
        ("points", "normals, one per point", |a| {
            a.points[0].normals.truncate(1)
        }),
        ("points", "radius", |a| a.points[1].disk_radius = 0.0),
        ("links_transfer", "rising", |a| {
            a.transfer.as_mut().unwrap().columns.swap(1, 2)
        }),
        ("links_transfer", "below 5", |a| {
            a.transfer.as_mut().unwrap().columns[4] = 5
        }),
        ("links_bounce", "row sum", |a| {
            a.bounce.as_mut().unwrap().matrix.row_sums[0] = 1.5
        }),
        ("links_bounce", "sum to", |a| {
            a.bounce.as_mut().unwrap().matrix.row_sums[0] = 0.3
        }),
        ("links_bounce", "sender level below 2", |a| {
            a.bounce.as_mut().unwrap().level = 2
        }),
        ("links_bounce", "3 rows", |a| a.bounce.as_mut().unwrap().level = 1),
        ("links_solution", "row sum", |a| {
            a.solution.as_mut().unwrap().channels[2].row_sums[1] = f32::INFINITY
        }),
        ("links_solution", "1 or 3 channels", |a| {
            a.solution.as_mut().unwrap().channels.truncate(2)
        }),
        ("links_transfer", "one per cluster", |a| a.senders = None),
        ("parted", "pairs in ascending order", |a| {
            separations(a).pairs[1] = [2, 1]
        }),
        ("parted", "a point of a coarser level", |a| {
            separations(a).pairs[0] = [1, 0]
        }),
        ("parted", "a point of a coarser level", |a| {
            separations(a).pairs[1][1] = 2
        }),
        ("parted", "a point of a coarser level", |a| {
            separations(a).pairs[1][0] = 5
        }),
        ("parted", "finest points in ascending order", |a| {
            separations(a).near[1] = 0
        }),
        ("parted", "a finest point below 3", |a| separations(a).near[1] = 3),
        ("senders", "1 to 2 sender levels", |a| {
            a.senders.as_mut().unwrap().counts.clear()
        }),
        ("senders", "2 clusters", |a| {
            a.senders.as_mut().unwrap().counts[0] = 3
        }),
        ("senders", "one per finest point", |a| {
            a.senders.as_mut().unwrap().leaf_of_point.push(0)
        }),
        ("senders", "a cluster below 3", |a| {
            a.senders.as_mut().unwrap().leaf_of_point[2] = 3
        }),
        ("senders", "levels of parents", |a| {
            a.senders.as_mut().unwrap().parents.clear()
        }),
        ("senders", "a cluster below 2", |a| {
            a.senders.as_mut().unwrap().parents[0][1] = 2
        }),
        ("light_tree", "a power of two", |a| {
            a.light_tree = Some(environment(vec![0, 1]))
        }),
        ("light_tree", "a power of two", |a| {
            a.light_tree = Some(environment(vec![]))
        }),
        ("light_tree", "a power of two", |a| {
            a.light_tree = Some(environment((0..300).collect()))
        }),
        ("light_tree", "256 once, found 7", |a| {
            a.light_tree = Some(environment(vec![7; 256]))
        }),
        ("light_tree", "256 once, found 256", |a| {
            a.light_tree = Some(environment((1..=256).collect()))
        }),
        ("light_tree", "area above 0", |a| {
            on_wall(a, |area, _, _| *area = 0.0)
        }),
        ("light_tree", "normals, one per light", |a| {
            on_wall(a, |_, _, normals| normals.truncate(255))
        }),
        ("light_tree", "finite positions", |a| {
            on_wall(a, |_, positions, _| positions[9][2] = f32::NAN)
        }),
        ("light_tree", "unit normals", |a| {
            on_wall(a, |_, _, normals| normals[255] = [1.0; 3])
        }),
        ("cuts", "a light tree", |a| a.light_tree = None),
        ("cuts", "sigma above 0", |a| cuts(a).sigma = 0.0),
        ("cuts", "unit above 0", |a| cuts(a).unit = f32::INFINITY),
        ("cuts", "at least one site", |a| cuts(a).row_offsets = vec![0]),
        ("cuts", "leaves that can start at leaf 1", |a| {
            cuts(a).heights[2] = 1
        }),
        ("cuts", "leaves in all", |a| cuts(a).heights[0] = 7),
        ("cuts", "a value of 0 to", |a| cuts(a).values[3] = -0.1),
        ("cuts", "one per finest point", |a| {
            let cuts = cuts(a);
            cuts.row_offsets.pop();
            let end = cuts.row_offsets[cuts.row_offsets.len() - 1] as usize;
            cuts.heights.truncate(end);
            cuts.values.truncate(end);
        }),
    ];
    for (section, expected, apply) in breaks {
        let mut asset = small_asset();
        apply(&mut asset);
        let error = write_asset(&asset).unwrap_err();
        let (class, fault) = fault(&error);
        assert_eq!((class, fault.section.as_str()), ("invalid", section), "{error}");
        assert!(
            fault.expected.contains(expected) || error.to_string().contains(expected),
            "{error}"
        );
    }
}
