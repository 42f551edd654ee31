//! SPEC.md suffices: a second reader, written from it alone (`tests/reader`, in Python), finds the same values in every
//! fixture, and refuses what this one refuses.

mod common;

use common::assets::{
    empty_asset, extended_asset, glass_asset, pane_asset, short_asset, wide_asset, widened_asset,
};
use common::{Forged, dump, fixtures, forge, sections_of, small_asset};
use relight_format::*;
use std::path::{Path, PathBuf};
use std::process::Command;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// A Python with numpy and a zstd module: the one that RELIGHT_PYTHON names, else python3. Without one the tests of this
/// file pass without having tested anything, and say so; with RELIGHT_READER_REQUIRED set, as in `.ci/run`, they fail.
fn python() -> Option<PathBuf> {
    let python = std::env::var_os("RELIGHT_PYTHON").map_or_else(|| "python3".into(), PathBuf::from);
    let ready = Command::new(&python)
        .args(["-c", "import zstd_frame, numpy"])
        .current_dir(root().join("tests/reader"))
        .output();
    match ready {
        Ok(output) if output.status.success() => Some(python),
        other => {
            let why = other.map_or_else(
                |e| e.to_string(),
                |o| String::from_utf8_lossy(&o.stderr).into_owned(),
            );
            let message = format!(
                "SKIPPED: the second reader of the format was NOT run: {} lacks numpy or a zstd module \
                 (compression.zstd, zstandard or pyzstd): {}",
                python.display(),
                why.trim().lines().last().unwrap_or("")
            );
            assert!(std::env::var_os("RELIGHT_READER_REQUIRED").is_none(), "{message}");
            // Not through `eprintln`, which the test harness swallows.
            use std::io::Write;
            let _ = writeln!(std::io::stderr(), "{message}");
            None
        }
    }
}

fn run(python: &Path, arguments: &[&Path], check: bool) -> String {
    let mut command = Command::new(python);
    command.arg(root().join("tests/reader/dump.py"));
    if check {
        command.arg("--check");
    }
    let output = command.args(arguments).output().unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    String::from_utf8(output.stdout).unwrap()
}

fn agree(python: &Path, file: &Path) {
    let asset = read_file(file, &Limits::default()).unwrap();
    let said = run(python, &[file], false);
    let (ours, theirs) = (dump::lines(&asset), said.lines().collect::<Vec<_>>());
    for (ours, theirs) in ours.iter().zip(&theirs) {
        assert_eq!(ours, theirs, "{}", file.display());
    }
    assert_eq!(ours.len(), theirs.len(), "{}", file.display());
}

#[test]
fn both_readers_find_the_same_in_every_fixture() {
    let Some(python) = python() else { return };
    let files = fixtures();
    assert!(files.len() >= 4);
    files.iter().for_each(|(file, _)| agree(&python, Path::new(file)));
}

/// What today's writer writes, which fixtures may lag behind, and assets of the caller's choice:
/// `RELIGHT_ASSETS=a.relight:b.relight cargo test --release -p relight-format --test second_reader`.
#[test]
fn both_readers_find_the_same_in_what_is_written_now() {
    let Some(python) = python() else { return };
    let folder = tempfile::tempdir().unwrap();
    let assets = [
        small_asset(),
        wide_asset(),
        empty_asset(),
        short_asset(),
        pane_asset(),
        extended_asset(),
        glass_asset(),
    ];
    for (i, asset) in assets.iter().enumerate() {
        let file = folder.path().join(format!("{i}.relight"));
        write_file(&file, asset).unwrap();
        agree(&python, &file);
    }
    if let Some(more) = std::env::var_os("RELIGHT_ASSETS") {
        std::env::split_paths(&more).for_each(|file| agree(&python, &file));
    }
}

/// Files that are forged behind right checksums: both readers accept the same ones, and find the same in those.
#[test]
fn both_readers_refuse_the_same_forgeries() {
    let Some(python) = python() else { return };
    let folder = tempfile::tempdir().unwrap();
    let mut forgeries = Vec::new();
    for asset in [
        small_asset(),
        wide_asset(),
        short_asset(),
        pane_asset(),
        extended_asset(),
        glass_asset(),
    ] {
        forgeries.extend(forged_from(&write_asset(&asset).unwrap()));
    }
    forgeries.extend(disputable(&sections_of(&write_asset(&small_asset()).unwrap())));
    let files: Vec<PathBuf> = forgeries
        .iter()
        .enumerate()
        .map(|(i, bytes)| {
            let file = folder.path().join(format!("{i}"));
            std::fs::write(&file, bytes).unwrap();
            file
        })
        .collect();
    let paths: Vec<&Path> = files.iter().map(PathBuf::as_path).collect();
    let said = run(&python, &paths, true);
    let mut accepted = 0;
    for ((bytes, file), said) in forgeries.iter().zip(&files).zip(said.lines()) {
        let ours = read_asset(bytes, &Limits::default());
        let theirs = said.starts_with("accepted");
        let keep = || {
            let kept = std::env::temp_dir().join("relight_disputed.relight");
            let _ = std::fs::copy(file, &kept);
            kept
        };
        assert_eq!(
            ours.is_ok(),
            theirs,
            "ours {:?}, theirs {said}; kept as {:?}",
            ours.as_ref().err(),
            keep()
        );
        accepted += usize::from(theirs);
        // A tenth of them value by value: each is a process.
        if theirs && accepted % 40 == 0 {
            agree(&python, file);
        }
    }
    assert_eq!(said.lines().count(), files.len());
    assert!(
        accepted > 20 && accepted < files.len(),
        "{accepted} of {}",
        files.len()
    );
}

/// What a sloppy reader might take: frames in pieces, frames to be skipped, a row sum below f32's normal numbers, a grid
/// of nothing that is not finite.
fn disputable(sections: &[Forged]) -> Vec<Vec<u8>> {
    let with = |kind: u32, codec: u32, raw: &[u8], stored: Vec<u8>| {
        let mut sections = sections.to_vec();
        let section = sections.iter_mut().find(|s| s.kind == kind).unwrap();
        *section = Forged {
            flags: section.flags,
            raw_bytes: raw.len() as u64,
            codec,
            ..Forged::new(kind, stored)
        };
        forge(&sections)
    };
    let pack = |bytes: &[u8]| zstd::bulk::compress(bytes, 3).unwrap();
    let stage = br#"{"cameras":[]}"#;
    let skippable = [0x50, 0x2a, 0x4d, 0x18, 1, 0, 0, 0, 7];
    let of_one_row = |row_sum: f32, fractions: [u16; 2]| {
        let mut raw = vec![0; 4];
        raw.extend([2, 0, 0, 0, 2, 0, 0, 0]);
        raw.extend([2, 0, 0, 0]); // lengths, first column, gap
        let sums = [row_sum.to_le_bytes(), [0; 4]];
        raw.extend((0..4).flat_map(|plane| sums.map(|s| s[plane])));
        raw.extend((0..2).flat_map(|plane| fractions.map(|f| f.to_le_bytes()[plane])));
        with(8, 0, &raw, raw.clone())
    };
    let no_points = |origin: f32, step: f32| {
        let mut raw = vec![1, 0, 0, 0];
        raw.extend([1.0f32, 1.0].iter().flat_map(|r| r.to_le_bytes()));
        raw.extend([0, 0, 0, 0, 1]);
        raw.extend([0.0, origin, 0.0, step].iter().flat_map(|v| v.to_le_bytes()));
        raw.extend([1, 1, 1]);
        let needs_points = [7, 8, 9, 11, 13];
        let sections: Vec<Forged> = sections
            .iter()
            .filter(|s| !needs_points.contains(&s.kind))
            .map(|s| {
                if s.kind == 6 {
                    Forged::new(6, raw.clone())
                } else {
                    s.clone()
                }
            })
            .collect();
        forge(&sections)
    };
    vec![
        with(5, 1, stage, pack(stage)),
        with(5, 1, stage, [pack(&stage[..5]), pack(&stage[5..])].concat()),
        with(5, 1, stage, [pack(stage), skippable.to_vec()].concat()),
        with(5, 1, stage, [skippable.to_vec(), pack(stage)].concat()),
        with(5, 1, b"", skippable.to_vec()),
        of_one_row(0.5, [3, 4]),
        of_one_row(1e-44, [3, 4]),
        of_one_row(1e-45, [65535, 65535]),
        of_one_row(1e-45, [0, 0]),
        of_one_row(-1e-3, [1, 1]),
        of_one_row(1.0001, [1, 1]),
        no_points(0.0, 1.0),
        no_points(f32::NAN, 1.0),
        no_points(0.0, f32::INFINITY),
    ]
}

/// Single bytes of each section's raw bytes replaced: all that are near its start, where counts and modes stand, and some
/// of the rest.
fn forged_from(file: &[u8]) -> Vec<Vec<u8>> {
    let sections = sections_of(file);
    let mut forgeries = Vec::new();
    for (i, section) in sections.iter().enumerate() {
        let raw = section.raw();
        let mut put = |raw: Vec<u8>| {
            let mut sections = sections.clone();
            sections[i] = section.with_raw(raw);
            forgeries.push(forge(&sections));
        };
        // 48 places over the section; the first 24 bytes all.
        let places = (0..24).chain((0..48).map(|k| k * raw.len() / 48));
        for (k, at) in places.filter(|&at| at < raw.len()).enumerate() {
            let mut changed = raw.clone();
            changed[at] = [0, 1, 2, 3, 0x7f, 0x80, 0xff, changed[at] ^ 1][k % 8];
            put(changed);
        }
        put(raw[..raw.len() - 1].to_vec());
        put([&raw[..], &[0]].concat());
    }
    forgeries
}

/// Writes the fixtures of the present layout; one that is there already is left alone: a file that a version wrote is
/// never written again.
#[test]
#[ignore = "writes fixtures when a layout is new"]
fn write_the_fixtures() {
    for (name, asset) in [
        ("environment", small_asset()),
        ("surface_at_points", wide_asset()),
        ("nothing", empty_asset()),
        ("short", short_asset()),
        ("widened", widened_asset()),
        ("extended", extended_asset()),
        ("glass", glass_asset()),
    ] {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!(
            "tests/fixtures/version_{}_{name}.relight",
            layout::SPEC_VERSION
        ));
        if !file.exists() {
            write_file(&file, &asset).unwrap();
        }
    }
}
