//! `relight inspect`.

use crate::stage::{complaint, cornell, folder, inspect_json, json, relight, with_broken_links};

#[test]
fn what_inspect_says_agrees_with_what_bake_said() {
    let said = inspect_json(cornell());
    let points = said["points"].as_array().unwrap();
    assert_eq!(points.len(), 2);
    // Radii halve, so counts grow about fourfold on surfaces.
    let [coarse, fine] = [0, 1].map(|i| points[i].as_u64().unwrap());
    assert!(fine > 2 * coarse && fine < 8 * coarse, "{coarse}, {fine}");
    let receivers = coarse + fine;
    assert_eq!(said["potential_links"], receivers * coarse);
    let links = said["links"].as_u64().unwrap();
    assert!(links > 0 && links <= receivers * coarse);
    let bytes = said["bytes"].as_object().unwrap();
    assert_eq!(bytes["total"], std::fs::metadata(cornell()).unwrap().len());
    let stored: u64 = bytes.values().filter_map(|s| s["stored"].as_u64()).sum();
    assert!(stored < bytes["total"].as_u64().unwrap());
    assert!(bytes["links_transfer"]["raw"].as_u64().unwrap() > 0);
    assert!(
        said["seconds"]["total"].as_f64().unwrap() > 0.0,
        "the log lies beside the asset"
    );
    assert!(said["left_out"].is_array());
    assert!(said["rays"].as_u64().unwrap() > 0);
}

#[test]
fn without_its_log_an_asset_has_no_times() {
    let folder = folder();
    let alone = folder.path().join("alone.relight");
    std::fs::copy(cornell(), &alone).unwrap();
    let said = inspect_json(&alone);
    assert!(said.get("seconds").is_none());
    let output = relight()
        .arg("inspect")
        .arg(&alone)
        .assert()
        .success()
        .get_output()
        .clone();
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(
        text.contains("links_transfer") && !text.contains("seconds"),
        "{text}"
    );
}

#[test]
fn a_log_that_is_none_is_left_aside_with_a_note() {
    let folder = folder();
    let asset = folder.path().join("a.relight");
    std::fs::copy(cornell(), &asset).unwrap();
    let log = folder.path().join("a.relight.log.json");
    for text in ["{", r#"{"schema": 1, "seconds": 3, "threads": 2}"#] {
        std::fs::write(&log, text).unwrap();
        let mut command = relight();
        command.arg("inspect").arg(&asset).arg("--json");
        let output = command.assert().success().get_output().clone();
        assert!(json(&output.stdout).get("seconds").is_none());
        let notes = String::from_utf8(output.stderr).unwrap();
        assert!(
            notes.contains("a.relight.log.json") && notes.contains("left aside"),
            "{notes}"
        );
    }
}

#[test]
fn damage_anywhere_is_noticed() {
    let whole = std::fs::read(cornell()).unwrap();
    let folder = folder();
    let broken = folder.path().join("broken.relight");
    // Strict prefixes, and single flipped bits spread over the file.
    let ends = [0, 1, 55, 56, whole.len() / 2, whole.len() - 1];
    let mut cases: Vec<Vec<u8>> = ends.iter().map(|&end| whole[..end].to_vec()).collect();
    for i in 0..16 {
        let mut flipped = whole.clone();
        flipped[i * (whole.len() - 1) / 15] ^= 1 << (i % 8);
        cases.push(flipped);
    }
    for case in cases {
        std::fs::write(&broken, &case).unwrap();
        let text = complaint(
            relight().arg("inspect").arg(&broken).args(["--verify", "--json"]),
            1,
        );
        assert!(text.contains("broken.relight"), "{text}");
    }
}

#[test]
fn every_level_can_be_drawn() {
    let folder = folder();
    let images = folder.path().join("images");
    relight()
        .arg("inspect")
        .arg(cornell())
        .arg("--images")
        .arg(&images)
        .assert()
        .success();
    assert_eq!(crate::stage::names(&images), ["level_0.png", "level_1.png"]);
    let bytes = |name: &str| std::fs::read(images.join(name)).unwrap();
    assert!(bytes("level_0.png") != bytes("level_1.png"));
}

/// What `inspect` says stands in provenance: what the links themselves are, it never reads, unless it is asked to.
#[test]
fn links_are_counted_without_being_read() {
    let folder = folder();
    let broken = with_broken_links(folder.path(), |links| links.fill(0));
    let said = |asset: &std::path::Path| {
        let mut said = inspect_json(asset);
        // What the log beside the file says, and the file's name.
        for key in ["asset", "seconds", "peak_memory_bytes", "threads"] {
            said.as_object_mut().unwrap().remove(key);
        }
        for left in said["left_out"].as_array_mut().unwrap() {
            left.as_object_mut().unwrap().remove("saved_seconds");
        }
        said
    };
    assert_eq!(said(&broken), said(cornell()));
    let text = complaint(relight().arg("inspect").arg(&broken).arg("--verify"), 1);
    assert!(
        text.contains("links_transfer") && text.contains("checksum"),
        "{text}"
    );
    let verified = relight()
        .arg("inspect")
        .arg(cornell())
        .args(["--verify", "--json"])
        .assert()
        .success();
    assert_eq!(json(&verified.get_output().stdout)["verified"], true);
}

/// Truth: data/generate's Cornell box.
#[test]
fn names_that_options_take_are_listed() {
    let names = &inspect_json(cornell())["names"];
    assert_eq!(names["cameras"], serde_json::json!(["Camera"]));
    assert_eq!(names["lights"].as_array().unwrap().len(), 1);
    assert_eq!(names["materials"].as_array().unwrap().len(), 4);
    let run = relight().arg("inspect").arg(cornell()).assert().success();
    let text = String::from_utf8(run.get_output().stdout.clone()).unwrap();
    assert!(
        text.contains("cameras    \"Camera\"") && text.contains("materials  \""),
        "{text}"
    );
}
