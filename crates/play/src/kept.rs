//! What a bake has left out, and whether that is missed.

use relight_format::layout::setting;
use relight_format::{self as format, Provenance};
use relight_scene::camera::CameraTrack;
use relight_scene::light::{LightKind, LightTrack};
use relight_scene::sequence::{Sequence, camera_to_json};

/// Why an asset cannot play a sequence: the bake left out what it needs.
#[derive(Debug, thiserror::Error)]
pub enum LeftOutError {
    /// The scene's own lights were left out.
    #[error(
        "the scene's own lights were left out of this asset, because it was baked with --lights: give a sequence \
         with --lights, or bake with --keep lights to keep them"
    )]
    OwnLights,
    /// The scene has no lights.
    #[error("the scene in this asset has no lights of its own: give a sequence with --lights")]
    NoLights,
    /// What the camera sees was not refined.
    #[error(
        "this asset was baked with --cameras-only for other cameras than {0:?}: bake without --cameras-only, or with \
         --lights for a sequence that has this camera"
    )]
    Camera(String),
    /// Emission of materials was left out.
    #[error(
        "light {0:?} lets materials shine, but their emission was left out of this asset, because it was baked \
         with --lights for a sequence without an `emissive` light: bake with --keep emission, or with this sequence"
    )]
    Emission(String),
}

/// Checks that an asset was baked for a camera.
pub(crate) fn check_camera(provenance: &Provenance, camera: &CameraTrack) -> Result<(), LeftOutError> {
    let hash = format::content_hash(camera_to_json(camera).as_bytes());
    match provenance.setting(setting::CAMERAS_ONLY) {
        Some(known) if !known.split(' ').any(|known| known == format!("{hash:016x}")) => {
            Err(LeftOutError::Camera(camera.name.clone()))
        }
        _ => Ok(()),
    }
}

/// Checks that an asset has lights of its own.
pub(crate) fn check_own_lights(provenance: &Provenance, own: &Sequence) -> Result<(), LeftOutError> {
    match () {
        () if provenance.setting(setting::OWN_LIGHTS) == Some(setting::LEFT_OUT) => {
            Err(LeftOutError::OwnLights)
        }
        () if own.lights.is_empty() => Err(LeftOutError::NoLights),
        () => Ok(()),
    }
}

/// Checks that an asset has kept what makes its surfaces shine, if any light asks for that.
pub(crate) fn check_emission(provenance: &Provenance, lights: &[LightTrack]) -> Result<(), LeftOutError> {
    let emissive = (lights.iter()).find(|light| matches!(light.kind, LightKind::Emissive { .. }));
    match emissive {
        Some(light) if provenance.setting(setting::EMISSION) == Some(setting::LEFT_OUT) => {
            Err(LeftOutError::Emission(light.name.clone()))
        }
        _ => Ok(()),
    }
}
