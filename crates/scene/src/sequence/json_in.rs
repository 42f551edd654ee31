//! Reads the JSON of design section 4. Everything is checked: unknown fields and light types, ranges, rising
//! keys, names that occur twice; the message holds the path of the field.

use super::fields::{
    Field, FieldError, Range, animated, complain, direction, expected, factor, join, number, object,
    required, scalar, show, text, vector,
};
use super::{Sequence, SequenceCamera, SequenceError};
use crate::animated::{Animated, Blend};
use crate::camera::CameraTrack;
use crate::environment::read_environment;
use crate::light::{EnvironmentMap, LightKind, LightTrack};
use glam::{DVec3, Vec3};
use serde_json::{Map, Value};
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The version of the sequence format that this program reads, the value of `relight_sequence`.
const VERSION: u64 = 1;

/// Reads a lighting sequence and the environment maps that it names.
///
/// # Errors
/// See [`SequenceError`].
pub fn read_sequence(path: &Path) -> Result<Sequence, SequenceError> {
    let text = std::fs::read_to_string(path).map_err(|source| SequenceError::Read {
        file: path.to_owned(),
        source,
    })?;
    let base = path.parent().unwrap_or(Path::new(""));
    parse_sequence(&text, base, &path.display().to_string())
}

/// Reads a lighting sequence from its text. Files that it names are relative to `base_dir`; `name` stands for
/// the sequence in messages.
///
/// # Errors
/// See [`SequenceError`].
pub fn parse_sequence(text: &str, base_dir: &Path, name: &str) -> Result<Sequence, SequenceError> {
    let value = parse_json(text, name)?;
    let mut maps = Maps {
        base_dir: Some(base_dir.to_owned()),
        loaded: HashMap::new(),
    };
    sequence(&value, "", &mut maps).map_err(|error| named(error, name))
}

/// Reads what [`super::stage_to_json`] wrote: the scene's cameras and its own lights. Environment maps are
/// not part of a scene and are refused.
///
/// # Errors
/// See [`SequenceError`].
pub fn stage_from_json(text: &str) -> Result<(Vec<CameraTrack>, Sequence), SequenceError> {
    let name = "the scene's cameras and lights";
    let value = parse_json(text, name)?;
    stage(&value).map_err(|error| named(error, name))
}

fn named(error: FieldError, name: &str) -> SequenceError {
    SequenceError::Field {
        name: name.into(),
        path: error.path,
        message: error.message,
    }
}

fn parse_json(text: &str, name: &str) -> Result<Value, SequenceError> {
    serde_json::from_str(text).map_err(|error| {
        let message = error.to_string();
        // The place is a field of its own; the parser's message repeats it at its end.
        let end = message.rfind(" at line ").unwrap_or(message.len());
        SequenceError::Syntax {
            name: name.into(),
            line: error.line(),
            column: error.column(),
            message: message[..end].into(),
        }
    })
}

fn stage(value: &Value) -> Field<(Vec<CameraTrack>, Sequence)> {
    let map = object(value, "", &["cameras", "sequence"])?;
    let cameras = list(required(map, "", "cameras")?, "cameras")?;
    let cameras = cameras
        .iter()
        .enumerate()
        .map(|(i, value)| {
            let path = format!("cameras[{i}]");
            let known = ["name", "position", "look_at", "up", "vfov_deg", "aspect"];
            let map = object(value, &path, &known)?;
            let name = text(required(map, &path, "name")?, &join(&path, "name"))?;
            own_camera(map, &path, name)
        })
        .collect::<Field<Vec<CameraTrack>>>()?;
    let mut maps = Maps {
        base_dir: None,
        loaded: HashMap::new(),
    };
    Ok((
        cameras,
        sequence(required(map, "", "sequence")?, "sequence", &mut maps)?,
    ))
}

/// Environment maps of one sequence: a file that several lights name is read once.
struct Maps {
    /// What files are relative to; `None`: no files here.
    base_dir: Option<PathBuf>,
    loaded: HashMap<PathBuf, Arc<EnvironmentMap>>,
}

impl Maps {
    fn get(&mut self, file: &str, path: &str) -> Field<Arc<EnvironmentMap>> {
        let Some(base) = &self.base_dir else {
            return complain(path, "an asset holds no environment maps; use a sequence file");
        };
        let place = base.join(file);
        if let Some(map) = self.loaded.get(&place) {
            return Ok(map.clone());
        }
        match read_environment(&place) {
            Ok(map) => {
                let map = Arc::new(map);
                self.loaded.insert(place, map.clone());
                Ok(map)
            }
            Err(error) => complain(path, error.to_string()),
        }
    }
}

fn list<'a>(value: &'a Value, path: &str) -> Field<&'a Vec<Value>> {
    match value {
        Value::Array(list) => Ok(list),
        _ => expected(path, "a list", value),
    }
}

fn sequence(value: &Value, path: &str, maps: &mut Maps) -> Field<Sequence> {
    let map = object(
        value,
        path,
        &["relight_sequence", "frames", "fps", "camera", "lights"],
    )?;
    let version = required(map, path, "relight_sequence")?;
    if version.as_u64() != Some(VERSION) {
        return complain(
            &join(path, "relight_sequence"),
            format!(
                "expected {VERSION}, the version that this program reads, found {}",
                show(version)
            ),
        );
    }
    let frames = match map.get("frames") {
        None => 1,
        Some(value) => match value.as_u64().and_then(|frames| u32::try_from(frames).ok()) {
            Some(frames) if frames >= 1 => frames,
            _ => return expected(&join(path, "frames"), "a whole number of at least 1", value),
        },
    };
    let fps = match map.get("fps") {
        None => 24.0,
        Some(value) => number(value, &join(path, "fps"), Range::Positive)?,
    };
    let camera = map
        .get("camera")
        .map(|value| camera(value, &join(path, "camera")))
        .transpose()?;
    let lights_path = join(path, "lights");
    let mut names = HashSet::new();
    let mut lights = Vec::new();
    for (i, value) in list(required(map, path, "lights")?, &lights_path)?
        .iter()
        .enumerate()
    {
        let light_path = format!("{lights_path}[{i}]");
        let light = light(value, &light_path, maps)?;
        if !names.insert(light.name.clone()) {
            return complain(
                &join(&light_path, "name"),
                format!(
                    "{:?} is already the name of another light; names must differ",
                    light.name
                ),
            );
        }
        lights.push(light);
    }
    Ok(Sequence {
        frames,
        fps,
        camera,
        lights,
    })
}

fn camera(value: &Value, path: &str) -> Field<SequenceCamera> {
    let map = object(
        value,
        path,
        &["node", "position", "look_at", "up", "vfov_deg", "aspect"],
    )?;
    if let Some(node) = map.get("node") {
        if map.len() > 1 {
            return complain(
                path,
                "either `node`, or `position`, `look_at`, `up` and `vfov_deg`, not both",
            );
        }
        return Ok(SequenceCamera::Node(text(node, &join(path, "node"))?));
    }
    Ok(SequenceCamera::Own(own_camera(map, path, String::new())?))
}

fn own_camera(map: &Map<String, Value>, path: &str, name: String) -> Field<CameraTrack> {
    let point = |field: &str| {
        animated(required(map, path, field)?, &join(path, field), |v, p| {
            vector(v, p, Range::Any)
        })
    };
    let aspect = map
        .get("aspect")
        .map(|v| scalar(v, &join(path, "aspect"), Range::Positive))
        .transpose()?;
    Ok(CameraTrack {
        name,
        position: point("position")?,
        look_at: point("look_at")?,
        up: match map.get("up") {
            None => Animated::Constant(Vec3::Y),
            Some(value) => animated(value, &join(path, "up"), direction)?,
        },
        vfov_deg: animated(
            required(map, path, "vfov_deg")?,
            &join(path, "vfov_deg"),
            |v, p| scalar(v, p, Range::Between(0.0, 180.0)),
        )?,
        aspect,
    })
}

/// The light types and their fields beside `name` and `type`.
const LIGHT_TYPES: [(&str, &[&str]); 8] = [
    ("point", &["position", "intensity"]),
    (
        "spot",
        &[
            "position",
            "direction",
            "inner_angle_deg",
            "outer_angle_deg",
            "intensity",
        ],
    ),
    ("directional", &["direction", "irradiance"]),
    ("rect", &["center", "edge_u", "edge_v", "radiance"]),
    ("sphere", &["center", "radius", "radiance"]),
    ("environment", &["file", "scale", "rotation_deg"]),
    ("sun_sky", &["turbidity", "sun_direction", "scale"]),
    ("emissive", &["material", "scale"]),
];

fn light(value: &Value, path: &str, maps: &mut Maps) -> Field<LightTrack> {
    let Value::Object(map) = value else {
        return expected(path, "an object", value);
    };
    let type_path = join(path, "type");
    let kind = text(required(map, path, "type")?, &type_path)?;
    let Some((_, fields)) = LIGHT_TYPES.iter().find(|(name, _)| *name == kind) else {
        let known: Vec<&str> = LIGHT_TYPES.iter().map(|(name, _)| *name).collect();
        return complain(
            &type_path,
            format!("unknown light type {kind:?}; known: {}", known.join(", ")),
        );
    };
    let mut known = vec!["name", "type"];
    known.extend(*fields);
    object(value, path, &known)?;
    let name = text(required(map, path, "name")?, &join(path, "name"))?;
    if name.is_empty() {
        return complain(&join(path, "name"), "a light's name must not be empty");
    }

    let get = |field: &str| required(map, path, field).map(|value| (value, join(path, field)));
    let point = |field: &str| {
        let (value, path) = get(field)?;
        animated(value, &path, |v, p| vector(v, p, Range::Any))
    };
    let color = |field: &str| {
        let (value, path) = get(field)?;
        animated(value, &path, |v, p| vector(v, p, Range::NonNegative))
    };
    let way = |field: &str| {
        let (value, path) = get(field)?;
        animated(value, &path, direction)
    };
    let number = |field: &str, range: Range| {
        let (value, path) = get(field)?;
        animated(value, &path, |v, p| scalar(v, p, range))
    };
    let scale = || match map.get("scale") {
        None => Ok(Animated::Constant(Vec3::ONE)),
        Some(value) => animated(value, &join(path, "scale"), factor),
    };
    let kind = match kind.as_str() {
        "point" => LightKind::Point {
            position: point("position")?,
            intensity: color("intensity")?,
        },
        "spot" => {
            let inner = match map.get("inner_angle_deg") {
                None => Animated::Constant(0.0),
                Some(_) => number("inner_angle_deg", Range::Within(0.0, 90.0))?,
            };
            let outer = number("outer_angle_deg", Range::Within(0.0, 90.0))?;
            check_angles(&inner, &outer, path)?;
            LightKind::Spot {
                position: point("position")?,
                direction: way("direction")?,
                inner_angle_deg: inner,
                outer_angle_deg: outer,
                intensity: color("intensity")?,
            }
        }
        "directional" => LightKind::Directional {
            direction: way("direction")?,
            irradiance: color("irradiance")?,
        },
        "rect" => {
            let (edge_u, edge_v) = (way("edge_u")?, way("edge_v")?);
            check_edges(&edge_u, &edge_v, path)?;
            LightKind::Rect {
                center: point("center")?,
                edge_u,
                edge_v,
                radiance: color("radiance")?,
            }
        }
        "sphere" => LightKind::Sphere {
            center: point("center")?,
            radius: number("radius", Range::Positive)?,
            radiance: color("radiance")?,
        },
        "environment" => {
            let (value, file_path) = get("file")?;
            let file = text(value, &file_path)?;
            let rotation_deg = match map.get("rotation_deg") {
                None => Animated::Constant(0.0),
                Some(_) => number("rotation_deg", Range::Any)?,
            };
            let scale = scale()?;
            LightKind::Environment {
                map: maps.get(&file, &file_path)?,
                file,
                scale,
                rotation_deg,
            }
        }
        "sun_sky" => LightKind::SunSky {
            turbidity: match map.get("turbidity") {
                // A clear day, the middle of the range in which Preetham's fit is good.
                None => Animated::Constant(3.0),
                Some(_) => number("turbidity", Range::Within(2.0, 10.0))?,
            },
            sun_direction: way("sun_direction")?,
            scale: scale()?,
        },
        // The only type left in LIGHT_TYPES.
        _ => LightKind::Emissive {
            material: match map.get("material") {
                None => None,
                Some(value) => Some(text(value, &join(path, "material"))?),
            },
            scale: scale()?,
        },
    };
    Ok(LightTrack { name, kind })
}

/// The frames at which either value has a key; frame 0 where both are constant.
fn key_frames<T, U>(a: &Animated<T>, b: &Animated<U>) -> Vec<f64> {
    let mut frames = vec![0.0];
    if let Animated::Keys { keys, .. } = a {
        frames.extend(keys.iter().map(|key| key.0));
    }
    if let Animated::Keys { keys, .. } = b {
        frames.extend(keys.iter().map(|key| key.0));
    }
    frames
}

fn check_angles(inner: &Animated<f32>, outer: &Animated<f32>, path: &str) -> Field<()> {
    for frame in key_frames(inner, outer) {
        let (i, o) = (inner.at(frame), outer.at(frame));
        if i > o {
            return complain(
                &join(path, "inner_angle_deg"),
                format!("must not exceed outer_angle_deg, but at frame {frame} it is {i} and that is {o}"),
            );
        }
    }
    Ok(())
}

fn check_edges<T: Blend + Into<Vec3>>(edge_u: &Animated<T>, edge_v: &Animated<T>, path: &str) -> Field<()> {
    for frame in key_frames(edge_u, edge_v) {
        let u: DVec3 = edge_u.at(frame).into().as_dvec3();
        let v: DVec3 = edge_v.at(frame).into().as_dvec3();
        // Edges within 1e-6 radians of parallel span no area that f32 could tell from rounding.
        if u.cross(v).length() <= 1e-6 * u.length() * v.length() {
            return complain(
                &join(path, "edge_v"),
                format!("must not be parallel to edge_u, but at frame {frame} it is"),
            );
        }
    }
    Ok(())
}
