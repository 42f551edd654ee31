//! Point positions on a cubic grid whose step is R/256 (SPEC 6.6.1).
//!
//! Rounding is off by half a step on each axis, and the decoded f32 by at most 1/16 of a step more (or the level
//! is stored exactly): √3·(1/2 + 1/16)/256 R < R/256. The number of bytes per axis follows from the level's
//! extent, so a small scene and a wide one both keep the bound. Levels too wide for 24 bits, too far from the
//! origin for f32 to resolve the step, or with non-finite numbers, are stored exactly.

use bincode::{Decode, Encode};

/// The grid of one level.
#[derive(Debug, Clone, Copy, PartialEq, Encode, Decode)]
pub struct Grid {
    /// Corner of the level's bounds, world space, metres.
    pub origin: [f32; 3],
    /// Distance of neighbouring grid points, metres.
    pub step: f32,
}

/// Steps per Poisson-disk radius.
const STEPS_PER_RADIUS: f32 = 256.0;

impl Grid {
    /// The grid of a level with Poisson-disk radius `disk_radius`, or `None` when it must be stored exactly.
    pub fn of(disk_radius: f32, positions: &[[f32; 3]]) -> Option<Grid> {
        let mut low = [f32::INFINITY; 3];
        let mut high = [f32::NEG_INFINITY; 3];
        for position in positions {
            if !position.iter().all(|c| c.is_finite()) {
                return None;
            }
            for axis in 0..3 {
                low[axis] = low[axis].min(position[axis]);
                high[axis] = high[axis].max(position[axis]);
            }
        }
        if positions.is_empty() {
            return Some(Grid {
                origin: [0.0; 3],
                step: 1.0,
            });
        }
        let step = disk_radius / STEPS_PER_RADIUS;
        // A power of two below it would be rounded away by subnormals: no real radius is that small.
        let usable = step.is_finite() && step > f32::MIN_POSITIVE;
        let fits = (0..3).all(|axis| {
            let extent = (f64::from(high[axis]) - f64::from(low[axis])) / f64::from(step);
            let farthest = f64::from(low[axis].abs().max(high[axis].abs()));
            // Half an ulp of the farthest coordinate, 2⁻²⁴ of it at most, is to stay below step/16.
            extent < f64::from(1 << 24) - 1.0 && farthest <= f64::from(step) * f64::from(1 << 20)
        });
        // −0 and +0 compare equal but differ in the file: keep the one that addition gives.
        (usable && fits).then(|| Grid {
            origin: low.map(|c| c + 0.0),
            step,
        })
    }

    /// Grid coordinates of a position.
    pub fn encode(&self, position: [f32; 3]) -> [u32; 3] {
        let mut code = [0; 3];
        for axis in 0..3 {
            let steps = (f64::from(position[axis]) - f64::from(self.origin[axis])) / f64::from(self.step);
            code[axis] = steps.round() as u32;
        }
        code
    }

    /// The position of grid coordinates.
    pub fn decode(&self, code: [u32; 3]) -> [f32; 3] {
        [0, 1, 2].map(|axis| self.decode_axis(axis, code[axis]))
    }

    /// One coordinate (axis 0 to 2) of the position of a grid coordinate.
    pub fn decode_axis(&self, axis: usize, code: u32) -> f32 {
        (f64::from(self.origin[axis]) + f64::from(code) * f64::from(self.step)) as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn positions_stay_within_a_256th_of_the_radius(
            unit in prop::collection::vec(prop::array::uniform3(-1.0f32..1.0), 1..40),
            scale in -30i32..30, radius in -14i32..3, offset in prop::array::uniform3(-100.0f32..100.0),
        ) {
            let scale = 2f32.powi(scale);
            let radius = scale * 1.37 * 2f32.powi(radius);
            let positions: Vec<[f32; 3]> =
                unit.iter().map(|p| [0, 1, 2].map(|a| (p[a] + offset[a]) * scale)).collect();
            if let Some(grid) = Grid::of(radius, &positions) {
                let decoded: Vec<_> = positions.iter().map(|&p| grid.decode(grid.encode(p))).collect();
                for (p, q) in positions.iter().zip(&decoded) {
                    let distance = (0..3).map(|a| (f64::from(p[a]) - f64::from(q[a])).powi(2)).sum::<f64>().sqrt();
                    prop_assert!(distance <= f64::from(radius) / 256.0);
                }
                prop_assert_eq!(Grid::of(radius, &decoded), Some(grid), "what was decoded has the same grid");
                for (p, q) in positions.iter().zip(&decoded) {
                    prop_assert_eq!(grid.encode(*q), grid.encode(*p));
                }
            }
        }
    }

    #[test]
    fn a_wide_building_with_fine_points_still_fits_the_grid() {
        assert!(
            Grid::of(
                0.02,
                &[[-500.0, 0.0, 0.0], [500.0, 20.0, 300.0]].map(|p| p.map(|c: f32| c * 0.1))
            )
            .is_some()
        );
        assert!(Grid::of(1e-6, &[[0.0; 3], [100.0; 3]]).is_none());
        assert!(Grid::of(1.0, &[[f32::NAN; 3]]).is_none());
    }
}
