//! What `play --help` tells of defaults, and options that have no effect.

use crate::stage::{complaint, cornell, folder, relight};
use assert_cmd::Command;
use relight_play::frame::settings::ILLUMINATION_CUT;
use relight_render::lightcuts::LightcutSettings;
use relight_render::many_lights::PointSettings;
use relight_render::pixelcuts::PixelcutsSettings;
use std::path::Path;

/// Truth: the defaults of the libraries, which is what counts where an option is not given.
#[test]
fn help_tells_the_defaults_that_count() {
    let output = relight()
        .args(["play", "--help"])
        .assert()
        .success()
        .get_output()
        .clone();
    let text = String::from_utf8(output.stdout).unwrap();
    let lines: Vec<&str> = text.lines().map(str::trim).collect();
    let (points, lightcuts, pixelcuts) = (
        PointSettings::default(),
        LightcutSettings::default(),
        PixelcutsSettings::default(),
    );
    for (option, default) in [
        ("--illumination-cut", ILLUMINATION_CUT.to_string()),
        ("--environment-samples", points.environment.to_string()),
        ("--sun-samples", points.sun.to_string()),
        ("--sky-samples", points.sky.to_string()),
        ("--vpls", "0".into()),
        ("--clamp", points.clamp.to_string()),
        ("--error-ratio", lightcuts.error_ratio.to_string()),
        ("--max-nodes", lightcuts.max_nodes.to_string()),
        ("--clusters", pixelcuts.clusters.to_string()),
        ("--trees", pixelcuts.trees.to_string()),
        ("--sh-degree", pixelcuts.degree.to_string()),
    ] {
        let begin = (lines.iter())
            .position(|line| line.split_whitespace().next() == Some(option))
            .unwrap_or_else(|| panic!("{option} is not in the help"));
        let said: Vec<&str> = lines[begin + 1..]
            .iter()
            .take_while(|line| !line.starts_with('-'))
            .copied()
            .collect();
        let said = said.join(" ");
        assert!(
            said.contains(&format!("[default: {default}]")),
            "{option}: {default}: {said}"
        );
    }
}

/// Of the Cornell box, which has points and no visibility cuts.
fn play(folder: &Path, words: &[&str]) -> Command {
    let mut play = relight();
    play.arg("play")
        .arg(cornell())
        .arg("-o")
        .arg(folder.join("f.exr"));
    play.args(["--size", "4x4", "--spp", "1"]).args(words);
    play
}

#[test]
fn options_without_an_effect_are_refused_or_told() {
    let folder = folder();
    for (words, said) in [
        (
            &["--error-ratio", "0.1"][..],
            "--error-ratio counts with --integrator lightcuts alone",
        ),
        (
            &["--integrator", "path", "--trees", "3"],
            "--trees counts with --integrator pixelcuts alone",
        ),
        (
            &["--integrator", "path", "--vpls", "3"],
            "--vpls counts with --integrator brute, lightcuts and pixelcuts alone",
        ),
        (
            &["--integrator", "transfer", "--illumination-cut", "64"],
            "--illumination-cut counts with --integrator auto and cuts alone",
        ),
    ] {
        let text = complaint(&mut play(folder.path(), words), 2);
        assert!(text.contains(said), "{words:?}: {text}");
    }
    for (words, said) in [
        (
            &["--illumination-cut", "64"][..],
            "warning: --illumination-cut counts for nothing here",
        ),
        (
            &["--exposure", "2"],
            "warning: --exposure counts for nothing here",
        ),
        (
            &["--integrator", "lightcuts", "--vpls", "50", "--clamp", "0.1"],
            "warning: --clamp counts for nothing here",
        ),
    ] {
        let output = play(folder.path(), words).assert().success().get_output().clone();
        let text = String::from_utf8(output.stderr).unwrap();
        assert!(text.contains(said), "{words:?}: {text}");
    }
}
