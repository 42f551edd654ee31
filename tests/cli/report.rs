//! Reports: what is measured, what is written, that a stopped one goes on, and that the page works in a browser.

use crate::stage::{complaint, cornell, data, folder, json, names, relight};
use relight_scene::image::{BEAUTY, ExrHeader, Layers, decode_ldr, write_exr};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;
use tempfile::TempDir;

fn command(out: &Path, more: &[&str]) -> assert_cmd::Command {
    let mut command = relight();
    command
        .arg("report")
        .arg(cornell())
        .arg("--lights")
        .arg(data("cornell.lights.json"))
        .arg("-o")
        .arg(out)
        .args(["--size", "24x24", "--json", "-q"])
        .args(more);
    command
}

fn report(out: &Path, more: &[&str]) -> Value {
    json(&command(out, more).assert().success().get_output().stdout)
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
fn shared() -> (&'static Path, &'static Value) {
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
        assert_eq!(setting["repetitions"].as_array().unwrap().len(), 3);
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
            let better = number(b, "ms_per_frame") < number(a, "ms_per_frame");
            assert!(
                !(better && number(b, "error") < number(a, "error")),
                "{b} beats {a}"
            );
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
    let second = report(folder.path(), &["--budget", "3s"]);
    assert!(samples(&second) > samples(&first));
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

fn chromium() -> Option<PathBuf> {
    let named = std::env::var_os("RELIGHT_CHROMIUM").map(PathBuf::from);
    let paths = std::env::var_os("PATH").unwrap_or_default();
    let found = std::env::split_paths(&paths)
        .flat_map(|folder| ["chromium", "chromium-browser", "google-chrome"].map(|name| folder.join(name)))
        .find(|program| program.is_file());
    named.or(found)
}

/// Clicks and keys, and what must have come of them; the title says how it went.
const HARNESS: &str = r#"<script>{
const check = (holds, what) => { if (!holds) wrong.push(what); };
for (const plot of document.querySelectorAll("figure.plot"))
  check(plot.querySelectorAll("svg circle").length > 1 && plot.getBoundingClientRect().height > 100, "plot " + plot.id);
const table = document.querySelector("table.sortable");
const column = () => [...table.tBodies[0].rows].map((row) => parseFloat(row.cells[2].textContent));
const rises = (list) => list.every((value, i) => i === 0 || list[i - 1] <= value);
table.tHead.rows[0].cells[2].click();
check(rises(column()), "ascending");
table.tHead.rows[0].cells[2].click();
check(rises(column().reverse()) && !rises(column()), "descending");
const shown = (figure) => [...figure.querySelectorAll("img")].findIndex((image) => image.offsetHeight > 0);
const figures = [...document.querySelectorAll("figure.flip")];
check(figures.length > 5 && figures.every((figure) => shown(figure) === 0), "pictures first");
figures[0].click();
check(shown(figures[0]) === 1 && shown(figures[1]) === 0, "one reference after a click");
document.dispatchEvent(new KeyboardEvent("keydown", { key: "3" }));
check(figures.every((figure) => shown(figure) === 2), "error maps after 3");
check([...document.images].every((image) => image.complete && image.naturalWidth === 24), "pictures load");
document.title = "tested: " + (wrong.length ? wrong.join("; ") : "all well");
}</script>"#;

#[test]
fn in_a_browser_plots_show_tables_sort_and_pictures_flip() {
    let Some(browser) = chromium() else {
        assert!(
            std::env::var_os("RELIGHT_BROWSER_REQUIRED").is_none(),
            "no Chromium, though it is required"
        );
        eprintln!("SKIPPED: no Chromium on this machine: the report's page was NOT tested in a browser");
        return;
    };
    let (report, _) = shared();
    let page = std::fs::read_to_string(report.join("report.html")).unwrap();
    let catcher = "<script>const wrong = []; addEventListener(\"error\", (e) => wrong.push(e.message));</script></head>";
    let page = page
        .replacen("</head>", catcher, 1)
        .replacen("</body>", &format!("{HARNESS}</body>"), 1);
    let folder = folder();
    let file = folder.path().join("tested.html");
    std::fs::write(&file, page).unwrap();
    let output = Command::new(browser)
        .args([
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--enable-logging=stderr",
            "--dump-dom",
        ])
        .arg(format!(
            "--user-data-dir={}",
            folder.path().join("profile").display()
        ))
        .arg(format!("file://{}", file.display()))
        .output()
        .unwrap();
    let (dom, log) = (
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr),
    );
    assert!(
        dom.contains("<title>tested: all well</title>"),
        "{:.400}\n{log}",
        dom
    );
    assert!(!log.contains("CONSOLE"), "{log}");
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
