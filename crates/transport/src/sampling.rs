//! Direction sets: stratified points on the hemisphere.

use crate::grid::morton_order;
use crate::random::Stream;
use glam::{Vec2, Vec3};
use std::f32::consts::TAU;

/// An orthonormal frame around a unit normal; columns are tangent, bitangent, normal.
///
/// Source: Duff et al. 2017, branchless construction.
#[derive(Clone, Copy, Debug)]
pub struct Frame {
    /// First tangent.
    pub tangent: Vec3,
    /// Second tangent.
    pub bitangent: Vec3,
    /// The normal.
    pub normal: Vec3,
}

impl Frame {
    /// A frame around the unit vector `normal`.
    #[inline]
    pub fn around(normal: Vec3) -> Frame {
        let sign = 1f32.copysign(normal.z);
        let a = -1.0 / (sign + normal.z);
        let b = normal.x * normal.y * a;
        Frame {
            tangent: Vec3::new(1.0 + sign * normal.x * normal.x * a, sign * b, -sign * normal.x),
            bitangent: Vec3::new(b, sign + normal.y * normal.y * a, -normal.y),
            normal,
        }
    }

    /// World direction of local `v` (z along the normal).
    #[inline]
    pub fn world_from_local(&self, v: Vec3) -> Vec3 {
        self.tangent * v.x + self.bitangent * v.y + self.normal * v.z
    }
}

/// Uniform direction on the upper hemisphere from a point of the unit square. The area-preserving map keeps
/// strata compact: height from one coordinate, angle from the other.
#[inline]
pub fn uniform_hemisphere(u: Vec2) -> Vec3 {
    let z = u.x;
    let radius = (1.0 - z * z).max(0.0).sqrt();
    let (sin, cos) = (TAU * u.y).sin_cos();
    Vec3::new(radius * cos, radius * sin, z)
}

/// Cosine-weighted direction on the upper hemisphere (Malley's method).
#[inline]
pub fn cosine_hemisphere(u: Vec2) -> Vec3 {
    let radius = u.x.sqrt();
    let (sin, cos) = (TAU * u.y).sin_cos();
    Vec3::new(radius * cos, radius * sin, (1.0 - u.x).max(0.0).sqrt())
}

/// The `i`-th point of the R2 sequence: the additive recurrence by the plastic number's powers (Roberts
/// 2018), in the unit square, started at `start`.
///
/// Any run of consecutive points is spread evenly, so that a gather can stop after any of them.
#[inline]
pub fn r2(i: u32, start: Vec2) -> Vec2 {
    // 1/p and 1/p² for the plastic number p = 1.3247179572447460, in 32-bit fixed point, exact for any i.
    const STEP: [u32; 2] = [3_242_174_889, 2_447_445_414];
    let scale = 1.0 / (1u64 << 32) as f64;
    let x = (f64::from(i.wrapping_mul(STEP[0])) * scale + f64::from(start.x)).fract();
    let y = (f64::from(i.wrapping_mul(STEP[1])) * scale + f64::from(start.y)).fract();
    Vec2::new(x as f32, y as f32)
}

/// Uniformly spread directions over the upper hemisphere for gathers, and what they sum to.
#[derive(Clone, Debug)]
pub struct DirectionSet {
    /// Local unit directions, z > 0, neighbours next to each other along a Morton curve: rays that follow one another meet
    /// the same places, in the scene and in memory.
    pub directions: Vec<Vec3>,
    /// Σ z · 2/N: what a full hemisphere of radiosity 1 gives as irradiance, 1 up to the set's own error.
    pub full: f32,
}

impl DirectionSet {
    /// `count` directions, at least one, scrambled by `stream`.
    pub fn uniform(count: usize, stream: &mut Stream) -> DirectionSet {
        let start = Vec2::new(stream.uniform(), stream.uniform());
        let count = count.max(1);
        let spread: Vec<Vec3> = (0..count as u32)
            .map(|i| uniform_hemisphere(r2(i, start)))
            .collect();
        let order = morton_order(&spread);
        let directions: Vec<Vec3> = order.iter().map(|&i| spread[i as usize]).collect();
        let heights: f64 = directions.iter().map(|d| f64::from(d.z)).sum();
        DirectionSet {
            full: (heights * 2.0 / count as f64) as f32,
            directions,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_orthonormal_for_every_normal() {
        let mut stream = Stream::new(3, 0, 0);
        for i in 0..10_000 {
            let n = if i == 0 {
                Vec3::NEG_Z
            } else {
                let z = 2.0 * stream.uniform() - 1.0;
                let (s, c) = (TAU * stream.uniform()).sin_cos();
                (Vec3::new(c, s, 0.0) * (1.0 - z * z).max(0.0).sqrt() + Vec3::Z * z).normalize()
            };
            let f = Frame::around(n);
            // Single precision: a few units in the last place of 1.
            assert!(f.tangent.dot(f.normal).abs() < 1e-6 && f.tangent.dot(f.bitangent).abs() < 1e-6);
            assert!((f.tangent.cross(f.bitangent) - f.normal).length() < 1e-6);
        }
    }

    #[test]
    fn a_direction_set_integrates_the_cosine() {
        // ∫ cos dω / π over the hemisphere is 1; the R2 sequence converges like 1/N up to logarithms.
        for count in [64, 256, 1024, 4096] {
            let set = DirectionSet::uniform(count, &mut Stream::new(1, 0, count as u64));
            assert!(
                (set.full - 1.0).abs() < 4.0 / count as f32,
                "{count}: {}",
                set.full
            );
            let sideways: Vec3 = set.directions.iter().copied().sum::<Vec3>() * (2.0 / count as f32);
            assert!(sideways.truncate().length() < 8.0 / count as f32);
        }
    }
}
