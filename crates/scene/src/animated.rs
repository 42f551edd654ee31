//! Values that may change from frame to frame: a constant or keyframes.

use glam::{Vec2, Vec3, Vec4};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How a value moves between two keys.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Interpolation {
    /// The earlier key's value holds until the next key.
    Step,
    /// Straight line between keys.
    #[default]
    Linear,
    /// Catmull-Rom spline through the keys, with one-sided tangents at both ends.
    Cubic,
}

/// A value over time, in frames; fractional frames are allowed.
#[derive(Clone, Debug, PartialEq)]
pub enum Animated<T> {
    /// The same at every frame.
    Constant(T),
    /// Keys `(frame, value)` with strictly rising frames, at least one. Before the first and after the last
    /// key the nearest key's value holds.
    Keys {
        /// The keys.
        keys: Vec<(f64, T)>,
        /// How to go from key to key.
        interpolation: Interpolation,
    },
}

/// What [`Animated`] needs of a value: a weighted sum of two values, and differences through it.
pub trait Blend: Copy + PartialEq {
    /// `self * a + other * b`.
    fn blend(self, a: f32, other: Self, b: f32) -> Self;
}

impl Blend for f32 {
    fn blend(self, a: f32, other: f32, b: f32) -> f32 {
        self * a + other * b
    }
}

macro_rules! blend_vector {
    ($($vector:ty),*) => {$(
        impl Blend for $vector {
            fn blend(self, a: f32, other: Self, b: f32) -> Self {
                self * a + other * b
            }
        }
    )*};
}
blend_vector!(Vec2, Vec3, Vec4);

impl<T: Blend> Animated<T> {
    /// The value at `frame`.
    pub fn at(&self, frame: f64) -> T {
        let (keys, interpolation) = match self {
            Animated::Constant(value) => return *value,
            Animated::Keys { keys, interpolation } => (keys, *interpolation),
        };
        let next = keys.partition_point(|key| key.0 <= frame);
        if next == 0 {
            return keys[0].1;
        }
        if next == keys.len() || interpolation == Interpolation::Step {
            return keys[next - 1].1;
        }
        let ((f0, v0), (f1, v1)) = (keys[next - 1], keys[next]);
        let span = f1 - f0;
        let t = ((frame - f0) / span) as f32;
        // What stands still does so to the bit, or a lamp's noise would change with its last digit.
        let between = |a: f32, b: f32| if v0 == v1 { v0 } else { v0.blend(a, v1, b) };
        if interpolation == Interpolation::Linear {
            return between(1.0 - t, t);
        }
        // Cubic Hermite form with Catmull-Rom tangents for unevenly spaced keys; at an end the tangent is
        // the chord.
        let tangent = |before: (f64, T), after: (f64, T)| {
            let scale = (span / (after.0 - before.0)) as f32;
            after.1.blend(scale, before.1, -scale)
        };
        let m0 = tangent(
            if next >= 2 { keys[next - 2] } else { keys[next - 1] },
            keys[next],
        );
        let m1 = tangent(
            keys[next - 1],
            if next + 1 < keys.len() {
                keys[next + 1]
            } else {
                keys[next]
            },
        );
        let (t2, t3) = (t * t, t * t * t);
        let points = between(2.0 * t3 - 3.0 * t2 + 1.0, 3.0 * t2 - 2.0 * t3);
        let tangents = m0.blend(t3 - 2.0 * t2 + t, m1, t3 - t2);
        points.blend(1.0, tangents, 1.0)
    }

    /// Whether the value is the same at every frame.
    pub fn is_constant(&self) -> bool {
        match self {
            Animated::Constant(_) => true,
            Animated::Keys { keys, .. } => keys.iter().all(|key| key.1 == keys[0].1),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Truth: the value that all keys have, to the bit.
    #[test]
    fn equal_keys_stand_still() {
        let value = Vec3::new(0.3, 0.4, 0.1);
        for interpolation in [Interpolation::Step, Interpolation::Linear, Interpolation::Cubic] {
            let still = Animated::Keys {
                keys: vec![(0.0, value), (7.0, value), (999.0, value)],
                interpolation,
            };
            assert!(still.is_constant());
            assert!((0..1100).all(|frame| still.at(f64::from(frame) / 1.1) == value));
        }
        let moving = Animated::Keys {
            keys: vec![(0.0, value), (1.0, Vec3::ZERO), (2.0, value)],
            interpolation: Interpolation::Linear,
        };
        assert!(!moving.is_constant());
        assert_eq!(moving.at(1.0), Vec3::ZERO);
    }
}
