//! The spatial basis times spherical harmonics: functions of place and direction, such as radiance.
//!
//! Source: Lehtinen et al. 2008, section 2.1 (tensor product bases: coefficients are vectors of directional
//! coefficients), with the multilevel scheme of equations 1 to 7 and its pull-push.
//!
//! Directions are world directions at every point: points with different normals share one directional frame,
//! so that nothing is rotated and every harmonic passes through the spatial basis like a scalar. (Vector
//! irradiance does not: it is a half-space's share, and [`crate::pyramid::carry`] turns it with the surface.)

use crate::basis::Level;
use crate::pyramid::LevelRanges;
use crate::sh::{COUNT, Coefficients};
use crate::sparse::{SparseMatrix, row};
use glam::Vec3;
use rayon::prelude::*;

/// Points per parallel task.
const CHUNK: usize = 1024;

fn add_scaled(sum: &mut Coefficients, other: &Coefficients, weight: f32) {
    for (s, o) in sum.iter_mut().zip(other) {
        *s += o * weight;
    }
}

fn combined(row: impl Iterator<Item = (u32, f32)>, values: &[Coefficients]) -> Coefficients {
    let mut sum = [0.0; COUNT];
    for (k, weight) in row {
        add_scaled(&mut sum, &values[k as usize], weight);
    }
    sum
}

/// Values at the points of all levels from coefficients, in place (equation 7 backwards): a coefficient is the
/// difference to what the parents' values say. `fine_from_coarse` as [`crate::pyramid::fine_from_coarse`]
/// builds it.
pub fn push(values: &mut [Coefficients], ranges: &LevelRanges, fine_from_coarse: &SparseMatrix) {
    for level in 1..ranges.levels() {
        let range = ranges.range(level);
        let (coarser, rest) = values.split_at_mut(range.start);
        let own = rest[..range.len()].par_iter_mut().with_min_len(CHUNK);
        own.enumerate().for_each(|(local, value)| {
            let predicted = combined(row(fine_from_coarse, range.start + local), coarser);
            add_scaled(value, &predicted, 1.0);
        });
    }
}

/// Coefficients from values at the points of all levels (equation 7): the inverse of [`push`].
pub fn differences(values: &[Coefficients], fine_from_coarse: &SparseMatrix) -> Vec<Coefficients> {
    (0..values.len())
        .into_par_iter()
        .with_min_len(CHUNK)
        .map(|i| {
            let mut own = values[i];
            let predicted = combined(row(fine_from_coarse, i), values);
            add_scaled(&mut own, &predicted, -1.0);
            own
        })
        .collect()
}

/// Pull: replaces each value, from the second finest level up, by the weighted mean of its children's, so that
/// coarse levels carry local averages instead of samples. Points without children keep theirs.
pub fn pull(values: &mut [Coefficients], ranges: &LevelRanges, fine_from_coarse: &SparseMatrix) {
    let coarse_from_fine = fine_from_coarse.transpose_view().to_csr();
    for level in (0..ranges.levels().saturating_sub(1)).rev() {
        let range = ranges.range(level);
        let (coarser, finer) = values.split_at_mut(range.end);
        let own = coarser[range.start..].par_iter_mut().with_min_len(CHUNK);
        own.enumerate().for_each(|(local, value)| {
            let children = row(&coarse_from_fine, range.start + local);
            let weights: f32 = children.clone().map(|c| c.1).sum();
            if weights > 0.0 {
                *value = [0.0; COUNT];
                for (child, weight) in children {
                    add_scaled(value, &finer[child as usize - range.end], weight / weights);
                }
            }
        });
    }
}

/// The directional function at a place from the values at one level's points (equation 3), or `None` where no
/// point of the level is near. `row` is scratch space.
pub fn at(
    level: &Level,
    values: &[Coefficients],
    place: Vec3,
    normal: Vec3,
    row: &mut Vec<(u32, f32)>,
) -> Option<Coefficients> {
    row.clear();
    level.functions_or_nearest_at(place, normal, row);
    (!row.is_empty()).then(|| combined(row.iter().copied(), values))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::poisson::Disks;
    use crate::pyramid::fine_from_coarse;
    use crate::random::Stream;
    use crate::sh::tests::{direction, quadrature};
    use crate::sh::{MAX_DEGREE, project, reconstruct};

    /// Three levels on the unit sphere, where neighbours' normals differ.
    fn sphere() -> (Vec<Level>, LevelRanges, SparseMatrix) {
        let mut s = Stream::new(51, 0, 0);
        let candidates: Vec<Vec3> = (0..60_000).map(|_| direction(&mut s)).collect();
        let levels: Vec<Level> = [0.4f32, 0.2, 0.1]
            .into_iter()
            .map(|radius| {
                let mut disks = Disks::new(radius);
                disks.throw(&candidates, &candidates, 0, |_| true);
                Level::new(disks.positions, disks.normals, radius, 2.0 * radius)
            })
            .collect();
        let ranges = LevelRanges::new(levels.iter().map(Level::len));
        let rows = fine_from_coarse(&levels, |_, _| false);
        (levels, ranges, rows)
    }

    /// Radiance of degree 3 in direction whose parts vary over space: (1 + a·x) and (2 − b·x) times two cubics.
    fn radiance(x: Vec3, d: Vec3) -> f32 {
        (1.0 + 0.5 * x.x) * (1.0 + d.x * d.y * d.z) + (2.0 - 0.3 * x.y) * (d.z * d.z * d.z - d.y)
    }

    fn projected(x: Vec3) -> Coefficients {
        project(
            MAX_DEGREE,
            quadrature().into_iter().map(|(d, w)| (d, radiance(x, d), w)),
        )
    }

    fn difference(a: &Coefficients, b: &Coefficients) -> f32 {
        a.iter().zip(b).fold(0.0f32, |m, (a, b)| m.max((a - b).abs()))
    }

    #[test]
    fn radiance_that_is_the_same_everywhere_stays_so_on_every_level_and_between_points() {
        let (levels, ranges, rows) = sphere();
        let everywhere = projected(Vec3::ZERO);
        let mut values = vec![everywhere; ranges.total()];
        pull(&mut values, &ranges, &rows);
        let mut coefficients = differences(&values, &rows);
        // Some fifty roundings of numbers up to 7, as below.
        let rounding = 2e-5;
        for c in &coefficients[ranges.range(0).end..] {
            assert!(
                difference(c, &[0.0; COUNT]) < rounding,
                "a constant needs no finer level"
            );
        }
        push(&mut coefficients, &ranges, &rows);
        let mut s = Stream::new(52, 0, 0);
        let mut row = Vec::new();
        for _ in 0..500 {
            let (x, d) = (direction(&mut s), direction(&mut s));
            let own = &coefficients[ranges.range(2)];
            let there = at(&levels[2], own, x, x, &mut row).unwrap();
            assert!((reconstruct(&there, d) - radiance(Vec3::ZERO, d)).abs() < rounding);
        }
    }

    #[test]
    fn values_at_points_come_back_from_their_differences() {
        let (levels, ranges, rows) = sphere();
        let wanted: Vec<Coefficients> = levels
            .iter()
            .flat_map(|l| l.positions.iter().map(|x| projected(*x)))
            .collect();
        let mut values = differences(&wanted, &rows);
        push(&mut values, &ranges, &rows);
        for (value, wanted) in values.iter().zip(&wanted) {
            assert!(difference(value, wanted) < 2e-5);
        }
    }

    #[test]
    fn radiance_between_points_is_within_its_variation_over_a_support() {
        let (levels, ranges, _) = sphere();
        let finest = &levels[2];
        let values: Vec<Coefficients> = finest.positions.iter().map(|x| projected(*x)).collect();
        assert_eq!(values.len(), ranges.range(2).len());
        let mut s = Stream::new(53, 0, 0);
        let mut row = Vec::new();
        let mut squares = 0.0;
        for _ in 0..2000 {
            let (x, d) = (direction(&mut s), direction(&mut s));
            let there = at(finest, &values, x, x, &mut row).unwrap();
            let error = reconstruct(&there, d) - radiance(x, d);
            // Shepard averages values at most a support radius (0.2) away. The gradient over space is at most
            // 0.5·(1 + 0.2) + 0.3·1.4: |xyz| ≤ 0.2 and |z³ − y| < 1.4 on the sphere.
            assert!(error.abs() < 0.2 * 1.02 + 1e-4);
            squares += error * error;
        }
        // Neighbours lie on all sides, so that first-order errors mostly cancel.
        assert!((squares / 2000.0f32).sqrt() < 0.2 * 1.02 * 0.2);
    }

    #[test]
    fn pulled_values_are_averages_of_what_lies_below() {
        let (_, ranges, rows) = sphere();
        let mut s = Stream::new(54, 0, 0);
        // Noise on the finest level alone; its mean is 0 and its variance 1/3.
        let mut values = vec![[7.0; COUNT]; ranges.total()];
        for value in &mut values[ranges.range(2)] {
            *value = std::array::from_fn(|_| 2.0 * s.uniform() - 1.0);
        }
        pull(&mut values, &ranges, &rows);
        let variance = |l: usize| {
            let own = &values[ranges.range(l)];
            own.iter().flatten().map(|v| v * v).sum::<f32>() / (own.len() * COUNT) as f32
        };
        // A support of 1.5 R of the coarse level holds some 0.7·π·(2·1.5)² = 20 finer points, unevenly weighted:
        // the variance falls by several times per level, and nothing of the 7 is left.
        assert!(variance(2) > 0.3 && variance(1) < 0.3 / 4.0 && variance(0) < variance(1) / 2.0);
    }
}
