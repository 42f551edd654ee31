//! `relight check`.

use crate::stage::{bake_json, complaint, cornell, data, folder, json, relight};
use relight_format::{Limits, read_file, write_file};
use serde_json::Value;

#[test]
fn the_suite_names_its_cases_and_says_what_must_hold() {
    let output = relight().args(["check", "--list"]).assert().success();
    let text = String::from_utf8(output.get_output().stdout.clone()).unwrap();
    for name in [
        "furnace/sphere/0.999",
        "bounce/rooms",
        "lights/million",
        "geometry/not-finite",
    ] {
        assert!(text.contains(name), "{text}");
    }
    let said = complaint(relight().args(["check", "--case", "no-such"]), 2);
    assert!(said.contains("no-such") && said.contains("--list"), "{said}");
    relight().args(["check", "a.relight", "--fast"]).assert().code(2);
}

#[test]
fn a_case_gives_numbers_bounds_and_reasons() {
    let output = relight()
        .args(["check", "--case", "bounce/rooms", "--case", "sums/", "--json"])
        .assert()
        .success();
    let said = json(&output.get_output().stdout);
    assert_eq!(said["passed"], true);
    let cases = said["cases"].as_array().unwrap();
    assert!(cases.len() >= 5);
    for case in cases {
        assert_eq!(case["ok"], true);
        assert!(case["value"].as_f64().unwrap() <= case["bound"].as_f64().unwrap());
        assert!(case["name"].is_string() && case["why"].is_string() && case["margin"].is_number());
    }
    let products = cases
        .iter()
        .find(|c| c["name"] == "bounce/rooms: products")
        .unwrap();
    assert!(products["value"].as_f64().unwrap() <= 40.0);
}

#[test]
fn an_asset_is_checked_and_one_whose_links_give_too_much_falls_short() {
    let folder = folder();
    let asset = folder.path().join("cornell.relight");
    bake_json(
        &data("cornell.glb"),
        &asset,
        &["--lambert", "--levels", "4", "--sender-levels", "3"],
    );
    let check = |path: &std::path::Path| relight().arg("check").arg(path).arg("--json").assert();
    let good = check(&asset).success();
    let said = json(&good.get_output().stdout);
    assert_eq!(said["passed"], true);
    let names: Vec<&str> = said["cases"]
        .as_array()
        .unwrap()
        .iter()
        .filter_map(|c| c["name"].as_str())
        .collect();
    for part in ["file:", "basis:", "coverage:", "bounces:", "links:", "light:"] {
        assert!(names.iter().any(|n| n.starts_with(part)), "{names:?}");
    }

    // A tenth more light in every link: no checksum minds, no rule of the format is broken.
    let mut broken = read_file(&asset, &Limits::default()).unwrap();
    for v in &mut broken.transfer.as_mut().unwrap().vectors {
        *v = v.map(|x| 1.1 * x);
    }
    let path = folder.path().join("broken.relight");
    write_file(&path, &broken).unwrap();
    let fell = check(&path).code(3);
    let said = json(&fell.get_output().stdout);
    let short: Vec<&Value> = said["cases"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|c| c["ok"] == false)
        .collect();
    assert!(
        short
            .iter()
            .any(|c| c["name"] == "links: even light, mean against fresh rays" && c["stage"] == "links"),
        "{short:?}"
    );
    let words = String::from_utf8(fell.get_output().stderr.clone()).unwrap();
    assert!(words.contains("above its bound"), "{words}");
}

#[test]
fn a_damaged_asset_is_an_error() {
    let folder = folder();
    let mut bytes = std::fs::read(cornell()).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    let path = folder.path().join("damaged.relight");
    std::fs::write(&path, bytes).unwrap();
    let said = complaint(relight().arg("check").arg(&path), 1);
    assert!(said.contains("damaged.relight"), "{said}");
}
