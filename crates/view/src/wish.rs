//! What a tab may ask for, and within which bounds.

use crate::encode::Look;
use crate::tone::Tone;
use relight_play::LevelPart;
use relight_play::glam::Vec3;
use relight_play::scene::animated::Animated;
use relight_play::scene::camera::{Camera, CameraTrack};
use serde::Deserialize;
use serde_json::value::RawValue;
use std::sync::Arc;

/// Most pixels across and down.
pub const MOST_SIDE: u32 = 4096;
/// Most pixels of a picture: those of 4 K.
pub const MOST_PIXELS: u32 = 3840 * 2160;
/// How far from the origin an eye may be, metres; squares of it fit 32-bit numbers.
const FAR: f32 = 1e15;
/// Exposures that change anything: an f32 holds no more stops.
const MOST_EXPOSURE: f32 = 100.0;

/// A message of a tab, such as `{"show": {…}}`.
#[derive(Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Message {
    /// Show this picture; it takes the place of all that was asked for before.
    Show(Box<Show>),
    /// Tell what a pixel shows.
    Pick(Pick),
}

/// A picture to show.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Show {
    /// Comes back with the picture.
    pub id: u64,
    /// Whether more is to follow at once: the picture is made quickly and not refined.
    #[serde(default)]
    pub moving: bool,
    /// Pixels across, of the refined picture.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Frames of the sequence, fractions allowed.
    #[serde(default)]
    pub time: f64,
    /// Stops of exposure of the encoded picture.
    #[serde(default)]
    pub exposure: f32,
    /// How brightness becomes what a screen shows.
    #[serde(default)]
    pub tone: Tone,
    /// What is shown: `beauty`, another layer of a frame, `light.NAME`, `level.N` (indirect light of receivers up to this level) or
    /// `detail.N` (what this level alone adds).
    #[serde(default = "beauty")]
    pub layer: String,
    /// How light is made.
    #[serde(default)]
    pub by: By,
    /// Where from.
    pub camera: Eye,
    /// A lighting sequence; left out, the one of before.
    #[serde(default)]
    pub lights: Option<Box<RawValue>>,
    /// Material edits; left out, those of before.
    #[serde(default)]
    pub materials: Option<Box<RawValue>>,
}

fn beauty() -> String {
    "beauty".into()
}

/// How light is made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum By {
    /// By what the asset holds.
    #[default]
    Asset,
    /// By path tracing, the reference.
    Path,
    /// By the asset, and then, pass by pass, by path tracing beside it.
    Both,
}

/// A pixel to tell about.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pick {
    /// Comes back with the answer.
    pub id: u64,
    /// From the left edge of the picture, 0 to 1.
    pub x: f32,
    /// From its top edge, 0 to 1.
    pub y: f32,
    /// Whether to tell, too, which points and links bring indirect light there.
    #[serde(default)]
    pub links: bool,
    /// Whether to tell, too, which clusters of lights light it.
    #[serde(default)]
    pub clusters: bool,
}

/// A camera as a lighting sequence has its own, standing still.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Eye {
    /// The eye, metres, the scene's offset taken away.
    pub position: [f32; 3],
    /// What is in the middle of the picture.
    pub look_at: [f32; 3],
    /// Up.
    pub up: [f32; 3],
    /// Vertical field of view, degrees.
    pub vfov_deg: f32,
}

impl Eye {
    /// The camera, as a sequence's would be.
    pub fn camera(&self) -> Camera {
        let fixed = |xyz: [f32; 3]| Animated::Constant(Vec3::from_array(xyz));
        CameraTrack {
            name: String::new(),
            position: fixed(self.position),
            look_at: fixed(self.look_at),
            up: fixed(self.up),
            vfov_deg: Animated::Constant(self.vfov_deg),
            aspect: None,
        }
        .at(0.0)
    }
}

/// The newest wish of a tab, complete.
#[derive(Clone)]
pub struct Wish {
    /// Of the newest [`Show`].
    pub id: u64,
    /// Whether more is to follow at once.
    pub moving: bool,
    /// Pixels across and down.
    pub size: (u32, u32),
    /// Frames of the sequence.
    pub time: f64,
    /// How values become what a screen shows.
    pub look: Look,
    /// What is shown.
    pub layer: String,
    /// How light is made.
    pub by: By,
    /// Where from.
    pub eye: Eye,
    /// A lighting sequence as JSON; `None`: the first lights.
    pub lights: Option<Arc<str>>,
    /// Material edits as JSON; `None`: no edits.
    pub materials: Option<Arc<str>>,
}

impl Wish {
    /// Whether the other one is of the same picture.
    pub fn is_like(&self, other: &Wish) -> bool {
        self.is_alike_in_light(other) && self.look == other.look
    }

    /// Whether the other one is of the same picture before exposure and tone mapping.
    pub fn is_alike_in_light(&self, other: &Wish) -> bool {
        let same = |a: &Option<Arc<str>>, b: &Option<Arc<str>>| match (a, b) {
            (Some(a), Some(b)) => Arc::ptr_eq(a, b),
            (None, None) => true,
            _ => false,
        };
        self.size == other.size
            && self.time == other.time
            && self.layer == other.layer
            && self.by == other.by
            && self.eye == other.eye
            && same(&self.lights, &other.lights)
            && same(&self.materials, &other.materials)
    }

    /// Which levels of the transfer make its indirect light, if not all.
    pub fn levels(&self) -> Option<LevelPart> {
        let number = |prefix| self.layer.strip_prefix(prefix)?.parse().ok();
        let up_to = number("level.").map(LevelPart::UpTo);
        up_to.or_else(|| number("detail.").map(LevelPart::Only))
    }

    /// The layer of a frame that it shows.
    pub fn layer_of_frame(&self) -> &str {
        match self.levels() {
            Some(_) => "indirect",
            None => &self.layer,
        }
    }

    /// Whether path tracing is to be shown beside it: it is of light that path tracing makes, too.
    pub fn compares(&self) -> bool {
        let light = ["beauty", "emission", "direct", "indirect"].contains(&self.layer.as_str());
        self.by == By::Both && !self.moving && (light || self.layer.starts_with("light."))
    }
}

impl Show {
    /// What of it no picture can be made of, in words.
    fn fault(&self) -> Option<String> {
        let sides = [self.width, self.height];
        if sides.iter().any(|n| !(1..=MOST_SIDE).contains(n)) || self.width * self.height > MOST_PIXELS {
            return Some(format!(
                "a picture of {} × {} pixels: each side must be 1 to {MOST_SIDE}, at most {MOST_PIXELS} pixels in all",
                self.width, self.height
            ));
        }
        let eye = &self.camera;
        let all = [eye.position, eye.look_at, eye.up];
        if !all.as_flattened().iter().all(|x| x.abs() <= FAR) {
            return Some(format!("a camera beyond {FAR:e} m"));
        }
        if !(0.01..=179.0).contains(&eye.vfov_deg) {
            return Some(format!(
                "a field of view of {}°: it must be 0.01 to 179",
                eye.vfov_deg
            ));
        }
        if !(0.0..=1e9).contains(&self.time) {
            return Some(format!("frame {}: it must be 0 to 1e9", self.time));
        }
        if self.exposure.is_nan() || self.exposure.abs() > MOST_EXPOSURE {
            return Some(format!(
                "an exposure of {}: it must be ±{MOST_EXPOSURE} stops",
                self.exposure
            ));
        }
        None
    }

    /// The wish it makes of the one before.
    ///
    /// # Errors
    /// What is wrong, in words.
    pub fn wish(self, before: Option<&Wish>) -> Result<Wish, String> {
        if let Some(fault) = self.fault() {
            return Err(fault);
        }
        let text = |given: Option<Box<RawValue>>, old: Option<&Arc<str>>| match given {
            // The same text keeps what was prepared of it.
            Some(text) if old.is_some_and(|old| **old == *text.get()) => old.cloned(),
            Some(text) => Some(Arc::from(text.get())),
            None => old.cloned(),
        };
        Ok(Wish {
            id: self.id,
            moving: self.moving,
            size: (self.width, self.height),
            time: self.time,
            look: Look {
                exposure: self.exposure,
                tone: self.tone,
            },
            layer: self.layer,
            by: self.by,
            eye: self.camera,
            lights: text(self.lights, before.and_then(|b| b.lights.as_ref())),
            materials: text(self.materials, before.and_then(|b| b.materials.as_ref())),
        })
    }
}

/// Reads a message.
///
/// # Errors
/// It is none, in words.
pub fn message(text: &str) -> Result<Message, String> {
    serde_json::from_str(text).map_err(|error| format!("not a message: {error}"))
}
