//! Importance particles: how they bounce about the scene.

use glam::Vec2;
use relight_scene::rays::Ray;
use relight_scene::surface::{SurfaceHit, Surfaces, ray_from};
use relight_transport::random::Stream;
use relight_transport::sampling::{Frame, cosine_hemisphere};

/// Sends an importance particle along `ray`; it leaves each surface as a matt one reflects. Calls `landed` with the number and
/// place of each of at most `most` landings, which tells whether it goes on; returns the number of rays cast.
pub fn walk(
    surfaces: &dyn Surfaces,
    mut ray: Ray,
    s: &mut Stream,
    most: usize,
    mut landed: impl FnMut(usize, &SurfaceHit, &mut Stream) -> bool,
) -> u64 {
    for landing in 0..most {
        let Some(hit) = surfaces.closest_hit(&ray) else {
            return landing as u64 + 1;
        };
        if !landed(landing, &hit, s) {
            return landing as u64 + 1;
        }
        let u = Vec2::new(s.uniform(), s.uniform());
        let direction = Frame::around(hit.geometric_normal).world_from_local(cosine_hemisphere(u));
        ray = ray_from(&hit, direction);
    }
    most as u64
}
