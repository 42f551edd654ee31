//! Places of surfaces that light arrives at.

use glam::Vec3;
use relight_scene::rays::SurfacePoint;
use relight_scene::surface::{SurfaceHit, ray_end};

/// A place that light arrives at: what that needs to know of a hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Where rays from it start. Its normal is the geometric one, on the side that is lit.
    pub start: SurfacePoint,
    /// Unit smooth normal, on the same side.
    pub normal: Vec3,
}

impl Place {
    /// Whether a direction is on the side where both normals are.
    pub(crate) fn faces(&self, direction: Vec3) -> bool {
        self.normal.dot(direction) > 0.0 && self.start.normal.dot(direction) > 0.0
    }
}

impl From<&SurfaceHit> for Place {
    fn from(hit: &SurfaceHit) -> Place {
        Place {
            start: ray_end(hit),
            normal: hit.normal,
        }
    }
}
