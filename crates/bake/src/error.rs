//! Why a bake may fail.

use glam::Vec3;
use relight_scene::traced::TracedSceneError;

/// What went wrong in a bake.
#[derive(Debug, thiserror::Error)]
pub enum BakeError {
    /// No surface is reached from the viewpoints.
    #[error(
        "no surface is reachable from {}: give a place inside the scene with --viewpoint X,Y,Z",
        match viewpoints.as_slice() {
            [] => "any place that was tried".into(),
            places => "the viewpoints ".to_owned()
                + &places.iter().map(|v| format!("({}, {}, {})", v.x, v.y, v.z)).collect::<Vec<_>>().join(", "),
        }
    )]
    NothingReachable {
        /// Where importance particles started.
        viewpoints: Vec<Vec3>,
    },
    /// The scene contradicts itself or has a damaged texture.
    #[error(transparent)]
    Scene(#[from] TracedSceneError),
    /// A parameter is out of range.
    #[error("{name} is {found}, but must be {expected}")]
    Parameter {
        /// Name of the command-line option.
        name: &'static str,
        /// What was given.
        found: String,
        /// What is allowed.
        expected: &'static str,
    },
    /// Points and bounces alone need more memory than the machine has.
    #[error(
        "these settings make about {} points, which need at least {} MB of memory, and this machine has {} MB: take a \
         larger --coarse-radius, fewer --levels or --preset draft",
        in_words(*points), in_words(needed / 1e6), available / 1_000_000
    )]
    TooLarge {
        /// Points of all levels, about.
        points: f64,
        /// Bytes that they and the bounces surely take.
        needed: f64,
        /// Bytes that there are.
        available: u64,
    },
    /// More elements of cuts than the file can count.
    #[error(
        "the cuts have {elements} elements, more than 2^32: raise --sigma, or take fewer --cut-lights or a larger \
         --coarse-radius"
    )]
    TooManyCutElements {
        /// How many.
        elements: usize,
    },
    /// A unit of work cannot be kept.
    #[error("cannot {action} {}: {source}; free some space or mend the permissions and go on with the same command", path.display())]
    Unit {
        /// What was being done.
        action: &'static str,
        /// The file or folder.
        path: std::path::PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// A signal asked the bake to stop.
    #[error("the bake was stopped; nothing was written")]
    Stopped,
}

/// A count; what is beyond all machines by its size alone.
fn in_words(count: f64) -> String {
    if count < 1e15 {
        format!("{count:.0}")
    } else {
        format!("{count:.1e}")
    }
}
