//! Progress and cancellation of what takes long.

use thiserror::Error;

/// Who watches a rendering: hears how far it is, and may stop it. `()` does neither.
pub trait Watch: Sync {
    /// So many of its parts are done. Called from worker threads.
    fn advance_to(&self, _done: usize, _of: usize) {}

    /// Whether it shall stop; asked between parts (tiles of an image, stages of a frame).
    fn stopped(&self) -> bool {
        false
    }
}

impl Watch for () {}

/// Rendering was stopped from outside; there is no image.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[error("rendering was stopped")]
pub struct Cancelled;

/// Goes on, or not.
///
/// # Errors
/// [`Cancelled`] if `watch` says so.
pub fn go_on(watch: &dyn Watch) -> Result<(), Cancelled> {
    if watch.stopped() { Err(Cancelled) } else { Ok(()) }
}
