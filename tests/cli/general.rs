//! Help, versions, usage, options that every command knows.

use crate::stage::{complaint, cornell, folder, relight};

const COMMANDS: [&str; 9] = [
    "bake", "play", "inspect", "check", "export", "mix", "compare", "report", "demo",
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

/// What a command line that makes no sense is answered with.
fn usage(words: &[&str]) -> String {
    let output = relight().args(words).assert().code(2).get_output().clone();
    String::from_utf8(output.stderr).unwrap()
}

/// Each option with a number: what is too small, too large, negative or no number is answered with the range.
#[test]
fn numbers_out_of_range_are_refused_with_the_range() {
    let bake = ["bake", "a.glb", "-o", "a.relight"];
    let play = ["play", "a.relight", "-o", "f.exr"];
    let cuts = ["bake", "a.glb", "-o", "a.relight", "--cuts", "environment"];
    for (command, option, values, range) in [
        (
            &bake[..],
            "--levels",
            &["13", "0", "-1", "two"][..],
            "from 1 to 12",
        ),
        (&bake, "--sender-levels", &["13", "-1"], "from 1 to 12"),
        (
            &bake,
            "--coarse-radius",
            &["0", "-1", "nan", "1e30"],
            "above 0 and at most",
        ),
        (
            &bake,
            "--epsilon",
            &["nan", "1e9", "-1", "0", "-1e-3"],
            "above 0 and at most 100",
        ),
        (&bake, "--bounces", &["0", "-3"], "from 1 to"),
        (
            &bake,
            "--target-error",
            &["300%", "-5%", "-1", "0", "nan"],
            "above 0 and at most 1 (100%)",
        ),
        (&bake, "--threads", &["0", "-1", "1025"], "from 1 to 1024"),
        (&bake, "--seed", &["-1", "x"], "from 0 to 18446744073709551615"),
        (
            &cuts,
            "--cut-lights",
            &["128", "2097152", "-1"],
            "from 256 to 1048576",
        ),
        (&cuts, "--sigma", &["0", "inf", "-2"], "above 0 and at most 1000"),
        (&cuts, "--beta", &["-0.1", "nan", "2"], "from 0 to 1"),
        (&cuts, "--cut-nodes", &["0", "-1", "1048577"], "from 1 to 1048576"),
        (&play, "--exposure", &["1e30", "-1e30", "nan"], "from -100 to 100"),
        (
            &play,
            "--illumination-cut",
            &["0", "-1", "1048577", "many"],
            "from 1 to 1048576",
        ),
        (&play, "--spp", &["0", "-1"], "from 1 to 1048576"),
        (&play, "--max-bounces", &["-1"], "from 0 to"),
        (&play, "--area-samples", &["0", "-1"], "from 1 to 16777216"),
        (&play, "--vpls", &["-1", "16777217"], "from 0 to 16777216"),
        (&play, "--clamp", &["0", "-1", "nan"], "above 0"),
        (&play, "--error-ratio", &["-1", "2"], "from 0 to 1"),
        (&play, "--max-nodes", &["-1"], "from 0 to"),
        (&play, "--clusters", &["0", "-1"], "from 1 to 1048576"),
        (&play, "--trees", &["0", "-1", "1025"], "from 1 to 1024"),
        (&play, "--sh-degree", &["-1", "4"], "from 0 to 3"),
        (&play, "--frames", &["-1"], "expected A, A-B"),
        (&play, "--size", &["-1", "0x4"], "from 1 to 16384"),
        (
            &["compare", "a.exr", "b.exr"],
            "--max-relmse",
            &["-1", "nan"],
            "at least 0",
        ),
        (&["check"], "--random", &["0", "-1"], "from 1 to"),
        (&["view", "a"], "--port", &["-1", "65536"], "from 0 to 65535"),
        (
            &bake,
            "--viewpoint",
            &["1,2", "nan,1,2", "1e38,0,0"],
            "from -1e12 to 1e12",
        ),
        (
            &["report", "a", "--lights", "l", "-o", "d"],
            "--budget",
            &["-1", "-1s"],
            "expected a time",
        ),
        (
            &["export", "a", "--what", "links", "-o", "d"],
            "--matrix-limit",
            &["-1"],
            "a number of bytes",
        ),
    ] {
        for value in values {
            let text = usage(&[command, &[option, value]].concat());
            assert!(
                text.contains(option) && text.contains(range),
                "{option} {value}: {text}"
            );
        }
    }
    // What only all options together tell.
    for (option, value) in [("--sender-levels", "9"), ("--cut-lights", "30000")] {
        let text = complaint(relight().args(cuts).args([option, value]), 2);
        assert!(text.contains(option), "{text}");
    }
    // Without cuts these would do nothing.
    for (option, value) in [
        ("--cut-lights", "1024"),
        ("--sigma", "2"),
        ("--beta", "0.5"),
        ("--cut-nodes", "9"),
    ] {
        let text = complaint(relight().args(bake).args([option, value]), 2);
        assert!(text.contains(option) && text.contains("--cuts"), "{text}");
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

/// Farms read these lines; what goes wrong is one of them.
#[test]
fn with_json_progress_all_that_is_said_is_json() {
    let room = folder();
    let frame = room.path().join("f.exr");
    let asset = cornell().to_str().unwrap();
    let play = [
        "play",
        asset,
        "--size",
        "8x8",
        "-v",
        "-o",
        frame.to_str().unwrap(),
    ];
    let gone = ["inspect", "no such file"];
    let (unknown, range) = (["inspect", "a", "--levels"], ["check", "--random", "-1"]);
    for (words, code, last) in [
        (&play[..], 0, "note"),
        (&gone[..], 1, "error"),
        (&unknown[..], 2, "error"),
        (&range[..], 2, "error"),
    ] {
        let mut run = relight();
        let run = run.args(words).args(["--progress", "json"]).assert().code(code);
        let text = String::from_utf8(run.get_output().stderr.clone()).unwrap();
        let lines: Vec<serde_json::Value> = (text.lines())
            .map(|line| serde_json::from_str(line).unwrap_or_else(|_| panic!("{line}")))
            .collect();
        let is = |kind: &str| lines.iter().any(|line| line[kind].is_string());
        assert!(is(last), "{text}");
        assert!(code != 0 || (is("stage") && is("detail")), "{text}");
    }
}

/// What a terminal shows, which `script` is here.
fn on_a_terminal(term: &str, columns: u32, folder: &std::path::Path) -> Option<String> {
    let (program, asset) = (env!("CARGO_BIN_EXE_relight"), cornell().display());
    let line = format!(
        "stty cols {columns} rows 24; TERM={term} {program} play {asset} -o {}/f.exr --size 64x64 --integrator path --spp 64",
        folder.display()
    );
    let output = std::process::Command::new("script")
        .args(["-qec", &line, "/dev/null"])
        .output();
    let output = output.ok().filter(|o| o.status.success())?;
    Some(String::from_utf8_lossy(&output.stdout).into_owned())
}

#[cfg(target_os = "linux")]
#[test]
fn bars_fit_the_terminal_and_dumb_ones_have_lines() {
    let room = folder();
    let Some(text) = on_a_terminal("dumb", 80, room.path()) else {
        eprintln!("SKIPPED: there is no script(1) that makes a terminal");
        return;
    };
    assert!(
        text.contains("Lighting frames ...") && !text.contains('\u{1b}'),
        "{text:?}"
    );
    for columns in [80, 40] {
        let text = on_a_terminal("xterm", columns, room.path()).unwrap();
        let bars: Vec<String> = (text.split(['\r', '\n']))
            .map(without_escapes)
            .filter(|line| line.contains("Lighting") && line.contains('%'))
            .collect();
        assert!(!bars.is_empty(), "{text:?}");
        for bar in bars {
            assert!(bar.chars().count() <= columns as usize, "{columns}: {bar:?}");
        }
    }
}

/// A line without what moves the cursor: ESC [ … letter.
fn without_escapes(line: &str) -> String {
    let mut parts = line.split('\u{1b}');
    let first = parts.next().unwrap_or_default().to_owned();
    parts.fold(first, |text, part| {
        text + part
            .trim_start_matches(|c: char| !c.is_ascii_alphabetic())
            .get(1..)
            .unwrap_or_default()
    })
}
