//! Nothing is lost when a hand slips: what a command reads it never replaces, and what it writes replaces its own kind alone.

use crate::stage::{SQUARE, TINY_LIGHT, complaint, cornell, data, folder, gltf, names, relight, sequence};
use assert_cmd::Command;
use std::path::{Path, PathBuf};

/// A copy of a file of the repository.
fn copy(from: &Path, folder: &Path, name: &str) -> PathBuf {
    let to = folder.join(name);
    std::fs::copy(from, &to).unwrap();
    to
}

fn with(command: &str, words: &[&Path]) -> Command {
    let mut run = relight();
    run.arg(command).args(words);
    run
}

/// Runs what must fail and leave everything in a folder as it was; returns what it said.
fn refused(folder: &Path, command: &mut Command) -> String {
    let before: Vec<(String, Vec<u8>)> = contents(folder);
    let text = complaint(command, 1);
    assert!(contents(folder) == before, "{text}");
    text
}

fn contents(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let read = |name: String| {
        let bytes = std::fs::read(folder.join(&name)).unwrap_or_default();
        (name, bytes)
    };
    names(folder).into_iter().map(read).collect()
}

const READ: &str = "is read by this command";

#[test]
fn a_bake_never_replaces_its_scene_or_its_lights() {
    let room = folder();
    let scene = copy(&data("cornell.glb"), room.path(), "c.glb");
    let lights = sequence(room.path(), "l.json", TINY_LIGHT);
    let link = room.path().join("link.relight");
    let hard = room.path().join("hard.relight");
    std::fs::hard_link(&scene, &hard).unwrap();
    let mut outputs = vec![scene.clone(), lights.clone(), hard, room.path().join("./c.glb")];
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink(&scene, &link).unwrap();
        outputs.push(link);
    }
    for force in [None, Some("--force")] {
        for output in &outputs {
            let mut bake = with("bake", &[&scene]);
            bake.arg("--lights")
                .arg(&lights)
                .arg("-o")
                .arg(output)
                .args(force);
            let text = refused(room.path(), &mut bake);
            assert!(text.contains(READ), "{text}");
        }
    }
    let text = refused(
        room.path(),
        with("bake", &[&scene]).arg("-o").arg(&scene).arg("--dry-run"),
    );
    assert!(text.contains(READ), "{text}");
    let plan = room.path().join("plan");
    let text = refused(
        room.path(),
        with("bake", &[&scene])
            .arg("-o")
            .arg(&scene)
            .arg("--plan")
            .arg(&plan),
    );
    assert!(text.contains(READ), "{text}");
}

/// A log is written beside the asset, and a scene may lie in several files.
#[test]
fn what_stands_beside_an_output_and_what_a_scene_names_is_kept_too() {
    let room = folder();
    let scene = gltf(room.path(), &SQUARE);
    let text = refused(
        room.path(),
        with("bake", &[&scene])
            .arg("-o")
            .arg(room.path().join("scene.bin"))
            .arg("--force"),
    );
    assert!(text.contains(READ), "{text}");
    let lights = sequence(room.path(), "a.relight.log.json", TINY_LIGHT);
    let mut bake = with("bake", &[&scene]);
    bake.arg("--lights").arg(&lights).arg("--force");
    let text = refused(room.path(), bake.arg("-o").arg(room.path().join("a.relight")));
    assert!(text.contains("a.relight.log.json: is read"), "{text}");
}

const SIZE: [&str; 2] = ["--size", "16x16"];

/// A frame as an environment map in a folder, and a sequence that it lights.
fn environment(folder: &Path) -> (PathBuf, PathBuf) {
    let frame = folder.join("env.exr");
    with("play", &[cornell()])
        .arg("-o")
        .arg(&frame)
        .args(SIZE)
        .assert()
        .success();
    (frame, crate::stage::sky(folder, "env.exr"))
}

#[test]
fn a_play_never_replaces_what_it_reads() {
    let room = folder();
    // An environment map, which a frame's name may hit.
    let (frame, sky) = environment(room.path());
    let asset = copy(cornell(), room.path(), "asset.exr");
    for force in [None, Some("--force")] {
        for output in [&frame, &asset] {
            let mut play = with("play", &[&asset]);
            play.arg("--lights")
                .arg(&sky)
                .arg("-o")
                .arg(output)
                .args(SIZE)
                .args(force);
            let text = refused(room.path(), &mut play);
            assert!(text.contains(READ), "{text}");
        }
    }
    // Any frame of a sequence, not the first alone.
    let lights = r#"{ "relight_sequence": 1, "frames": 3, "lights": [
        { "name": "sky", "type": "environment", "file": "f_2.exr" } ] }"#;
    std::fs::rename(&frame, room.path().join("f_2.exr")).unwrap();
    let lights = sequence(room.path(), "three.json", lights);
    let mut play = with("play", &[cornell()]);
    play.arg("--lights").arg(&lights).args(SIZE).arg("-o");
    let text = refused(room.path(), play.arg(room.path().join("f_#.exr")));
    assert!(text.contains("f_2.exr: is read"), "{text}");
}

/// Readers take UTF-16 and numbers that JSON doesn't have; what such files name is read all the same.
#[test]
fn what_files_in_other_encodings_name_is_kept_too() {
    let room = folder();
    let utf16 = |text: &str| -> Vec<u8> {
        let units = text.encode_utf16();
        [0xff, 0xfe]
            .into_iter()
            .chain(units.flat_map(u16::to_le_bytes))
            .collect()
    };
    let scene = gltf(room.path(), &SQUARE);
    let text = std::fs::read_to_string(&scene).unwrap();
    for text in [
        utf16(&text),
        text.replace("\"asset\":", "\"extras\":NaN,\"asset\":")
            .into_bytes(),
    ] {
        std::fs::write(&scene, text).unwrap();
        let mut bake = with("bake", &[&scene]);
        bake.arg("-o").arg(room.path().join("scene.bin")).arg("--force");
        let text = refused(room.path(), &mut bake);
        assert!(text.contains(READ), "{text}");
    }
    let (frame, sky) = environment(room.path());
    let text = std::fs::read_to_string(&sky).unwrap();
    std::fs::write(&sky, utf16(&text)).unwrap();
    let mut play = with("play", &[cornell()]);
    play.arg("--lights").arg(&sky).args(SIZE).arg("-o").arg(&frame);
    let text = refused(room.path(), &mut play);
    assert!(text.contains(READ), "{text}");
}

/// Beside an asset a bake keeps its units; what else lies there is not its own.
#[test]
fn a_bake_removes_no_file_that_it_has_not_made() {
    let room = folder();
    let asset = room.path().join("a.relight");
    let units = room.path().join("a.relight.units");
    std::fs::create_dir(&units).unwrap();
    std::fs::write(units.join("thesis.unit"), "all of it").unwrap();
    let mut bake = with("bake", &[&data("cornell.glb")]);
    bake.args(crate::stage::TINY)
        .arg("--resume")
        .arg("-o")
        .arg(&asset)
        .assert()
        .success();
    assert_eq!(names(&units), ["thesis.unit"]);
}

#[test]
fn an_export_never_replaces_its_asset_and_writes_all_or_nothing() {
    let room = folder();
    let asset = copy(cornell(), room.path(), "points.ply");
    let out = room.path().to_owned();
    let export = |asset: &Path| {
        let mut run = with("export", &[asset]);
        run.args(["--what", "points", "-o"]).arg(&out);
        run
    };
    let text = refused(room.path(), export(&asset).arg("--force"));
    assert!(text.contains(READ), "{text}");
    let text = refused(room.path(), &mut export(cornell()));
    assert!(text.contains("points.ply: is an asset, not a PLY file"), "{text}");
    export(cornell()).arg("--force").assert().success();
    export(cornell()).assert().success();
    // Its own page it replaces, others' not.
    std::fs::write(room.path().join("README.txt"), "my thesis").unwrap();
    let text = refused(room.path(), &mut export(cornell()));
    assert!(
        text.contains("README.txt: is a text, not the page of an export"),
        "{text}"
    );
    // Nothing of a matrix that is too large, nor the folder for it.
    let out = room.path().join("new/folder");
    let mut run = with("export", &[cornell()]);
    run.args(["--what", "transfer", "--matrix-limit", "1", "-o"])
        .arg(&out);
    complaint(&mut run, 1);
    assert!(!room.path().join("new").exists());
}

#[test]
fn reports_and_pictures_replace_their_own_kind_alone() {
    let room = folder();
    let lights = sequence(room.path(), "report.json", TINY_LIGHT);
    let mut report = with("report", &[cornell()]);
    report.arg("--lights").arg(&lights).arg("-o").arg(room.path());
    let text = refused(room.path(), report.arg("--force"));
    assert!(text.contains(READ), "{text}");
    std::fs::write(room.path().join("level_1.png"), "my thesis").unwrap();
    let mut inspect = with("inspect", &[cornell()]);
    inspect.arg("--images").arg(room.path());
    let text = refused(room.path(), &mut inspect);
    assert!(text.contains("level_1.png: is a text, not a PNG image"), "{text}");
    std::fs::write(room.path().join("random_7.glb"), "my thesis").unwrap();
    let mut check = relight();
    check
        .args(["check", "--random", "1", "--seed", "7", "--images"])
        .arg(room.path());
    let text = refused(room.path(), &mut check);
    assert!(text.contains("random_7.glb: is a text"), "{text}");
}

#[test]
fn another_kind_of_file_is_replaced_with_force_alone() {
    let room = folder();
    let thesis = room.path().join("thesis.txt");
    std::fs::write(&thesis, "all of it").unwrap();
    let mut bake = with("bake", &[&data("cornell.glb")]);
    bake.args(crate::stage::TINY).arg("-o").arg(&thesis);
    let text = refused(room.path(), &mut bake);
    assert!(
        text.contains("thesis.txt: is a text, not an asset") && text.contains("--force"),
        "{text}"
    );
    bake.arg("--force").assert().success();
    assert!(
        std::fs::read(&thesis)
            .unwrap()
            .starts_with(&relight_format::layout::MAGIC)
    );
    // An asset is replaced by an asset, an image by an image.
    let mut bake = with("bake", &[&data("cornell.glb")]);
    bake.args(crate::stage::TINY)
        .arg("-o")
        .arg(&thesis)
        .assert()
        .success();
    let frame = room.path().join("f.exr");
    for _ in 0..2 {
        let mut play = with("play", &[cornell()]);
        play.args(["--size", "8x8", "-o"]).arg(&frame).assert().success();
    }
    std::fs::write(&frame, "not an image").unwrap();
    let mut play = with("play", &[cornell()]);
    let text = refused(room.path(), play.args(["--size", "8x8", "-o"]).arg(&frame));
    assert!(text.contains("f.exr: is a text, not an OpenEXR image"), "{text}");
}
