//! EXT_lights_image_based: the environment that a scene is lit by, six images of a cube, which become a map of the scene's own lights.
//!
//! Of the levels of images only the first is read, which is what a mirror sees: relight blurs by itself. Irradiance coefficients tell how the
//! images lie (`cube_map`), and are else computed anew. The map's numbers times the intensity are taken as W/(m² sr).

use super::accessors::Data;
use super::cube_map::{Encoding, Faces};
use super::json::{At, Faults};
use super::list::List;
use super::materials::{Materials, load_image};
use super::nodes::shown_scene;
use super::notes::Notes;
use crate::animated::Animated;
use crate::data_uri::data_uri;
use crate::image::{BEAUTY, ExrHeader, Layers, Limits, decode_ldr, encode_exr};
use crate::json::quantity::MAX_FACTOR;
use crate::light::{EnvironmentMap, LightKind};
use crate::map_files;
use glam::{DQuat, DVec3, Vec3};
use serde_json::Value;
use std::path::Path;

const NAME: &str = "EXT_lights_image_based";

/// Largest image of a face, pixels: 4096 × 4096. The map shows a quarter of a side's 512.
const MAX_PIXELS: u64 = 1 << 24;

/// A light of the list.
struct ImageLight {
    name: Option<String>,
    /// From the cube to the world.
    rotation: DQuat,
    intensity: f32,
    /// Images of the first level.
    faces: [usize; 6],
    /// Spherical harmonics, if they are as the extension wants them.
    coefficients: Option<[DVec3; 9]>,
    /// What the file says that a face has along a side.
    size: Option<f64>,
}

/// The lights of the file, and which of them the scene has.
pub(super) struct ImageLights {
    list: List<ImageLight>,
    chosen: Option<usize>,
}

impl ImageLights {
    /// Reads the list and the choice of the scene that is shown.
    pub fn parse(root: &At, images: usize, notes: &mut Notes) -> ImageLights {
        let list = List::lights_of(root, NAME, |at| parse_light(at, images));
        let of_scene = shown_scene(root).and_then(|(_, scene)| scene.extension(NAME));
        let chosen =
            of_scene.and_then(|at| at.required_index("light", list.len(), &format!("lights of {NAME}")));
        match (list.len(), chosen) {
            (0, _) | (1, Some(_)) => {}
            (count, None) => notes.say(format!("{NAME}: the scene has none of the file's {count} lights")),
            (count, Some(i)) => notes.say(format!("{NAME}: the scene has lights[{i}] of the file's {count}")),
        }
        ImageLights { list, chosen }
    }

    /// The environment of the scene with what the file calls it, if it has one. What it is goes to the notes.
    pub fn load(
        &self,
        source: &Materials,
        data: &Data,
        folder: &Path,
        faults: &Faults,
        notes: &mut Notes,
    ) -> Option<(String, LightKind)> {
        let index = self.chosen?;
        let light = self.list.get(index, faults)?;
        let at = format!("extensions.{NAME}.lights[{index}]");
        let faces = light.faces(&at, source, data, folder, faults, notes)?;
        let (lie, agreement) = faces.lie(light.coefficients.as_ref());
        let map = faces.unfolded(lie, light.rotation);
        notes.say(format!(
            "{NAME}: lights[{index}] is an environment map of {} × {} pixels, of faces of {} × {}; {}, {}; its numbers are taken as W/(m² sr)",
            map.width,
            map.height,
            faces.side(),
            faces.side(),
            lie.name(),
            match agreement {
                Some(cosine) => format!("with which its irradianceCoefficients agree best (cosine {cosine:.2})"),
                None => "since its irradianceCoefficients don't tell".to_owned(),
            }
        ));
        notes.count(
            &format!("{NAME}: texels with a divisor of 0, taken as 1/255"),
            faces.zero_divisors(),
        );
        if let Some(size) = light.size.filter(|size| *size != faces.side() as f64) {
            notes.say(format!(
                "{NAME}: specularImageSize of lights[{index}] is {size}, but its faces have {}",
                faces.side()
            ));
        }
        let Some(kind) = environment(&map, light.intensity) else {
            faults.add(at, "makes no environment map; export the scene again");
            return None;
        };
        Some((
            light.name.clone().unwrap_or_else(|| "environment".to_owned()),
            kind,
        ))
    }

    /// Notes what is wrong with what nobody used.
    pub fn note_unused(&self, notes: &mut Notes) {
        self.list.note_unused(notes);
    }
}

fn parse_light(at: &At, images: usize) -> Option<ImageLight> {
    let rotation = DQuat::from_array(at.doubles("rotation").unwrap_or([0.0, 0.0, 0.0, 1.0]));
    // Any length but zero names a rotation; exporters round.
    let rotation = (rotation.length_squared() >= 1e-12 && rotation.length_squared().is_finite())
        .then(|| rotation.normalize());
    if rotation.is_none() {
        at.fault_at("rotation", "must be a unit quaternion (x, y, z, w)");
    }
    let intensity = at.float("intensity").unwrap_or(1.0);
    if !(intensity >= 0.0 && f64::from(intensity) <= MAX_FACTOR) {
        at.fault_at("intensity", "must be a number of at least 0, up to 1e15");
        return None;
    }
    let levels = at.items("specularImages");
    let Some(first) = levels.first() else {
        at.fault_at("specularImages", "must hold at least one level of six images");
        return None;
    };
    let six = first.elements();
    if six.len() != 6 {
        first.fault(format!(
            "must be six indices of images (+X, -X, +Y, -Y, +Z, -Z), found {}; export the scene again",
            six.len()
        ));
        return None;
    }
    let faces: Vec<usize> = (six.iter())
        .filter_map(|face| face.as_index(images, "images"))
        .collect();
    Some(ImageLight {
        name: at.name(),
        rotation: rotation?,
        intensity,
        faces: faces.try_into().ok()?,
        coefficients: coefficients(at),
        size: at.value.get("specularImageSize").and_then(Value::as_f64),
    })
}

/// Nine times three finite numbers; what is else is no fault, since they are computed anew.
fn coefficients(at: &At) -> Option<[DVec3; 9]> {
    let rows = at.value.get("irradianceCoefficients")?.as_array()?;
    let row = |row: &Value| {
        let [r, g, b] = row.as_array()?.as_slice() else {
            return None;
        };
        let color = DVec3::new(r.as_f64()?, g.as_f64()?, b.as_f64()?);
        // Squares of them are summed.
        (color.is_finite() && color.abs().max_element() < 1e100).then_some(color)
    };
    let rows: Option<Vec<DVec3>> = rows.iter().map(row).collect();
    rows?.try_into().ok()
}

impl ImageLight {
    fn faces(
        &self,
        at: &str,
        source: &Materials,
        data: &Data,
        folder: &Path,
        faults: &Faults,
        notes: &mut Notes,
    ) -> Option<Faces> {
        let limits = Limits {
            max_pixels: MAX_PIXELS,
            ..Limits::default()
        };
        let mut total = 0;
        let mut images = Vec::with_capacity(6);
        for &image in &self.faces {
            // What is wrong with its entry.
            source.images.get(image, faults)?;
            let name = format!("images[{image}]");
            let mut read = || {
                let bytes = load_image(source, image, data, folder, &mut total, notes)?;
                let encoding = match has_alpha(&bytes) {
                    true => Encoding::Rgbd,
                    false => Encoding::Plain,
                };
                let decoded = decode_ldr(&name, &bytes, &limits).map_err(|error| {
                    let text = error.to_string();
                    text.strip_prefix(&format!("{name}: "))
                        .unwrap_or(&text)
                        .to_owned()
                })?;
                Ok((decoded, encoding))
            };
            match read() {
                Ok(face) => images.push(face),
                Err::<_, String>(message) => {
                    faults.add(name, message);
                    return None;
                }
            }
        }
        let faces = Faces::new(images);
        faces
            .map_err(|(face, message)| faults.add(format!("{at}.specularImages[0][{face}]"), message))
            .ok()
    }
}

/// Whether an image is a PNG with alpha, which the extension takes as RGBD, whatever the alpha is.
fn has_alpha(bytes: &[u8]) -> bool {
    // Behind signature, length, name, width, height and depth: the type of colour, with 4 for alpha.
    bytes.starts_with(b"\x89PNG") && bytes.get(25).is_some_and(|kind| kind & 4 != 0)
}

/// A light of a map, which stands in the light's `file` as half floats and is what is read back from there.
fn environment(map: &EnvironmentMap, intensity: f32) -> Option<LightKind> {
    let mut layers = Layers::new(map.width, map.height);
    let pixels: Vec<[f32; 3]> = map.pixels.iter().map(|pixel| pixel.to_array()).collect();
    layers.push_rgb(BEAUTY, &pixels);
    let (bytes, _) = encode_exr("the environment map", &layers, &ExrHeader::new(), false).ok()?;
    let file = data_uri("image/x-exr", &bytes);
    let maps = map_files::embedded(&file)?.ok()?;
    Some(LightKind::Environment {
        maps,
        file: file.into(),
        scale: Animated::Constant(Vec3::splat(intensity)),
        rotation_deg: Animated::Constant(0.0),
    })
}
