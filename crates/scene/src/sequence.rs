//! Lighting sequences: what shines at which frame, seen by which camera (design section 4), and their JSON.

pub(crate) mod fields;
mod json_in;
mod json_out;

pub use fields::SequenceError;
pub use json_in::{parse_sequence, read_sequence, stage_from_json};
pub use json_out::{camera_to_json, sequence_to_json, stage_to_json};

use crate::camera::CameraTrack;
use crate::light::LightTrack;

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

/// The camera of a sequence.
#[derive(Clone, Debug, PartialEq)]
pub enum SequenceCamera {
    /// A camera node of the scene, by name.
    Node(String),
    /// A camera of the sequence's own.
    Own(CameraTrack),
}

#[cfg(test)]
mod tests;
