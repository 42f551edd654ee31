//! `relight export`: other tools read what an asset holds.

use crate::stage::{TINY, bake_json, complaint, cornell, data, folder, json, names, relight};
use relight_format::{Asset, LightSamples, Limits, read_file};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use tempfile::TempDir;

/// The Cornell box with cuts of the fewest lights, of directions or of surfaces.
fn with_cuts(mode: &'static str) -> &'static Path {
    static ASSETS: [OnceLock<(TempDir, PathBuf)>; 2] = [const { OnceLock::new() }; 2];
    let place = usize::from(mode == "indirect");
    &ASSETS[place]
        .get_or_init(|| {
            let folder = folder();
            let asset = folder.path().join("cuts.relight");
            let options = [&TINY[..], &["--cuts", mode, "--cut-lights", "256"]].concat();
            bake_json(&data("cornell.glb"), &asset, &options);
            (folder, asset)
        })
        .1
}

fn export(asset: &Path, what: &str, folder: &Path) -> Value {
    let output = relight()
        .arg("export")
        .arg(asset)
        .args(["--what", what, "--json", "-o"])
        .arg(folder)
        .assert()
        .success()
        .get_output()
        .clone();
    let said = json(&output.stdout);
    let mut listed: Vec<String> = said["files"]
        .as_array()
        .unwrap()
        .iter()
        .map(|f| f["file"].as_str().unwrap().to_owned())
        .collect();
    listed.sort();
    assert_eq!(names(folder), listed, "nothing but what is said is there");
    said
}

/// Type, shape and data of an .npy file, read as numpy's own description of the format has it.
fn npy(file: &Path) -> (String, Vec<usize>, Vec<u8>) {
    let bytes = std::fs::read(file).unwrap();
    assert_eq!(&bytes[..8], b"\x93NUMPY\x01\x00");
    let end = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    assert!(end.is_multiple_of(64) && bytes[end - 1] == b'\n');
    let header = std::str::from_utf8(&bytes[10..end]).unwrap();
    let between = |start: &str, stop: &str| {
        let rest = header.split_once(start).unwrap().1;
        rest.split_once(stop).unwrap().0.to_owned()
    };
    assert!(header.contains("'fortran_order': False"));
    let shape: Vec<usize> = between("'shape': (", ")")
        .split(',')
        .filter(|n| !n.is_empty())
        .map(|n| n.parse().unwrap())
        .collect();
    (between("'descr': '", "'"), shape, bytes[end..].to_vec())
}

fn floats(file: &Path) -> Vec<f32> {
    let (kind, shape, bytes) = npy(file);
    assert_eq!(kind, "<f4");
    assert_eq!(bytes.len(), 4 * shape.iter().product::<usize>());
    bytes
        .chunks(4)
        .map(|b| f32::from_le_bytes(b.try_into().unwrap()))
        .collect()
}

fn numbers(file: &Path) -> Vec<u32> {
    let (kind, shape, bytes) = npy(file);
    assert_eq!((kind.as_str(), shape.len()), ("<u4", 1));
    bytes
        .chunks(4)
        .map(|b| u32::from_le_bytes(b.try_into().unwrap()))
        .collect()
}

fn asset(path: &Path) -> Asset {
    read_file(path, &Limits::default()).unwrap()
}

#[test]
fn points_are_those_of_the_file_in_arrays_and_in_a_ply() {
    let folder = folder();
    export(cornell(), "points", folder.path());
    let levels = asset(cornell()).points;
    let positions: Vec<f32> = levels
        .iter()
        .flat_map(|l| l.positions.as_flattened())
        .copied()
        .collect();
    assert_eq!(floats(&folder.path().join("positions.npy")), positions);
    let albedo: Vec<f32> = levels
        .iter()
        .flat_map(|l| l.albedo.as_flattened())
        .copied()
        .collect();
    assert_eq!(floats(&folder.path().join("albedo.npy")), albedo);
    let (kind, shape, level) = npy(&folder.path().join("level.npy"));
    assert_eq!((kind.as_str(), shape), ("|u1", vec![positions.len() / 3]));
    let of_finest = level.iter().filter(|&&l| l == 1).count();
    assert_eq!(of_finest, levels[1].positions.len());

    let ply = std::fs::read(folder.path().join("points.ply")).unwrap();
    let end = ply.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
    let header = std::str::from_utf8(&ply[..end]).unwrap();
    assert!(
        header.starts_with("ply\nformat binary_little_endian 1.0\n"),
        "{header}"
    );
    assert!(
        header.contains(&format!("element vertex {}\n", level.len())),
        "{header}"
    );
    // Nine floats and a byte.
    assert_eq!(ply.len() - end, level.len() * 37);
    let at = end + 37 * (level.len() - 1);
    let last = [0, 1, 2].map(|i| f32::from_le_bytes(ply[at + 4 * i..at + 4 * i + 4].try_into().unwrap()));
    assert_eq!(last, *levels[1].positions.last().unwrap());
    assert_eq!(ply[at + 36], 1);
}

#[test]
fn links_are_those_of_the_file() {
    let folder = folder();
    let said = export(cornell(), "links", folder.path());
    let asset = asset(cornell());
    let transfer = asset.transfer.unwrap();
    assert_eq!(said["facts"]["receivers"], transfer.receivers);
    assert_eq!(
        numbers(&folder.path().join("transfer_row_offsets.npy")),
        transfer.row_offsets
    );
    assert_eq!(
        numbers(&folder.path().join("transfer_columns.npy")),
        transfer.columns
    );
    assert_eq!(
        floats(&folder.path().join("transfer_vectors.npy")),
        transfer.vectors.as_flattened()
    );
    let bounce = asset.bounce.unwrap().matrix;
    assert_eq!(floats(&folder.path().join("bounce_weights.npy")), bounce.weights);
    let senders = asset.senders.unwrap();
    assert_eq!(
        numbers(&folder.path().join("sender_of_finest_point.npy")),
        senders.leaf_of_point
    );
}

/// The Radiance header, then rows of `NCOLS` entries of `NCOMP` floats.
fn matrix(file: &Path) -> ([usize; 3], Vec<f32>) {
    let bytes = std::fs::read(file).unwrap();
    let end = bytes.windows(2).position(|w| w == b"\n\n").unwrap() + 2;
    let header = std::str::from_utf8(&bytes[..end]).unwrap();
    assert!(
        header.starts_with("#?RADIANCE\n") && header.contains("\nFORMAT=float\n"),
        "{header}"
    );
    let field = |name: &str| {
        let line = header.lines().find_map(|line| line.strip_prefix(name)).unwrap();
        line.parse::<usize>().unwrap()
    };
    let shape = [field("NROWS="), field("NCOLS="), field("NCOMP=")];
    let values: Vec<f32> = bytes[end..]
        .chunks(4)
        .map(|b| f32::from_le_bytes(b.try_into().unwrap()))
        .collect();
    assert_eq!(values.len(), shape.iter().product::<usize>());
    (shape, values)
}

/// Truth: the sparse product, entry by entry in f64. What radiosity 1 everywhere sends, a row of the matrix sums to.
#[test]
fn the_dense_matrix_acts_as_the_sparse_operator() {
    let folder = folder();
    export(cornell(), "transfer", folder.path());
    let asset = asset(cornell());
    let t = asset.transfer.unwrap();
    let (shape, values) = matrix(&folder.path().join("transfer.mtx"));
    assert_eq!(shape, [t.receivers as usize, t.senders as usize, 3]);
    let radiosity = |column: usize| (column % 7) as f64 - 2.5;
    for (row, dense) in t.row_offsets.windows(2).zip(values.chunks(3 * shape[1])) {
        for axis in 0..3 {
            let sparse: f64 = (row[0] as usize..row[1] as usize)
                .map(|i| f64::from(t.vectors[i][axis]) * radiosity(t.columns[i] as usize))
                .sum();
            let sum: f64 = (0..shape[1])
                .map(|c| f64::from(dense[3 * c + axis]) * radiosity(c))
                .sum();
            assert!((sum - sparse).abs() <= 1e-12 * sparse.abs().max(1.0));
        }
    }
    let (shape, values) = matrix(&folder.path().join("bounce.mtx"));
    let k = asset.bounce.unwrap().matrix;
    assert_eq!(shape, [k.rows as usize, k.rows as usize, 1]);
    for (sum, row) in k.row_sums.iter().zip(values.chunks(shape[1])) {
        let dense: f64 = row.iter().map(|&w| f64::from(w)).sum();
        assert!((dense - f64::from(*sum)).abs() <= 1e-6 * f64::from(*sum));
    }
}

#[test]
fn a_matrix_that_would_be_too_large_is_refused_with_its_size() {
    let folder = folder();
    let out = folder.path().join("out");
    let text = complaint(
        relight()
            .arg("export")
            .arg(cornell())
            .args(["--what", "transfer", "--matrix-limit", "10K", "-o"])
            .arg(&out),
        1,
    );
    assert!(
        text.contains("--matrix-limit (10240)") && text.contains("cornell.relight"),
        "{text}"
    );
    assert!(names(&out).is_empty());
    let usage = relight()
        .arg("export")
        .arg(cornell())
        .args(["--what", "transfer", "--matrix-limit", "much", "-o"])
        .arg(&out)
        .assert()
        .code(2)
        .get_output()
        .clone();
    assert!(String::from_utf8(usage.stderr).unwrap().contains("500M"));
}

#[test]
fn cuts_and_their_lights_are_those_of_the_file() {
    for mode in ["environment", "indirect"] {
        let file = with_cuts(mode);
        let asset = asset(file);
        let (cuts, tree) = (asset.cuts.unwrap(), asset.light_tree.unwrap());
        let out = folder();
        let said = export(file, "cuts", out.path());
        assert_eq!(said["facts"]["lights"], 256);
        assert_eq!(numbers(&out.path().join("cut_row_offsets.npy")), cuts.row_offsets);
        assert_eq!(npy(&out.path().join("cut_heights.npy")).2, cuts.heights);
        assert_eq!(floats(&out.path().join("cut_values.npy")), cuts.values);
        // Nodes tile: each starts where the one before it ends, and the last ends at the last light.
        let first = numbers(&out.path().join("cut_first_leaves.npy"));
        for row in cuts.row_offsets.windows(2) {
            let mut next = 0;
            for i in row[0] as usize..row[1] as usize {
                assert_eq!(first[i], next);
                next += 1 << cuts.heights[i];
            }
            assert_eq!(next, 256);
        }
        let out = folder();
        let said = export(file, "lights", out.path());
        match tree.lights {
            LightSamples::Environment { .. } => {
                assert_eq!(said["facts"]["kind"], "environment");
                let directions = floats(&out.path().join("light_directions.npy"));
                // Even over the sphere: their sum is nothing, their lengths 1.
                for axis in 0..3 {
                    let sum: f32 = directions.iter().skip(axis).step_by(3).sum();
                    assert!(sum.abs() < 0.01 * 256.0, "{sum}");
                }
                for d in directions.chunks(3) {
                    let square: f32 = d.iter().map(|c| c * c).sum();
                    assert!((square - 1.0).abs() < 1e-5);
                }
            }
            LightSamples::Surface { positions, .. } => {
                assert_eq!(said["facts"]["kind"], "surface");
                let positions = positions.as_flattened();
                assert_eq!(floats(&out.path().join("light_positions.npy")), positions);
            }
        }
        assert!(out.path().join("lights.ply").is_file());
    }
}

#[test]
fn what_an_asset_lacks_is_said() {
    let folder = folder();
    let refused = |what: &str| {
        complaint(
            relight()
                .arg("export")
                .arg(cornell())
                .args(["--what", what, "-o"])
                .arg(folder.path().join(what)),
            1,
        )
    };
    for what in ["cuts", "lights"] {
        let text = refused(what);
        assert!(
            text.contains("--cuts environment") && text.contains("cornell.relight"),
            "{text}"
        );
    }
    let missing = complaint(
        relight()
            .args(["export", "missing.relight", "--what", "points", "-o"])
            .arg(folder.path()),
        1,
    );
    assert!(missing.contains("missing.relight"), "{missing}");
}

/// Only what is asked for is read: damage elsewhere is not even seen, damage in it is.
#[test]
fn points_are_exported_from_a_file_whose_links_are_damaged() {
    let folder = folder();
    let broken = folder.path().join("broken.relight");
    let mut bytes = std::fs::read(cornell()).unwrap();
    let summary = relight_format::summarise(&bytes).unwrap();
    let links = summary
        .sections
        .iter()
        .find(|s| s.name == "links_transfer")
        .unwrap();
    bytes[links.offset as usize + 5] ^= 1;
    std::fs::write(&broken, bytes).unwrap();
    export(&broken, "points", &folder.path().join("points"));
    let out = folder.path().join("links");
    let text = complaint(
        relight()
            .arg("export")
            .arg(&broken)
            .args(["--what", "links", "-o"])
            .arg(&out),
        1,
    );
    assert!(
        text.contains("links_transfer") && text.contains("checksum"),
        "{text}"
    );
    // The reference integrators need no links either.
    relight()
        .arg("play")
        .arg(&broken)
        .args(["--integrator", "path", "--spp", "1", "--size", "16x16", "-o"])
        .arg(folder.path().join("frame.exr"))
        .assert()
        .success();
}
