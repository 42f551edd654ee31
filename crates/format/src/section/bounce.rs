//! The flat bounce operator: rows, columns, row sums, fractions (SPEC 6.8).

use crate::asset::BounceLinks;
use crate::codec::bytes::{Cursor, Planes, put_planes};
use crate::codec::fraction;
use crate::error::Result;
use crate::section::rows;

fn row_weights(bounce: &BounceLinks) -> impl Iterator<Item = &[f32]> {
    bounce
        .row_offsets
        .windows(2)
        .map(|pair| &bounce.weights[pair[0] as usize..pair[1] as usize])
}

pub fn encode(bounce: &BounceLinks, out: &mut Vec<u8>) {
    out.extend_from_slice(&bounce.rows.to_le_bytes());
    out.extend_from_slice(&(bounce.columns.len() as u32).to_le_bytes());
    rows::encode(&bounce.row_offsets, &bounce.columns, out);
    put_planes(
        out,
        4,
        &bounce.row_sums.iter().map(|s| s.to_bits()).collect::<Vec<_>>(),
    );
    let fractions: Vec<u32> = row_weights(bounce).flat_map(fraction::encode).collect();
    put_planes(out, 2, &fractions);
}

pub fn decode(cursor: &mut Cursor<'_>) -> Result<BounceLinks> {
    let rows = cursor.u32()?;
    let count = cursor.u32()? as usize;
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
    Ok(BounceLinks {
        rows,
        row_offsets,
        columns,
        weights,
        row_sums,
    })
}

/// The bounce operator that a reader of the file will see in place of `bounce`: same rows, columns and row sums,
/// the weights in 16 bits and rescaled to their row's sum.
pub fn quantised_bounce(bounce: &BounceLinks) -> BounceLinks {
    let mut weights = Vec::with_capacity(bounce.weights.len());
    let mut row = Vec::new();
    for (exact, &row_sum) in row_weights(bounce).zip(&bounce.row_sums) {
        row.clear();
        row.extend(fraction::encode(exact));
        fraction::decode(&row, row_sum, &mut weights);
    }
    BounceLinks {
        rows: bounce.rows,
        row_offsets: bounce.row_offsets.clone(),
        columns: bounce.columns.clone(),
        weights,
        row_sums: bounce.row_sums.clone(),
    }
}
