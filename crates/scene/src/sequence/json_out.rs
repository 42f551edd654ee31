//! Writes sequences and a scene's own cameras and lights as the JSON that [`super::json_in`] reads.

use super::{Sequence, SequenceCamera};
use crate::animated::{Animated, Interpolation};
use crate::camera::CameraTrack;
use crate::light::{LightKind, LightTrack};
use glam::Vec3;
use serde_json::{Map, Value, json};

/// A sequence as JSON text, one that [`super::parse_sequence`] reads back to an equal sequence. Environment
/// maps are named by their file, not included.
pub fn sequence_to_json(sequence: &Sequence) -> String {
    pretty(&sequence_value(sequence))
}

/// A scene's cameras and its own lights as JSON text, for an asset; [`super::stage_from_json`] reads it.
pub fn stage_to_json(cameras: &[CameraTrack], sequence: &Sequence) -> String {
    let cameras: Vec<Value> = cameras
        .iter()
        .map(|camera| {
            let mut fields = camera_fields(camera);
            fields.insert("name".into(), camera.name.clone().into());
            Value::Object(fields)
        })
        .collect();
    pretty(&json!({ "cameras": cameras, "sequence": sequence_value(sequence) }))
}

/// One camera as [`stage_to_json`] writes it, without its name: equal texts are equal cameras.
pub fn camera_to_json(camera: &CameraTrack) -> String {
    pretty(&Value::Object(camera_fields(camera)))
}

fn pretty(value: &Value) -> String {
    // `{:#}` of a Value is its indented text; it cannot fail, keys are texts.
    format!("{value:#}\n")
}

fn sequence_value(sequence: &Sequence) -> Value {
    let mut fields = Map::new();
    fields.insert("relight_sequence".into(), 1.into());
    fields.insert("frames".into(), sequence.frames.into());
    fields.insert("fps".into(), sequence.fps.into());
    match &sequence.camera {
        None => {}
        Some(SequenceCamera::Node(node)) => {
            fields.insert("camera".into(), json!({ "node": node }));
        }
        Some(SequenceCamera::Own(camera)) => {
            fields.insert("camera".into(), Value::Object(camera_fields(camera)));
        }
    }
    fields.insert("lights".into(), sequence.lights.iter().map(light_value).collect());
    Value::Object(fields)
}

fn camera_fields(camera: &CameraTrack) -> Map<String, Value> {
    let mut fields = Map::new();
    fields.insert("position".into(), animated(&camera.position, vector));
    fields.insert("look_at".into(), animated(&camera.look_at, vector));
    fields.insert("up".into(), animated(&camera.up, vector));
    fields.insert("vfov_deg".into(), animated(&camera.vfov_deg, scalar));
    if let Some(aspect) = camera.aspect {
        fields.insert("aspect".into(), scalar(aspect));
    }
    fields
}

fn light_value(light: &LightTrack) -> Value {
    let mut fields = Map::new();
    fields.insert("name".into(), light.name.clone().into());
    let mut put = |name: &str, value: Value| {
        fields.insert(name.into(), value);
    };
    match &light.kind {
        LightKind::Point { position, intensity } => {
            put("type", "point".into());
            put("position", animated(position, vector));
            put("intensity", animated(intensity, vector));
        }
        LightKind::Spot {
            position,
            direction,
            inner_angle_deg,
            outer_angle_deg,
            intensity,
        } => {
            put("type", "spot".into());
            put("position", animated(position, vector));
            put("direction", animated(direction, vector));
            put("inner_angle_deg", animated(inner_angle_deg, scalar));
            put("outer_angle_deg", animated(outer_angle_deg, scalar));
            put("intensity", animated(intensity, vector));
        }
        LightKind::Directional {
            direction,
            irradiance,
        } => {
            put("type", "directional".into());
            put("direction", animated(direction, vector));
            put("irradiance", animated(irradiance, vector));
        }
        LightKind::Rect {
            center,
            edge_u,
            edge_v,
            radiance,
        } => {
            put("type", "rect".into());
            put("center", animated(center, vector));
            put("edge_u", animated(edge_u, vector));
            put("edge_v", animated(edge_v, vector));
            put("radiance", animated(radiance, vector));
        }
        LightKind::Sphere {
            center,
            radius,
            radiance,
        } => {
            put("type", "sphere".into());
            put("center", animated(center, vector));
            put("radius", animated(radius, scalar));
            put("radiance", animated(radiance, vector));
        }
        LightKind::Environment {
            map: _,
            file,
            scale,
            rotation_deg,
        } => {
            put("type", "environment".into());
            put("file", file.clone().into());
            put("scale", animated(scale, vector));
            put("rotation_deg", animated(rotation_deg, scalar));
        }
        LightKind::SunSky {
            turbidity,
            sun_direction,
            scale,
        } => {
            put("type", "sun_sky".into());
            put("turbidity", animated(turbidity, scalar));
            put("sun_direction", animated(sun_direction, vector));
            put("scale", animated(scale, vector));
        }
        LightKind::Emissive { material, scale } => {
            put("type", "emissive".into());
            if let Some(material) = material {
                put("material", material.clone().into());
            }
            put("scale", animated(scale, vector));
        }
    }
    Value::Object(fields)
}

fn animated<T: Copy>(value: &Animated<T>, write: impl Fn(T) -> Value) -> Value {
    match value {
        Animated::Constant(value) => write(*value),
        Animated::Keys { keys, interpolation } => {
            let keys: Vec<Value> = keys
                .iter()
                .map(|&(frame, value)| json!([frame, write(value)]))
                .collect();
            let interpolation = match interpolation {
                Interpolation::Step => "step",
                Interpolation::Linear => "linear",
                Interpolation::Cubic => "cubic",
            };
            json!({ "keys": keys, "interpolation": interpolation })
        }
    }
}

fn vector(value: Vec3) -> Value {
    Value::Array(value.to_array().into_iter().map(scalar).collect())
}

/// The shortest decimal that reads back as the same f32 (0.1, not 0.10000000149011612).
fn scalar(value: f32) -> Value {
    let short = value.to_string().parse::<f64>().ok();
    let exact = f64::from(value);
    Value::from(short.filter(|short| *short as f32 == value).unwrap_or(exact))
}
