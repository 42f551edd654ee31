//! Ctrl-C and SIGTERM in every stage: the right exit code, old files unharmed, nothing new left behind.
#![cfg(unix)]

use crate::stage::{STOPS_WITHIN, Stopping, cornell, data, folder, names, send};
use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};

/// Starts the program, sends `signal` when a line of stderr begins with `stage`, and returns the exit code.
fn stopped_in(stage: &str, signal: &str, command: &mut Command) -> Option<i32> {
    stopped_saying(stage, signal, command).0
}

/// The same, with what was said from then on. It must stop within [`STOPS_WITHIN`].
fn stopped_saying(stage: &str, signal: &str, command: &mut Command) -> (Option<i32>, String) {
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
    let stopping = Stopping::now(&child);
    send(signal, &child);
    // Drained, or the child might block on its last words.
    let said: Vec<String> = lines.map_while(Result::ok).collect();
    let seconds = stopping.seconds(&child);
    assert!(seconds < STOPS_WITHIN, "{stage}: stopped after {seconds:.2} s");
    (child.wait().unwrap().code(), said.join("\n"))
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

/// What a play computes before its first frame takes longest, and is one piece.
#[test]
fn a_playback_stops_in_time_whatever_it_computes() {
    let folder = folder();
    for stage in ["Reading the asset", "Lighting frames"] {
        let mut play = Command::new(env!("CARGO_BIN_EXE_relight"));
        play.arg("play")
            .arg(cornell())
            .arg("-o")
            .arg(folder.path().join("new/f.exr"))
            .args(["--integrator", "transfer", "--spp", "256", "--size", "640x640"]);
        let (code, words) = stopped_saying(stage, "-INT", &mut play);
        assert_eq!(code, Some(130), "{words}");
        assert!(words.contains("relight: stopped; frames"), "{words}");
        assert!(names(folder.path()).is_empty());
    }
}

#[test]
fn a_bake_that_is_stopped_says_what_is_left_and_how_to_go_on() {
    let folder = folder();
    let asset = folder.path().join("a.relight");
    let bake = |more: &[&str]| {
        let mut bake = Command::new(env!("CARGO_BIN_EXE_relight"));
        bake.arg("bake").arg(data("atrium.glb")).arg("-o").arg(&asset);
        bake.args(["--levels", "4"]).args(more);
        bake
    };
    let (_, words) = stopped_saying("Linking points", "-INT", &mut bake(&[]));
    assert!(words.contains("nothing was written or left behind"), "{words}");
    assert!(words.contains("--resume keeps what is finished"), "{words}");
    let (_, words) = stopped_saying("Linking points", "-INT", &mut bake(&["--resume"]));
    assert!(words.contains("of finished work in"), "{words}");
    assert!(words.contains("the same command goes on from there"), "{words}");
    assert!(!words.contains("nothing"), "{words}");
    assert_eq!(names(folder.path()), ["a.relight.units"]);
    std::fs::remove_dir_all(folder.path().join("a.relight.units")).unwrap();
    let (_, words) = stopped_saying("Reading the scene", "-TERM", &mut bake(&["--resume"]));
    assert!(words.contains("nothing was left behind"), "{words}");
    assert!(names(folder.path()).is_empty());
}
