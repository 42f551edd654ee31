//! What frames say about themselves in their files.

use crate::choice::{Choice, Integrator, Tracer};
use crate::player::Player;
use crate::shot::{MOVING_SAMPLES, STANDING_SAMPLES, ShotSettings};
use relight_render::{brute, lightcuts, path, pixelcuts};
use relight_scene::camera::Camera;
use relight_scene::image::{ExrCamera, ExrHeader};
use relight_scene::sequence::{Sequence, sequence_to_json};

/// What lies behind the scene.
const BACKGROUND: &str = "what shines where nothing of the scene is, skies and lamps without matter, is part of R G B and of emission; it \
     is the layer background, and A is the share of the pixel that is scene: R G B less background is premultiplied by A";

/// A sequence's hash, 16 hexadecimal digits: XXH3-64 of its canonical JSON, in which files stand by the names that the sequence
/// has for them. Those of one sequence are equal however its file was laid out.
pub fn sequence_hash(sequence: &Sequence) -> String {
    let hash = relight_format::content_hash(sequence_to_json(sequence).as_bytes());
    format!("{hash:016x}")
}

/// Of a frame: by what it was made.
#[derive(Clone, Copy, Debug)]
pub struct FrameOrigin<'a> {
    /// Who looks, and the name of its node.
    pub camera: (&'a Camera, &'a str),
    /// How the shot was made.
    pub shot: &'a ShotSettings,
    /// How the light was made.
    pub choice: &'a Choice,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Frames per second.
    pub fps: f64,
    /// Which frame.
    pub frame: u32,
    /// [`sequence_hash`].
    pub sequence_hash: &'a str,
}

impl Player {
    /// What a frame's file says about the frame.
    pub fn header(&self, origin: &FrameOrigin<'_>) -> ExrHeader {
        let (camera, name) = origin.camera;
        let size = (origin.shot.width, origin.shot.height);
        ExrHeader {
            asset_hash: Some(format!("{:016x}", self.hash)),
            sequence_hash: Some(origin.sequence_hash.to_owned()),
            integrator: Some(origin.choice.integrator.name().to_owned()),
            samples: samples(&origin.choice.integrator, origin.shot),
            seed: Some(origin.seed),
            frames_per_second: Some(origin.fps),
            frame: Some(origin.frame),
            camera: Some(ExrCamera::of(camera, name, self.scene().offset, size)),
            background: Some(BACKGROUND.to_owned()),
            ..ExrHeader::new()
        }
    }
}

/// Samples of every pixel; `None` where each takes as many as it needs.
fn samples(integrator: &Integrator, shot: &ShotSettings) -> Option<u32> {
    let by_itself = match integrator {
        Integrator::Traced(tracer) => match tracer {
            Tracer::Path { .. } => path::SPP,
            Tracer::Brute | Tracer::BrutePoints(_) => brute::SPP,
            Tracer::Lightcuts {
                reconstruction: true, ..
            } => return shot.samples,
            Tracer::Lightcuts { .. } => lightcuts::SPP,
            Tracer::Pixelcuts { .. } => pixelcuts::SPP,
        },
        _ if shot.moving => MOVING_SAMPLES,
        _ => STANDING_SAMPLES,
    };
    Some(shot.samples.unwrap_or(by_itself))
}
