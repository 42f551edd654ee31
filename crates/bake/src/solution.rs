//! All bounces solved at bake time: S = K + KρK + … on one sender level.
//!
//! Source: Lehtinen et al. 2008, equation 15 and the end of section 3.2 (second and later bounces on coarse
//! receivers, truncated at ε). With S a frame costs one product with a small matrix instead of an iteration,
//! and the reflectances ρ are fixed.
//!
//! Deviation: scalars on clusters instead of vectors on receivers, as in [`bounces`](crate::bounces), so that no
//! number of bounces can make energy.

use crate::error::BakeError;
use crate::units::Units;
use glam::Vec3;
use rayon::prelude::*;
use relight_transport::senders::SenderTree;
use relight_transport::sparse::Rows;
use std::ops::Range;

/// Finest sender level that is used: two levels above the finest points' clusters are coarse enough for light
/// that has bounced twice, and S, which is nearly dense, stays small.
const FINEST_LEVEL: usize = 1;

/// The series ends where what is left of it is at most this share of the row's sum: a tenth of what the
/// iteration at play time allows (1 %), so that the truncation at ε dominates.
const REST: f64 = 1e-3;

/// Terms after which a series ends whatever is left; as at play time.
const MOST_TERMS: u32 = 20_000;

/// The solved bounces of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Solution {
    /// Sender level.
    pub level: usize,
    /// One matrix for grey reflectances, else one for red, green and blue each.
    pub channels: Vec<Rows>,
}

/// Solves the bounces. `k`: the operator on sender level `k_level`; `albedo`: of the finest points; `terms`:
/// products with K, `None` to convergence; entries that make up at most `epsilon` of their row are left out,
/// the row's sum is kept.
///
/// # Errors
/// A unit cannot be kept, or `step`, told of the rows that are done, stops the bake.
pub fn solution(
    k: &Rows,
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
    let albedo = tree.pulled(albedo).swap_remove(level);
    let grey = albedo.iter().all(|a| a.x == a.y && a.y == a.z);
    let channels = (0..if grey { 1 } else { 3 })
        .map(|channel| {
            let rho: Vec<f64> = albedo.iter().map(|a| f64::from(a[channel])).collect();
            solved(&k, &rho, terms.unwrap_or(MOST_TERMS), epsilon, units, step)
        })
        .collect::<Result<_, BakeError>>()?;
    Ok(Solution { level, channels })
}

/// The operator on the sender level above `level`: rows averaged by area, columns summed.
fn coarser(k: &Rows, tree: &SenderTree, level: usize) -> Rows {
    let parents = &tree.parents[level - 1];
    let shares = &tree.shares[tree.ranges.range(level)];
    let clusters = tree.ranges.range(level - 1).len();
    let rows = (0..clusters)
        .into_par_iter()
        .map_init(
            || vec![0.0f64; clusters],
            |dense, cluster| {
                for &child in tree.children(level - 1, cluster) {
                    let share = f64::from(shares[child as usize]);
                    for &(column, weight) in k.row(child as usize) {
                        dense[parents[column as usize] as usize] += share * f64::from(weight);
                    }
                }
                taken(dense, 0.0)
            },
        )
        .collect();
    joined(rows, clusters)
}

/// Rows of K + KρK + …: x ← (x∘ρ) K from x = row of K, summed. Rows are independent of each other.
fn solved(
    k: &Rows,
    rho: &[f64],
    terms: u32,
    epsilon: f32,
    units: Units,
    step: &(impl Fn(usize) -> Result<(), BakeError> + Sync),
) -> Result<Rows, BakeError> {
    let clusters = k.rows();
    let inputs = units.inputs(|key| {
        key.u32s(&k.offsets).f32s(&[epsilon]).u64s(&[u64::from(terms)]);
        for (column, weight) in &k.entries {
            key.u32s(&[*column, weight.to_bits()]);
        }
        key.u64s(&rho.iter().map(|r| r.to_bits()).collect::<Vec<u64>>());
    });
    let mut rows = Vec::with_capacity(clusters);
    for range in units.ranges(0..clusters, ROWS_PER_UNIT) {
        let part: SparseRows = units.taken_or_made("solution", inputs, &range, || {
            solved_rows(k, rho, terms, epsilon, range.clone(), step)
        })?;
        rows.extend(part.0);
    }
    Ok(joined(rows, clusters))
}

/// Rows per unit of work.
const ROWS_PER_UNIT: usize = 128;

/// Rows of a range: (column, weight).
pub struct SparseRows(pub Vec<Vec<(u32, f32)>>);

fn solved_rows(
    k: &Rows,
    rho: &[f64],
    terms: u32,
    epsilon: f32,
    range: Range<usize>,
    step: &(impl Fn(usize) -> Result<(), BakeError> + Sync),
) -> Result<SparseRows, BakeError> {
    let clusters = k.rows();
    let brightest = rho.iter().copied().fold(0.0, f64::max);
    let zeros = || [0; 3].map(|_: i32| vec![0.0f64; clusters]);
    range
        .into_par_iter()
        .map_init(zeros, |[sum, term, next], row| {
            for &(column, weight) in k.row(row) {
                term[column as usize] = f64::from(weight);
            }
            for number in 1..=terms {
                sum.iter_mut().zip(term.iter()).for_each(|(s, t)| *s += t);
                // Rows of K sum to at most 1, so that each term is at most the brightest ρ of the last.
                let rest = term.iter().sum::<f64>() * brightest;
                if number == terms || rest <= REST * (1.0 - brightest) * sum.iter().sum::<f64>() {
                    break;
                }
                next.fill(0.0);
                for (j, (t, rho)) in term.iter().zip(rho).enumerate() {
                    let carried = t * rho;
                    if carried > 0.0 {
                        for &(column, weight) in k.row(j) {
                            next[column as usize] += carried * f64::from(weight);
                        }
                    }
                }
                std::mem::swap(term, next);
            }
            term.fill(0.0);
            step(1)?;
            Ok(taken(sum, f64::from(epsilon)))
        })
        .collect::<Result<_, BakeError>>()
        .map(SparseRows)
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

fn joined(rows: Vec<Vec<(u32, f32)>>, clusters: usize) -> Rows {
    let mut joined = Rows {
        columns: clusters as u32,
        offsets: vec![0],
        entries: Vec::new(),
    };
    for row in rows {
        joined.entries.extend(row);
        joined.offsets.push(joined.entries.len() as u32);
    }
    joined
}

#[cfg(test)]
mod tests {
    use super::*;
    use relight_transport::bounce;
    use relight_transport::random::Stream;

    /// A closed scene of `n` leaves, four points each, under three coarse clusters.
    fn closed(n: usize) -> (Rows, SenderTree) {
        let mut s = Stream::new(41, 0, 0);
        let mut k = joined(
            (0..n)
                .map(|_| (0..n as u32).map(|j| (j, s.uniform())).collect())
                .collect(),
            n,
        );
        k.normalise();
        let parents = (0..n as u32).map(|i| i % 3).collect();
        let leaves = (0..4 * n as u32).map(|p| p / 4).collect();
        (k, SenderTree::new(&[3, n], leaves, vec![parents], vec![9; 4 * n]))
    }

    fn solved(k: &Rows, tree: &SenderTree, albedo: &[Vec3], terms: Option<u32>, epsilon: f32) -> Solution {
        solution(k, 1, tree, albedo, terms, epsilon, Units::none(), &|_| Ok(())).unwrap()
    }

    #[test]
    fn a_closed_furnace_reaches_its_analytic_value() {
        // S applied to uniform radiosity ρ gives ρ/(1 − ρ); the series stops at 1e-3 of the rest.
        let (k, tree) = closed(30);
        for rho in [0.0f32, 0.5, 0.9, 0.99] {
            let s = solved(&k, &tree, &[Vec3::splat(rho); 120], None, 0.025);
            assert_eq!(s.channels.len(), 1, "grey reflectances need one matrix");
            let exact = rho / (1.0 - rho);
            for e in s.channels[0].apply(&[Vec3::splat(rho); 30]) {
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
            for e in s.channels[0].apply(&[Vec3::splat(0.9); 30]) {
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
                for (a, b) in s.channels[channel].apply(&emitted).iter().zip(&iterated) {
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
        for row in 0..3 {
            let sum: f32 = coarse.row(row).iter().map(|e| e.1).sum();
            assert!((sum - 1.0).abs() < 1e-5, "{sum}");
        }
    }
}
