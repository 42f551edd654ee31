//! Why an asset could not be judged.

use relight_format::FormatError;
use relight_play::open::OpenError;
use relight_play::player::FrameError;
use relight_render::watch::Cancelled;
use relight_scene::light_set::LightSetError;
use relight_scene::traced::TracedSceneError;
use thiserror::Error;

/// Why an asset could not be judged.
#[derive(Debug, Error)]
pub enum ProbeError {
    /// The scene cannot be traced.
    #[error(transparent)]
    Scene(#[from] TracedSceneError),
    /// A light cannot be sampled.
    #[error(transparent)]
    Lights(#[from] LightSetError),
    /// The asset would not be read again.
    #[error(transparent)]
    Format(#[from] FormatError),
    /// The asset cannot be played.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// The asset cannot be lit.
    #[error(transparent)]
    Frame(FrameError),
    /// It was stopped from outside.
    #[error("it was stopped")]
    Stopped,
}

impl From<Cancelled> for ProbeError {
    fn from(_: Cancelled) -> ProbeError {
        ProbeError::Stopped
    }
}

impl From<FrameError> for ProbeError {
    fn from(error: FrameError) -> ProbeError {
        match error {
            FrameError::Cancelled(stopped) => stopped.into(),
            other => ProbeError::Frame(other),
        }
    }
}
