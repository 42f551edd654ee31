//! Reports: what is measured, what is written, that a stopped one goes on, and that the page works in a browser.

use crate::stage::{bake_json, complaint, cornell, data, folder, json, names, relight};
use relight_scene::image::{BEAUTY, ExrHeader, Layers, decode_ldr, write_exr};
use serde_json::Value;
use std::path::Path;
use std::sync::OnceLock;
use tempfile::TempDir;

fn command(out: &Path, more: &[&str]) -> assert_cmd::Command {
    command_of(cornell(), out, more)
}

fn command_of(asset: &Path, out: &Path, more: &[&str]) -> assert_cmd::Command {
    let mut command = relight();
    command
        .arg("report")
        .arg(asset)
        .arg("--lights")
        .arg(data("cornell.lights.json"))
        .arg("-o")
        .arg(out)
        .args(["--size", "24x24", "--json", "-q"])
        .args(more);
    command
}

fn report(out: &Path, more: &[&str]) -> Value {
    said(command(out, more))
}

fn said(mut command: assert_cmd::Command) -> Value {
    json(&command.assert().success().get_output().stdout)
}

/// Two halves of a reference, so that no test waits for one to converge.
fn halves() -> &'static str {
    static HALVES: OnceLock<TempDir> = OnceLock::new();
    let made = HALVES.get_or_init(|| {
        let folder = folder();
        for (half, seed) in [("a", "11"), ("b", "12")] {
            relight()
                .arg("play")
                .arg(cornell())
                .arg("--lights")
                .arg(data("cornell.lights.json"))
                .arg("-o")
                .arg(folder.path().join(format!("frame_0000_{half}.exr")))
                .args(["--integrator", "path", "--spp", "256", "--size", "24x24"])
                .args(["--frames", "0", "--float", "--seed", seed])
                .assert()
                .success();
        }
        folder
    });
    made.path().to_str().unwrap()
}

/// One report for all tests, with time for everything.
pub fn shared() -> (&'static Path, &'static Value) {
    static REPORT: OnceLock<(TempDir, Value)> = OnceLock::new();
    let (folder, said) = REPORT.get_or_init(|| {
        let folder = folder();
        let said = report(folder.path(), &["--budget", "1h", "--reference", halves()]);
        (folder, said)
    });
    (folder.path(), said)
}

fn settings(said: &Value) -> &[Value] {
    said["settings"].as_array().unwrap()
}

fn number(setting: &Value, name: &str) -> f64 {
    setting[name]
        .as_f64()
        .unwrap_or_else(|| panic!("{name} of {setting}"))
}

#[test]
fn every_integrator_and_bake_option_is_measured_and_named() {
    let (_, said) = shared();
    assert_eq!(said["not_measured"].as_array().unwrap().len(), 0);
    for integrator in ["auto", "path", "brute", "lightcuts", "pixelcuts"] {
        assert!(
            settings(said).iter().any(|s| s["integrator"] == integrator),
            "{integrator}"
        );
    }
    for setting in settings(said) {
        for name in ["ms_per_frame", "asset_bytes", "rmse", "relmse", "flip", "p99"] {
            assert!(number(setting, name) > 0.0, "{name} of {setting}");
        }
        assert!(setting["bias"].is_f64() && setting["pareto"].is_boolean());
        // Each is played until its spread is known.
        assert!(setting["repetitions"].as_array().unwrap().len() >= 3, "{setting}");
        let [low, high] = [0, 1].map(|i| setting["error_range"][i].as_f64().unwrap());
        assert!(
            low <= number(setting, "error") && number(setting, "error") <= high,
            "{setting}"
        );
        assert!(number(setting, "ms_spread") > 0.0);
    }
    // Another threshold makes another file, whose bake was timed.
    let base = settings(said).iter().find(|s| s["label"] == "auto").unwrap();
    let coarse = settings(said)
        .iter()
        .find(|s| s["knobs"]["epsilon"].as_f64() > Some(0.05))
        .unwrap();
    assert!(number(coarse, "asset_bytes") < number(base, "asset_bytes"));
    assert!(number(coarse, "bake_seconds") > 0.0);
}

/// Truth: a path tracer's variance falls as one over its samples, a dominated setting is on no front.
#[test]
fn errors_fall_with_samples_and_the_front_holds_what_nothing_beats() {
    let (_, said) = shared();
    let path = |spp: f64| {
        let found = settings(said)
            .iter()
            .find(|s| s["integrator"] == "path" && s["layer"] == "beauty" && s["knobs"]["spp"] == spp);
        number(found.unwrap(), "relmse")
    };
    assert!(path(64.0) < 0.5 * path(4.0), "{} {}", path(64.0), path(4.0));
    for a in settings(said).iter().filter(|s| s["pareto"] == true) {
        for b in settings(said).iter().filter(|b| b["layer"] == a["layer"]) {
            // By more than may be chance, of which three standard errors leave little.
            let spread = |s: &Value| 3.0 * number(s, "ms_spread");
            let faster = number(b, "ms_per_frame") + spread(b) < number(a, "ms_per_frame") - spread(a);
            let nearer = b["error_range"][1].as_f64() < a["error_range"][0].as_f64();
            assert!(!(faster && nearer), "{b} beats {a}");
        }
    }
    let front = |layer: &str| {
        settings(said)
            .iter()
            .filter(|s| s["layer"] == layer && s["pareto"] == true)
            .count()
    };
    assert!(front("beauty") > 0 && front("direct") > 0);
    let said = said["findings"].as_array().unwrap();
    assert!(said.len() >= 3);
    for (sentence, begins) in said.iter().zip(["For 1 %", "For 3 %", "For 10 %"]) {
        assert!(sentence.as_str().unwrap().starts_with(begins), "{sentence}");
    }
}

#[test]
fn the_page_needs_nothing_beside_it_and_the_table_has_every_setting() {
    let (folder, said) = shared();
    let page = std::fs::read_to_string(folder.join("report.html")).unwrap();
    let plots = names(&folder.join("plots"));
    // Each as lines and as pixels.
    let ending = |ending: &str| plots.iter().filter(|name| name.ends_with(ending)).count();
    assert_eq!(
        (ending(".svg"), ending(".png"), plots.len()),
        (4, 4, 8),
        "{plots:?}"
    );
    assert_eq!(page.matches("<svg").count(), ending(".svg"));
    let picture = std::fs::read(folder.join("plots/error_time.png")).unwrap();
    let picture = decode_ldr("plot", &picture, &Default::default()).unwrap();
    let dark = |p: &&[u8; 4]| p.iter().any(|c| *c < 128);
    let coloured = picture.rgba8.iter().filter(dark).count();
    // Axes, letters and dots: more than a line, far less than a full page.
    assert!(coloured > 2000 && coloured < 200_000, "{coloured}");
    let outside = page.replace("http://www.w3.org/2000/svg", "");
    assert!(!outside.contains("http") && !outside.contains("src=\"pictures"));
    let csv = std::fs::read_to_string(folder.join("report.csv")).unwrap();
    assert_eq!(csv.lines().count(), 1 + settings(said).len());
    let written: Value = serde_json::from_slice(&std::fs::read(folder.join("report.json")).unwrap()).unwrap();
    assert_eq!(&written, said);
}

#[test]
fn a_second_report_takes_the_references_of_the_first_further() {
    let folder = folder();
    let samples = |said: &Value| said["references"][0]["spp"].as_u64().unwrap();
    let first = report(folder.path(), &["--budget", "0.001s"]);
    // Short of time, it measures one setting and names the others.
    assert_eq!(settings(&first).len(), 1);
    assert!(first["not_measured"].as_array().unwrap().len() > 5);
    // However busy the machine is, there is a budget that is enough.
    let further = ["3s", "15s", "60s"]
        .iter()
        .any(|budget| samples(&report(folder.path(), &["--budget", budget])) > samples(&first));
    assert!(further);
}

/// The budget is kept but for one setting and the pages, and what one report measured the next one takes up.
#[test]
fn a_second_report_goes_on_where_the_first_one_stopped() {
    let folder = folder();
    let budget = |seconds: &str| {
        let start = std::time::Instant::now();
        let said = report(folder.path(), &["--budget", seconds, "--reference", halves()]);
        (said, start.elapsed().as_secs_f64())
    };
    let (first, took) = budget("3s");
    // Of a machine that does other things beside; without a limit it takes a minute.
    assert!(took < 15.0, "{took}");
    let count = settings(&first).len();
    let (second, _) = budget("3s");
    assert!(settings(&second).len() >= count);
    for before in settings(&first) {
        let now = settings(&second)
            .iter()
            .find(|s| s["command"] == before["command"]);
        let now = now.unwrap_or_else(|| panic!("{before} is lost"));
        let times = |s: &Value| s["repetitions"].as_array().unwrap().clone();
        assert!(times(now).starts_with(&times(before)), "{before}\n{now}");
    }
}

/// Truth: the least of bake, what is done once, and frames, over all settings that err by no more than asked for.
#[test]
fn the_bake_counts_over_the_frames_that_are_planned() {
    let folder = folder();
    // Finer than that of the other tests, which errs by more than 10 %.
    let asset = folder.path().join("cornell.relight");
    bake_json(
        &data("cornell.glb"),
        &asset,
        &["--levels", "3", "--sender-levels", "2", "--coarse-radius", "0.1"],
    );
    for frames in ["1", "1000000"] {
        let said = said(command_of(
            &asset,
            &folder.path().join("report"),
            &[
                "--budget",
                "1h",
                "--reference",
                halves(),
                "--frames-planned",
                frames,
            ],
        ));
        assert_eq!(said["frames_planned"].to_string(), frames);
        let takes = |s: &Value| {
            let traced = ["path", "brute", "lightcuts", "pixelcuts"]
                .iter()
                .any(|i| s["integrator"] == *i);
            let bake = if traced { 0.0 } else { number(s, "bake_seconds") };
            bake + 1e-3
                * (number(s, "ms_once_per_shot") + frames.parse::<f64>().unwrap() * number(s, "ms_per_frame"))
        };
        let good = settings(&said)
            .iter()
            .filter(|s| s["layer"] == "beauty" && number(s, "error") <= 0.1);
        let best = good.min_by(|a, b| takes(a).total_cmp(&takes(b))).unwrap();
        let advice = said["findings"][2].as_str().unwrap();
        let begins = format!("For 10 % error use {}: ", best["label"].as_str().unwrap());
        assert!(advice.starts_with(&begins), "{advice}\n{begins}");
        let words = if frames == "1" {
            "for 1 frame"
        } else {
            "for 1,000,000 frames"
        };
        assert!(advice.contains(words), "{advice}");
    }
}

#[test]
fn what_a_report_baked_is_not_baked_again() {
    let assets = |folder: &Path| -> Vec<_> {
        let kept = names(&folder.join("assets")).into_iter();
        kept.map(|name| {
            let modified = std::fs::metadata(folder.join("assets").join(&name))
                .unwrap()
                .modified();
            (name, modified.unwrap())
        })
        .collect()
    };
    let (done, _) = shared();
    let folder = folder();
    std::fs::create_dir(folder.path().join("assets")).unwrap();
    for (name, _) in assets(done) {
        std::fs::copy(
            done.join("assets").join(&name),
            folder.path().join("assets").join(&name),
        )
        .unwrap();
    }
    let before = assets(folder.path());
    assert!(before.len() > 5);
    report(folder.path(), &["--budget", "1h", "--reference", halves()]);
    assert_eq!(assets(folder.path()), before);
}

/// Truth: `compare` of the frames that the report keeps.
#[test]
fn frames_in_a_row_tell_their_flicker() {
    let folder = folder();
    let mut command = relight();
    command
        .args(["report", cornell().to_str().unwrap(), "--lights"])
        .arg(data("cornell_moving.lights.json"))
        .arg("-o")
        .arg(folder.path())
        .args([
            "--size", "24x24", "--json", "-q", "--frames", "0-3", "--budget", "0.001s",
        ]);
    let said = json(&command.assert().success().get_output().stdout);
    let setting = &settings(&said)[0];
    let layer = setting["layer"].as_str().unwrap();
    let images = std::fs::read_dir(folder.path().join("images"))
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .find(|path| path.is_dir())
        .unwrap();
    let pattern = images.join("frame_####.exr");
    let compared = relight()
        .arg("compare")
        .args([&pattern, &pattern])
        .args(["--layer", if layer == "all" { "" } else { layer }, "--json"])
        .assert()
        .success();
    let compared = json(&compared.get_output().stdout);
    let flicker = number(setting, "flicker");
    assert!(flicker > 0.0 && flicker < 2.0, "{flicker}");
    assert!(
        compared.to_string().contains(&setting["flicker"].to_string()),
        "{flicker}: {compared}"
    );
    let (_, single) = shared();
    assert!(
        settings(single)
            .iter()
            .all(|setting| setting["flicker"].is_null())
    );
}

#[test]
fn references_of_another_size_are_refused_and_given_ones_are_taken() {
    let folder = folder();
    let write = |width: usize| {
        let mut layers = Layers::new(width, 24);
        layers.push_rgb(BEAUTY, &vec![[1.0; 3]; width * 24]);
        write_exr(
            &folder.path().join("frame_0000.exr"),
            &layers,
            &ExrHeader::new(),
            true,
        )
        .unwrap();
    };
    let given = [
        "--budget",
        "0.001s",
        "--reference",
        folder.path().to_str().unwrap(),
    ];
    write(23);
    let said = complaint(&mut command(&folder.path().join("out"), &given), 1);
    assert!(
        said.contains("frame_0000.exr") && said.contains("23 x 24") && said.contains("--size"),
        "{said}"
    );
    write(24);
    let said = report(&folder.path().join("out"), &given);
    // Against white, a dim room is too dark.
    assert!(number(&settings(&said)[0], "bias") < 0.0);
    let findings = said["findings"].to_string();
    assert!(findings.contains("not known"), "{findings}");
    assert_eq!(said["references"][0]["floor_relmse"], Value::Null);
}

#[test]
fn of_a_dark_sequence_a_report_gives_no_advice() {
    let (out, lights) = (folder(), folder());
    let file = lights.path().join("dark.json");
    std::fs::write(&file, r#"{ "relight_sequence": 1, "lights": [] }"#).unwrap();
    let mut command = relight();
    command
        .arg("report")
        .arg(cornell())
        .arg("--lights")
        .arg(&file)
        .arg("-o")
        .arg(out.path());
    command.args(["--size", "8x8", "--json", "-q", "--budget", "1s"]);
    let said = json(&command.assert().success().get_output().stdout);
    let findings = said["findings"].as_array().unwrap();
    assert_eq!(findings.len(), 1, "{findings:?}");
    assert!(
        findings[0]
            .as_str()
            .unwrap()
            .contains("No light reaches the camera"),
        "{findings:?}"
    );
}
