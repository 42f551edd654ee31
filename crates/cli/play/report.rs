//! What a play did, for people, other commands and --json.

use relight_play::frame::stats::{Figure, FrameStats};
use relight_play::shot::ShotTimes;
use relight_probes::Expected;
use serde::ser::SerializeMap;
use serde::{Serialize, Serializer};

/// What a play did.
#[derive(Clone, Debug, Serialize)]
pub struct PlayReport {
    /// Version of the JSON.
    pub schema: u32,
    /// `play`.
    pub command: &'static str,
    /// The asset's file.
    pub asset: String,
    /// Identifies its content, hexadecimal.
    pub asset_hash: String,
    /// What the bake expects of its errors, if it has measured itself.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub expected: Option<Expected>,
    /// How light was made.
    pub integrator: &'static str,
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    /// Worker threads.
    pub threads: usize,
    /// Whether the camera stood still.
    pub fixed_camera: bool,
    /// Largest share of a frame's fragments that have no point near them, and no indirect light; nothing where no points are used.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub without_points: Option<f64>,
    /// The moving picture, if one was written.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub movie: Option<String>,
    /// Stops that previews are exposed by: 2^stops times the image; nothing where none are written.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub exposure_ev: Option<f32>,
    /// That of all times: `ms`.
    pub time_unit: &'static str,
    /// What was done once.
    pub once_per_shot: OncePerShot,
    /// Images of patches of the sky, if frames are sums of them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub daylight: Option<DaylightReport>,
    /// What was done for each frame, in order.
    pub frames: Vec<FrameReport>,
}

/// Milliseconds of what is done once.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct OncePerShot {
    /// Reading and preparing the asset.
    pub load: f64,
    /// What a standing camera sees.
    #[serde(flatten)]
    pub shot: Option<ShotReport>,
    /// Images of patches of the sky.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub patches: Option<f64>,
}

/// Images of patches of the sky.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct DaylightReport {
    /// Patches of the whole sky.
    pub patches: usize,
    /// Those of them that have an image.
    pub images: usize,
    /// Those that shine on nothing that is seen.
    pub unseen: usize,
    /// Memory of the images.
    pub bytes: u64,
}

/// Milliseconds that a shot took.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct ShotReport {
    /// Primary rays.
    pub expose: f64,
    /// What lighting needs of the asset.
    pub weigh: f64,
}

impl From<ShotTimes> for ShotReport {
    fn from(times: ShotTimes) -> ShotReport {
        ShotReport {
            expose: times.expose,
            weigh: times.weigh,
        }
    }
}

/// A frame's times, milliseconds, and figures.
#[derive(Clone, Debug, Serialize)]
pub struct FrameReport {
    /// Its number.
    pub frame: u32,
    /// What it adds to the run.
    pub total: f64,
    /// Writing its files.
    pub write: f64,
    /// Evaluating changed materials again, if there are edits.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub edit: Option<f64>,
    /// What a moving camera sees.
    #[serde(flatten)]
    pub shot: Option<ShotReport>,
    /// Its stages, and what they did.
    #[serde(flatten)]
    pub figures: Figures,
}

/// Figures by name.
#[derive(Clone, Debug)]
pub struct Figures(pub Vec<(&'static str, Figure)>);

impl From<&FrameStats> for Figures {
    fn from(stats: &FrameStats) -> Figures {
        Figures(stats.figures())
    }
}

impl Serialize for Figures {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(self.0.len()))?;
        for (name, figure) in &self.0 {
            match figure {
                Figure::Count(count) => map.serialize_entry(name, count)?,
                Figure::Milliseconds(value) | Figure::Mean(value) => map.serialize_entry(name, value)?,
            }
        }
        map.end()
    }
}

impl OncePerShot {
    /// Milliseconds of what a standing camera needs.
    pub fn of_shot(&self) -> f64 {
        self.shot.map_or(0.0, |shot| shot.expose + shot.weigh)
    }
}

impl FrameReport {
    /// All figures but its number, by name.
    pub fn entries(&self) -> impl Iterator<Item = (&'static str, f64)> {
        let shot = (self.shot.iter()).flat_map(|shot| [("expose", shot.expose), ("weigh", shot.weigh)]);
        ([("total", self.total), ("write", self.write)].into_iter())
            .chain(self.edit.map(|edit| ("edit", edit)))
            .chain(shot)
            .chain(
                self.figures
                    .0
                    .iter()
                    .map(|(name, figure)| (*name, figure.value())),
            )
    }
}

impl PlayReport {
    /// Milliseconds that each frame added to the run.
    pub fn totals(&self) -> impl Iterator<Item = f64> {
        self.frames.iter().map(|frame| frame.total)
    }
}
