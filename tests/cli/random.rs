//! `relight check --random`: scenes of seeds, which import without complaints and are measured one by one.

use crate::stage::{folder, json, names, relight, send};
use relight_data_generate::random;
use relight_scene::gltf::{ImportOptions, import};
use relight_scene::sequence::read_sequence_at;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

#[test]
fn every_seed_imports_and_nothing_is_noted_but_where_it_stands() {
    let folder = folder();
    let (file, lights) = (folder.path().join("s.glb"), folder.path().join("s.lights.json"));
    for seed in 0..50 {
        let scene = random(seed);
        std::fs::write(&file, scene.glb.to_bytes()).unwrap();
        std::fs::write(&lights, &scene.sequence).unwrap();
        let imported = import(&file, &ImportOptions::default()).unwrap_or_else(|e| panic!("{seed}: {e}"));
        let moved = |note: &String| note.starts_with("the scene lies far from its origin");
        let notes: Vec<&String> = imported.notes.iter().filter(|note| !moved(note)).collect();
        assert!(notes.is_empty(), "{seed}: {notes:?}");
        // Where the file says that it stands far away, the importer has found so.
        let far = scene.says.contains("offset 1e6") || scene.says.contains("offset 2e6");
        assert!(!far || imported.offset.length() > 0.0, "{seed}: {}", scene.says);
        read_sequence_at(&lights, imported.offset).unwrap_or_else(|e| panic!("{seed}: {e}"));
    }
}

#[test]
fn seeds_are_measured_and_told_one_by_one() {
    let folder = folder();
    let output = relight()
        .args(["check", "--random", "2", "--seed", "10", "--json", "--images"])
        .arg(folder.path())
        .output()
        .unwrap();
    // Whether they are within their bounds is for .ci/run to say.
    assert!(matches!(output.status.code(), Some(0 | 3)));
    let said = json(&output.stdout);
    let seeds = said["random"]["seeds"].as_array().unwrap();
    assert_eq!(seeds.len(), 2);
    for (k, seed) in seeds.iter().enumerate() {
        assert_eq!(seed["seed"], 10 + k);
        assert_eq!(seed["says"], random(10 + k as u64).says);
        assert!(seed["failed"].is_null(), "{seed}");
        for layer in ["indirect", "direct"] {
            let of = |what: &str| seed[layer][what].as_f64().unwrap();
            assert!(
                of("error") >= 0.0 && of("noise").is_finite() && of("bias") > -1.0,
                "{seed}"
            );
        }
        assert!(seed["points"].as_f64().unwrap() > 100.0);
    }
    let spread = &said["random"]["distribution"][0];
    assert_eq!(spread["what"], "indirect error");
    assert!(spread["median"].as_f64().unwrap() <= spread["worst"].as_f64().unwrap());
    let files = names(folder.path());
    assert!(
        ["random_10.glb", "random_10.lights.json", "random_10.png"]
            .iter()
            .all(|f| files.iter().any(|g| g == f))
    );
    relight().args(["check", "--random", "0"]).assert().code(2);
}

/// At any moment: bake, frame or path tracing.
#[cfg(unix)]
#[test]
fn it_stops_within_two_seconds_of_a_signal() {
    for milliseconds in [300, 1100, 2300] {
        let mut child = Command::new(env!("CARGO_BIN_EXE_relight"))
            .args(["check", "--random", "40", "--quiet"])
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        std::thread::sleep(Duration::from_millis(milliseconds));
        send("-TERM", &child);
        let asked = Instant::now();
        assert_eq!(child.wait().unwrap().code(), Some(143));
        assert!(asked.elapsed() < Duration::from_secs(2), "{:?}", asked.elapsed());
    }
}
