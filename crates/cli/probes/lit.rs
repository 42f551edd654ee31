//! The lights under which a bake judges itself.

use super::viewpoints::Viewpoints;
use crate::failure::Failure;
use relight_scene::scene::Scene;
use relight_scene::sequence::{Sequence, parse_sequence};
use std::path::Path;

/// The lights at hand: those given, else the scene's own, else a mix of lamps in open space and a sun, each of which gives what it
/// lights some 1 W/m².
///
/// # Errors
/// None that a scene can cause: the mix is a sequence like any other.
pub fn lit(scene: &Scene, given: Option<&Sequence>, viewpoints: &Viewpoints) -> Result<Sequence, Failure> {
    if let Some(sequence) = given {
        return Ok(sequence.clone());
    }
    if !scene.sequence.lights.is_empty() {
        return Ok(scene.sequence.clone());
    }
    let mut lights = vec![serde_json::json!({
        "name": "sun", "type": "directional", "direction": [-0.4, -0.8, -0.45], "irradiance": [1, 1, 1]
    })];
    for (i, (place, way)) in viewpoints.lamps.iter().enumerate() {
        let intensity = way.powi(2).clamp(f32::MIN_POSITIVE, 1e30);
        lights.push(serde_json::json!({
            "name": format!("lamp {i}"), "type": "point", "position": place.to_array(), "intensity": [intensity, intensity, intensity]
        }));
    }
    let mix = serde_json::json!({"relight_sequence": 1, "lights": lights});
    Ok(parse_sequence(
        &mix.to_string(),
        Path::new("."),
        "the lights of the bake's own check",
    )?)
}
