//! EXT_lights_area, a draft: rectangles and discs that shine along a node's −Z. Babylon.js writes it; its loader is what files are tried
//! with.
//!
//! An earlier draft said `shape`, `width`, `height` and `radius`, which leave no doubt and are read, too.

use super::json::At;
use super::list::List;
use super::notes::Notes;
use crate::json::quantity::MAX_LIGHT;
use glam::Vec3;
use std::f32::consts::PI;

/// Luminance of a light that doesn't say its own, cd/m².
const USUAL: f32 = 1000.0;

/// An area light, of the size that it has at a node's scale of 1.
pub(super) struct AreaLight {
    pub name: Option<String>,
    /// Along the node's X and Y, metres.
    pub size: [f32; 2],
    /// RGB, W/(m² sr): a candela is taken as a W/sr.
    pub radiance: Vec3,
}

/// The document's list of them.
pub(super) fn parse(root: &At, notes: &mut Notes) -> List<AreaLight> {
    List::lights_of(root, "EXT_lights_area", |at| parse_light(at, notes))
}

/// A node's, by its number.
pub(super) fn of_node(node: &At, lights: usize) -> Option<usize> {
    node.extension("EXT_lights_area")?
        .required_index("light", lights, "lights of EXT_lights_area")
}

fn parse_light(at: &At, notes: &mut Notes) -> Option<AreaLight> {
    let length = |key: &str| {
        let length = at.float(key);
        if length.is_some_and(|length| length <= 0.0) {
            at.fault_at(key, "must be above 0, in metres");
        }
        length
    };
    let usual = length("size").unwrap_or(1.0);
    let size = match at.text("type").or_else(|| at.text("shape")) {
        Some("rect") => {
            let rect = at.object("rect");
            let aspect = rect.as_ref().and_then(|rect| rect.float("aspect")).unwrap_or(1.0);
            if aspect <= 0.0 {
                at.fault_at("rect", "needs an aspect above 0: its width over its height");
            }
            let height = length("height").unwrap_or(usual);
            [length("width").unwrap_or(height * aspect), height]
        }
        Some("disk") => {
            notes.count("discs of EXT_lights_area taken as squares of the same area", 1);
            let radius = length("radius").unwrap_or(0.5 * usual);
            [radius * PI.sqrt(); 2]
        }
        _ => {
            at.fault_at("type", "must be \"rect\" or \"disk\"");
            return None;
        }
    };
    let color = at.floats("color").map_or(Vec3::ONE, Vec3::from_array);
    let intensity = at.float("intensity").unwrap_or(USUAL);
    if color.min_element() < 0.0 {
        at.fault_at("color", "must not be negative");
    }
    let most = f64::from(intensity) * f64::from(color.max_element());
    if !(0.0..=MAX_LIGHT).contains(&most) {
        at.fault_at(
            "intensity",
            format!("is {intensity:e} (colour times intensity may be from 0 to {MAX_LIGHT:e})"),
        );
    }
    Some(AreaLight {
        name: at.name(),
        size,
        radiance: color * intensity,
    })
}
