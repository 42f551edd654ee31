//! Lighting sequences, written as JSON with one light per line.

use serde_json::{Value, json};

/// A sequence file: `frames` frames at 24 per second, an optional camera (a value for its `camera` field), and lights.
pub fn sequence(frames: u32, camera: Option<Value>, lights: &[Value]) -> Vec<u8> {
    let mut text = format!("{{ \"relight_sequence\": 1, \"frames\": {frames}, \"fps\": 24,\n");
    if let Some(camera) = camera {
        text += &format!("  \"camera\": {camera},\n");
    }
    let lines: Vec<String> = lights.iter().map(|light| format!("    {light}")).collect();
    text += &format!("  \"lights\": [\n{} ] }}\n", lines.join(",\n"));
    text.into_bytes()
}

/// A value with keys, `interpolation` being `step`, `linear` or `cubic`.
pub fn keys(interpolation: &str, keys: &[(u32, Value)]) -> Value {
    let list: Vec<Value> = keys.iter().map(|(frame, value)| json!([frame, value])).collect();
    json!({ "keys": list, "interpolation": interpolation })
}

/// A point light.
pub fn point(name: &str, position: Value, intensity: [f64; 3]) -> Value {
    json!({ "name": name, "type": "point", "position": position, "intensity": intensity })
}

/// The emissive materials of one name.
pub fn emissive(name: &str, material: &str) -> Value {
    json!({ "name": name, "type": "emissive", "material": material })
}
