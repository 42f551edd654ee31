//! What is written is what is read, up to the stated quantisation.

mod common;

use common::assets::{extended_asset, glass_asset, pane_asset, short_asset, wide_asset, widened_asset};
use common::small_asset;
use proptest::prelude::*;
use relight_format::*;

fn round_trip(asset: &Asset) -> Asset {
    read_asset(&write_asset(asset).unwrap(), &Limits::default()).unwrap()
}

/// What a reader should see, from the public quantising functions alone. Vertex normals of `small_asset` are not all
/// on the 16-bit grid: compared by angle below.
fn expected(asset: &Asset) -> Asset {
    let mut asset = asset.clone();
    asset.points = asset.points.iter().map(quantised_level).collect();
    let links = asset.transfer.as_ref();
    asset.transfer = links.map(|links| quantised_links(links, asset.coding));
    let matrices = asset.bounce.iter_mut().map(|bounce| &mut bounce.matrix);
    let matrices = matrices.chain(asset.solution.iter_mut().flat_map(|s| &mut s.channels));
    matrices.for_each(|matrix| *matrix = quantised_weights(matrix));
    asset.light_tree = asset.light_tree.as_ref().map(quantised_light_tree);
    asset.cuts = asset.cuts.as_ref().map(quantised_cuts);
    asset
}

#[test]
fn points_wider_than_their_level_come_back_and_only_they_need_a_newer_reader() {
    let asset = widened_asset();
    let back = round_trip(&asset);
    assert!(
        back.points
            .iter()
            .skip(1)
            .all(|level| !level.widenings.is_empty())
    );
    assert_eq!(back.points, expected(&asset).points);
    let grey = Asset {
        coding: Coding {
            grey: true,
            ..Coding::default()
        },
        points: short_asset().points,
        ..Asset::default()
    };
    let mut wide = grey.clone();
    wide.points[0].widenings = vec![3; wide.points[0].positions.len()];
    assert_eq!(round_trip(&wide).coding, wide.coding);
    for broken in [vec![3], vec![32; wide.points[0].positions.len()]] {
        wide.points[0].widenings = broken;
        assert!(write_asset(&wide).is_err());
    }
}

#[test]
fn panes_come_back_and_only_they_need_a_newer_reader() {
    let asset = pane_asset();
    let bytes = write_asset(&asset).unwrap();
    assert_eq!(
        read_asset(&bytes, &Limits::default()).unwrap().materials,
        asset.materials
    );
    let materials = |bytes: &[u8]| {
        let sections = common::sections_of(bytes);
        let materials = sections
            .iter()
            .find(|s| s.kind == layout::Kind::Materials as u32)
            .unwrap();
        (materials.version, materials.needs)
    };
    assert_eq!(materials(&bytes), (2, 5));
    assert_eq!(materials(&write_asset(&small_asset()).unwrap()), (1, 1));
    // Version 1 has none.
    let mut sections = common::sections_of(&bytes);
    for section in &mut sections {
        (section.version, section.needs) = (1, 1);
    }
    let error = read_asset(&common::forge(&sections), &Limits::default())
        .unwrap_err()
        .to_string();
    assert!(error.contains("an alpha mode of 0 to 2"), "{error}");
    let mut asset = asset;
    asset.materials[0].alpha_mode = AlphaMode::Pane(1.5);
    assert!(
        write_asset(&asset)
            .unwrap_err()
            .to_string()
            .contains("transmission")
    );
}

#[test]
fn extensions_of_materials_come_back_and_only_they_need_a_newer_reader() {
    let asset = extended_asset();
    let bytes = write_asset(&asset).unwrap();
    let read = read_asset(&bytes, &Limits::default()).unwrap();
    assert_eq!(read.materials, asset.materials);
    assert_eq!(read.material_extensions, asset.material_extensions);
    let sections = common::sections_of(&bytes);
    let materials = (sections.iter())
        .find(|s| s.kind == layout::Kind::Materials as u32)
        .unwrap();
    assert_eq!((materials.version, materials.needs), (3, 6));
    let refused = |change: fn(&mut Asset)| {
        let mut asset = asset.clone();
        change(&mut asset);
        write_asset(&asset).unwrap_err().to_string()
    };
    assert!(refused(|a| a.material_extensions[0].ior = 0.5).contains("indices of refraction"));
    assert!(refused(|a| a.material_extensions[0].clearcoat = 1.5).contains("within their ranges"));
    assert!(refused(|a| a.material_extensions[0].anisotropy_rotation = f32::NAN).contains("finite"));
    assert!(refused(|a| a.material_extensions[0].material = 99).contains("material"));
    assert!(refused(|a| a.material_extensions.push(a.material_extensions[0].clone())).contains("each once"));
    assert!(refused(|a| a.textures.clear()).contains("texture"));
}

#[test]
fn solid_glass_comes_back_and_only_it_needs_a_newer_reader() {
    for extended in [true, false] {
        let mut asset = glass_asset();
        if !extended {
            asset.material_extensions.clear();
        }
        let bytes = write_asset(&asset).unwrap();
        let read = read_asset(&bytes, &Limits::default()).unwrap();
        assert_eq!(read.material_extensions, asset.material_extensions);
        assert_eq!(read.material_glass, asset.material_glass);
        let sections = common::sections_of(&bytes);
        let materials = (sections.iter())
            .find(|s| s.kind == layout::Kind::Materials as u32)
            .unwrap();
        assert_eq!((materials.version, materials.needs), (4, 7));
    }
    let refused = |change: fn(&mut Asset)| {
        let mut asset = glass_asset();
        change(&mut asset);
        write_asset(&asset).unwrap_err().to_string()
    };
    assert!(refused(|a| a.material_glass[0].thickness = -1.0).contains("none negative"));
    assert!(refused(|a| a.material_glass[0].absorption[2] = f32::INFINITY).contains("finite"));
    assert!(refused(|a| a.material_glass[0].material = 99).contains("material"));
    assert!(refused(|a| a.material_glass.push(a.material_glass[0].clone())).contains("each once"));
    assert!(refused(|a| a.material_extensions[0].clearcoat = 2.0).contains("within their ranges"));
}

#[test]
fn every_section_survives() {
    let asset = small_asset();
    let mut read = round_trip(&asset);
    let normals = read.geometry.meshes[0].normals.clone().unwrap();
    for (a, b) in asset.geometry.meshes[0]
        .normals
        .as_ref()
        .unwrap()
        .iter()
        .zip(&normals)
    {
        let distance = (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f32>().sqrt();
        assert!(distance <= 6.6e-5, "the octahedral bound for 16 bits");
    }
    read.geometry.meshes[0].normals = asset.geometry.meshes[0].normals.clone();
    assert_eq!(read, expected(&asset));
}

#[test]
fn writing_what_was_read_gives_the_same_bytes() {
    let bytes = write_asset(&small_asset()).unwrap();
    assert_eq!(write_asset(&small_asset()).unwrap(), bytes);
    assert_eq!(
        write_asset(&read_asset(&bytes, &Limits::default()).unwrap()).unwrap(),
        bytes
    );
}

/// A file of specification version 1, written once and never again: every later version reads it.
const VERSION_1: &[u8] = include_bytes!("fixtures/version_1.relight");

#[test]
fn the_first_version_is_still_read() {
    let summary = summarise(VERSION_1).unwrap();
    assert_eq!((summary.format_version, summary.sections.len()), (1, 11));
    assert!(
        summary
            .sections
            .iter()
            .any(|s| s.codec == Some(layout::Codec::Zstd))
    );
    assert_eq!(
        read_asset(VERSION_1, &Limits::default()).unwrap(),
        round_trip(&Asset {
            // The first files had none.
            light_tree: None,
            cuts: None,
            separations: None,
            ..small_asset()
        })
    );
}

/// Fixtures are of earlier builds, with readers and writers of their own: what was read of one is written with the same raw
/// bytes in every section. (zstd may pack them otherwise.)
#[test]
fn what_every_fixture_holds_is_written_as_it_was() {
    let raw = |file: &[u8]| -> Vec<_> {
        let sections = common::sections_of(file);
        sections.iter().map(|s| (s.kind, s.version, s.raw())).collect()
    };
    let files = common::fixtures();
    for (name, bytes) in &files {
        let asset = read_asset(bytes, &Limits::default()).unwrap();
        assert!(raw(&write_asset(&asset).unwrap()) == raw(bytes), "{name}");
    }
    assert!(files.len() >= 6);
}

#[test]
fn an_asset_of_nothing_holds_provenance_alone() {
    let asset = Asset::default();
    assert_eq!(round_trip(&asset), asset);
    let summary = summarise(&write_asset(&asset).unwrap()).unwrap();
    assert_eq!(
        summary
            .sections
            .iter()
            .map(|s| s.name.as_str())
            .collect::<Vec<_>>(),
        ["provenance"]
    );
}

#[test]
fn a_summary_names_sections_and_adds_up_to_the_file() {
    let bytes = write_asset(&small_asset()).unwrap();
    let summary = summarise(&bytes).unwrap();
    let names: Vec<_> = summary.sections.iter().map(|s| s.name.as_str()).collect();
    let all = "provenance geometry materials textures stage points links_transfer links_bounce links_solution estimates senders light_tree cuts parted";
    assert_eq!(names.join(" "), all);
    let stored: u64 = summary.sections.iter().map(|s| s.stored_bytes).sum();
    // Header of 56 bytes, table entries of 48.
    assert_eq!(56 + stored + 48 * 14, bytes.len() as u64);
    assert_eq!(summary.provenance, small_asset().provenance);
}

#[test]
fn files_are_written_whole_and_read_back() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("a.relight");
    write_file(&path, &Asset::default()).unwrap();
    write_file(&path, &small_asset()).unwrap();
    assert_eq!(
        std::fs::read(&path).unwrap(),
        write_asset(&small_asset()).unwrap()
    );
    assert_eq!(
        read_file(&path, &Limits::default()).unwrap(),
        round_trip(&small_asset())
    );
    assert_eq!(
        read_summary(&path).unwrap(),
        summarise(&std::fs::read(&path).unwrap()).unwrap()
    );
    // An asset that may not be written leaves what was there.
    let mut broken = small_asset();
    broken.points[0].support_radius = f32::NAN;
    assert!(matches!(write_file(&path, &broken), Err(FormatError::Invalid(_))));
    assert_eq!(
        read_file(&path, &Limits::default()).unwrap(),
        round_trip(&small_asset())
    );
    assert_eq!(
        std::fs::read_dir(directory.path()).unwrap().count(),
        1,
        "no partial file is left"
    );
}

#[test]
fn file_errors_name_the_file() {
    let directory = tempfile::tempdir().unwrap();
    let missing = directory.path().join("missing/a.relight");
    for error in [
        write_file(&missing, &Asset::default()).unwrap_err(),
        read_file(&missing, &Limits::default()).unwrap_err(),
        read_summary(&missing).unwrap_err(),
        write_file(directory.path(), &Asset::default()).unwrap_err(),
    ] {
        assert!(matches!(error, FormatError::Io { .. }));
        assert!(
            error.to_string().contains(directory.path().to_str().unwrap()),
            "{error}"
        );
    }
}

#[cfg(unix)]
#[test]
fn a_symbolic_link_is_followed() {
    let directory = tempfile::tempdir().unwrap();
    let [real, link] = ["real.relight", "link.relight"].map(|name| directory.path().join(name));
    write_file(&real, &Asset::default()).unwrap();
    std::os::unix::fs::symlink(&real, &link).unwrap();
    write_file(&link, &small_asset()).unwrap();
    assert!(link.is_symlink());
    assert_eq!(read_summary(&real).unwrap().provenance, small_asset().provenance);
}

/// Rows of any links over `senders` columns.
fn sparse_rows(senders: u32) -> impl Strategy<Value = (Vec<u32>, Vec<u32>)> {
    prop::collection::vec(prop::collection::btree_set(0..senders, 0..12), 0..20).prop_map(|rows| {
        let mut offsets = vec![0];
        let mut columns = Vec::new();
        for row in rows {
            columns.extend(row);
            offsets.push(columns.len() as u32);
        }
        (offsets, columns)
    })
}

/// Senders on one level of `clusters`, over `points` finest points.
fn one_level(clusters: u32, points: u32) -> Option<Senders> {
    Some(Senders {
        counts: vec![clusters],
        importance: (0..points).map(|i| (i * 5 % 65) as u8).collect(),
        leaf_of_point: (0..points).map(|i| i * 7 % clusters).collect(),
        parents: Vec::new(),
    })
}

fn points(count: usize) -> Level {
    Level {
        disk_radius: 0.1,
        widenings: Vec::new(),
        support_radius: 0.2,
        positions: (0..count)
            .map(|i| [i as f32 * 0.37, (i % 7) as f32, -2.0])
            .collect(),
        normals: vec![[0.0, 1.0, 0.0]; count],
        albedo: vec![[0.5; 3]; count],
    }
}

fn asset_of_cuts(lights: LightSamples, cuts: Cuts) -> Asset {
    Asset {
        points: vec![points(cuts.row_offsets.len() - 1)],
        light_tree: Some(LightTree { lights }),
        cuts: Some(cuts),
        ..Asset::default()
    }
}

/// Files of three versions with cuts at the vertices of meshes: the cuts are refused by name, and the rest is still read.
#[test]
fn cuts_at_vertices_are_refused_and_the_rest_of_their_files_is_read() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/vertices");
    for (name, written) in [
        ("version_1_surface", wide_asset()),
        ("version_2_short", short_asset()),
        ("version_3_surface", wide_asset()),
    ] {
        let file = folder.join(format!("{name}.relight"));
        let error = read_file(&file, &Limits::default()).unwrap_err();
        assert!(matches!(error, FormatError::Unsupported(_)), "{error}");
        let said = error.to_string();
        assert!(
            said.contains("cuts, byte 0") && said.contains("at vertices") && said.contains("bake it again"),
            "{said}"
        );
        assert_eq!(
            Content::from_counts(&read_summary(&file).unwrap().provenance.counts),
            None
        );
        let others: Vec<layout::Kind> = (layout::Kind::ALL.into_iter())
            .filter(|kind| *kind != layout::Kind::Cuts)
            .collect();
        let read = read_parts(&file, &Limits::default(), &others).unwrap();
        let today = round_trip(&written);
        assert!(
            read.transfer == today.transfer && read.points == today.points,
            "{name}"
        );
        assert!(
            read.geometry == today.geometry && read.materials == today.materials,
            "{name}"
        );
    }
}

#[test]
fn values_that_no_code_holds_are_refused() {
    let cuts = |value: f32, sigma: f32| Cuts {
        sigma,
        unit: 1.0,
        row_offsets: vec![0, 1],
        heights: vec![8],
        values: vec![value],
    };
    let write = |value, sigma| write_asset(&asset_of_cuts(common::directions(), cuts(value, sigma)));
    // 16 steps per unit at height 8 and σ = 2; 2¹⁶ for the smallest σ.
    for (most, sigma) in [(524_287.94, 2.0), (127.999, f32::MIN_POSITIVE)] {
        write(most, sigma).unwrap();
        let error = write(most * 1.01, sigma).unwrap_err().to_string();
        assert!(error.contains("a value of 0 to"), "{error}");
    }
    for value in [f32::NAN, f32::INFINITY, -1.0] {
        assert!(write(value, 2.0).is_err());
    }
}

#[test]
fn cuts_take_memory_that_is_counted() {
    // A hundred sites that see every light alone: 25,600 elements of 5 bytes in memory.
    let cuts = Cuts {
        sigma: 2.0,
        unit: 1.0,
        row_offsets: (0..=100).map(|site| 256 * site).collect(),
        heights: vec![0; 25_600],
        values: vec![1.0; 25_600],
    };
    let bytes = write_asset(&asset_of_cuts(common::directions(), cuts)).unwrap();
    assert!(bytes.len() < 3000);
    let read = |total_bytes: u64| {
        let limits = Limits {
            total_bytes,
            ..Limits::default()
        };
        read_asset(&bytes, &limits)
    };
    // Beside them stand the raw bytes of the section, offsets, and less than 8,000 bytes of tree, points and provenance.
    let arrays = 5 * 25_600 + 4 * 101 + 25_620;
    let error = read(arrays).unwrap_err();
    assert!(matches!(error, FormatError::LimitExceeded(_)), "{error}");
    assert!(error.to_string().contains("cuts"), "{error}");
    assert!(read(arrays + 8000).is_ok());
}

/// Rows of any cuts over 256 lights: at each leaf the node that fits, lowered by a digit, with a value.
fn any_cuts() -> impl Strategy<Value = Cuts> {
    let row = prop::collection::vec((0u8..5, 0.0f32..3.0), 256);
    (prop::collection::vec(row, 1..8), -3.0f32..3.0, any::<bool>()).prop_map(|(rows, log_sigma, seen)| {
        let mut cuts = Cuts {
            sigma: log_sigma.exp(),
            unit: 1.0,
            row_offsets: vec![0],
            ..Cuts::default()
        };
        for row in rows {
            let mut start = 0u32;
            let mut choices = row.iter();
            while start < 256 {
                let &(less, value) = choices.next().unwrap();
                let height = start.trailing_zeros().min(8).saturating_sub(u32::from(less));
                cuts.heights.push(height as u8);
                // Visibility is mostly 0 or 1.
                cuts.values.push(if seen {
                    (value - 1.0).clamp(0.0, 1.0)
                } else {
                    value
                });
                start += 1 << height;
            }
            cuts.row_offsets.push(cuts.heights.len() as u32);
        }
        cuts
    })
}

proptest! {
    #[test]
    fn cuts_survive_within_half_a_step(cuts in any_cuts()) {
        let asset = asset_of_cuts(common::directions(), cuts.clone());
        let read = round_trip(&asset);
        let stored = read.cuts.as_ref().unwrap();
        prop_assert_eq!(stored, &quantised_cuts(&cuts));
        prop_assert_eq!(&quantised_cuts(stored), stored);
        prop_assert_eq!(write_asset(&read).unwrap(), write_asset(&asset).unwrap());
        for i in 0..cuts.heights.len() {
            let steps = (2.0 * f64::from(1u32 << cuts.heights[i]).sqrt() / f64::from(cuts.sigma)).ceil().max(1.0);
            let error = (f64::from(cuts.values[i]) - f64::from(stored.values[i])).abs();
            // Half a step, and the rounding of values below 4 to f32.
            prop_assert!(error <= 0.5 / steps + 2.4e-7);
            prop_assert!(error == 0.0 || ![0.0, 1.0].contains(&cuts.values[i]));
        }
    }

    #[test]
    fn surface_lights_survive_within_their_bounds(
        unit in prop::collection::vec((prop::array::uniform3(-1.0f32..1.0), -1.0f32..1.0, 0.0f32..6.3), 256),
        log_area in -20.0f32..3.0, scale in -20i32..20,
    ) {
        let scale = 2f32.powi(scale);
        let area = log_area.exp() * scale * scale;
        let positions: Vec<_> = unit.iter().map(|(p, ..)| p.map(|c| c * scale)).collect();
        let normals: Vec<_> = unit.iter().map(|&(_, z, phi)| {
            let s = (1.0 - z * z).sqrt();
            [s * phi.cos(), z, s * phi.sin()]
        }).collect();
        let tree = LightTree { lights: LightSamples::Surface { area, positions: positions.clone(), normals: normals.clone() } };
        let asset = Asset { light_tree: Some(tree.clone()), ..Asset::default() };
        let read = round_trip(&asset);
        prop_assert_eq!(read.light_tree.as_ref(), Some(&quantised_light_tree(&tree)));
        prop_assert_eq!(write_asset(&read).unwrap(), write_asset(&asset).unwrap());
        let Some(LightTree { lights: LightSamples::Surface { positions: p, normals: n, .. } }) = read.light_tree else {
            panic!("other lights");
        };
        let distance = |a: [f32; 3], b: [f32; 3]| {
            (0..3).map(|i| (f64::from(a[i]) - f64::from(b[i])).powi(2)).sum::<f64>().sqrt()
        };
        for i in 0..256 {
            prop_assert!(distance(positions[i], p[i]) <= f64::from(area).sqrt() / 256.0);
            prop_assert!(distance(normals[i], n[i]) <= 1.1e-3);
        }
    }

    #[test]
    fn the_order_of_directions_is_exact(order in Just((0..1024u32).collect::<Vec<_>>()).prop_shuffle()) {
        let asset = Asset {
            light_tree: Some(LightTree { lights: LightSamples::Environment { order } }),
            ..Asset::default()
        };
        prop_assert_eq!(round_trip(&asset), asset);
    }

    #[test]
    fn links_survive_quantised((row_offsets, columns) in sparse_rows(300), seed in any::<u32>()) {
        let rows = row_offsets.len() as u32 - 1;
        let hash = |i: u32| (i.wrapping_mul(2_654_435_761) ^ seed).wrapping_mul(2_246_822_519);
        let component = |i: u32| (f64::from(hash(i)) / f64::from(u32::MAX) * 4.0 - 2.0) as f32;
        let vectors: Vec<_> =
            (0..columns.len() as u32).map(|i| [0, 1, 2].map(|k| component(3 * i + k))).collect();
        let links = Links { receivers: 320, senders: 300, row_offsets, columns, vectors };
        // Rows after the last are empty.
        let mut links = links;
        let last = *links.row_offsets.last().unwrap();
        links.row_offsets.extend((rows..320).map(|_| last));
        let asset = Asset {
            points: vec![points(300), points(20)],
            senders: one_level(300, 20),
            transfer: Some(links.clone()),
            ..Asset::default()
        };
        let read = round_trip(&asset);
        let stored = read.transfer.as_ref().unwrap();
        prop_assert_eq!(stored, &quantised_links(&links, Coding::default()));
        prop_assert_eq!(write_asset(&read).unwrap(), write_asset(&asset).unwrap());
        for (v, q) in links.vectors.iter().zip(&stored.vectors) {
            prop_assert_eq!(*q, quantised_vector(*v, Coding::default()), "each vector for itself");
        }
    }

    #[test]
    fn bounce_rows_keep_their_sums((row_offsets, columns) in sparse_rows(20), scale in 0.01f32..0.08) {
        let rows = row_offsets.len() - 1;
        let mut row_offsets = row_offsets;
        let last = row_offsets[rows];
        row_offsets.extend((rows..20).map(|_| last));
        let weights: Vec<f32> = (0..columns.len()).map(|i| scale * (1 + i * 7 % 11) as f32 / 11.0).collect();
        let row_sums = row_offsets
            .windows(2)
            .map(|p| weights[p[0] as usize..p[1] as usize].iter().map(|&w| f64::from(w)).sum::<f64>() as f32)
            .collect();
        let matrix = WeightRows { rows: 20, row_offsets, columns, weights, row_sums };
        let asset = Asset {
            points: vec![points(20)],
            senders: one_level(20, 20),
            bounce: Some(BounceLinks { level: 0, matrix: matrix.clone() }),
            ..Asset::default()
        };
        let read = round_trip(&asset);
        let stored = &read.bounce.as_ref().unwrap().matrix;
        prop_assert_eq!(stored, &quantised_weights(&matrix));
        prop_assert_eq!(write_asset(&read).unwrap(), write_asset(&asset).unwrap());
        prop_assert_eq!(&stored.row_sums, &matrix.row_sums);
        for (p, &sum) in stored.row_offsets.windows(2).zip(&stored.row_sums) {
            let total: f64 = stored.weights[p[0] as usize..p[1] as usize].iter().map(|&w| f64::from(w)).sum();
            // Each weight is rounded to f32 once.
            prop_assert!((total - f64::from(sum)).abs() <= 6e-8 * f64::from(sum));
        }
    }

    #[test]
    fn levels_survive_within_their_bounds(
        unit in prop::collection::vec((prop::array::uniform3(-1.0f32..1.0), -1.0f32..1.0, 0.0f32..6.3), 0..60),
        radius in 0.001f32..0.5, scale in -20i32..20,
    ) {
        let scale = 2f32.powi(scale);
        let level = Level {
            disk_radius: radius * scale,
            widenings: Vec::new(),
            support_radius: 2.0 * radius * scale,
            positions: unit.iter().map(|(p, ..)| p.map(|c| c * scale)).collect(),
            normals: unit.iter().map(|&(_, z, phi)| {
                let s = (1.0 - z * z).sqrt();
                [s * phi.cos(), z, s * phi.sin()]
            }).collect(),
            albedo: unit.iter().map(|(p, ..)| p.map(f32::abs)).collect(),
        };
        let asset = Asset { points: vec![level.clone()], ..Asset::default() };
        let read = round_trip(&asset);
        let stored = &read.points[0];
        prop_assert_eq!(stored, &quantised_level(&level));
        prop_assert_eq!(write_asset(&read).unwrap(), write_asset(&asset).unwrap());
        let distance = |a: [f32; 3], b: [f32; 3]| {
            (0..3).map(|i| (f64::from(a[i]) - f64::from(b[i])).powi(2)).sum::<f64>().sqrt()
        };
        for i in 0..unit.len() {
            prop_assert!(distance(level.positions[i], stored.positions[i]) <= f64::from(level.disk_radius) / 256.0);
            prop_assert!(distance(level.normals[i], stored.normals[i]) <= 1.1e-3);
            prop_assert!((0..3).all(|c| (level.albedo[i][c] - stored.albedo[i][c]).abs() <= 1.9e-4));
        }
    }

    #[test]
    fn meshes_keep_their_bits_and_their_triangles(
        bits in prop::collection::vec(prop::array::uniform5(any::<u32>()), 1..60),
        corners in prop::collection::vec(prop::array::uniform3(any::<u32>()), 0..60),
    ) {
        let float = |b: u32| Some(f32::from_bits(b)).filter(|f| f.is_finite()).unwrap_or(-0.0);
        let vertices = bits.len() as u32;
        let mesh = Mesh {
            positions: bits.iter().map(|b| [float(b[0]), float(b[1]), float(b[2])]).collect(),
            uvs: vec![bits.iter().map(|b| [float(b[3]), float(b[4])]).collect(); 2],
            triangles: corners.iter().map(|t| t.map(|i| i % vertices)).collect(),
            ..Mesh::default()
        };
        let geometry = Geometry { meshes: vec![mesh], instances: vec![] };
        let asset = Asset { geometry, materials: vec![Material::default()], ..Asset::default() };
        let read = round_trip(&asset);
        let to_bits = |mesh: &Mesh| {
            let positions: Vec<_> = mesh.positions.iter().map(|p| p.map(f32::to_bits)).collect();
            let uvs: Vec<Vec<_>> = mesh.uvs.iter().map(|s| s.iter().map(|p| p.map(f32::to_bits)).collect()).collect();
            (positions, uvs, mesh.triangles.clone())
        };
        prop_assert_eq!(to_bits(&read.geometry.meshes[0]), to_bits(&asset.geometry.meshes[0]));
    }
}
