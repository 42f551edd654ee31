//! Moving pictures: every frame as its preview shows it, at the sequence's pace.

use crate::stage::{complaint, cornell, data, folder, json, names, relight};
use relight_scene::image::movie::decode_movie;
use relight_scene::image::{Image8, decode_ldr};
use std::path::Path;

fn play(folder: &Path, more: &[&str]) -> assert_cmd::Command {
    let mut play = relight();
    play.arg("play")
        .arg(cornell())
        .arg("--lights")
        .arg(data("cornell_moving.lights.json"))
        .args(["--size", "25x15", "--frames", "0-6x2"])
        .args(more)
        .current_dir(folder);
    play
}

fn decoded(path: &Path) -> Vec<(Image8, u32)> {
    decode_movie(&std::fs::read(path).unwrap()).unwrap()
}

#[test]
fn a_movie_shows_what_previews_show() {
    let room = folder();
    let run = play(
        room.path(),
        &["-o", "f_#.exr", "--png", "--movie", "m.webp", "--json"],
    )
    .assert()
    .success();
    assert_eq!(json(&run.get_output().stdout)["movie"], "m.webp");
    let movie = decoded(&room.path().join("m.webp"));
    assert_eq!(movie.len(), 4);
    let sequence = std::fs::read_to_string(data("cornell_moving.lights.json")).unwrap();
    let sequence: serde_json::Value = serde_json::from_str(&sequence).unwrap();
    let fps = sequence["fps"].as_f64().unwrap_or(24.0);
    let all: u32 = movie.iter().map(|(_, ms)| ms).sum();
    // Every second frame is shown for two frames' time.
    assert!(
        (f64::from(all) - 8.0 * 1000.0 / fps).abs() <= 1.0,
        "{all} ms at {fps}"
    );
    for ((image, _), frame) in movie.iter().zip([0, 2, 4, 6]) {
        let png = std::fs::read(room.path().join(format!("f_{frame}.png"))).unwrap();
        assert!(
            *image == decode_ldr("preview", &png, &Default::default()).unwrap(),
            "{frame}"
        );
    }
    // Alone, and of few colours.
    play(room.path(), &["--movie", "new/m.gif"]).assert().success();
    assert_eq!(names(&room.path().join("new")), ["m.gif"]);
    let gif = decoded(&room.path().join("new/m.gif"));
    for ((a, _), (b, _)) in gif.iter().zip(&movie) {
        let apart = a.rgba8.as_flattened().iter().zip(b.rgba8.as_flattened());
        let mean = apart.map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>() / (4 * a.rgba8.len()) as f64;
        assert!(mean < 6.0, "{mean}");
    }
}

#[test]
fn names_and_other_files_are_refused_before_the_work() {
    let room = folder();
    for (words, code, said) in [
        (&["--movie", "m.avi"][..], 2, ".webp, .gif or .mp4"),
        (&["--png", "--movie", "m.gif"], 2, "--output"),
        (&[], 2, "--output"),
    ] {
        let run = play(room.path(), words).assert().code(code);
        let text = String::from_utf8(run.get_output().stderr.clone()).unwrap();
        assert!(text.contains(said), "{text}");
    }
    std::fs::write(room.path().join("m.webp"), "my thesis").unwrap();
    let text = complaint(&mut play(room.path(), &["--movie", "m.webp"]), 1);
    assert!(text.contains("m.webp: is a text, not a WebP picture"), "{text}");
}

/// Whatever the machine has, the program of that name that is found first writes the movie.
#[cfg(unix)]
#[test]
fn mp4_is_written_by_ffmpeg_or_a_word_says_what_is_missing() {
    use std::os::unix::fs::PermissionsExt;
    let (room, tools) = (folder(), folder());
    let text = complaint(
        play(room.path(), &["--movie", "m.mp4"]).env("PATH", tools.path()),
        1,
    );
    for part in ["m.mp4", "ffmpeg", ".webp"] {
        assert!(text.contains(part), "{text}");
    }
    assert!(names(room.path()).is_empty());
    let ffmpeg = tools.path().join("ffmpeg");
    let with = |script: &str| {
        std::fs::write(&ffmpeg, format!("#!/bin/sh\n{script}\n")).unwrap();
        std::fs::set_permissions(&ffmpeg, std::fs::Permissions::from_mode(0o755)).unwrap();
        let path = format!(
            "{}:{}",
            tools.path().display(),
            std::env::var("PATH").unwrap_or_default()
        );
        let mut run = play(room.path(), &["--movie", "m.mp4"]);
        run.env("PATH", path);
        run
    };
    // One that keeps what it was given: its words, then the pixels.
    with("for last; do :; done; echo \"$@\" > \"$last\"; cat >> \"$last\"")
        .assert()
        .success();
    let written = std::fs::read(room.path().join("m.mp4")).unwrap();
    let end = written.iter().position(|b| *b == b'\n').unwrap();
    let words = String::from_utf8_lossy(&written[..end]).into_owned();
    assert!(
        words.contains("-video_size 25x15") && words.contains("rgb24"),
        "{words}"
    );
    assert_eq!(written.len() - end - 1, 4 * 25 * 15 * 3);
    std::fs::remove_file(room.path().join("m.mp4")).unwrap();
    let text = complaint(&mut with("echo no such codec >&2; exit 1"), 1);
    assert!(text.contains("m.mp4") && text.contains("no such codec"), "{text}");
    assert!(names(room.path()).is_empty());
}
