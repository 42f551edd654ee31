//! Bounding cones of directions.

use glam::Vec3;
use std::f32::consts::PI;

/// Rounding of the angles of one merge, radians.
const ROUNDING: f32 = 1e-6;

/// All directions within an angle of an axis.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cone {
    /// Unit.
    pub axis: Vec3,
    /// Half angle, radians in 0..=π.
    pub half: f32,
}

impl Cone {
    /// Half angle of the cone around two cones; the same whichever comes first.
    pub fn merged_half(&self, other: &Cone) -> f32 {
        let between = angle(self.axis, other.axis);
        let (small, large) = (self.half.min(other.half), self.half.max(other.half));
        if between + small <= large {
            large
        } else {
            (0.5 * (between + (small + large)) + ROUNDING).min(PI)
        }
    }

    /// A cone around two cones.
    pub fn merged(&self, other: &Cone) -> Cone {
        let half = self.merged_half(other);
        if half >= PI {
            return Cone {
                axis: self.axis,
                half: PI,
            };
        }
        let between = angle(self.axis, other.axis);
        if between + other.half <= self.half {
            return *self;
        }
        if between + self.half <= other.half {
            return *other;
        }
        // From one axis towards the other by what the half angle has grown.
        let across = (other.axis - self.axis * self.axis.dot(other.axis))
            .try_normalize()
            .unwrap_or_else(|| self.axis.any_orthonormal_vector());
        let (sin, cos) = (half - self.half).sin_cos();
        Cone {
            axis: (self.axis * cos + across * sin).normalize(),
            half,
        }
    }
}

/// Angle between unit vectors: of their chord, or of the chord to the opposite, whichever keeps its digits.
fn angle(a: Vec3, b: Vec3) -> f32 {
    if a.dot(b) >= 0.0 {
        2.0 * (0.5 * (a - b).length()).min(1.0).asin()
    } else {
        PI - 2.0 * (0.5 * (a + b).length()).min(1.0).asin()
    }
}
