//! A file of the wrong kind is named, with the command that takes it; and where a stream is enough, pipes are read.

use crate::stage::{TINY_LIGHT, complaint, cornell, data, folder, relight, sequence};

/// What is given to which command, and what must be said.
#[test]
fn the_wrong_kind_of_file_is_named_with_the_right_command() {
    let room = folder();
    let frame = room.path().join("f.exr").display().to_string();
    let (scene, sky) = (data("cornell.glb"), data("sky.hdr"));
    let (lights, edits) = (data("cornell.lights.json"), data("table_materials.json"));
    let log = format!("{}.log.json", cornell().display());
    let path = |p: &std::path::Path| p.display().to_string();
    let (scene, sky, lights, edits) = (path(&scene), path(&sky), path(&lights), path(&edits));
    let asset = path(cornell());
    let o = |command: &str, words: &[&str]| -> Vec<String> {
        let words = words.iter().map(|w| (*w).to_owned());
        std::iter::once(command.to_owned()).chain(words).collect()
    };
    for (words, said) in [
        (
            o("play", &[&scene, "-o", &frame]),
            ["a glTF scene, not an asset", "relight bake "],
        ),
        (
            o("inspect", &[&scene]),
            ["a glTF scene, not an asset", "relight bake "],
        ),
        (
            o("check", &[&scene]),
            ["a glTF scene, not an asset", "relight bake "],
        ),
        (
            o("export", &[&scene, "--what", "points", "-o", &frame]),
            ["a glTF scene", "relight bake "],
        ),
        (
            o("view", &[&scene, "--port", "0"]),
            ["a glTF scene, not an asset", "relight bake "],
        ),
        (
            o("view", &[&asset, "--lights", &sky, "--port", "0"]),
            ["an HDR image", "\"type\": \"environment\""],
        ),
        (
            o("report", &[&scene, "--lights", &lights, "-o", &frame]),
            ["a glTF scene", "relight bake "],
        ),
        (
            o("play", &[&lights, "-o", &frame]),
            ["a lighting sequence, not an asset", "--lights "],
        ),
        (
            o("play", &[&log, "-o", &frame]),
            ["the log of a bake", "give the asset beside it"],
        ),
        (
            o("bake", &[&asset, "-o", &frame]),
            ["an asset, not a scene", "relight play "],
        ),
        (
            o("bake", &[&lights, "-o", &frame]),
            ["a lighting sequence, not a scene", "--lights "],
        ),
        (
            o("bake", &[&scene, "--lights", &sky, "-o", &frame]),
            ["an HDR image", "\"type\": \"environment\""],
        ),
        (
            o("play", &[&asset, "--lights", &sky, "-o", &frame]),
            ["an HDR image", "\"type\": \"environment\""],
        ),
        (
            o("play", &[&asset, "--lights", &edits, "-o", &frame]),
            ["a file of material edits", "--materials "],
        ),
        (
            o("play", &[&asset, "--lights", &scene, "-o", &frame]),
            ["a glTF scene", "relight bake "],
        ),
        (
            o("play", &[&asset, "--materials", &lights, "-o", &frame]),
            ["a lighting sequence", "--lights "],
        ),
        (
            o("compare", &[&asset, &asset]),
            ["an asset, not an OpenEXR image", "relight play "],
        ),
        (
            o("compare", &[&sky, &sky]),
            ["an HDR image, not an OpenEXR image", "give"],
        ),
        (
            o("bake", &["--merge", &asset]),
            ["an asset, not the folder of a plan", "--plan"],
        ),
        (
            o(
                "report",
                &[&asset, "--lights", &lights, "--reference", &sky, "-o", &frame],
            ),
            ["an HDR image, not a folder with references", "frame_0000.exr"],
        ),
    ] {
        let text = complaint(relight().args(&words), 1);
        assert!(said.iter().all(|said| text.contains(said)), "{words:?}: {text}");
    }
    let text = complaint(relight().arg("inspect").arg(room.path()), 1);
    assert!(text.contains("is a folder"), "{text}");
}

/// A sequence is read from front to back, an asset is not.
#[cfg(unix)]
#[test]
fn sequences_come_through_pipes_and_assets_do_not() {
    let room = folder();
    let lights = std::fs::read(data("cornell.lights.json")).unwrap();
    let frame = room.path().join("f.exr");
    let mut play = relight();
    play.arg("play")
        .arg(cornell())
        .args(["--lights", "/dev/stdin", "--size", "8x8"]);
    play.args(["--frames", "0", "-o"])
        .arg(&frame)
        .write_stdin(lights)
        .assert()
        .success();
    for command in ["inspect", "check"] {
        let text = complaint(relight().args([command, "/dev/stdin"]).write_stdin("x"), 1);
        assert!(text.contains("/dev/stdin: is a pipe"), "{text}");
    }
    let mut bake = relight();
    bake.args(["bake", "/dev/stdin", "-o"])
        .arg(room.path().join("a.relight"))
        .write_stdin("x");
    let text = complaint(&mut bake, 1);
    assert!(text.contains("/dev/stdin: is a pipe"), "{text}");
    let text = complaint(relight().args(["inspect", "-"]), 1);
    assert!(
        text.contains("write what comes through a pipe to a file"),
        "{text}"
    );
    let mut play = relight();
    play.arg("play").arg(cornell()).args(["--lights", "-", "-o"]);
    let text = complaint(play.arg(&frame), 1);
    assert!(text.contains("give /dev/stdin"), "{text}");
}

/// As editors and shells of Windows write them.
#[test]
fn sequences_with_byte_order_marks_are_read() {
    let room = folder();
    let utf8 = format!("\u{feff}{TINY_LIGHT}").into_bytes();
    let wide = |unit: fn(u16) -> [u8; 2]| -> Vec<u8> {
        let text = format!("\u{feff}{TINY_LIGHT}");
        text.encode_utf16().flat_map(unit).collect()
    };
    let (lights, frame) = (room.path().join("l.json"), room.path().join("f.exr"));
    for bytes in [utf8, wide(u16::to_le_bytes), wide(u16::to_be_bytes)] {
        std::fs::write(&lights, bytes).unwrap();
        let mut play = relight();
        play.arg("play").arg(cornell()).arg("--lights").arg(&lights);
        play.args(["--size", "8x8", "-o"]).arg(&frame).assert().success();
    }
    std::fs::write(&lights, [0xff, 0xfe, 0x41]).unwrap();
    let mut play = relight();
    play.arg("play").arg(cornell()).arg("--lights").arg(&lights);
    let text = complaint(play.arg("-o").arg(&frame), 1);
    assert!(text.contains("l.json") && text.contains("UTF-8"), "{text}");
}

#[test]
fn scene_descriptions_with_byte_order_marks_are_read() {
    let room = folder();
    let text = r#"{ "relight_scene": 1, "camera": { "position": [0, 0, 4], "look_at": [0, 0, 0], "vfov_deg": 40 },
        "boxes": [{ "name": "box", "min": [-1, -1, -1], "max": [1, 1, 1], "albedo": [0.5, 0.5, 0.5] }] }"#;
    let text = format!("\u{feff}{text}");
    let wide: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
    for bytes in [text.into_bytes(), wide] {
        let scene = room.path().join("box.scene.json");
        std::fs::write(&scene, bytes).unwrap();
        let mut bake = relight();
        bake.arg("bake").arg(&scene).args(["--dry-run", "-o"]);
        bake.arg(room.path().join("a.relight"))
            .args(crate::stage::TINY)
            .assert()
            .success();
    }
}

/// A map is read from front to back, once.
#[cfg(unix)]
#[test]
fn environment_maps_come_through_pipes() {
    let room = folder();
    let text = r#"{ "relight_sequence": 1, "lights": [ { "name": "sky", "type": "environment", "file": "/dev/stdin" } ] }"#;
    let lights = sequence(room.path(), "l.json", text);
    let mut play = relight();
    play.arg("play").arg(cornell()).arg("--lights").arg(&lights);
    play.args(["--size", "8x8", "-o"]).arg(room.path().join("f.exr"));
    play.write_stdin(std::fs::read(data("sky.hdr")).unwrap())
        .assert()
        .success();
}
