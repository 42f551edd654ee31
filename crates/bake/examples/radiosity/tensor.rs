//! The spatial basis times spherical harmonics: functions of place and direction, such as radiance.
//!
//! Source: Lehtinen et al. 2008, section 2.1 (tensor product bases: coefficients are vectors of directional
//! coefficients), with the multilevel scheme of equations 1 to 7.
//!
//! Directions are world directions at every point: points with different normals share one directional frame,
//! so that nothing is rotated and every harmonic passes through the spatial basis like a scalar. (Vector
//! irradiance does not: it is a half-space's share, and `relight_transport::pyramid::carry` turns it with the surface.)

use glam::Vec3;
use relight_transport::basis::Level;
use relight_transport::pyramid::LevelRanges;
use relight_transport::sh::{COUNT, Coefficients};
use relight_transport::sparse::{SparseMatrix, row};

fn combined(row: impl Iterator<Item = (u32, f32)>, values: &[Coefficients]) -> Coefficients {
    let mut sum = [0.0; COUNT];
    for (k, weight) in row {
        for (s, value) in sum.iter_mut().zip(&values[k as usize]) {
            *s += value * weight;
        }
    }
    sum
}

/// Gives the points of all levels whose value isn't `known` what their parents say (equation 7 with coefficients of
/// 0), coarse levels first; 0 where there is no parent. `fine_from_coarse` as
/// [`relight_transport::pyramid::fine_from_coarse`] builds it.
pub fn fill(
    values: &mut [Coefficients],
    known: impl Fn(usize) -> bool,
    ranges: &LevelRanges,
    fine_from_coarse: &SparseMatrix,
) {
    for i in (0..ranges.total()).filter(|&i| !known(i)) {
        values[i] = combined(row(fine_from_coarse, i), values);
    }
}

/// The directional function at a place from the values at one level's points (equation 3); 0 where no point of the
/// level is near. `row` is scratch space.
pub fn at(
    level: &Level,
    values: &[Coefficients],
    place: Vec3,
    normal: Vec3,
    row: &mut Vec<(u32, f32)>,
) -> Coefficients {
    row.clear();
    level.functions_or_nearest_at(place, normal, row);
    combined(row.iter().copied(), values)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec2;
    use relight_transport::poisson::{Dart, Disks};
    use relight_transport::pyramid::fine_from_coarse;
    use relight_transport::random::Stream;
    use relight_transport::sampling::uniform_hemisphere;
    use relight_transport::sh::{dot, evaluate};
    use std::f32::consts::PI;

    fn direction(s: &mut Stream) -> Vec3 {
        uniform_hemisphere(Vec2::new(2.0 * s.uniform() - 1.0, s.uniform())).normalize()
    }

    /// Three levels on the unit sphere, where neighbours' normals differ.
    fn sphere() -> (Vec<Level>, LevelRanges, SparseMatrix) {
        let mut s = Stream::new(51, 0, 0);
        let darts: Vec<Dart> = (0..60_000)
            .map(|_| direction(&mut s))
            .map(|x| Dart::plain(x, x))
            .collect();
        let levels: Vec<Level> = [0.4f32, 0.2, 0.1]
            .into_iter()
            .map(|radius| {
                let mut disks = Disks::new(radius);
                disks.throw(&darts, 0, |_| true);
                Level::new(disks.positions, disks.normals, radius, 2.0 * radius)
            })
            .collect();
        let ranges = LevelRanges::new(levels.iter().map(Level::len));
        let rows = fine_from_coarse(&levels, |_, _| false);
        (levels, ranges, rows)
    }

    /// Radiance of degree 2 in direction whose parts vary over space.
    fn radiance(x: Vec3, d: Vec3) -> f32 {
        (1.0 + 0.5 * x.x) * d.z + (2.0 - 0.3 * x.y) * d.x * d.y
    }

    /// The same in harmonics: z and xy are √(4π/3) and √(4π/15) of them.
    fn harmonics(x: Vec3) -> Coefficients {
        let mut c = [0.0; COUNT];
        c[2] = (1.0 + 0.5 * x.x) * (4.0 * PI / 3.0).sqrt();
        c[4] = (2.0 - 0.3 * x.y) * (4.0 * PI / 15.0).sqrt();
        c
    }

    /// Most that radiance changes over a unit of length: |z| ≤ 1 and |xy| ≤ 1/2.
    const VARIATION: f32 = 0.5 + 0.3 / 2.0;

    #[test]
    fn radiance_that_is_the_same_everywhere_needs_the_coarsest_level_only() {
        let (levels, ranges, rows) = sphere();
        let mut values = vec![[7.0; COUNT]; ranges.total()];
        values[ranges.range(0)].fill(harmonics(Vec3::ZERO));
        fill(&mut values, |i| ranges.range(0).contains(&i), &ranges, &rows);
        let mut s = Stream::new(52, 0, 0);
        let mut row = Vec::new();
        for _ in 0..500 {
            let (x, d) = (direction(&mut s), direction(&mut s));
            let there = at(&levels[2], &values[ranges.range(2)], x, x, &mut row);
            // Some fifty roundings of numbers up to 7.
            assert!((dot(&there, &evaluate(d)) - radiance(Vec3::ZERO, d)).abs() < 2e-5);
        }
    }

    #[test]
    fn radiance_between_points_and_below_known_ones_is_within_its_variation_over_the_supports() {
        let (levels, ranges, rows) = sphere();
        let places: Vec<Vec3> = levels.iter().flat_map(|l| l.positions.iter().copied()).collect();
        let mut s = Stream::new(53, 0, 0);
        let mut row = Vec::new();
        // Shepard averages values at most a support radius away: 0.2 from the finest points, and where these took
        // their parents' word, 0.4 more.
        for (finest_known, reach) in [(true, 0.2f32), (false, 0.6)] {
            let known = |i| finest_known || i < ranges.range(2).start;
            let mut values: Vec<Coefficients> = places.iter().map(|&x| harmonics(x)).collect();
            fill(&mut values, known, &ranges, &rows);
            let mut squares = 0.0;
            for _ in 0..2000 {
                let (x, d) = (direction(&mut s), direction(&mut s));
                let there = at(&levels[2], &values[ranges.range(2)], x, x, &mut row);
                let error = dot(&there, &evaluate(d)) - radiance(x, d);
                assert!(error.abs() < reach * VARIATION + 1e-4);
                squares += error * error;
            }
            // Neighbours lie on all sides, so that first-order errors mostly cancel.
            assert!((squares / 2000.0f32).sqrt() < 0.2 * reach * VARIATION);
        }
    }
}
