//! `relight inspect`.

use crate::stage::{
    SQUARE, TINY, complaint, cornell, data, folder, gltf, inspect_json, json, relight, sequence,
    with_broken_links,
};

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

/// Truth: closed forms. 1 W/sr of white light is 683 cd and 4π × 683 lm; I cos θ / d² of it arrives on a floor.
#[test]
fn lights_are_told_in_lumens_candela_and_lux() {
    let folder = folder();
    let square = gltf(folder.path(), &SQUARE);
    let asset = folder.path().join("a.relight");
    relight()
        .arg("bake")
        .arg(&square)
        .arg("-o")
        .arg(&asset)
        .args(TINY)
        .assert()
        .success();
    let lights = sequence(
        folder.path(),
        "l.json",
        r#"{ "relight_sequence": 1, "frames": 2, "lights": [
            { "name": "bulb", "type": "point", "position": [0, 3, 5], "intensity": {"keys": [[0, [1, 1, 1]], [1, [2, 2, 2]]]} },
            { "name": "panel", "type": "rect", "center": [0, 30, 5], "edge_u": [1, 0, 0], "edge_v": [0, 0, 2], "radiance": [1, 1, 1] },
            { "name": "sun", "type": "directional", "direction": [0, -1, -1], "irradiance": [0, 1, 0] },
            { "name": "lamp", "type": "ies", "file": "TILT=NONE\n1 -1 1 2 1 1 2 0 0 0\n1 1 9\n0 180\n0\n10 10", "position": [0, 3, 5] } ] }"#,
    );
    let mut command = relight();
    command
        .arg("inspect")
        .arg(&asset)
        .args(["--json", "--lux", "0,1,5", "--frame", "1", "--lights"])
        .arg(&lights);
    let said = json(&command.assert().success().get_output().stdout);
    let of = |i: usize, field: &str| said["photometry"]["lights"][i][field].as_f64();
    let close = |found: Option<f64>, truth: f64| {
        let found = found.unwrap();
        assert!((found / truth - 1.0).abs() < 1e-3, "{found}, not {truth}");
    };
    let pi = std::f64::consts::PI;
    close(of(0, "candela"), 2.0 * 683.0);
    close(of(0, "lumens"), 4.0 * pi * 2.0 * 683.0);
    // 2 m above.
    close(of(0, "lux_at_place"), 2.0 * 683.0 / 4.0);
    close(of(1, "candela"), 2.0 * 683.0);
    close(of(1, "lumens"), 2.0 * pi * 683.0);
    // From 29 m above: cos⁴ over its 1 m × 2 m, to the second order.
    close(
        of(1, "lux_at_place"),
        683.0 * 2.0 / 841.0 * (1.0 - 2.0 * (5.0 / 12.0) / 841.0),
    );
    close(of(2, "lux"), 0.7152 * 683.0);
    close(of(2, "lux_at_place"), 0.7152 * 683.0 * 0.5f64.sqrt());
    assert_eq!(of(2, "lumens"), None);
    close(of(3, "file_lumens"), 40.0 * pi);
    close(of(3, "lux_at_place"), 10.0 * 683.0 / 4.0);
    let place = &said["photometry"]["place"];
    let direct: f64 = (0..4).map(|i| of(i, "lux_at_place").unwrap()).sum();
    close(place["lux_direct"].as_f64(), direct);
    assert!(place["lux_reflected"].as_f64().unwrap() >= 0.0);
    // The scene's own: candela of the file, unless it was written in others.
    let boxed = folder.path().join("b.relight");
    relight()
        .arg("bake")
        .arg(data("cornell.glb"))
        .arg("-o")
        .arg(&boxed)
        .args(TINY)
        .assert()
        .success();
    for (units, factor) in [("spec", 1.0), ("raw", 683.0)] {
        let mut command = relight();
        command
            .arg("inspect")
            .arg(&boxed)
            .args(["--json", "--light-units", units]);
        let own = json(&command.assert().success().get_output().stdout);
        let own = &own["photometry"]["lights"][0];
        assert_eq!(own["lumens_per_watt"].as_f64(), Some(factor), "{own}");
    }
    let mut command = relight();
    command
        .arg("inspect")
        .arg(&asset)
        .args(["--lux", "0,1,5", "--lights"])
        .arg(&lights);
    let text = String::from_utf8(command.assert().success().get_output().stdout.clone()).unwrap();
    assert!(
        text.contains("photometry \"bulb\": 8,583 lm, 683 cd at most, 171 lx at the place (683 lm/W)"),
        "{text}"
    );
    assert!(text.contains("lx at 0, 1, 5, facing up: "), "{text}");
    let mut command = relight();
    command
        .arg("inspect")
        .arg(&asset)
        .args(["--frame", "2", "--lights"])
        .arg(&lights);
    assert!(complaint(&mut command, 2).contains("the sequence has frames 0 to 1"));
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
