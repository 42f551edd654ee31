//! Lighting sequences: what shines at which frame, seen by which camera; and their JSON, of which `docs/sequences.md`
//! has every field.

#[cfg(test)]
mod tests;

use crate::animated::{Animated, Interpolation};
use crate::camera::CameraTrack;
use crate::json::decode::{Document, Object, read_text};
use crate::json::error::JsonError;
use crate::json::path::JsonPath;
use crate::json::quantity::{Above0, Number, Range, Version1, given, positive};
use crate::light::{Day, EnvironmentMaps, LightKind, LightTrack, MapFile};
use crate::map_files::{self, MAX_MAP_BYTES, shown};
use crate::photometry::{self, Photometry};
use crate::weather::Weather;
use glam::DVec3;
use schemars::JsonSchema;
use serde::de::{Error as _, IgnoredAny};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::Value;
use serde_json::value::RawValue;
use std::collections::{HashMap, HashSet};
use std::num::NonZeroU32;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A lighting sequence: `frames` frames of lights and, if it names one, a camera.
#[derive(Clone, Debug, PartialEq)]
pub struct Sequence {
    /// Number of frames, at least 1.
    pub frames: u32,
    /// Frames per second.
    pub fps: f64,
    /// Which camera looks, if the sequence says so.
    pub camera: Option<SequenceCamera>,
    /// All lights; those of the scene itself do not shine beside them.
    pub lights: Vec<LightTrack>,
}

/// One dark frame.
impl Default for Sequence {
    fn default() -> Self {
        Sequence {
            frames: 1,
            fps: film_rate(),
            camera: None,
            lights: Vec::new(),
        }
    }
}

/// The camera of a sequence.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum SequenceCamera {
    /// A camera node of the scene, by name.
    Node(
        #[serde(serialize_with = "Node::write")]
        #[schemars(with = "Node")]
        String,
    ),
    /// A camera of the sequence's own.
    Own(CameraTrack),
}

/// A camera node of the scene.
#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "CameraNode")]
struct Node {
    /// Its name.
    node: String,
}

impl Node {
    fn write<S: Serializer>(node: &str, serializer: S) -> Result<S::Ok, S::Error> {
        Node { node: node.into() }.serialize(serializer)
    }
}

/// A sequence as a file has it, with cameras and lights as text or in memory.
#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(
    deny_unknown_fields,
    bound(deserialize = "C: Deserialize<'de>, L: Deserialize<'de>")
)]
pub(crate) struct SequenceFile<C, L> {
    /// The version of this form.
    relight_sequence: Version1,
    /// Number of frames.
    #[serde(default = "one_frame", deserialize_with = "frame_count")]
    #[schemars(range(min = 1, max = MAX_FRAMES))]
    frames: NonZeroU32,
    /// Frames per second.
    #[serde(default = "film_rate", deserialize_with = "positive")]
    #[schemars(with = "Above0")]
    fps: f64,
    /// Which camera looks; if left out, the first one of the scene.
    #[serde(
        default,
        deserialize_with = "given",
        skip_serializing_if = "Option::<C>::is_none"
    )]
    #[schemars(with = "C")]
    camera: Option<C>,
    /// All lights; those of the scene itself do not shine beside them. No two have the same name.
    lights: Vec<L>,
}

/// Most frames of a sequence: four days of film.
const MAX_FRAMES: u32 = 10_000_000;

fn frame_count<'de, D: Deserializer<'de>>(deserializer: D) -> Result<NonZeroU32, D::Error> {
    let number = deserializer.deserialize_f64(Number(Range::Within(1.0, f64::from(MAX_FRAMES))))?;
    (NonZeroU32::new(number as u32).filter(|_| number.fract() == 0.0))
        .ok_or_else(|| D::Error::custom(format_args!("expected a whole number, found {number}")))
}

fn one_frame() -> NonZeroU32 {
    NonZeroU32::MIN
}

fn film_rate() -> f64 {
    24.0
}

/// A scene's own cameras and lights, as an asset has them.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct StageFile<C, S> {
    cameras: Vec<C>,
    sequence: S,
}

#[derive(Serialize)]
struct NamedCamera<'a> {
    name: &'a str,
    #[serde(flatten)]
    camera: &'a CameraTrack,
}

/// Reads a lighting sequence and the environment maps that it names.
///
/// # Errors
/// See [`JsonError`].
pub fn read_sequence(path: &Path) -> Result<Sequence, JsonError> {
    let text = read_text(path, "lighting sequence")?;
    let base = path.parent().unwrap_or(Path::new(""));
    parse_sequence(&text, base, &path.display().to_string())
}

/// As [`read_sequence`], for a scene from whose positions `offset` was taken away ([`crate::scene::Scene::offset`]): so it
/// is from those of cameras and lights, before they become 32-bit numbers.
///
/// # Errors
/// See [`JsonError`].
pub fn read_sequence_at(path: &Path, offset: DVec3) -> Result<Sequence, JsonError> {
    let text = read_text(path, "lighting sequence")?;
    let base = path.parent().unwrap_or(Path::new(""));
    parse_sequence_at(&text, base, &path.display().to_string(), offset)
}

/// A sequence's text with `offset` taken away from all positions; `None` if that changes nothing.
fn moved(text: &str, offset: DVec3) -> Option<String> {
    fn place(value: &mut Value, offset: DVec3) {
        match value {
            Value::Array(xyz) => {
                for (x, offset) in xyz.iter_mut().zip(offset.to_array()) {
                    if let Some(number) = x.as_f64() {
                        *x = (number - offset).into();
                    }
                }
            }
            Value::Object(animated) => {
                let keys = animated.get_mut("keys").and_then(Value::as_array_mut);
                for value in keys.into_iter().flatten().filter_map(|key| key.get_mut(1)) {
                    place(value, offset);
                }
            }
            _ => {}
        }
    }
    if offset == DVec3::ZERO {
        return None;
    }
    let mut sequence: Value = serde_json::from_str(text).ok()?;
    let lights = sequence.get_mut("lights").and_then(Value::as_array_mut);
    for value in lights.into_iter().flatten() {
        for key in ["position", "center"] {
            value
                .get_mut(key)
                .into_iter()
                .for_each(|value| place(value, offset));
        }
    }
    for key in ["position", "look_at"] {
        let value = sequence.get_mut("camera").and_then(|camera| camera.get_mut(key));
        value.into_iter().for_each(|value| place(value, offset));
    }
    Some(sequence.to_string())
}

/// Reads a lighting sequence from its text. Files that it names are relative to `base_dir`; `name` stands for
/// the sequence in messages.
///
/// # Errors
/// See [`JsonError`].
pub fn parse_sequence(text: &str, base_dir: &Path, name: &str) -> Result<Sequence, JsonError> {
    Reader {
        document: Document { name, text },
        base_dir: Some(base_dir),
        maps: HashMap::new(),
        frames: 1,
    }
    .sequence(text, &JsonPath::default())
}

/// As [`parse_sequence`], for a scene that was moved as in [`read_sequence_at`].
///
/// # Errors
/// See [`JsonError`].
pub fn parse_sequence_at(
    text: &str,
    base_dir: &Path,
    name: &str,
    offset: DVec3,
) -> Result<Sequence, JsonError> {
    let sequence = parse_sequence(text, base_dir, name)?;
    // What is wrong was found in the text as it is.
    match moved(text, offset) {
        Some(text) => parse_sequence(&text, base_dir, name),
        None => Ok(sequence),
    }
}

/// Reads a lighting sequence from its text, without files: `maps` are the environment maps that it may name. `name` stands
/// for the sequence in messages.
///
/// # Errors
/// See [`JsonError`].
pub fn parse_sequence_with(
    text: &str,
    maps: &HashMap<PathBuf, EnvironmentMaps>,
    name: &str,
) -> Result<Sequence, JsonError> {
    Reader {
        document: Document { name, text },
        base_dir: None,
        maps: maps.clone(),
        frames: 1,
    }
    .sequence(text, &JsonPath::default())
}

/// Reads what [`stage_to_json`] wrote: the scene's cameras and its own lights. Environment maps are read where they stand in
/// the text as data URIs; names of files are refused.
///
/// # Errors
/// See [`JsonError`].
pub fn stage_from_json(text: &str) -> Result<(Vec<CameraTrack>, Sequence), JsonError> {
    let document = Document {
        name: "the scene's cameras and lights",
        text,
    };
    let mut reader = Reader {
        document,
        base_dir: None,
        maps: HashMap::new(),
        frames: 1,
    };
    let root = JsonPath::default();
    let file: StageFile<&RawValue, &RawValue> = document.decode(text, &root)?;
    let cameras = (file.cameras.iter().enumerate())
        .map(|(i, camera)| reader.named_camera(camera.get(), &root.key("cameras").index(i)))
        .collect::<Result<_, _>>()?;
    Ok((
        cameras,
        reader.sequence(file.sequence.get(), &root.key("sequence"))?,
    ))
}

/// A sequence as JSON text, one that [`parse_sequence`] reads back to an equal sequence. Environment
/// maps are named by their file, not included, but for those that stand in the text already.
pub fn sequence_to_json(sequence: &Sequence) -> String {
    pretty(&SequenceFile::of(sequence))
}

/// A scene's cameras and its own lights as JSON text, for an asset; [`stage_from_json`] reads it.
pub fn stage_to_json(cameras: &[CameraTrack], sequence: &Sequence) -> String {
    let cameras: Vec<_> = cameras
        .iter()
        .map(|camera| NamedCamera {
            name: &camera.name,
            camera,
        })
        .collect();
    pretty(&StageFile {
        cameras,
        sequence: SequenceFile::of(sequence),
    })
}

/// One camera as [`stage_to_json`] writes it, without its name: equal texts are equal cameras.
pub fn camera_to_json(camera: &CameraTrack) -> String {
    pretty(camera)
}

/// Indented, with the fields of each object in the order of their names.
fn pretty(value: &impl Serialize) -> String {
    let value = serde_json::to_value(value).unwrap_or(Value::Null);
    format!("{value:#}\n")
}

impl<'a> SequenceFile<&'a SequenceCamera, &'a LightTrack> {
    fn of(sequence: &'a Sequence) -> Self {
        SequenceFile {
            relight_sequence: Version1,
            frames: NonZeroU32::new(sequence.frames).unwrap_or(NonZeroU32::MIN),
            fps: sequence.fps,
            camera: sequence.camera.as_ref(),
            lights: sequence.lights.iter().collect(),
        }
    }
}

/// Reads the objects of one text.
struct Reader<'a> {
    document: Document<'a>,
    /// What files are relative to; `None`: no files here.
    base_dir: Option<&'a Path>,
    /// Environment maps by file or pattern: one that several lights name is read once.
    maps: HashMap<PathBuf, EnvironmentMaps>,
    /// Frames of the sequence.
    frames: u32,
}

/// What says which fields a light has. Other fields are ignored.
#[derive(Deserialize)]
#[serde(expecting = "an object")]
struct LightHead {
    name: String,
    r#type: String,
}

/// Ignores all fields but one.
#[derive(Deserialize)]
struct CameraHead {
    node: Option<IgnoredAny>,
}

#[derive(Deserialize)]
struct Name {
    name: String,
}

impl<'a> Reader<'a> {
    fn sequence(&mut self, text: &'a str, path: &JsonPath) -> Result<Sequence, JsonError> {
        let file: SequenceFile<&RawValue, &RawValue> = self.document.decode(text, path)?;
        let camera = file
            .camera
            .map(|camera| self.camera(camera.get(), &path.key("camera")));
        self.frames = file.frames.get();
        let mut names = HashSet::new();
        let mut lights = Vec::with_capacity(file.lights.len());
        for (i, light) in file.lights.iter().enumerate() {
            let path = path.key("lights").index(i);
            let light = self.light(light.get(), &path)?;
            if !names.insert(light.name.clone()) {
                let message = format!(
                    "{:?} is already the name of another light; names must differ",
                    light.name
                );
                return Err(self.document.error(&path.key("name"), message));
            }
            lights.push(light);
        }
        Ok(Sequence {
            frames: file.frames.get(),
            fps: file.fps,
            camera: camera.transpose()?,
            lights,
        })
    }

    fn camera(&self, text: &'a str, path: &JsonPath) -> Result<SequenceCamera, JsonError> {
        let head: CameraHead = self.document.decode(text, path)?;
        Ok(match head.node {
            Some(_) => SequenceCamera::Node(self.document.decode::<Node>(text, path)?.node),
            None => SequenceCamera::Own(self.document.decode(text, path)?),
        })
    }

    fn named_camera(&self, text: &'a str, path: &JsonPath) -> Result<CameraTrack, JsonError> {
        let Name { name } = self.document.decode(text, path)?;
        let object = Object::new(text).without(&["name"]);
        let camera = (self.document).decode_with(object, path, |object| CameraTrack::deserialize(object))?;
        Ok(CameraTrack { name, ..camera })
    }

    fn light(&mut self, text: &'a str, path: &JsonPath) -> Result<LightTrack, JsonError> {
        let LightHead { name, r#type } = self.document.decode(text, path)?;
        let object = Object::new(text)
            .without(&["name", "type"])
            .variant("type", &r#type);
        let kind = (self.document).decode_with(object, path, |object| LightKind::deserialize(object))?;
        let mut light = LightTrack { name, kind };
        if light.name.is_empty() {
            let message = "a light's name must not be empty";
            return Err(self.document.error(&path.key("name"), message));
        }
        match &mut light.kind {
            LightKind::Spot {
                inner_angle_deg,
                outer_angle_deg,
                ..
            } => self.check_angles(inner_angle_deg, outer_angle_deg, path)?,
            LightKind::Rect { edge_u, edge_v, .. } => self.check_edges(edge_u, edge_v, path)?,
            LightKind::Environment { maps, file, .. } => *maps = self.maps_of(file, &path.key("file"))?,
            LightKind::Ies { profile, file, .. } => *profile = self.profile(file, &path.key("file"))?,
            LightKind::Weather {
                weather,
                file,
                day,
                hours,
                ..
            } => {
                let start = day.map_or(0.0, Day::hours);
                let times = values(hours).map(|hours| start + f64::from(hours));
                let range = times.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), time| {
                    (low.min(time), high.max(time))
                });
                *weather = self.weather(file, range, &path.key("file"))?;
            }
            _ => {}
        }
        Ok(light)
    }

    /// The maps of a file, or of one for each key.
    fn maps_of(&mut self, file: &MapFile, path: &JsonPath) -> Result<EnvironmentMaps, JsonError> {
        let (keys, interpolation) = match file {
            MapFile::One(name) => return self.maps_of_name(name, path),
            MapFile::Keys { keys, interpolation } => (keys, interpolation),
        };
        let (mut maps, mut bytes) = (Vec::new(), 0);
        for (i, (frame, name)) in keys.iter().enumerate() {
            let path = path.key("keys").index(i).index(1);
            let of_name = self.maps_of_name(name, &path)?;
            let Some(map) = of_name.only() else {
                let message = "is a pattern of several maps; keys take one file each";
                return Err(self.document.error(&path, message));
            };
            // One that several keys name takes its room once.
            if !maps.iter().any(|(_, other)| Arc::ptr_eq(other, map)) {
                bytes += map.pixels.len() * size_of::<glam::Vec3>();
            }
            if bytes > MAX_MAP_BYTES {
                let message = format!(
                    "with {} the maps take more than {MAX_MAP_BYTES} bytes of memory; make them smaller or fewer",
                    shown(name)
                );
                return Err(self.document.error(&path, message));
            }
            maps.push((*frame, map.clone()));
        }
        EnvironmentMaps::of_keys(maps.clone(), *interpolation == Interpolation::Linear).map_err(|sizes| {
            let (a, b) = sizes.unwrap_or((0, 0));
            let [of_a, of_b] = [a, b].map(|i| format!("{} has {}x{}", shown(&keys[i].1), maps[i].1.width, maps[i].1.height));
            let message = format!(
                "maps that are blended must have one size, but {of_a} and {of_b} pixels; resize one, or use \"interpolation\": \"step\""
            );
            self.document.error(&path.key("keys"), message)
        })
    }

    /// The map of a name, or the maps of a pattern, one for each frame.
    fn maps_of_name(&mut self, file: &str, path: &JsonPath) -> Result<EnvironmentMaps, JsonError> {
        if let (None, Some(maps)) = (self.base_dir, self.maps.get(Path::new(file))) {
            return Ok(maps.clone());
        }
        if let Some(maps) = map_files::embedded(file) {
            return maps.map_err(|error| self.document.error(path, error));
        }
        let Some(base) = self.base_dir else {
            let message = "no map of this name is here: assets hold none by name, use a sequence file";
            return Err(self.document.error(path, message));
        };
        let name = base.join(file);
        if let Some(maps) = self.maps.get(&name) {
            return Ok(maps.clone());
        }
        let maps = map_files::read(&name, file, self.frames);
        let maps = maps.map_err(|error| self.document.error(path, error))?;
        Ok(self.maps.entry(name).or_insert(maps).clone())
    }

    /// Reads a photometric file, whose text takes the place of its name: so a sequence that is written again, or kept in an asset, has it.
    fn profile(&self, file: &mut String, path: &JsonPath) -> Result<Arc<Photometry>, JsonError> {
        let mut name = String::new();
        let mut folder = self.base_dir.map(Path::to_path_buf);
        if !file.contains('\n') {
            let Some(base) = self.base_dir else {
                let message = "no photometric file can be read here: give its whole text instead of its name";
                return Err(self.document.error(path, message));
            };
            name = format!("{file}: ");
            let whole = base.join(&*file);
            folder = whole.parent().map(Path::to_path_buf);
            let text = Photometry::text_of(&whole);
            *file = text.map_err(|error| self.document.error(path, error.to_string()))?;
        }
        if let Some(folder) = folder {
            let read = |tilt: &str| photometry::read_beside(&folder, tilt);
            let text = photometry::with_tilt(std::mem::take(file), read);
            *file = text.map_err(|error| self.document.error(path, format!("{name}{error}")))?;
        }
        let read = Photometry::parse(file);
        read.map(Arc::new)
            .map_err(|error| self.document.error(path, format!("{name}{error}")))
    }

    /// Reads a weather file, of which the lines for a range of times take the place of the name.
    fn weather(
        &self,
        file: &mut String,
        (from, to): (f64, f64),
        path: &JsonPath,
    ) -> Result<Arc<Weather>, JsonError> {
        let mut name = String::new();
        if !file.contains('\n') {
            let Some(base) = self.base_dir else {
                let message = "no weather file can be read here: give its whole text instead of its name";
                return Err(self.document.error(path, message));
            };
            name = format!("{file}: ");
            let text = Weather::text_of(&base.join(&*file));
            *file = text.map_err(|error| self.document.error(path, error.to_string()))?;
        }
        let read = || {
            let whole = Weather::parse(file)?;
            whole.check(from, to)?;
            let excerpt = whole.excerpt(file, from, to);
            Weather::parse(&excerpt).map(|weather| (weather, excerpt))
        };
        let (weather, excerpt) = read().map_err(|error| {
            let message = format!("{name}{error}");
            self.document.error(path, message)
        })?;
        *file = excerpt;
        Ok(Arc::new(weather))
    }

    fn check_angles(
        &self,
        inner: &Animated<f32>,
        outer: &Animated<f32>,
        path: &JsonPath,
    ) -> Result<(), JsonError> {
        for frame in key_frames(inner, outer) {
            let (i, o) = (inner.at(frame), outer.at(frame));
            if i > o {
                let message = format!(
                    "must not exceed outer_angle_deg, but at frame {frame} it is {i} and that is {o}"
                );
                return Err(self.document.error(&path.key("inner_angle_deg"), message));
            }
        }
        Ok(())
    }

    fn check_edges(
        &self,
        edge_u: &Animated<glam::Vec3>,
        edge_v: &Animated<glam::Vec3>,
        path: &JsonPath,
    ) -> Result<(), JsonError> {
        for frame in key_frames(edge_u, edge_v) {
            let [u, v]: [DVec3; 2] = [edge_u, edge_v].map(|edge| edge.at(frame).as_dvec3());
            // Edges within 1e-6 radians of parallel span no area that f32 could tell from rounding.
            if u.cross(v).length() <= 1e-6 * u.length() * v.length() {
                let message = format!("must not be parallel to edge_u, but at frame {frame} it is");
                return Err(self.document.error(&path.key("edge_v"), message));
            }
        }
        Ok(())
    }
}

/// The values of all keys, or the only one.
fn values(animated: &Animated<f32>) -> impl Iterator<Item = f32> {
    let (constant, keys) = match animated {
        Animated::Constant(value) => (Some(*value), &[][..]),
        Animated::Keys { keys, .. } => (None, keys.as_slice()),
    };
    constant.into_iter().chain(keys.iter().map(|key| key.1))
}

/// The frames at which either value has a key; frame 0 where both are constant.
fn key_frames<T>(a: &Animated<T>, b: &Animated<T>) -> Vec<f64> {
    let mut frames = vec![0.0];
    for value in [a, b] {
        if let Animated::Keys { keys, .. } = value {
            frames.extend(keys.iter().map(|key| key.0));
        }
    }
    frames
}
