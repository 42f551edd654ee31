//! `relight bake`.

use crate::stage::{
    SQUARE, TINY, bake_json, complaint, cornell, data, folder, gltf, inspect_json, is_dark, json, names,
    relight, sequence,
};
use serde_json::Value;

#[test]
fn the_json_of_a_bake_holds_what_scripts_rely_on() {
    let folder = folder();
    let asset = folder.path().join("new/folder/a.relight");
    let said = bake_json(&data("cornell.glb"), &asset, &TINY);
    assert!(said["points"].as_array().unwrap().iter().all(Value::is_u64));
    for key in ["links", "potential_links", "rays", "peak_memory_bytes"] {
        assert!(said[key].is_u64(), "{key}: {}", said[key]);
    }
    let seconds = said["seconds"].as_object().unwrap();
    for key in ["load", "points", "refine", "encode", "total", "ray_tracing"] {
        assert!(seconds[key].as_f64().unwrap() >= 0.0, "{key}");
    }
    let stages: f64 = seconds
        .iter()
        .filter(|s| *s.0 != "total" && *s.0 != "ray_tracing")
        .map(|s| s.1.as_f64().unwrap())
        .sum();
    let total = seconds["total"].as_f64().unwrap();
    assert!(stages <= total && stages > 0.5 * total, "{stages} of {total}");
    assert!(seconds["ray_tracing"].as_f64().unwrap() < total);
    assert!(said["bytes"]["total"].is_u64() && said["bytes"]["points"]["stored"].is_u64());
    assert_eq!(
        names(asset.parent().unwrap()),
        ["a.relight", "a.relight.log.json"]
    );
}

#[test]
fn an_asset_depends_on_scene_settings_and_seed_not_on_threads() {
    let folder = folder();
    let bytes = |name: &str, more: &[&str]| {
        let asset = folder.path().join(name);
        let options = [&TINY[..], more].concat();
        relight()
            .arg("bake")
            .arg(data("cornell.glb"))
            .arg("-o")
            .arg(&asset)
            .args(options)
            .assert()
            .success();
        std::fs::read(asset).unwrap()
    };
    let one = bytes("one", &["--threads", "1"]);
    assert!(
        one == bytes("two", &["--threads", "2"]),
        "one and two threads differ"
    );
    assert!(
        one == bytes("three", &["--threads", "3"]),
        "one and three threads differ"
    );
    assert!(one != bytes("seed", &["--seed", "1"]), "the seed changes nothing");
    assert!(
        one == std::fs::read(cornell()).unwrap(),
        "the path of the output changes the asset"
    );
}

#[test]
fn bounces_that_the_bake_solved_light_like_those_that_play_iterates() {
    let folder = folder();
    let baked = |name: &str, more: &[&str]| {
        let asset = folder.path().join(name);
        let said = bake_json(&data("cornell.glb"), &asset, &[&TINY[..], more].concat());
        let frame = asset.with_extension("exr");
        let mut play = relight();
        play.arg("play").arg(&asset).arg("-o").arg(&frame);
        play.args(["--frames", "0", "--size", "32x32"]).assert().success();
        (said, frame)
    };
    let (iterating, reference) = baked("iterating", &[]);
    let (solved, frame) = baked("solved", &["--solution"]);
    assert!(iterating["links_by_operator"]["bounce"] != 0 && iterating["links_by_operator"]["solution"] == 0);
    assert!(solved["links_by_operator"]["bounce"] == 0 && solved["links_by_operator"]["solution"] != 0);
    assert_eq!(solved["settings"]["solution"], "baked");
    let output = relight()
        .arg("compare")
        .args([&frame, &reference])
        .arg("--json")
        .assert()
        .success();
    let bias = json(&output.get_output().stdout)["layers"]["indirect"]["bias"]
        .as_f64()
        .unwrap();
    // The iteration stops within 1 %, the series within 0.1 %; truncation keeps the sums of rows.
    assert!(bias.abs() < 0.011, "{bias}");
}

#[test]
fn given_lights_decide_what_is_left_out() {
    let folder = folder();
    let asset = folder.path().join("a.relight");
    let lights = sequence(
        folder.path(),
        "l.json",
        r#"{"relight_sequence": 1, "lights": [{"name": "p", "type": "point", "position": [0.3, 0.3, 0.1],
            "intensity": [1, 1, 1]}]}"#,
    );
    let more = [&TINY[..], &["--lights", lights.to_str().unwrap()]].concat();
    let said = bake_json(&data("cornell.glb"), &asset, &more);
    let left_out: Vec<String> = said["left_out"]
        .as_array()
        .unwrap()
        .iter()
        .map(|l| l["what"].as_str().unwrap().to_owned())
        .collect();
    assert!(left_out.iter().any(|what| what.contains("light")), "{left_out:?}");
    assert!(
        left_out.iter().any(|what| what.contains("emission")),
        "{left_out:?}"
    );

    // What was left out is asked for: an error that names the way out.
    let frame = folder.path().join("f.exr");
    let text = complaint(relight().arg("play").arg(&asset).arg("-o").arg(&frame), 1);
    assert!(text.contains("--lights"), "{text}");
    let emissive = sequence(
        folder.path(),
        "e.json",
        r#"{"relight_sequence": 1, "lights": [{"name": "glow", "type": "emissive"}]}"#,
    );
    let text = complaint(
        relight()
            .arg("play")
            .arg(&asset)
            .arg("--lights")
            .arg(emissive)
            .arg("-o")
            .arg(&frame),
        1,
    );
    assert!(
        text.contains("glow") && text.contains("--keep emission"),
        "{text}"
    );
}

/// One flat square: nothing it reflects meets a surface again.
#[test]
fn a_scene_without_a_second_bounce_is_valid() {
    let folder = folder();
    let asset = folder.path().join("a.relight");
    let said = bake_json(
        &gltf(folder.path(), &SQUARE),
        &asset,
        &["--levels", "1", "--sender-levels", "1", "--coarse-radius", "0.2"],
    );
    assert_eq!(said["links"], 0);
    assert!(said["bytes"].get("links_transfer").is_none());
    assert!(
        said["notes"].to_string().contains("no indirect light"),
        "{}",
        said["notes"]
    );
    let lights = sequence(
        folder.path(),
        "l.json",
        r#"{"relight_sequence": 1, "lights": [{"name": "p", "type": "point", "position": [0, 0, 1], "intensity": [1, 1, 1]}]}"#,
    );
    let frame = folder.path().join("f.exr");
    relight()
        .arg("play")
        .arg(&asset)
        .arg("--lights")
        .arg(lights)
        .arg("-o")
        .arg(&frame)
        .args(["--size", "16x16"])
        .assert()
        .success();
    let layers = relight_scene::image::read_exr(&frame, &Default::default()).unwrap();
    assert!(layers.rgb("direct").unwrap().pixels.iter().any(|p| p[0] > 0.0));
    assert!(is_dark(&layers, "indirect"));
}

#[test]
fn a_failed_bake_leaves_the_old_asset_alone() {
    let folder = folder();
    let asset = folder.path().join("a.relight");
    std::fs::write(&asset, b"precious").unwrap();
    relight()
        .args(["bake", "no-such-scene.glb", "--force", "-o"])
        .arg(&asset)
        .assert()
        .code(1);
    assert_eq!(std::fs::read(&asset).unwrap(), b"precious");
    assert_eq!(names(folder.path()), ["a.relight"]);
}

/// A file system of 64 KiB in a name space of its own; skipped, loudly, where the system allows none. Twice: as it is, which is refused
/// from the number of points, and with `--force`, until the disk is full.
#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_an_error_that_leaves_nothing_behind() {
    for (force, linked) in [("", false), ("--force", true)] {
        let folder = folder();
        let script = format!(
            "mount -t tmpfs -o size=64k none {dir:?} || exit 99; \
             {program:?} bake {scene:?} -o {dir:?}/a.relight --levels 3 --sender-levels 2 --coarse-radius 0.1 {force}; \
             code=$?; ls -A {dir:?}; exit $code",
            dir = folder.path(),
            program = env!("CARGO_BIN_EXE_relight"),
            scene = data("cornell.glb"),
        );
        let output = std::process::Command::new("unshare")
            .args(["-rm", "sh", "-c", &script])
            .output();
        let Some(output) = output
            .ok()
            .filter(|o| !matches!(o.status.code(), Some(99) | None))
        else {
            eprintln!("SKIPPED: this system lets the test mount no small file system");
            return;
        };
        let text = String::from_utf8(output.stderr).unwrap();
        if text.contains("unshare") {
            eprintln!("SKIPPED: this system lets the test have no name space of its own ({text})");
            return;
        }
        assert_eq!(output.status.code(), Some(1), "{text}");
        assert!(text.contains("a.relight"), "{text}");
        assert_eq!(text.contains("Linking points"), linked, "{text}");
        assert!(linked || text.contains("its disk has"), "{text}");
        assert_eq!(
            String::from_utf8(output.stdout).unwrap(),
            "",
            "files were left behind"
        );
    }
}

/// No place of the box is open as far as disks of 50 m ask for; every level has points all the same.
#[test]
fn disks_wider_than_the_scene_still_have_points() {
    let folder = folder();
    let asset = folder.path().join("wide.relight");
    let options = ["--levels", "2", "--sender-levels", "2", "--coarse-radius", "50"];
    let said = bake_json(&data("cornell.glb"), &asset, &options);
    let points = said["points"].as_array().unwrap();
    assert!(points.iter().all(|n| n.as_u64().unwrap() > 0), "{points:?}");
}

/// Truth: the path tracer with a seed of its own, at the camera's own pixels, of which the check takes none.
#[test]
fn a_bake_measures_itself_as_the_path_tracer_measures_it() {
    let folder = folder();
    let asset = folder.path().join("a.relight");
    let lights = data("cornell.lights.json");
    let said = bake_json(
        &data("cornell.glb"),
        &asset,
        &["--preset", "draft", "--lights", lights.to_str().unwrap()],
    );
    let expected = &said["expected"];
    let error = expected["error"].as_f64().unwrap();
    let frame = |name: &str, more: &[&str]| {
        let image = folder.path().join(name);
        let mut play = relight();
        play.arg("play").arg(&asset).arg("-o").arg(&image);
        play.arg("--lights").arg(&lights);
        play.args(["--size", "64x64", "--float", "--json"]).args(more);
        let told = json(&play.assert().success().get_output().stdout);
        // What the path tracer makes owes nothing to the asset's operators.
        if more.is_empty() {
            assert_eq!(&told["expected"], expected, "play repeats it");
        }
        relight_scene::image::read_exr(&image, &relight_scene::image::Limits::default())
            .unwrap()
            .rgb("indirect")
            .unwrap()
    };
    let played = frame("p.exr", &[]);
    let [a, b] = ["11", "12"].map(|seed| {
        let path = ["--integrator", "path", "--spp", "256", "--seed", seed];
        frame(&format!("{seed}.exr"), &path)
    });
    let relmse = |x, y| relight_scene::image::metrics::relmse(x, y).unwrap();
    // Half of what two references differ by is the noise of one.
    let truth = (0.5 * (relmse(&played, &a) + relmse(&played, &b)) - 0.5 * relmse(&a, &b)).sqrt();
    // It says itself how sure it is: two standard errors.
    let noise = 2.0 * expected["error_noise"].as_f64().unwrap();
    assert!(noise < 0.06, "{noise}");
    assert!(
        error - noise < 1.5 * truth && truth < 1.5 * (error + noise),
        "{error} ± {noise}, {truth}"
    );
    assert_eq!(&inspect_json(&asset)["expected"], expected, "inspect repeats it");
}

/// Points farther apart than the rooms are wide know nothing of the wall between them.
#[test]
fn a_broken_bake_is_loud_and_strict_makes_it_an_exit_code() {
    let folder = folder();
    let lights = data("two_rooms_far.lights.json");
    let broken = |more: &[&str]| {
        let mut bake = relight();
        bake.arg("bake").arg(data("two_rooms.glb"));
        bake.arg("-o").arg(folder.path().join("broken.relight"));
        bake.arg("--lights").arg(&lights);
        bake.args(["--levels", "1", "--sender-levels", "1", "--coarse-radius", "8"]);
        bake.args(more).assert()
    };
    for (more, code) in [(&[][..], 0), (&["--strict"], 3)] {
        let output = broken(more).code(code).get_output().clone();
        let text = String::from_utf8(output.stderr).unwrap();
        assert!(
            text.contains("WARNING") && text.contains("--coarse-radius"),
            "{text}"
        );
    }
}

#[test]
fn without_any_light_a_bake_measures_itself_under_test_lights() {
    let folder = folder();
    let said = bake_json(
        &data("two_rooms.glb"),
        &folder.path().join("a.relight"),
        &["--levels", "2", "--sender-levels", "1", "--coarse-radius", "0.8"],
    );
    assert!(said["expected"]["error"].as_f64().unwrap() > 0.0);
    assert!(said["expected"]["bias_noise"].as_f64().unwrap() > 0.0);
}

/// The estimate is of other pixels; that these err likewise, docs/notebook/report.md measures.
#[test]
fn a_bake_for_an_error_says_what_it_expects_and_the_asset_repeats_it() {
    let folder = folder();
    let asset = folder.path().join("a.relight");
    let lights = data("cornell.lights.json");
    let lights = ["--lights", lights.to_str().unwrap()];
    let said = bake_json(
        &data("cornell.glb"),
        &asset,
        &[&["--target-error", "50%"][..], &lights].concat(),
    );
    let estimates = &said["estimates"];
    assert_eq!(estimates["target_error"], 0.5);
    let error = estimates["error_indirect"].as_f64().unwrap();
    assert!(error > 0.0 && error < 1.15 * 0.5, "{error}");
    let shown = relight()
        .arg("inspect")
        .arg(&asset)
        .assert()
        .success()
        .get_output()
        .stdout
        .clone();
    assert!(String::from_utf8(shown).unwrap().contains("expected to err by"));
    let frame = folder.path().join("f.exr");
    let mut play = relight();
    play.arg("play")
        .arg(&asset)
        .args(lights)
        .arg("-o")
        .arg(&frame)
        .args(["--frames", "0", "--size", "16x16"]);
    let told = play.assert().success().get_output().stderr.clone();
    assert!(String::from_utf8(told).unwrap().contains("expected to err by"));
    // What E chooses cannot be chosen beside it.
    let mut both = relight();
    both.arg("bake").arg(data("cornell.glb")).arg("-o").arg(&asset);
    both.args(["--target-error", "0.1", "--epsilon", "0.1"])
        .assert()
        .code(2);
}

/// Truth: path tracing of the same triangles, whose places `relight_scene` tests.
#[test]
fn implicit_surfaces_and_volumes_are_baked_by_their_description() {
    let folder = folder();
    let asset = folder.path().join("bonsai.relight");
    let said = bake_json(&data("isosurface.scene.json"), &asset, &["--preset", "draft"]);
    assert!(said["links"].as_u64().unwrap() > 1000);
    let frame = |name: &str, more: &[&str]| {
        let image = folder.path().join(name);
        relight()
            .args([
                "play", "--frames", "0", "--size", "60x48", "--layers", "indirect", "--float", "--lights",
            ])
            .arg(data("isosurface.lights.json"))
            .arg(&asset)
            .arg("-o")
            .arg(&image)
            .args(more)
            .assert()
            .success();
        image
    };
    let relit = frame("relit.exr", &[]);
    let traced = frame("traced.exr", &["--integrator", "path", "--spp", "256"]);
    let compared = relight()
        .args(["compare", "--json", "--layer", "indirect"])
        .args([relit, traced])
        .assert()
        .success();
    let layer = &json(&compared.get_output().stdout)["layers"]["indirect"];
    // A draft: measured are 0.007 and −1.6 % (docs/notebook/transfer.md); more is the noise of 256 paths and of few pixels.
    assert!(layer["relmse"].as_f64().unwrap() < 0.03, "{layer}");
    assert!(layer["bias"].as_f64().unwrap().abs() < 0.04, "{layer}");

    let wrong = folder.path().join("wrong.scene.json");
    std::fs::write(&wrong, r#"{ "relight_scene": 1, "spheres": [] }"#).unwrap();
    let said = complaint(relight().arg("bake").arg(&wrong).arg("-o").arg(&asset), 1);
    assert!(
        said.contains("wrong.scene.json") && said.contains("spheres"),
        "{said}"
    );
}
