//! What all settings of a report have in common.

use crate::failure::Failure;
use crate::frames::FrameRange;
use crate::options::parsed;
use crate::play::PlayArgs;
use std::path::{Path, PathBuf};

/// What all settings have in common.
pub struct Task {
    /// Folder for everything that is written.
    pub folder: PathBuf,
    /// The asset to report on.
    pub asset: PathBuf,
    /// The lighting sequence.
    pub lights: PathBuf,
    /// Frames to measure.
    pub frames: FrameRange,
    /// Pixels across and down.
    pub size: (usize, usize),
    /// Seed of everything.
    pub seed: u64,
    /// Identifies scene, lights, frames and size: what references and measurements are of.
    pub key: u64,
}

impl Task {
    /// A play of some frames into EXR files of full precision, with further options.
    ///
    /// # Errors
    /// The options are none of `play`'s.
    pub fn play_args(
        &self,
        asset: &Path,
        output: &Path,
        frames: FrameRange,
        more: &[String],
    ) -> Result<PlayArgs, Failure> {
        let words = [
            asset.display().to_string(),
            "--lights".into(),
            self.lights.display().to_string(),
            "-o".into(),
            output.display().to_string(),
            "--size".into(),
            format!("{}x{}", self.size.0, self.size.1),
            "--frames".into(),
            format!("{}-{}x{}", frames.first, frames.last, frames.step),
            "--float".into(),
        ];
        parsed(&[&words[..], more].concat())
    }
}
