//! Ctrl-C and SIGTERM in every stage: the right exit code, old files unharmed, nothing new left behind.
#![cfg(unix)]

use crate::stage::{cornell, data, folder, names, send};
use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};

/// Starts the program, sends `signal` when a line of stderr begins with `stage`, and returns the exit code.
fn stopped_in(stage: &str, signal: &str, command: &mut Command) -> Option<i32> {
    let mut child = command
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines();
    let reached = lines
        .by_ref()
        .map_while(Result::ok)
        .any(|line| line.starts_with(stage));
    assert!(reached, "the stage {stage:?} never began");
    send(signal, &child);
    // Drained, or the child might block on its last words.
    lines.for_each(drop);
    child.wait().unwrap().code()
}

#[test]
fn a_bake_stops_in_any_stage_and_leaves_everything_whole() {
    let folder = folder();
    let asset = folder.path().join("a.relight");
    std::fs::write(&asset, b"precious").unwrap();
    let stages = [
        "Reading the scene",
        "Preparing the scene",
        "Spreading points",
        "Linking points",
    ];
    for (i, stage) in stages.into_iter().enumerate() {
        let (signal, code) = if i % 2 == 0 { ("-INT", 130) } else { ("-TERM", 143) };
        let mut bake = Command::new(env!("CARGO_BIN_EXE_relight"));
        bake.arg("bake")
            .arg(data("atrium.glb"))
            .arg("-o")
            .arg(&asset)
            .args(["--levels", "4", "--force"]);
        assert_eq!(stopped_in(stage, signal, &mut bake), Some(code), "{stage}");
        assert_eq!(std::fs::read(&asset).unwrap(), b"precious", "{stage}");
        assert_eq!(names(folder.path()), ["a.relight"], "{stage}");
    }
}

/// So many samples that the frame cannot be done before the signal comes.
#[test]
fn a_playback_stops_within_a_frame() {
    let folder = folder();
    for integrator in ["path", "brute"] {
        let mut play = Command::new(env!("CARGO_BIN_EXE_relight"));
        play.arg("play")
            .arg(cornell())
            .arg("-o")
            .arg(folder.path().join("f.exr"))
            .args(["--integrator", integrator, "--spp", "4000", "--size", "640x640"]);
        assert_eq!(stopped_in("Lighting frames", "-INT", &mut play), Some(130));
        assert!(names(folder.path()).is_empty());
    }
}
