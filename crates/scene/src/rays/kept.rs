//! Triangles while the hierarchy is built.

use glam::Vec3;

/// A box in the tree's box frame (internal, relative to the anchor).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Bounds {
    pub low: Vec3,
    pub high: Vec3,
}

impl Bounds {
    pub(super) const EMPTY: Bounds = Bounds {
        low: Vec3::splat(f32::INFINITY),
        high: Vec3::splat(f32::NEG_INFINITY),
    };

    pub(super) fn union(self, other: Bounds) -> Bounds {
        Bounds {
            low: self.low.min(other.low),
            high: self.high.max(other.high),
        }
    }

    /// Half of the surface area; 0 for a point.
    pub(super) fn half_area(self) -> f32 {
        let d = (self.high - self.low).max(Vec3::ZERO);
        d.x * d.y + d.y * d.z + d.z * d.x
    }
}

/// A triangle that is kept: its index in the input and its internal vertices and padded box.
pub(super) struct Kept {
    pub triangle: u32,
    pub vertices: [Vec3; 3],
    pub bounds: Bounds,
}
