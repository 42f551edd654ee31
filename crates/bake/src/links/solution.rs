//! All bounces solved at bake time: S = K + KρK + … on one sender level.
//!
//! Source: Lehtinen et al. 2008, equation 15 and the end of section 3.2 (second and later bounces on coarse
//! receivers, truncated at ε). With S a frame costs one product with a small matrix instead of an iteration,
//! and the reflectances ρ are fixed.
//!
//! Deviation: scalars on clusters instead of vectors on receivers, as in [`bounces`](crate::links::bounces), so that no
//! number of bounces can make energy. All bounces by GMRES, as there: at a reflectance of 0.999 the series of one row
//! needs some 14,000 products.

use crate::error::BakeError;
use crate::units::Units;
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use relight_transport::bounce::MOST_ALBEDO;
use relight_transport::krylov::non_negative_solution;
use relight_transport::senders::SenderTree;
use relight_transport::sparse::{SparseMatrix, from_rows, row};
use std::ops::Range;

/// Finest sender level that is used: two levels above the finest points' clusters are coarse enough for light
/// that has bounced twice, and S, which is nearly dense, stays small.
const FINEST_LEVEL: usize = 1;

/// A row is solved where what is left of it is at most this share of its sum: a tenth of what the iteration at play
/// time allows (1 %), so that the truncation at ε dominates.
const REST: f64 = 1e-3;

/// The solved bounces of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Solution {
    /// Sender level.
    pub level: usize,
    /// One matrix for grey reflectances, else one for red, green and blue each.
    pub channels: Vec<SparseMatrix>,
}

/// Solves the bounces. `k`: the operator on sender level `k_level`; `albedo`: of the finest points; `terms`:
/// products with K, `None` to convergence; entries that make up at most `epsilon` of their row are left out,
/// the row's sum is kept.
///
/// # Errors
/// A unit cannot be kept, or `step`, told of the rows that are done, stops the bake.
pub fn solution(
    k: &SparseMatrix,
    k_level: usize,
    tree: &SenderTree,
    albedo: &[Vec3],
    terms: Option<u32>,
    epsilon: f32,
    units: Units,
    step: &(impl Fn(usize) -> Result<(), BakeError> + Sync),
) -> Result<Solution, BakeError> {
    let level = FINEST_LEVEL.min(k_level);
    let mut k = k.clone();
    for l in (level + 1..=k_level).rev() {
        k = coarser(&k, tree, l);
    }
    let most = DVec3::splat(MOST_ALBEDO);
    let albedo: Vec<DVec3> = (tree.pulled(albedo).swap_remove(level).iter())
        .map(|a| a.as_dvec3().min(most))
        .collect();
    let room = Workspace {
        grey: albedo.iter().all(|a| a.x == a.y && a.y == a.z),
        brightest: albedo.iter().fold(DVec3::ZERO, |m, a| m.max(*a)),
        k,
        albedo,
        terms,
        epsilon: f64::from(epsilon),
    };
    let channels = room.solved(units, step)?;
    Ok(Solution { level, channels })
}

/// The operator on the sender level above `level`: rows averaged by area, columns summed.
fn coarser(k: &SparseMatrix, tree: &SenderTree, level: usize) -> SparseMatrix {
    let parents = &tree.parents[level - 1];
    let shares = &tree.shares[tree.ranges.range(level)];
    let clusters = tree.ranges.range(level - 1).len();
    let rows: Vec<_> = (0..clusters)
        .into_par_iter()
        .map_init(
            || vec![0.0f64; clusters],
            |dense, cluster| {
                for &child in tree.children(level - 1, cluster) {
                    let share = f64::from(shares[child as usize]);
                    for (column, weight) in row(k, child as usize) {
                        dense[parents[column as usize] as usize] += share * f64::from(weight);
                    }
                }
                taken(dense, 0.0)
            },
        )
        .collect();
    from_rows(&rows, clusters)
}

/// Rows per unit of work.
const ROWS_PER_UNIT: usize = 128;

/// Rows of a range, one for each channel in turn: (column, weight).
pub struct SparseRows(pub Vec<Vec<(u32, f32)>>);

/// What is solved. A row x of S = K + KρK + … is the row k of K and all that its senders receive: x = k + (x∘ρ) K. Rows
/// are independent of each other.
struct Workspace {
    k: SparseMatrix,
    /// At most [`MOST_ALBEDO`].
    albedo: Vec<DVec3>,
    brightest: DVec3,
    /// Whether one matrix does for all channels: then three rows are solved at a time, else the three channels of one.
    grey: bool,
    /// Products with K, `None` to convergence.
    terms: Option<u32>,
    epsilon: f64,
}

impl Workspace {
    /// The matrix of each channel.
    fn solved(
        &self,
        units: Units,
        step: &(impl Fn(usize) -> Result<(), BakeError> + Sync),
    ) -> Result<Vec<SparseMatrix>, BakeError> {
        let clusters = self.k.rows();
        let inputs = units.inputs(|key| {
            let terms = self.terms.map_or(u64::MAX, u64::from);
            key.u32s(self.k.indptr().raw_storage())
                .u64s(&[self.epsilon.to_bits(), terms]);
            for (column, weight) in self.k.indices().iter().zip(self.k.data()) {
                key.u32s(&[*column, weight.to_bits()]);
            }
            let albedo = self.albedo.iter().flat_map(|a| a.to_array());
            key.u64s(&albedo.map(f64::to_bits).collect::<Vec<u64>>());
        });
        let channels = if self.grey { 1 } else { 3 };
        let mut rows = vec![Vec::with_capacity(clusters); channels];
        for range in units.ranges(0..clusters, ROWS_PER_UNIT) {
            let part: SparseRows =
                units.taken_or_made("solution", inputs, &range, || self.rows(range.clone(), step))?;
            for (i, row) in part.0.into_iter().enumerate() {
                rows[i % channels].push(row);
            }
        }
        Ok(rows.into_iter().map(|rows| from_rows(&rows, clusters)).collect())
    }

    fn rows(
        &self,
        range: Range<usize>,
        step: &(impl Fn(usize) -> Result<(), BakeError> + Sync),
    ) -> Result<SparseRows, BakeError> {
        let at_once = if self.grey { 3 } else { 1 };
        let solved: Vec<Vec<Vec<(u32, f32)>>> = range
            .clone()
            .into_par_iter()
            .step_by(at_once)
            .map(|first| {
                let rows = first..(first + at_once).min(range.end);
                let x = self.solve(self.first(rows.clone()));
                step(rows.len())?;
                let lanes = if self.grey { rows.len() } else { 3 };
                let lane = |lane| taken(&mut x.iter().map(|x| x[lane]).collect::<Vec<f64>>(), self.epsilon);
                Ok((0..lanes).map(lane).collect())
            })
            .collect::<Result<_, BakeError>>()?;
        Ok(SparseRows(solved.into_iter().flatten().collect()))
    }

    /// Rows of K side by side, or one of them for all channels.
    fn first(&self, rows: Range<usize>) -> Vec<DVec3> {
        let mut first = vec![DVec3::ZERO; self.k.rows()];
        for (lane, i) in rows.enumerate() {
            for (column, weight) in row(&self.k, i) {
                match self.grey {
                    true => first[column as usize][lane] = f64::from(weight),
                    false => first[column as usize] = DVec3::splat(f64::from(weight)),
                }
            }
        }
        first
    }

    fn solve(&self, first: Vec<DVec3>) -> Vec<DVec3> {
        if let Some(terms) = self.terms {
            return self.series(first, terms);
        }
        // Rows of K sum to at most 1: what is left to add to x is at most the sum of its residual over 1 − ρ.
        let allowed = (DVec3::ONE - self.brightest) * REST;
        let sum = |x: &[DVec3]| x.iter().sum::<DVec3>();
        let spread = (self.k.rows() as f64).sqrt();
        let change =
            |x: &[DVec3], next: &[DVec3]| x.iter().zip(next).map(|(x, n)| (*n - *x).abs()).sum::<DVec3>();
        non_negative_solution(
            first,
            |x| self.received(x),
            |x| allowed * sum(x) / spread,
            |x, next| change(x, next).cmple(allowed * sum(next)).all(),
        )
        .0
    }

    /// So many terms of k + (k∘ρ) K + ….
    fn series(&self, first: Vec<DVec3>, terms: u32) -> Vec<DVec3> {
        let mut sum = vec![DVec3::ZERO; first.len()];
        let mut term = first;
        for number in 1..=terms {
            sum.iter_mut().zip(&term).for_each(|(s, t)| *s += *t);
            if number < terms {
                term = self.received(&term);
            }
        }
        sum
    }

    /// (x∘ρ) K.
    fn received(&self, x: &[DVec3]) -> Vec<DVec3> {
        let mut next = vec![DVec3::ZERO; x.len()];
        for (j, (x, rho)) in x.iter().zip(&self.albedo).enumerate() {
            let sent = *x * *rho;
            if sent != DVec3::ZERO {
                for (column, weight) in row(&self.k, j) {
                    next[column as usize] += sent * f64::from(weight);
                }
            }
        }
        next
    }
}

/// The entries of a dense row, less the smallest that make up at most `epsilon` of its sum; the others, at least the
/// largest, are scaled up to it, so that no `epsilon` loses light. Leaves zeros behind.
fn taken(dense: &mut [f64], epsilon: f64) -> Vec<(u32, f32)> {
    let mut row: Vec<(u32, f64)> = (0u32..)
        .zip(dense.iter().copied())
        .filter(|e| e.1 > 0.0)
        .collect();
    dense.fill(0.0);
    let sum: f64 = row.iter().map(|e| e.1).sum();
    row.sort_unstable_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
    let mut dropped = 0.0;
    let kept_from = row
        .iter()
        .position(|e| {
            dropped += e.1;
            dropped > epsilon * sum
        })
        .unwrap_or(row.len().saturating_sub(1));
    row.drain(..kept_from);
    let kept: f64 = row.iter().map(|e| e.1).sum();
    let scale = if kept > 0.0 { sum / kept } else { 0.0 };
    row.sort_unstable_by_key(|e| e.0);
    row.into_iter()
        .map(|(column, weight)| (column, (weight * scale) as f32))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use relight_transport::bounce;
    use relight_transport::random::Stream;
    use relight_transport::sparse::{apply, normalise};

    /// A closed scene of `n` leaves, four points each, under three coarse clusters.
    fn closed(n: usize) -> (SparseMatrix, SenderTree) {
        let mut s = Stream::new(41, 0, 0);
        let mut row = || (0..n as u32).map(|j| (j, s.uniform())).collect();
        let mut k = from_rows(&(0..n).map(|_| row()).collect::<Vec<_>>(), n);
        normalise(&mut k);
        let parents = (0..n as u32).map(|i| i % 3).collect();
        let leaves = (0..4 * n as u32).map(|p| p / 4).collect();
        (k, SenderTree::new(&[3, n], leaves, vec![parents], vec![9; 4 * n]))
    }

    fn solved(
        k: &SparseMatrix,
        tree: &SenderTree,
        albedo: &[Vec3],
        terms: Option<u32>,
        epsilon: f32,
    ) -> Solution {
        solution(k, 1, tree, albedo, terms, epsilon, Units::none(), &|_| Ok(())).unwrap()
    }

    #[test]
    fn a_closed_furnace_reaches_its_analytic_value() {
        // S applied to uniform radiosity ρ gives ρ/(1 − ρ); a row is solved to 1e-3.
        let (k, tree) = closed(30);
        for rho in [0.0f32, 0.5, 0.9, 0.99] {
            let s = solved(&k, &tree, &[Vec3::splat(rho); 120], None, 0.025);
            assert_eq!(s.channels.len(), 1, "grey reflectances need one matrix");
            let exact = rho / (1.0 - rho);
            for e in apply(&s.channels[0], &[Vec3::splat(rho); 30]) {
                assert!((e.x - exact).abs() <= 2e-3 * exact, "{rho}: {e}");
            }
        }
    }

    /// `--epsilon` may be any number above zero; from 1 on a row would have dropped all that it has.
    #[test]
    fn no_threshold_loses_light() {
        let (k, tree) = closed(30);
        for epsilon in [0.5, 1.0, 10.0, f32::MAX] {
            let s = solved(&k, &tree, &[Vec3::splat(0.9); 120], None, epsilon);
            for e in apply(&s.channels[0], &[Vec3::splat(0.9); 30]) {
                assert!((e.x / 9.0 - 1.0).abs() <= 2e-3, "{epsilon}: {e}");
            }
        }
    }

    #[test]
    fn the_solution_gives_what_the_iteration_gives() {
        let (k, tree) = closed(30);
        let mut s = Stream::new(42, 0, 0);
        let by_leaf: Vec<Vec3> = (0..30)
            .map(|_| 0.8 * Vec3::new(s.uniform(), s.uniform(), s.uniform()))
            .collect();
        let at_points: Vec<Vec3> = (0..120).map(|p| by_leaf[p / 4]).collect();
        let emitted: Vec<Vec3> = (0..30).map(|_| Vec3::splat(s.uniform())).collect();
        for bounces in [Some(1), Some(3), None] {
            let s = solved(&k, &tree, &at_points, bounces, 0.0);
            assert_eq!(s.channels.len(), 3);
            let (iterated, _) = bounce::solve(&k, &emitted, &by_leaf, bounces);
            for channel in 0..3 {
                for (a, b) in apply(&s.channels[channel], &emitted).iter().zip(&iterated) {
                    // To convergence both stop early: 1 % and 0.1 %. Else they differ by rounding.
                    let tolerance = if bounces.is_some() { 1e-5 } else { 0.011 };
                    assert!(
                        (a[channel] - b[channel]).abs() <= tolerance * b[channel],
                        "{a} {b}"
                    );
                }
            }
        }
    }

    #[test]
    fn a_coarser_operator_carries_the_same_uniform_light() {
        let (k, tree) = closed(30);
        let coarse = coarser(&k, &tree, 1);
        // Averages of sums of 1; f32 rounding of weights and shares.
        for i in 0..3 {
            let sum: f32 = row(&coarse, i).map(|e| e.1).sum();
            assert!((sum - 1.0).abs() < 1e-5, "{sum}");
        }
    }
}
