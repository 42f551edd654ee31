//! Random directions that unit tests share.

use crate::random::Stream;
use crate::sampling::uniform_hemisphere;
use glam::{Vec2, Vec3};

/// A unit vector, evenly distributed.
pub fn direction(s: &mut Stream) -> Vec3 {
    uniform_hemisphere(Vec2::new(2.0 * s.uniform() - 1.0, s.uniform())).normalize()
}

/// So many of them.
pub fn directions(seed: u64, count: usize) -> Vec<Vec3> {
    let mut s = Stream::new(seed, 0, 0);
    (0..count).map(|_| direction(&mut s)).collect()
}
