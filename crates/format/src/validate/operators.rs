//! Rules of sparse operators (SPEC 6.7 to 6.9).

use super::check::{check, check_each, check_finite, check_length};
use crate::asset::{Links, WeightRows};
use crate::error::Result;
use crate::layout::Kind;

/// How far a bounce row may sum from its stated sum, relative: f32 sums of thousands of weights pass.
const ROW_SUM_TOLERANCE: f64 = 1e-4;

impl Links {
    /// Checks rows, columns and vectors.
    ///
    /// # Errors
    /// `Invalid` with the row or link.
    pub fn validate(&self) -> Result<()> {
        let kind = Kind::LinksTransfer;
        let links = self.columns.len();
        check_length(kind, "vectors, one per link", self.vectors.len(), links)?;
        let (offsets, columns) = (&self.row_offsets, &self.columns);
        check_rows(kind, self.receivers, self.senders, offsets, columns)?;
        check_finite(kind, "vectors", &self.vectors)
    }
}

impl WeightRows {
    /// Checks that the rows are the clusters of a sender level, of which `counts` has the numbers; rows and columns, weights
    /// of at least 0, and row sums of at most `most` that the weights add up to.
    pub(super) fn validate(&self, kind: Kind, level: u32, counts: &[u32], most: f32) -> Result<()> {
        let Some(&clusters) = counts.get(level as usize) else {
            let expected = format_args!("a sender level below {}", counts.len());
            return check(false, kind, 0, expected, level);
        };
        let (rows, links) = (self.rows as usize, self.columns.len());
        check_length(kind, "rows, one per cluster", rows, clusters as usize)?;
        check_length(kind, "weights, one per link", self.weights.len(), links)?;
        check_length(kind, "row sums, one per row", self.row_sums.len(), rows)?;
        check_rows(kind, self.rows, self.rows, &self.row_offsets, &self.columns)?;
        let fine = |&weight: &f32| weight >= 0.0 && weight.is_finite();
        check_each(kind, &self.weights, "a finite weight of at least 0", fine)?;
        let expected = format_args!("a row sum of 0 to {most}");
        check_each(kind, &self.row_sums, expected, |sum| (0.0..=most).contains(sum))?;
        for (row, (pair, &stated)) in self.row_offsets.windows(2).zip(&self.row_sums).enumerate() {
            let weights = &self.weights[pair[0] as usize..pair[1] as usize];
            let sum: f64 = weights.iter().map(|&w| f64::from(w)).sum();
            let close = (sum - f64::from(stated)).abs() <= ROW_SUM_TOLERANCE * f64::from(stated);
            let expected = format_args!("weights that sum to the row's {stated}");
            check(close, kind, row, expected, sum)?;
        }
        Ok(())
    }
}

/// Offsets from 0 to the number of links, never falling; columns rising within a row and below `columns_end`.
fn check_rows(kind: Kind, rows: u32, columns_end: u32, row_offsets: &[u32], columns: &[u32]) -> Result<()> {
    let (rows, what) = (rows as usize, "row offsets, one per row and one more");
    check_length(kind, what, row_offsets.len(), rows + 1)?;
    let (first, last) = (row_offsets[0], row_offsets[rows]);
    check(first == 0, kind, 0, "a first row offset of 0", first)?;
    let expected = format_args!("{} links", columns.len());
    check(last as usize == columns.len(), kind, rows, expected, last)?;
    for (row, pair) in row_offsets.windows(2).enumerate() {
        let expected = format_args!("row offsets from {} to {last}", pair[0]);
        let in_order = pair[0] <= pair[1] && pair[1] <= last;
        check(in_order, kind, row, expected, pair[1])?;
        let row_columns = &columns[pair[0] as usize..pair[1] as usize];
        let rising = row_columns.windows(2).all(|pair| pair[0] < pair[1]);
        let found = "a column that does not rise";
        check(rising, kind, row, "rising columns in the row", found)?;
        if let Some(&column) = row_columns.last() {
            let expected = format_args!("columns below {columns_end}");
            check(column < columns_end, kind, row, expected, column)?;
        }
    }
    Ok(())
}
