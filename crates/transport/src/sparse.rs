//! Sparse matrices: those of `sprs` in compressed rows, with products whose sums have a fixed order.
//!
//! sprs multiplies by vectors of one number type on one core. Light has three channels, and a frame waits for its products:
//! [`apply`] walks the matrix's own storage in parallel over rows, each row's sum from the lowest column to the highest
//! whatever the number of threads. sprs's product is its check in the tests.

use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::iter::Sum;
use std::ops::Mul;

/// A sparse matrix of weights, always in compressed rows; columns ascend within a row. Columns and offsets are `u32`: at
/// most 2³² entries.
pub type SparseMatrix = sprs::CsMatI<f32, u32>;

/// Rows per parallel task: long enough to hide scheduling, short enough to balance two cores.
const CHUNK: usize = 1024;

/// The matrix with no entry.
pub fn zero(rows: usize, columns: usize) -> SparseMatrix {
    SparseMatrix::zero((rows, columns))
}

/// A matrix from its rows of (column, weight).
///
/// # Panics
/// A row has a column twice, or one that is not below `columns`.
pub fn from_rows(rows: Vec<Vec<(u32, f32)>>, columns: usize) -> SparseMatrix {
    let mut offsets = Vec::with_capacity(rows.len() + 1);
    offsets.push(0);
    let mut end = 0;
    offsets.extend(rows.iter().map(|row| {
        end += row.len() as u32;
        end
    }));
    let (indices, weights) = rows.iter().flatten().copied().unzip();
    let shape = (rows.len(), columns);
    SparseMatrix::new_from_unsorted(shape, offsets, indices, weights)
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

/// A sparse matrix of weights in rows (compressed sparse rows). Column indices are below `columns`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Rows {
    /// Number of columns.
    pub columns: u32,
    /// Start of each row in `entries`, and the end of the last: rows + 1 values.
    pub offsets: Vec<u32>,
    /// (column, weight).
    pub entries: Vec<(u32, f32)>,
}

impl Rows {
    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.offsets.len().saturating_sub(1)
    }

    /// One row.
    #[inline]
    pub fn row(&self, i: usize) -> &[(u32, f32)] {
        &self.entries[self.offsets[i] as usize..self.offsets[i + 1] as usize]
    }

    /// Builds `rows` rows in parallel; `fill(i, row)` appends row `i`'s entries.
    pub fn build(rows: usize, columns: usize, fill: impl Fn(usize, &mut Vec<(u32, f32)>) + Sync) -> Rows {
        Rows::build_with(rows, columns, || (), |(), i, row| fill(i, row))
    }

    /// [`Rows::build`] with something that rows near each other share, such as a memo; it must not change what they are.
    pub fn build_with<T>(
        rows: usize,
        columns: usize,
        shared: impl Fn() -> T + Sync + Send,
        fill: impl Fn(&mut T, usize, &mut Vec<(u32, f32)>) + Sync,
    ) -> Rows {
        /// Ends of the rows within the chunk, and its entries.
        type Chunk = (Vec<u32>, Vec<(u32, f32)>);
        let chunks: Vec<Chunk> = (0..rows.div_ceil(CHUNK))
            .into_par_iter()
            .map_init(shared, |shared, chunk| {
                let mut entries = Vec::new();
                let ends = (chunk * CHUNK..((chunk + 1) * CHUNK).min(rows))
                    .map(|i| {
                        fill(shared, i, &mut entries);
                        entries.len() as u32
                    })
                    .collect();
                (ends, entries)
            })
            .collect();
        let mut offsets = Vec::with_capacity(rows + 1);
        offsets.push(0);
        let mut entries = Vec::with_capacity(chunks.iter().map(|c| c.1.len()).sum());
        for (ends, part) in chunks {
            let start = entries.len() as u32;
            offsets.extend(ends.into_iter().map(|end| start + end));
            entries.extend_from_slice(&part);
        }
        Rows {
            columns: columns as u32,
            offsets,
            entries,
        }
    }

    /// Calls `fill(i, part)` for every row in parallel with the part of `values`, which has one for each entry, that is the
    /// row's.
    ///
    /// # Panics
    /// `values` is shorter than the entries.
    pub fn fill_rows<T: Send>(&self, mut values: &mut [T], fill: impl Fn(usize, &mut [T]) + Sync) {
        let mut chunks = Vec::with_capacity(self.rows().div_ceil(CHUNK));
        for first in (0..self.rows()).step_by(CHUNK) {
            let end = (first + CHUNK).min(self.rows());
            let (chunk, rest) = values.split_at_mut((self.offsets[end] - self.offsets[first]) as usize);
            chunks.push((first..end, chunk));
            values = rest;
        }
        chunks.into_par_iter().for_each(|(rows, mut chunk)| {
            for i in rows {
                let (row, rest) = chunk.split_at_mut((self.offsets[i + 1] - self.offsets[i]) as usize);
                fill(i, row);
                chunk = rest;
            }
        });
    }

    /// The transposed matrix, rows in order of column index.
    pub fn transposed(&self) -> Rows {
        let mut offsets = vec![0u32; self.columns as usize + 1];
        for &(column, _) in &self.entries {
            offsets[column as usize + 1] += 1;
        }
        for i in 1..offsets.len() {
            offsets[i] += offsets[i - 1];
        }
        let mut next = offsets.clone();
        let mut entries = vec![(0u32, 0f32); self.entries.len()];
        for i in 0..self.rows() {
            for &(column, weight) in self.row(i) {
                entries[next[column as usize] as usize] = (i as u32, weight);
                next[column as usize] += 1;
            }
        }
        Rows {
            columns: self.rows() as u32,
            offsets,
            entries,
        }
    }

    /// Scales every row to sum 1; rows that sum to nothing stay as they are.
    pub fn normalise(&mut self) {
        for i in 0..self.rows() {
            let row = &mut self.entries[self.offsets[i] as usize..self.offsets[i + 1] as usize];
            let sum: f64 = row.iter().map(|e| f64::from(e.1)).sum();
            if sum > 0.0 {
                row.iter_mut().for_each(|e| e.1 = (f64::from(e.1) / sum) as f32);
            }
        }
    }
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
        let matrix = from_rows(entries.collect(), columns as usize);
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
        let mut matrix = from_rows(vec![vec![(2, 3.0), (0, 1.0)], vec![], vec![(1, 0.0)]], 3);
        normalise(&mut matrix);
        assert_eq!(
            matrix,
            from_rows(vec![vec![(0, 0.25), (2, 0.75)], vec![], vec![(1, 0.0)]], 3)
        );
        assert_eq!(largest_row_sum(&matrix), 1.0);
        assert_eq!(apply(&zero(2, 3), &[Vec3::ONE; 3]), [Vec3::ZERO; 2]);
    }
}
