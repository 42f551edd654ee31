//! What `docs/sequences.md` and `docs/materials.md` say is all there is, and their examples play.

use crate::stage::{TINY, complaint, data, folder, relight, sequence};
use relight_scene::schema;
use serde_json::Value;
use std::collections::BTreeSet;
use std::path::Path;

fn page(name: &str) -> String {
    std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs").join(name)).unwrap()
}

/// Names of fields, and values that are names, anywhere in a schema.
fn names(schema: &Value, found: &mut BTreeSet<String>) {
    match schema {
        Value::Object(fields) => {
            if let Some(Value::Object(properties)) = fields.get("properties") {
                found.extend(properties.keys().cloned());
            }
            for key in ["const", "enum"] {
                let named = fields
                    .get(key)
                    .into_iter()
                    .flat_map(|v| v.as_array().cloned().unwrap_or(vec![v.clone()]));
                found.extend(named.filter_map(|v| v.as_str().map(str::to_owned)));
            }
            fields.values().for_each(|value| names(value, found));
        }
        Value::Array(items) => items.iter().for_each(|item| names(item, found)),
        _ => {}
    }
}

#[test]
fn pages_name_every_field_of_their_schema() {
    for (name, schema) in [
        ("sequences.md", schema::sequence()),
        ("materials.md", schema::materials()),
    ] {
        let (page, mut fields) = (page(name), BTreeSet::new());
        names(&schema, &mut fields);
        assert!(fields.len() > 15, "{fields:?}");
        for field in fields {
            assert!(
                page.contains(&format!("`{field}`")),
                "docs/{name} does not say what `{field}` is"
            );
        }
    }
}

/// The JSON between fences of a page.
fn examples(page: &str) -> Vec<&str> {
    let blocks = page.split("```json\n").skip(1);
    blocks.map(|block| block.split("```").next().unwrap()).collect()
}

#[test]
fn examples_of_the_pages_play() {
    let folder = folder();
    let asset = folder.path().join("table.relight");
    let coarse = [&TINY[..4], &["--coarse-radius", "0.6"]].concat();
    let mut bake = relight();
    bake.arg("bake")
        .arg(data("table.glb"))
        .arg("-o")
        .arg(&asset)
        .args(coarse)
        .assert()
        .success();
    std::fs::copy(data("window.hdr"), folder.path().join("window.hdr")).unwrap();
    let play = || {
        let mut play = relight();
        play.arg("play")
            .arg(&asset)
            .arg("-o")
            .arg(folder.path().join("f_####.exr"));
        play.args(["--size", "12x8", "--frames", "0-0"]);
        play
    };
    let (sequences, materials) = (page("sequences.md"), page("materials.md"));
    let (sequences, materials) = (examples(&sequences), examples(&materials));
    assert!(sequences.len() > 8 && materials.len() > 2);
    for example in sequences {
        let lights = sequence(folder.path(), "example.json", example);
        play().arg("--lights").arg(lights).assert().success();
    }
    for example in materials {
        let edits = sequence(folder.path(), "edits.json", example);
        play().arg("--materials").arg(edits).assert().success();
    }
    // The sieve holds: what is wrong does not play.
    let wrong = sequence(
        folder.path(),
        "wrong.json",
        r#"{"relight_sequence": 1, "lights": [{"name": "a"}]}"#,
    );
    assert!(complaint(play().arg("--lights").arg(wrong), 1).contains("lights[0]: missing field `type`"));
}

/// What the command prints is what is committed for editors.
#[test]
fn schemas_are_printed() {
    for name in ["sequence", "materials", "scene"] {
        let output = relight()
            .args(["schema", name])
            .assert()
            .success()
            .get_output()
            .stdout
            .clone();
        let committed =
            Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("crates/format/schemas/{name}.schema.json"));
        assert!(output == std::fs::read(committed).unwrap(), "{name}");
    }
}
