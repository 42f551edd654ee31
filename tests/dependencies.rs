//! Which crate may use which: `cli`, `python` → `probes` → `bake`, `play`; `bake`, `play` → `render` → `scene`, `transport`; `bake` and
//! `play` also → `format`; `cli` → `view` → `play`.
//! `scene`, `transport`, `format` and `data/generate`, which `cli` alone uses, use none of ours; neither `play` nor `render` uses `bake`, nor the glTF importer.

use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;

/// What each crate of the product may use of ours. Whoever adds a line here changes the architecture.
const ALLOWED: [(&str, &[&str]); 11] = [
    (
        "relight",
        &[
            "relight-bake",
            // Random scenes for `check`.
            "relight-data-generate",
            "relight-play",
            "relight-probes",
            "relight-render",
            "relight-scene",
            "relight-transport",
            "relight-format",
            "relight-view",
        ],
    ),
    ("relight-view", &["relight-play"]),
    (
        "relight-python",
        &[
            "relight-bake",
            "relight-format",
            "relight-play",
            "relight-probes",
            "relight-scene",
        ],
    ),
    (
        "relight-probes",
        &[
            "relight-bake",
            "relight-play",
            "relight-render",
            "relight-scene",
            "relight-transport",
            "relight-format",
        ],
    ),
    (
        "relight-bake",
        &["relight-scene", "relight-transport", "relight-format"],
    ),
    (
        "relight-play",
        &[
            "relight-render",
            "relight-scene",
            "relight-transport",
            "relight-format",
        ],
    ),
    ("relight-render", &["relight-scene", "relight-transport"]),
    ("relight-scene", &[]),
    ("relight-transport", &[]),
    ("relight-format", &[]),
    ("relight-data-generate", &[]),
];

/// What Cargo prints of this workspace.
fn cargo(words: &[&str]) -> String {
    let output = Command::new(env!("CARGO"))
        .args(words)
        .arg("--offline")
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    String::from_utf8(output.stdout).unwrap()
}

fn metadata() -> Value {
    serde_json::from_str(&cargo(&["metadata", "--no-deps", "--format-version", "1"])).unwrap()
}

fn dependencies(package: &Value) -> impl Iterator<Item = &Value> {
    // Development dependencies reach no user.
    package["dependencies"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|d| d["kind"] != "dev")
}

#[test]
fn no_crate_uses_one_that_it_must_not_know() {
    let metadata = metadata();
    let mut seen = BTreeMap::new();
    for package in metadata["packages"].as_array().unwrap() {
        let ours: BTreeSet<&str> = dependencies(package)
            .map(|d| d["name"].as_str().unwrap())
            .filter(|name| *name == "relight" || name.starts_with("relight-"))
            .collect();
        seen.insert(package["name"].as_str().unwrap(), ours);
    }
    for (name, allowed) in ALLOWED {
        let ours = seen
            .get(name)
            .unwrap_or_else(|| panic!("crate {name} is gone: mend this table"));
        let forbidden: Vec<_> = ours.iter().filter(|d| !allowed.contains(d)).collect();
        assert!(forbidden.is_empty(), "{name} must not depend on {forbidden:?}");
    }
}

#[test]
fn the_player_builds_without_an_importer() {
    let metadata = metadata();
    let packages = metadata["packages"].as_array().unwrap();
    let package = |name: &str| packages.iter().find(|p| p["name"] == name).unwrap();
    let scene = package("relight-scene");
    assert_eq!(
        scene["features"]["default"],
        Value::Null,
        "features of relight-scene must be off by default"
    );
    for name in ["relight-play", "relight-render"] {
        let used = dependencies(package(name))
            .find(|d| d["name"] == "relight-scene")
            .unwrap();
        assert_eq!(used["features"], serde_json::json!([]), "{name}");
    }
    let gltf = dependencies(scene).find(|d| d["name"] == "gltf").unwrap();
    assert_eq!(gltf["optional"], true);
}

/// Who may turn values into bytes or read them: the file is `format`'s alone. `transport` knows no form of anything.
const BYTES: [(&str, &[&str]); 4] = [
    ("bincode", &["relight-format"]),
    // `scene`: textures of others may be compressed so.
    ("zstd", &["relight-format", "relight-scene"]),
    // `probes`: what they found is a part of what commands print.
    (
        "serde",
        &["relight", "relight-probes", "relight-scene", "relight-view"],
    ),
    (
        "serde_json",
        &[
            "relight",
            "relight-data-generate",
            "relight-scene",
            "relight-view",
        ],
    ),
];

#[test]
fn only_format_knows_bytes() {
    let metadata = metadata();
    for package in metadata["packages"].as_array().unwrap() {
        let name = package["name"].as_str().unwrap();
        for (library, allowed) in BYTES {
            let uses = dependencies(package).any(|d| d["name"] == library);
            assert!(
                !uses || allowed.contains(&name),
                "{name} must not depend on {library}"
            );
        }
    }
}

/// Who builds the program or the module for Python alone builds nothing again that the workspace's tests were built with.
#[test]
fn program_and_module_have_the_features_of_the_workspace() {
    let packages = |what: &[&str]| -> BTreeSet<String> {
        let form = ["tree", "--locked", "--prefix", "none", "--format", "{p} [{f}]"];
        let lines = cargo(&[&form, what].concat());
        let lines = lines.lines().map(|line| line.trim_end_matches(" (*)").to_owned());
        lines.filter(|line| !line.is_empty()).collect()
    };
    let all = packages(&["--edges", "normal,build,dev", "--workspace"]);
    for package in ["relight", "relight-python"] {
        let own = packages(&["--edges", "normal,build", "--package", package]);
        let alone: Vec<_> = own.difference(&all).collect();
        assert!(
            own.len() > 50 && alone.is_empty(),
            "name these features in the Cargo.toml of {package}: {alone:?}"
        );
    }
}
