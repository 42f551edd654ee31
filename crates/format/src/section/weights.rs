//! Operators on one sender level, one bounce or all: rows, columns, row sums, fractions (SPEC 6.8, 6.9).

use crate::asset::{BounceLinks, Solution, WeightRows};
use crate::codec::bytes::{Cursor, Planes, put_planes};
use crate::codec::{fraction, record};
use crate::error::Result;
use crate::section::rows;

/// Fewest raw bytes of a matrix: its two lengths.
const MIN_MATRIX_BYTES: usize = 8;

fn row_weights(matrix: &WeightRows) -> impl Iterator<Item = &[f32]> {
    matrix
        .row_offsets
        .windows(2)
        .map(|pair| &matrix.weights[pair[0] as usize..pair[1] as usize])
}

pub fn encode_bounce(bounce: &BounceLinks, out: &mut Vec<u8>) {
    record::put(bounce.level, out);
    encode(&bounce.matrix, out);
}

pub fn decode_bounce(cursor: &mut Cursor<'_>) -> Result<BounceLinks> {
    Ok(BounceLinks {
        level: record::fixed(cursor)?,
        matrix: decode(cursor)?,
    })
}

pub fn encode_solution(solution: &Solution, out: &mut Vec<u8>) {
    record::put((solution.level, solution.channels.len() as u32), out);
    solution.channels.iter().for_each(|matrix| encode(matrix, out));
}

pub fn decode_solution(cursor: &mut Cursor<'_>) -> Result<Solution> {
    let (level, count): (u32, u32) = record::fixed(cursor)?;
    let mut channels = cursor.vec(count as usize, MIN_MATRIX_BYTES)?;
    for _ in 0..count {
        channels.push(decode(cursor)?);
    }
    Ok(Solution { level, channels })
}

fn encode(matrix: &WeightRows, out: &mut Vec<u8>) {
    record::put((matrix.rows, matrix.columns.len() as u32), out);
    rows::encode(&matrix.row_offsets, &matrix.columns, out);
    put_planes(
        out,
        4,
        &matrix.row_sums.iter().map(|s| s.to_bits()).collect::<Vec<_>>(),
    );
    let fractions: Vec<u32> = row_weights(matrix).flat_map(fraction::encode).collect();
    put_planes(out, 2, &fractions);
}

fn decode(cursor: &mut Cursor<'_>) -> Result<WeightRows> {
    let (rows, count): (u32, u32) = record::fixed(cursor)?;
    let count = count as usize;
    let (row_offsets, columns) = rows::decode(cursor, rows as usize, count, rows)?;
    let mut row_sums = cursor.vec(rows as usize, 4)?;
    row_sums.extend(
        Planes::take(cursor, 4, rows as usize)?
            .values()
            .map(f32::from_bits),
    );
    let mut weights = cursor.vec(count, 2)?;
    let mut fractions = Planes::take(cursor, 2, count)?.values();
    let mut row = Vec::new();
    for (pair, &row_sum) in row_offsets.windows(2).zip(&row_sums) {
        row.clear();
        row.extend(fractions.by_ref().take((pair[1] - pair[0]) as usize));
        fraction::decode(&row, row_sum, &mut weights);
    }
    Ok(WeightRows {
        rows,
        row_offsets,
        columns,
        weights,
        row_sums,
    })
}

/// The matrix that a reader of the file will see in place of `matrix`: same rows, columns and row sums, the
/// weights in 16 bits and rescaled to their row's sum.
pub fn quantised_weights(matrix: &WeightRows) -> WeightRows {
    let mut weights = Vec::with_capacity(matrix.weights.len());
    let mut row = Vec::new();
    for (exact, &row_sum) in row_weights(matrix).zip(&matrix.row_sums) {
        row.clear();
        row.extend(fraction::encode(exact));
        fraction::decode(&row, row_sum, &mut weights);
    }
    WeightRows {
        rows: matrix.rows,
        row_offsets: matrix.row_offsets.clone(),
        columns: matrix.columns.clone(),
        weights,
        row_sums: matrix.row_sums.clone(),
    }
}
