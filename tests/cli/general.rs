//! Help, versions, usage, options that every command knows.

use crate::stage::{complaint, cornell, folder, relight};

const COMMANDS: [&str; 8] = [
    "bake", "play", "inspect", "check", "export", "compare", "report", "demo",
];

#[test]
fn help_goes_to_stdout_and_names_every_command() {
    let output = relight().arg("--help").assert().success().get_output().clone();
    let text = String::from_utf8(output.stdout).unwrap();
    for command in COMMANDS {
        assert!(text.contains(command), "{command} is not in the help");
        relight().args([command, "--help"]).assert().success();
    }
    assert!(text.contains("Exit codes"));
}

#[test]
fn the_version_is_the_package_s() {
    let output = relight().arg("--version").assert().success().get_output().clone();
    let text = String::from_utf8(output.stdout).unwrap();
    assert_eq!(text.trim(), concat!("relight ", env!("CARGO_PKG_VERSION")));
}

#[test]
fn wrong_usage_exits_with_2() {
    for args in [
        &[][..],
        &["dance"],
        &["bake", "scene.glb"],
        &["bake", "a.glb", "-o", "a.relight", "--levels", "two"],
        &["bake", "a.glb", "-o", "a.relight", "--preset", "best"],
        &["bake", "a.glb", "-o", "a.relight", "--viewpoint", "1,2"],
        &["play", "a.relight", "-o", "frame.png"],
        &["play", "a.relight", "-o", "f.exr", "--frames", "3-1"],
        &["play", "a.relight", "-o", "f.exr", "--size", "0x4"],
        &["play", "a.relight", "-o", "f.exr", "--layers", "smell"],
        &["inspect", "a.relight", "-q", "-v"],
        &["inspect", "a.relight", "--threads", "0"],
    ] {
        relight().args(args).assert().code(2);
    }
}

#[test]
fn parameters_out_of_range_are_wrong_usage_and_name_their_option() {
    for (option, value) in [
        ("--levels", "13"),
        ("--sender-levels", "9"),
        ("--coarse-radius", "0"),
        ("--epsilon", "nan"),
    ] {
        let text = complaint(
            relight().args(["bake", "a.glb", "-o", "a.relight", option, value]),
            2,
        );
        assert!(text.contains(option), "{text}");
    }
    for (option, value) in [
        ("--cut-lights", "128"),
        ("--cut-lights", "30000"),
        ("--cut-lights", "2097152"),
        ("--sigma", "0"),
        ("--sigma", "inf"),
        ("--beta", "-0.1"),
        ("--beta", "nan"),
    ] {
        let option_value = format!("{option}={value}");
        let bake = ["bake", "a.glb", "-o", "a.relight", &option_value];
        let text = complaint(relight().args(bake).args(["--cuts", "environment"]), 2);
        assert!(text.contains(option), "{text}");
        // Without cuts it would do nothing.
        let text = complaint(relight().args(bake), 2);
        assert!(text.contains(option) && text.contains("--cuts"), "{text}");
    }
}

#[test]
fn sizes_of_illumination_cuts_are_1_to_a_million() {
    for size in ["0", "-1", "1048577", "many"] {
        let size = format!("--illumination-cut={size}");
        let play = ["play", "a.relight", "-o", "f.exr", &size];
        let output = relight().args(play).assert().code(2).get_output().clone();
        let text = String::from_utf8(output.stderr).unwrap();
        assert!(text.contains("--illumination-cut"), "{text}");
    }
}

#[test]
fn quiet_silences_notes_but_not_errors() {
    let output = relight()
        .arg("inspect")
        .arg(cornell())
        .arg("-q")
        .assert()
        .success()
        .get_output()
        .clone();
    assert!(output.stderr.is_empty());
    assert!(!output.stdout.is_empty());
    complaint(relight().args(["inspect", "no such file", "-q"]), 1);
}

/// The device takes nothing: what would be printed is lost, and a script must hear of it.
#[cfg(target_os = "linux")]
#[test]
fn a_standard_output_that_takes_nothing_is_a_failure() {
    let full = std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    let status = std::process::Command::new(env!("CARGO_BIN_EXE_relight"))
        .arg("inspect")
        .arg(cornell())
        .arg("--json")
        .stdout(full)
        .stderr(std::process::Stdio::null())
        .status()
        .unwrap();
    assert_eq!(status.code(), Some(1));
}

#[test]
fn the_demo_says_where_it_can_run() {
    let folder = folder();
    // The program itself lies in the clone's target folder unless that is elsewhere; copied away, it is lost.
    let program = folder.path().join("relight");
    std::fs::copy(env!("CARGO_BIN_EXE_relight"), &program).unwrap();
    let demo = || {
        std::process::Command::new(&program)
            .arg("demo")
            .current_dir(folder.path())
            .output()
    };
    // A process that another test starts holds the copy open for writing until it becomes its program.
    let busy = |e: &std::io::Error| e.kind() == std::io::ErrorKind::ExecutableFileBusy;
    let mut output = demo();
    for _ in 0..100 {
        if !output.as_ref().is_err_and(busy) {
            break;
        }
        std::thread::sleep(std::time::Duration::from_millis(10));
        output = demo();
    }
    let output = output.unwrap();
    assert_eq!(output.status.code(), Some(1));
    let text = String::from_utf8(output.stderr).unwrap();
    assert!(text.contains("clone of the repository"), "{text}");
}
