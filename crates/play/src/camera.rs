//! Which camera a sequence is seen through.

use relight_scene::camera::CameraTrack;
use relight_scene::scene::Scene;
use relight_scene::sequence::{Sequence, SequenceCamera};

/// Why there is no camera.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CameraError {
    /// None has this name.
    #[error("no camera is named {name:?}, as {whence} asks; {known}")]
    Unknown {
        /// The name.
        name: String,
        /// Who asks for it.
        whence: &'static str,
        /// Those that there are, in words.
        known: String,
    },
    /// The scene has none.
    #[error(
        "the scene has no camera; give the lighting sequence one: \
         \"camera\": {{\"position\": [x,y,z], \"look_at\": [x,y,z], \"up\": [0,1,0], \"vfov_deg\": 50}}"
    )]
    None,
}

/// The camera of this name, else that of the sequence, else the scene's first.
///
/// # Errors
/// [`CameraError`].
pub fn camera_of<'a>(
    scene: &'a Scene,
    sequence: &'a Sequence,
    name: Option<&str>,
) -> Result<&'a CameraTrack, CameraError> {
    let named = |name: &str, whence: &'static str| {
        (scene.cameras.iter().find(|track| track.name == name)).ok_or_else(|| {
            let known: Vec<String> = scene.cameras.iter().map(|c| format!("{:?}", c.name)).collect();
            CameraError::Unknown {
                name: name.to_owned(),
                whence,
                known: if known.is_empty() {
                    "it has none".into()
                } else {
                    format!("it has {}", known.join(", "))
                },
            }
        })
    };
    match (name, &sequence.camera) {
        (Some(name), _) => named(name, "--camera"),
        (None, Some(SequenceCamera::Node(name))) => named(name, "the lighting sequence"),
        (None, Some(SequenceCamera::Own(track))) => Ok(track),
        (None, None) => scene.cameras.first().ok_or(CameraError::None),
    }
}
