//! The JSON Schemas that are committed for editors are those of the readers.

use relight_scene::schema;
use serde_json::Value;
use std::path::Path;

fn committed(name: &str) -> Value {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../format/schemas");
    let text = std::fs::read_to_string(folder.join(format!("{name}.schema.json"))).unwrap_or_default();
    serde_json::from_str(&text).unwrap_or_default()
}

#[test]
fn committed_schemas_are_current() {
    for (name, current) in [
        ("sequence", schema::sequence()),
        ("materials", schema::materials()),
        ("scene", schema::scene()),
    ] {
        assert!(
            committed(name) == current,
            "run `relight schema {name} > crates/format/schemas/{name}.schema.json`"
        );
    }
}
