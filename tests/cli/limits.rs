//! Limits of the system: on the size of files, and on what a disk has left.
#![cfg(unix)]

use crate::stage::{TINY, complaint, cornell, data, folder, names, relight};
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::Command;

/// A limit on the size of files ends a process by a signal, unless it takes that for an error. Each command says which of its files
/// it was, by the name that the user knows, and leaves nothing.
#[test]
fn a_limit_on_file_size_is_an_error_of_any_command_that_leaves_nothing_behind() {
    let folder = folder();
    let program = env!("CARGO_BIN_EXE_relight");
    let asset = cornell().display();
    let (scene, lights) = (data("cornell.glb"), data("cornell.lights.json"));
    let (scene, lights, tiny) = (scene.display(), lights.display(), TINY.join(" "));
    for (command, file) in [
        (format!("bake {scene} -o a.relight {tiny}"), "a.relight"),
        (
            format!("bake {scene} -o a.relight --resume {tiny}"),
            "a.relight.units/",
        ),
        (
            format!("bake {scene} -o a.relight --plan plan {tiny}"),
            "plan/units/",
        ),
        (format!("play {asset} -o new/f.exr --size 200x200"), "new/f.exr"),
        (
            format!("play {asset} --movie new/m.webp --size 200x200"),
            "new/m.webp",
        ),
        ("man new".to_owned(), "new/relight"),
        (format!("export {asset} --what links -o new"), "new/"),
        (format!("export {asset} --what points -o new/er"), "new/er/"),
        (format!("inspect {asset} --images new"), "new/level_0.png"),
        (
            format!("report {asset} --lights {lights} -o new --budget 1s --size 64x64"),
            "new/reference/",
        ),
        ("check --random 1 --images new".to_owned(), "new/random_0.glb"),
    ] {
        // Blocks of 512 or 1024 bytes.
        let script = format!("ulimit -f 4; exec {program} {command}");
        let output = Command::new("sh")
            .args(["-c", &script])
            .current_dir(folder.path())
            .output()
            .unwrap();
        let text = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(1), "{command}: {text}");
        let error = text.split("relight: error: ").nth(1).unwrap_or_default();
        assert!(
            error.contains("too large") && error.contains(file),
            "{command}: {text}"
        );
        assert!(!error.contains(".relight-"), "a file that nobody knows: {error}");
        assert!(
            names(folder.path()).is_empty(),
            "{command}: {:?}",
            names(folder.path())
        );
    }
}

/// A `df` that says what a test wants, in a folder of its own.
fn disk_with(kibibytes: u64, folder: &Path) -> String {
    let df = folder.join("df");
    let text = format!(
        "#!/bin/sh\necho Filesystem 1024-blocks Used Available Capacity Mounted on\necho disk 100 1 {kibibytes} 1% /\n"
    );
    std::fs::write(&df, text).unwrap();
    std::fs::set_permissions(&df, std::fs::Permissions::from_mode(0o755)).unwrap();
    format!(
        "{}:{}",
        folder.display(),
        std::env::var("PATH").unwrap_or_default()
    )
}

#[test]
fn a_disk_that_is_too_full_refuses_the_bake_before_its_work() {
    let (tools, room) = (folder(), folder());
    let path = disk_with(2, tools.path());
    let bake = |more: &[&str]| {
        let mut bake = relight();
        bake.env("PATH", &path)
            .arg("bake")
            .arg(data("cornell.glb"))
            .arg("-o");
        bake.arg(room.path().join("a.relight")).args(TINY).args(more);
        bake
    };
    for more in [
        &[][..],
        &["--resume"],
        &["--plan", "plan"],
        &["--target-error", "20%"][..],
    ] {
        // Levels are what a target chooses.
        let mut run = bake(more);
        if more.contains(&"--target-error") {
            run = relight();
            run.env("PATH", &path)
                .arg("bake")
                .arg(data("cornell.glb"))
                .arg("-o");
            run.arg(room.path().join("a.relight")).args(more);
        }
        let text = complaint(run.current_dir(room.path()), 1);
        assert!(
            text.contains("has 2 kB left") && text.contains("--force"),
            "{more:?}: {text}"
        );
        assert!(
            names(room.path()).is_empty(),
            "{more:?}: {:?}",
            names(room.path())
        );
    }
    let said = bake(&["--dry-run"])
        .assert()
        .success()
        .get_output()
        .stderr
        .clone();
    assert!(String::from_utf8(said).unwrap().contains("has 2 kB left"));
    // Who knows better goes on, and is told.
    let said = bake(&["--force"]).assert().success().get_output().stderr.clone();
    assert!(String::from_utf8(said).unwrap().contains("warning: "));
    std::fs::remove_file(room.path().join("a.relight")).unwrap();
    let path = disk_with(10_000_000, tools.path());
    bake(&[]).env("PATH", path).assert().success();
}
