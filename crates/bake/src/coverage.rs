//! How much of the scene's surface the points cover.
//!
//! Surfaces that no importance reached get no points (design section 6); what that leaves out is measured here
//! by surface samples, evenly by area.

use relight_scene::traced::TracedScene;
use relight_transport::basis::{Level, NearestPoint};
use relight_transport::random::Stream;

/// Surface samples: enough to see one per cent of the surface to within a tenth of itself.
const SAMPLES: u64 = 10_000;
/// Stage number of the random stream.
const STAGE: u32 = 10;

/// Area of the scene and how much of it has points on neither side.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Coverage {
    /// All triangles, m², cut-out parts not counted.
    pub area: f64,
    /// The part of `area` without points, m².
    pub uncovered: f64,
}

/// Measures coverage by the finest level.
pub fn coverage(scene: &TracedScene, finest: &Level, seed: u64) -> Coverage {
    let mut sums = Vec::with_capacity(scene.triangle_count());
    let mut total = 0.0f64;
    for triangle in 0..scene.triangle_count() as u32 {
        total += f64::from(scene.triangle_area(triangle));
        sums.push(total);
    }
    if total <= 0.0 {
        return Coverage::default();
    }
    let nearest = NearestPoint::new(finest);
    let (mut there, mut bare) = (0u64, 0u64);
    for i in 0..SAMPLES {
        let mut stream = Stream::new(seed, STAGE, i);
        // One sample in each of equally large parts.
        let at = (i as f64 + f64::from(stream.uniform())) / SAMPLES as f64 * total;
        let triangle = sums.partition_point(|sum| *sum < at).min(sums.len() - 1) as u32;
        let root = stream.uniform().sqrt();
        let v = stream.uniform() * root;
        let barycentric = [root - v, v];
        if scene.coverage(triangle, barycentric) <= 0.0 {
            continue;
        }
        there += 1;
        let hit = scene.surface_at(triangle, barycentric, true);
        let covered = |normal| nearest.at(hit.position, normal).is_some();
        bare += u64::from(!covered(hit.normal) && !covered(-hit.normal));
    }
    let share = total / SAMPLES as f64;
    Coverage {
        area: there as f64 * share,
        uncovered: bare as f64 * share,
    }
}
