//! What pixelcuts take.

use std::time::Instant;

/// Milliseconds of the stages of a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PixelcutsTimes {
    /// Eye rays.
    pub eye: f64,
    /// Lights that are evaluated at every pixel, and the choice of them.
    pub exact: f64,
    /// The coarse pass for the clamp.
    pub estimate: f64,
    /// Building trees.
    pub trees: f64,
    /// Choosing cuts and casting shadow rays.
    pub cuts: f64,
    /// Prefix sums.
    pub scatter: f64,
    /// Filtering and reflecting.
    pub shade: f64,
    /// Putting pixels together.
    pub resolve: f64,
}

/// What rendering a frame took.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PixelcutsStats {
    /// Points that eye rays found.
    pub points: usize,
    /// Lights that were evaluated at every pixel.
    pub exact: usize,
    /// Shadow rays, those of exact lights included.
    pub shadow_rays: u64,
    /// Those of exact lights.
    pub exact_rays: u64,
    /// Clusters of all cuts of all lights.
    pub clusters: u64,
    /// By stage.
    pub times: PixelcutsTimes,
}

/// Adds the milliseconds since `clock`, which starts anew.
pub(super) fn lap(clock: &mut Instant, sum: &mut f64) {
    *sum += clock.elapsed().as_secs_f64() * 1e3;
    *clock = Instant::now();
}
