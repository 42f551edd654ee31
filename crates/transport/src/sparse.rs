//! Sparse matrices: those of `sprs` in compressed rows, with products whose sums have a fixed order.
//!
//! sprs multiplies by vectors of one number type on one core. Light has three channels, and a frame waits for its products:
//! [`apply`] walks the matrix's own storage in parallel over rows, each row's sum from the lowest column to the highest
//! whatever the number of threads. sprs's product is its check in the tests.

use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::iter::Sum;
use std::ops::{Mul, Range};

/// A sparse matrix of weights, always in compressed rows; columns ascend within a row. Columns and offsets are `u32`: at
/// most 2³² entries.
pub type SparseMatrix = sprs::CsMatI<f32, u32>;

/// Rows per parallel task: long enough to hide scheduling, short enough to balance two cores.
const CHUNK: usize = 1024;

/// The matrix with no entry.
pub fn zero(rows: usize, columns: usize) -> SparseMatrix {
    SparseMatrix::zero((rows, columns))
}

/// A matrix from its rows of (column, weight), in any order within a row.
///
/// # Panics
/// As [`build_with`].
pub fn from_rows(rows: &[Vec<(u32, f32)>], columns: usize) -> SparseMatrix {
    build(rows.len(), columns, |i, row| row.extend_from_slice(&rows[i]))
}

/// Builds a matrix in parallel; `fill(i, row)` appends row `i`'s entries, in any order.
///
/// # Panics
/// As [`build_with`].
pub fn build(rows: usize, columns: usize, fill: impl Fn(usize, &mut Vec<(u32, f32)>) + Sync) -> SparseMatrix {
    build_with(rows, columns, || (), |(), i, row| fill(i, row))
}

/// [`build`] with something that rows near each other share, such as a memo; it must not change what they are.
///
/// # Panics
/// As [`build_runs`].
pub fn build_with<T>(
    rows: usize,
    columns: usize,
    shared: impl Fn() -> T + Sync + Send,
    fill: impl Fn(&mut T, usize, &mut Vec<(u32, f32)>) + Sync,
) -> SparseMatrix {
    let shared = || (shared(), Vec::new());
    build_runs(rows, columns, shared, |(shared, row), run, out| {
        for i in run {
            row.clear();
            fill(shared, i, row);
            out.push(row);
        }
    })
}

/// Some rows of a matrix, one after the other.
#[derive(Debug, Default)]
pub struct Rows {
    /// End of each.
    ends: Vec<u32>,
    columns: Vec<u32>,
    weights: Vec<f32>,
}

impl Rows {
    /// Appends a row; sorts its entries.
    pub fn push(&mut self, row: &mut [(u32, f32)]) {
        if !row.is_sorted_by_key(|entry| entry.0) {
            row.sort_unstable_by_key(|entry| entry.0);
        }
        self.columns.extend(row.iter().map(|entry| entry.0));
        self.weights.extend(row.iter().map(|entry| entry.1));
        self.ends.push(self.columns.len() as u32);
    }
}

/// [`build`] of several rows at a time: `fill(shared, run, rows)` appends those of a run, one after the other.
///
/// # Panics
/// A row has a column twice, or one that is not below `columns`; or a run has not as many rows as it should.
pub fn build_runs<T>(
    rows: usize,
    columns: usize,
    shared: impl Fn() -> T + Sync + Send,
    fill: impl Fn(&mut T, Range<usize>, &mut Rows) + Sync,
) -> SparseMatrix {
    let runs: Vec<Rows> = (0..rows.div_ceil(CHUNK))
        .into_par_iter()
        .map_init(shared, |shared, number| {
            let mut run = Rows::default();
            fill(shared, number * CHUNK..((number + 1) * CHUNK).min(rows), &mut run);
            run
        })
        .collect();
    let mut offsets = Vec::with_capacity(rows + 1);
    let mut entries = 0;
    offsets.push(0);
    for run in &runs {
        offsets.extend(run.ends.iter().map(|end| entries as u32 + end));
        entries += run.columns.len();
    }
    // Hundreds of megabytes of a large image, which all cores copy.
    let (mut indices, mut weights) = (vec![0; entries], vec![0.0; entries]);
    let (mut left, mut right) = (&mut indices[..], &mut weights[..]);
    let parts: Vec<_> = (runs.into_iter())
        .map(|run| {
            let (columns, others) = std::mem::take(&mut left).split_at_mut(run.columns.len());
            left = others;
            let (weights, others) = std::mem::take(&mut right).split_at_mut(run.weights.len());
            right = others;
            (run, columns, weights)
        })
        .collect();
    parts.into_par_iter().for_each(|(run, columns, weights)| {
        columns.copy_from_slice(&run.columns);
        weights.copy_from_slice(&run.weights);
    });
    SparseMatrix::try_new((rows, columns), offsets, indices, weights)
        .unwrap_or_else(|(.., error)| panic!("rows of a matrix with {columns} columns: {error}"))
}

/// Column and weight of each entry of row `i`.
#[inline]
pub fn row(matrix: &SparseMatrix, i: usize) -> impl ExactSizeIterator<Item = (u32, f32)> + Clone {
    let range = matrix.indptr().outer_inds_sz(i);
    let columns = matrix.indices()[range.clone()].iter();
    columns.copied().zip(matrix.data()[range].iter().copied())
}

/// The product with values of several channels, `out[i] = Σ_j weight_ij · values[j]`, in parallel over rows.
pub fn apply(matrix: &SparseMatrix, values: &[Vec3]) -> Vec<Vec3> {
    product(matrix, values, |weight| weight)
}

/// [`apply`] with values and sums in f64: for solvers, whose residual is a difference of nearly equal sums.
pub fn apply_double(matrix: &SparseMatrix, values: &[DVec3]) -> Vec<DVec3> {
    product(matrix, values, f64::from)
}

fn product<V, W>(matrix: &SparseMatrix, values: &[V], weight: impl Fn(f32) -> W + Sync) -> Vec<V>
where
    V: Mul<W, Output = V> + Sum + Copy + Send + Sync,
{
    (0..matrix.rows())
        .into_par_iter()
        .with_min_len(CHUNK / 4)
        .map(|i| row(matrix, i).map(|(j, w)| values[j as usize] * weight(w)).sum())
        .collect()
}

/// The sum of each row's weights, in f64.
pub fn row_sums(matrix: &SparseMatrix) -> impl ExactSizeIterator<Item = f64> {
    (0..matrix.rows()).map(|i| row(matrix, i).map(|e| f64::from(e.1)).sum())
}

/// Largest sum of a row's weights: the norm of a non-negative operator in the maximum norm.
pub fn largest_row_sum(matrix: &SparseMatrix) -> f64 {
    row_sums(matrix).fold(0.0, f64::max)
}

/// Scales every row to sum 1; rows that sum to nothing stay as they are.
pub fn normalise(matrix: &mut SparseMatrix) {
    let sums: Vec<f64> = row_sums(matrix).collect();
    for (mut row, sum) in matrix.outer_iterator_mut().zip(sums) {
        if sum > 0.0 {
            row.map_inplace(|w| (f64::from(*w) / sum) as f32);
        }
    }
}

/// Calls `fill(i, part)` for every row in parallel with the part of `values`, which has one for each entry, that is the
/// row's.
///
/// # Panics
/// `values` is shorter than the entries.
pub fn fill_rows<T: Send>(
    matrix: &SparseMatrix,
    mut values: &mut [T],
    fill: impl Fn(usize, &mut [T]) + Sync,
) {
    let offsets = matrix.indptr();
    let offsets = offsets.raw_storage();
    let mut chunks = Vec::with_capacity(matrix.rows().div_ceil(CHUNK));
    for first in (0..matrix.rows()).step_by(CHUNK) {
        let end = (first + CHUNK).min(matrix.rows());
        let (chunk, rest) = values.split_at_mut((offsets[end] - offsets[first]) as usize);
        chunks.push((first..end, chunk));
        values = rest;
    }
    chunks.into_par_iter().for_each(|(rows, mut chunk)| {
        for i in rows {
            let (row, rest) = chunk.split_at_mut((offsets[i + 1] - offsets[i]) as usize);
            fill(i, row);
            chunk = rest;
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;
    use sprs::prod::mul_acc_mat_vec_csr;

    /// Truth: sprs's own product, which sums in the same order: no digit differs.
    #[test]
    fn products_are_those_of_sprs() {
        let (rows, columns) = (3000usize, 700u32);
        let mut s = Stream::new(61, 0, 0);
        // From the highest column to the lowest, some rows empty.
        let of_row = |i: usize| (0..columns).rev().step_by(1 + i % 97).take(i % 50);
        let entries = (0..rows).map(|i| of_row(i).map(|j| (j, s.uniform())).collect());
        let matrix = from_rows(&entries.collect::<Vec<_>>(), columns as usize);
        let values: Vec<Vec3> = (0..columns)
            .map(|_| Vec3::new(s.uniform(), s.uniform() - 0.5, 1e20 * s.uniform()))
            .collect();
        let wide_values: Vec<DVec3> = values.iter().map(|v| v.as_dvec3()).collect();
        let wide = matrix.map(|w| f64::from(*w));
        let (single, double) = (apply(&matrix, &values), apply_double(&matrix, &wide_values));
        for channel in 0..3 {
            let of_channel: Vec<f32> = values.iter().map(|v| v[channel]).collect();
            let mut exact = vec![0.0f32; rows];
            mul_acc_mat_vec_csr(matrix.view(), &of_channel[..], &mut exact[..]);
            assert!(single.iter().zip(&exact).all(|(a, b)| a[channel] == *b));
            let of_channel: Vec<f64> = wide_values.iter().map(|v| v[channel]).collect();
            let mut exact = vec![0.0f64; rows];
            mul_acc_mat_vec_csr(wide.view(), &of_channel[..], &mut exact[..]);
            assert!(double.iter().zip(&exact).all(|(a, b)| a[channel] == *b));
        }
    }

    #[test]
    fn rows_that_have_a_sum_are_scaled_to_one() {
        let mut matrix = from_rows(&[vec![(2, 3.0), (0, 1.0)], vec![], vec![(1, 0.0)]], 3);
        normalise(&mut matrix);
        assert_eq!(
            matrix,
            from_rows(&[vec![(0, 0.25), (2, 0.75)], vec![], vec![(1, 0.0)]], 3)
        );
        assert_eq!(largest_row_sum(&matrix), 1.0);
        assert_eq!(apply(&zero(2, 3), &[Vec3::ONE; 3]), [Vec3::ZERO; 2]);
    }
}
