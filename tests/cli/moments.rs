//! A signal at any moment of any command that writes: what is on the disk then is the old file or the new one, whole.
#![cfg(unix)]

use crate::stage::{STOPS_WITHIN, Stopping, TINY, cornell, data, folder, names, send};
use relight_scene::image::{Limits, decode_exr};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

/// Moments at which each command is stopped, over the time that it takes.
const MOMENTS: u32 = 5;

/// Every file in a folder and those below, by its way from there.
fn files(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut found = BTreeMap::new();
    let mut left = vec![folder.to_owned()];
    while let Some(here) = left.pop() {
        for name in names(&here) {
            let path = here.join(name);
            if path.is_dir() {
                left.push(path);
            } else {
                let key = path.strip_prefix(folder).unwrap().to_owned();
                found.insert(key, std::fs::read(&path).unwrap());
            }
        }
    }
    found
}

/// Files whose bytes hold times, so that no two runs write the same: told whole by how they end.
fn is_whole(path: &Path, bytes: &[u8]) -> bool {
    match path.extension().and_then(|end| end.to_str()) {
        Some("json") => serde_json::from_slice::<serde_json::Value>(bytes).is_ok(),
        Some("html") => bytes.ends_with(b"</html>\n"),
        Some("svg") => bytes.trim_ascii_end().ends_with(b"</svg>"),
        // Scripts name the folder that they are for.
        Some("csv" | "sh") => bytes.ends_with(b"\n"),
        // The last chunk of every PNG.
        Some("png") => bytes.ends_with(b"IEND\xae\x42\x60\x82"),
        _ => false,
    }
}

fn run(words: &[String], folder: &Path) -> std::process::Child {
    Command::new(env!("CARGO_BIN_EXE_relight"))
        .args(words)
        .current_dir(folder)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap()
}

/// Runs a command of seed 1 to its end, then one of seed 2 over what that wrote, stopped at every moment; `is_kept` of files that
/// only a command that was stopped leaves.
fn stopped_at_any_moment(words: &str, is_kept: fn(&Path, &[u8]) -> bool) {
    let words_of = |seed: u32| -> Vec<String> {
        let words = words.split_whitespace().map(str::to_owned);
        words.chain(["--seed".into(), seed.to_string()]).collect()
    };
    let whole = |seed: u32| {
        let room = folder();
        let start = Instant::now();
        let code = run(&words_of(seed), room.path()).wait().unwrap().code();
        assert!(matches!(code, Some(0 | 3)), "{words}: {code:?}");
        (files(room.path()), start.elapsed(), room)
    };
    let (old, _, room) = whole(1);
    let (new, takes, _) = whole(2);
    assert!(!old.is_empty(), "{words}");
    for moment in 0..MOMENTS {
        // Every other one where nothing was before.
        let here = folder();
        if moment % 2 == 0 {
            for name in files(room.path()).keys() {
                std::fs::create_dir_all(here.path().join(name).parent().unwrap()).unwrap();
                std::fs::copy(room.path().join(name), here.path().join(name)).unwrap();
            }
        }
        let mut child = run(&words_of(2), here.path());
        std::thread::sleep(takes.mul_f64((f64::from(moment) + 0.5) / f64::from(MOMENTS)));
        let (signal, code) = [("-INT", 130), ("-TERM", 143)][moment as usize % 2];
        let mut seconds = 0.0;
        if child.try_wait().unwrap().is_none() {
            let stopping = Stopping::now(&child);
            send(signal, &child);
            seconds = stopping.seconds(&child);
        }
        let ended = child.wait().unwrap().code();
        // None: so early that nobody listened yet.
        assert!(
            [Some(code), Some(0), Some(3), None].contains(&ended),
            "{words}: {ended:?}"
        );
        assert!(seconds < STOPS_WITHIN, "{words}: stopped after {seconds:.2} s");
        for (path, bytes) in files(here.path()) {
            let is = |whole: &BTreeMap<PathBuf, Vec<u8>>| whole.get(&path) == Some(&bytes);
            assert!(
                is(&old) || is(&new) || is_whole(&path, &bytes) || is_kept(&path, &bytes),
                "{words}: {} of {} bytes at moment {moment} is neither old nor new",
                path.display(),
                bytes.len()
            );
        }
        for path in old.keys().filter(|_| moment % 2 == 0) {
            assert!(
                here.path().join(path).exists(),
                "{words}: {} is lost",
                path.display()
            );
        }
    }
}

fn never(_: &Path, _: &[u8]) -> bool {
    false
}

/// Whole by their names: a unit has its hash and its range in it, and is renamed to it when it is written.
fn is_unit(path: &Path, _: &[u8]) -> bool {
    path.extension().is_some_and(|end| end == "unit")
}

#[test]
fn bakes() {
    let scene = data("cornell.glb").display().to_string();
    let tiny = TINY.join(" ");
    stopped_at_any_moment(&format!("bake {scene} -o a.relight {tiny}"), never);
    stopped_at_any_moment(&format!("bake {scene} -o new/a.relight --resume {tiny}"), is_unit);
    stopped_at_any_moment(
        &format!("bake {scene} -o a.relight --plan plan --slurm {tiny}"),
        is_unit,
    );
}

#[test]
fn plays_exports_and_pictures() {
    let asset = cornell().display();
    let lights = data("cornell_moving.lights.json").display().to_string();
    stopped_at_any_moment(
        &format!("play {asset} --lights {lights} -o new/f_#.exr --png --frames 0-3 --size 64x64"),
        never,
    );
    stopped_at_any_moment(
        &format!("play {asset} --lights {lights} --movie new/m.gif --frames 0-3 --size 64x64"),
        never,
    );
    for what in ["points", "links", "factors"] {
        stopped_at_any_moment(&format!("export {asset} --what {what} -o new"), never);
    }
    stopped_at_any_moment(&format!("inspect {asset} --images new"), never);
}

/// What a report bakes and plays within its budget is the machine's speed's to say: whole is what reads.
fn reads(path: &Path, bytes: &[u8]) -> bool {
    match path.extension().and_then(|end| end.to_str()) {
        Some("relight") => relight_format::read_asset(bytes, &relight_format::Limits::default()).is_ok(),
        Some("exr") => decode_exr("frame", bytes, &Limits::default()).is_ok(),
        _ => false,
    }
}

#[test]
fn reports() {
    let asset = cornell().display();
    let lights = data("cornell.lights.json").display().to_string();
    stopped_at_any_moment(
        &format!("report {asset} --lights {lights} -o new --budget 1s --size 16x16"),
        reads,
    );
}

#[test]
fn checks_of_random_scenes() {
    stopped_at_any_moment("check --random 1 --images new", never);
}
