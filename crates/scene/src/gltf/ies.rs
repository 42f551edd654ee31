//! EXT_lights_ies: lamps that shine as photometric files say.

use super::accessors::Data;
use super::json::{At, Faults};
use super::layout::Layout;
use super::list::List;
use super::materials::ImageSource;
use super::notes::Notes;
use super::uri;
use crate::json::quantity::MAX_FACTOR;
use crate::photometry::{MAX_BYTES, Photometry, text, with_tilt};
use glam::Vec3;
use std::path::Path;
use std::sync::Arc;

/// Where the photometric files of a glTF are.
pub(super) struct Profiles {
    list: List<(Option<String>, ImageSource)>,
}

/// A node's lamp.
#[derive(Clone, Copy)]
pub(super) struct Lamp {
    pub profile: usize,
    /// RGB, W/sr per candela.
    pub scale: Vec3,
}

/// A photometric file, read.
#[derive(Clone)]
pub(super) struct Profile {
    pub text: String,
    pub photometry: Arc<Photometry>,
}

impl Profiles {
    /// Reads the list of the document.
    pub fn parse(root: &At, layout: &Layout) -> Profiles {
        let list = List::lights_of(root, "EXT_lights_ies", |at| {
            let name = at.name();
            let source = match at.text("uri") {
                Some(uri) => ImageSource::Uri(uri.to_owned()),
                None => {
                    ImageSource::View(at.required_index("bufferView", layout.views.len(), "bufferViews")?)
                }
            };
            Some((name, source))
        });
        Profiles { list }
    }

    /// A node's lamp.
    pub fn lamp(&self, node: &At) -> Option<Lamp> {
        let at = node.extension("EXT_lights_ies")?;
        let profile = at.required_index("light", self.list.len(), "lights of EXT_lights_ies")?;
        let color = at.floats("color").map_or(Vec3::ONE, Vec3::from_array);
        let scale = color.clamp(Vec3::ZERO, Vec3::ONE) * at.float("multiplier").unwrap_or(1.0);
        if !(scale.min_element() >= 0.0 && f64::from(scale.max_element()) <= MAX_FACTOR) {
            at.fault_at("multiplier", "must be a number of at least 0, up to 1e15");
            return None;
        }
        Some(Lamp { profile, scale })
    }

    /// The name of one.
    pub fn name(&self, profile: usize) -> Option<&String> {
        self.list.peek(profile)?.0.as_ref()
    }

    /// Reads the files of those that are `used`, by their index, and notes what they give.
    pub fn load(
        &self,
        used: impl Fn(usize) -> bool,
        data: &Data,
        folder: &Path,
        faults: &Faults,
        notes: &mut Notes,
    ) -> Vec<Option<Profile>> {
        let read = |i: usize| -> Result<Profile, String> {
            let (_, source) = self.list.get(i, faults).ok_or_else(String::new)?;
            let bytes = match source {
                ImageSource::View(view) => {
                    let bytes = data.view_bytes(*view);
                    bytes
                        .map_err(|fault| format!("cannot be read: {fault}"))?
                        .to_vec()
                }
                ImageSource::Uri(uri) => uri::decode_data_uri(uri)
                    .unwrap_or_else(|| uri::read_relative(folder, uri, MAX_BYTES + 1))?,
            };
            if bytes.len() as u64 > MAX_BYTES {
                return Err(format!("has more than {MAX_BYTES} bytes"));
            }
            // A file that TILT names lies beside the photometric one.
            let beside = match source {
                ImageSource::Uri(uri) if !uri.starts_with("data:") => Path::new(uri).parent(),
                _ => None,
            };
            let read_tilt = |name: &str| {
                let name = beside.unwrap_or(Path::new("")).join(name);
                uri::read_relative(folder, &name.to_string_lossy(), MAX_BYTES)
            };
            let text = with_tilt(text(&bytes), read_tilt).map_err(|error| error.to_string())?;
            let photometry =
                Photometry::parse(&text).map_err(|error| format!("is no photometric file: {error}"))?;
            Ok(Profile {
                text,
                photometry: Arc::new(photometry),
            })
        };
        (0..self.list.len())
            .map(|i| {
                if !used(i) {
                    return None;
                }
                match read(i) {
                    Ok(profile) => {
                        let lamp = &profile.photometry;
                        let tilt = match lamp.has_tilt() {
                            true => ", times its factors for tilted lamps (TILT)",
                            false => "",
                        };
                        notes.say(format!(
                            "EXT_lights_ies: lights[{i}] gives {:.0} lm, {:.0} cd at most{tilt}; a candela is taken as a W/sr",
                            lamp.lumens(),
                            lamp.peak()
                        ));
                        Some(profile)
                    }
                    Err(message) => {
                        if !message.is_empty() {
                            faults.add(format!("extensions.EXT_lights_ies.lights[{i}]"), message);
                        }
                        None
                    }
                }
            })
            .collect()
    }

    /// Notes what is wrong with what nobody used.
    pub fn note_unused(&self, notes: &mut Notes) {
        self.list.note_unused(notes);
    }
}
