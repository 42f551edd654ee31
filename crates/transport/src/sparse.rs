//! Sparse rows of non-negative weights: reconstruction and pull matrices.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

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

/// Rows per parallel task: long enough to hide scheduling, short enough to balance two cores.
const CHUNK: usize = 1024;

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

    /// Rows, one after another, as one matrix.
    pub fn joined(rows: Vec<Vec<(u32, f32)>>, columns: usize) -> Rows {
        let mut joined = Rows {
            columns: columns as u32,
            offsets: vec![0],
            entries: Vec::new(),
        };
        for row in rows {
            joined.entries.extend(row);
            joined.offsets.push(joined.entries.len() as u32);
        }
        joined
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

    /// `out[i] = Σ_j weight_ij · values[j]`, in parallel over rows.
    pub fn apply(&self, values: &[Vec3]) -> Vec<Vec3> {
        (0..self.rows())
            .into_par_iter()
            .with_min_len(CHUNK)
            .map(|i| self.row(i).iter().map(|&(j, w)| values[j as usize] * w).sum())
            .collect()
    }

    /// [`Rows::apply`] with values and sums in f64: for solvers, whose residual is a difference of nearly equal sums.
    pub fn apply_double(&self, values: &[DVec3]) -> Vec<DVec3> {
        (0..self.rows())
            .into_par_iter()
            .with_min_len(CHUNK / 4)
            .map(|i| {
                self.row(i)
                    .iter()
                    .map(|&(j, w)| values[j as usize] * f64::from(w))
                    .sum()
            })
            .collect()
    }

    /// Largest sum of a row's weights: the norm of a non-negative operator in the maximum norm. Summed in f64.
    pub fn largest_row_sum(&self) -> f64 {
        let sum = |i: usize| self.row(i).iter().map(|e| f64::from(e.1)).sum::<f64>();
        (0..self.rows()).map(sum).fold(0.0, f64::max)
    }
}
