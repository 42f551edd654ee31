//! What shells and `man` are given, and terminals without colours.

use crate::stage::{complaint, folder, names, relight};

const COMMANDS: [&str; 13] = [
    "bake",
    "play",
    "view",
    "inspect",
    "check",
    "export",
    "mix",
    "compare",
    "report",
    "demo",
    "schema",
    "completions",
    "man",
];

#[test]
fn completions_know_every_command_and_its_options() {
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        let run = relight().args(["completions", shell]).assert().success();
        let script = String::from_utf8(run.get_output().stdout.clone()).unwrap();
        for word in COMMANDS.iter().chain(&["viewpoint", "frames-planned", "movie"]) {
            assert!(script.contains(word), "{shell} has no {word}");
        }
    }
}

/// Truth: bash itself, which completes what somebody has begun to type.
#[cfg(target_os = "linux")]
#[test]
fn bash_completes_what_is_begun() {
    let run = relight().args(["completions", "bash"]).assert().success();
    let script = String::from_utf8(run.get_output().stdout.clone()).unwrap();
    let room = folder();
    let file = room.path().join("relight.bash");
    std::fs::write(&file, script).unwrap();
    let complete = "source relight.bash; COMP_WORDS=(relight bake --pre); COMP_CWORD=2; _relight relight --pre bake; \
                    echo \"${COMPREPLY[@]}\"";
    let Ok(output) = std::process::Command::new("bash")
        .args(["-c", complete])
        .current_dir(room.path())
        .output()
    else {
        eprintln!("SKIPPED: no bash");
        return;
    };
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert_eq!(
        said.trim(),
        "--preset",
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
}

#[test]
fn pages_for_man_are_written_for_every_command_and_replace_their_own_kind_alone() {
    let room = folder();
    let pages = room.path().join("man1");
    let man = || {
        let mut man = relight();
        man.arg("man").arg(&pages);
        man
    };
    man().assert().success();
    let written = names(&pages);
    assert_eq!(written.len(), 1 + COMMANDS.len(), "{written:?}");
    for command in COMMANDS {
        let text = std::fs::read_to_string(pages.join(format!("relight-{command}.1"))).unwrap();
        assert!(text.contains(&format!("relight\\-{command}")), "{text:.400}");
        assert!(
            text.contains(".SH SYNOPSIS") && text.contains(".SH OPTIONS"),
            "{command}"
        );
    }
    let text = std::fs::read_to_string(pages.join("relight-bake.1")).unwrap();
    assert!(
        text.contains("\\-\\-viewpoint") && text.contains("Examples"),
        "{text:.400}"
    );
    man().assert().success();
    std::fs::write(pages.join("relight.1"), "my thesis").unwrap();
    let said = complaint(&mut man(), 1);
    assert!(
        said.contains("relight.1: is a text, not a page for man"),
        "{said}"
    );
    man().arg("--force").assert().success();
}

/// What a terminal shows of the help, which has colours unless somebody wants none (no-color.org).
#[cfg(target_os = "linux")]
#[test]
fn who_wants_no_colour_gets_none() {
    let shown = |no_color: &str| {
        let line = format!(
            "{no_color} TERM=xterm {} bake --levels two",
            env!("CARGO_BIN_EXE_relight")
        );
        let output = std::process::Command::new("script")
            .args(["-qec", &line, "/dev/null"])
            .output();
        let text = output
            .ok()
            .map(|o| String::from_utf8_lossy(&o.stdout).into_owned());
        text.filter(|text| text.contains("levels"))
    };
    let Some(plain) = shown("NO_COLOR=1") else {
        eprintln!("SKIPPED: there is no script(1) that makes a terminal");
        return;
    };
    assert!(!plain.contains('\u{1b}'), "{plain:?}");
    assert!(shown("").unwrap().contains('\u{1b}'));
}
