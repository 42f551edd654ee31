//! Compressed rows: lengths and sorted columns as varints (SPEC 7.7). A row's first column is coded as its
//! difference from the first column of the last non-empty row before it, the others as the gap to their left
//! neighbour: columns are sorted by construction on reading.

use crate::codec::bytes::{Cursor, put_varint, unzigzag, zigzag};
use crate::error::Result;

pub fn encode(row_offsets: &[u32], columns: &[u32], out: &mut Vec<u8>) {
    let rows = || {
        row_offsets
            .windows(2)
            .map(|pair| &columns[pair[0] as usize..pair[1] as usize])
    };
    for row in rows() {
        put_varint(out, row.len() as u32);
    }
    let mut previous = 0u32;
    for row in rows() {
        if let Some(&first) = row.first() {
            put_varint(out, zigzag(first.wrapping_sub(previous)));
            previous = first;
        }
    }
    for row in rows() {
        for pair in row.windows(2) {
            // Sorted and distinct (validated): the gap is at least 1.
            put_varint(out, pair[1] - pair[0] - 1);
        }
    }
}

/// Offsets (`rows + 1`) and columns (`links`), all columns below `columns_end`.
pub fn decode(
    cursor: &mut Cursor<'_>,
    rows: usize,
    links: usize,
    columns_end: u32,
) -> Result<(Vec<u32>, Vec<u32>)> {
    cursor.justify(rows, 1)?;
    let mut row_offsets = cursor.vec(rows + 1, 0)?;
    row_offsets.push(0);
    let mut end = 0usize;
    for _ in 0..rows {
        end += cursor.varint()? as usize;
        if end > links {
            return Err(cursor.invalid(format_args!("rows of {links} links in all"), end));
        }
        row_offsets.push(end as u32);
    }
    if end != links {
        return Err(cursor.invalid(format_args!("rows of {links} links in all"), end));
    }
    let mut columns = cursor.vec(links, 1)?;
    columns.resize(links, 0u32);
    let out_of_range = |cursor: &Cursor<'_>, column: u64| {
        cursor.invalid(format_args!("a column below {columns_end}"), column)
    };
    let mut previous = 0u32;
    for pair in row_offsets.windows(2) {
        if pair[0] < pair[1] {
            previous = previous.wrapping_add(unzigzag(cursor.varint()?));
            if previous >= columns_end {
                return Err(out_of_range(cursor, previous.into()));
            }
            columns[pair[0] as usize] = previous;
        }
    }
    for pair in row_offsets.windows(2) {
        for link in pair[0] as usize + 1..pair[1] as usize {
            let column = u64::from(columns[link - 1]) + u64::from(cursor.varint()?) + 1;
            if column >= u64::from(columns_end) {
                return Err(out_of_range(cursor, column));
            }
            columns[link] = column as u32;
        }
    }
    Ok((row_offsets, columns))
}
