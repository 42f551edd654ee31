//! Elements of cuts as one byte each: how far the node lies below the largest that could start at its leaf, and the
//! commonest values (SPEC 7.10).
//!
//! A cut leaves a node unsplit when |C|·var ≤ σ², so that a mean over 2ʰ leaves stands for values that scatter by
//! σ/√2ʰ: steps of half of that, rounded to whole fractions of 1, lose little. They make 0 (nothing is seen) and 1
//! (everything) exact. A mean is off by at most 1/(2·steps), so a node's squared errors sum to at most σ²/16, and to
//! that the result's rounding to f32 adds a relative 2⁻²⁴. Encoding what was decoded changes nothing.
//!
//! Heights that were written as descents tile the leaves whatever they are, and zstd packs both about equally well
//! (docs/notebook/format.md compares layouts).

use crate::codec::bytes::{Cursor, put_varint};
use crate::error::Result;

/// Greatest height of a tree of lights: 2²⁰ leaves.
pub const MAX_HEIGHT: u8 = 20;

/// Most steps per unit, so that any σ above zero has a grid; reached below σ = 2⁻⁵ at height 20, σ = 2⁻¹⁵ at the leaves.
pub const MAX_STEPS: u32 = 1 << 16;

/// Greatest code: up to here the f32 of code/steps gives the code back.
pub const MAX_CODE: u32 = (1 << 23) - 1;

/// Descents are 0 to [`MAX_HEIGHT`]: a symbol is descent + 21 × class.
const DESCENTS: u8 = MAX_HEIGHT + 1;

/// Classes of codes: none at all, as many as steps, 1 to 9, others. Twelve times 21 symbols fit a byte.
const ZERO: u8 = 0;
const FULL: u8 = 1;
const OTHER: u8 = 11;
/// Codes below this, other than 0 and steps, have the class code + 1.
const FIRST_OTHER: u32 = 10;

/// Steps per unit of a node of 2^height leaves: max(1, ⌈2·√2^height/σ⌉), at most [`MAX_STEPS`]; 1 when σ is no number
/// above zero.
pub fn steps(height: u8, sigma: f32) -> u32 {
    let leaves = (1u64 << height.min(MAX_HEIGHT)) as f64;
    let wanted = (2.0 * leaves.sqrt() / f64::from(sigma)).ceil();
    // NaN and what is below 1 become 1.
    wanted.max(1.0).min(f64::from(MAX_STEPS)) as u32
}

/// The code of a mean: the nearest whole number of steps, at most [`MAX_CODE`]; 0 for NaN and what is below zero.
pub fn encode(value: f32, steps: u32) -> u32 {
    // The cast saturates, and makes NaN 0.
    ((f64::from(value) * f64::from(steps)).round() as u32).min(MAX_CODE)
}

/// The mean of a code.
pub fn decode(code: u32, steps: u32) -> f32 {
    (f64::from(code) / f64::from(steps)) as f32
}

/// A node and its code as a symbol; the code of class `OTHER` goes to `others`.
fn symbol(descent: u8, code: u32, steps: u32, others: &mut Vec<u8>) -> u8 {
    let class = match code {
        0 => ZERO,
        _ if code == steps => FULL,
        _ if code < FIRST_OTHER => code as u8 + 1,
        _ => {
            put_varint(others, code);
            OTHER
        }
    };
    descent + DESCENTS * class
}

/// Height of the largest node that can start at a leaf of a tree.
fn largest(start: u32, tree_height: u8) -> u8 {
    // Leaf 0 has 32 trailing zeros.
    (start.trailing_zeros() as u8).min(tree_height)
}

/// Appends a symbol for each element, then the codes of those of class `OTHER`. `heights` and `values` are those of
/// all rows, each of which tiles the leaves of a tree of `tree_height`.
pub(crate) fn put_elements(heights: &[u8], values: &[f32], tree_height: u8, sigma: f32, out: &mut Vec<u8>) {
    let steps: Vec<u32> = (0..=MAX_HEIGHT).map(|height| steps(height, sigma)).collect();
    let mut others = Vec::new();
    let mut start = 0u32;
    for (&height, &value) in heights.iter().zip(values) {
        let steps = steps[usize::from(height)];
        let descent = largest(start, tree_height) - height;
        out.push(symbol(descent, encode(value, steps), steps, &mut others));
        start = (start + (1 << height)) & ((1 << tree_height) - 1);
    }
    out.extend_from_slice(&others);
}

/// What [`elements`] reads: row offsets, heights and values of all rows.
pub(crate) type Rows = (Vec<u32>, Vec<u8>, Vec<f32>);

/// Reads `count` elements of `rows` rows, each of which tiles the leaves of a tree of `tree_height` (at most
/// [`MAX_HEIGHT`]).
///
/// # Errors
/// A symbol is not one of 7.10, rows do not end where they should, a code is above [`MAX_CODE`], or the bytes end.
pub(crate) fn elements(
    cursor: &mut Cursor<'_>,
    rows: usize,
    count: usize,
    tree_height: u8,
    sigma: f32,
) -> Result<Rows> {
    if rows > count {
        return Err(cursor.invalid(format_args!("an element for each of {rows} sites"), count));
    }
    let mut heights = cursor.vec(count, 1)?;
    let mut values = cursor.vec(count, 1)?;
    // One more than the sites, of which each has an element.
    let mut row_offsets = cursor.vec(rows + 1, 0)?;
    row_offsets.push(0);
    let steps: Vec<u32> = (0..=MAX_HEIGHT).map(|height| steps(height, sigma)).collect();
    // Means of the symbols, so that only others need a division.
    let known: Vec<_> = steps.iter().map(|&steps| known_means(steps)).collect();
    let mut start = 0u32;
    for (i, &symbol) in cursor.take(count)?.iter().enumerate() {
        let (class, descent) = (symbol / DESCENTS, symbol % DESCENTS);
        let most = largest(start, tree_height);
        if class > OTHER || descent > most {
            let expected = format_args!("a symbol of a node of at most 2^{most} leaves in element {i}");
            return Err(cursor.invalid(expected, symbol));
        }
        let height = most - descent;
        values.push(match class {
            OTHER => other(cursor, steps[usize::from(height)])?,
            class => known[usize::from(height)][usize::from(class)],
        });
        heights.push(height);
        start += 1 << height;
        if start == 1 << tree_height {
            start = 0;
            if row_offsets.len() > rows {
                return Err(cursor.invalid(format_args!("elements of {rows} sites"), "more of them"));
            }
            row_offsets.push(heights.len() as u32);
        }
    }
    if row_offsets.len() != rows + 1 || start != 0 {
        let found = format_args!("{} and {start} leaves", row_offsets.len() - 1);
        return Err(cursor.invalid(format_args!("elements of {rows} whole sites"), found));
    }
    Ok((row_offsets, heights, values))
}

/// The means of the classes below `OTHER`.
fn known_means(steps: u32) -> [f32; OTHER as usize] {
    let mut means = [0.0; OTHER as usize];
    means[usize::from(FULL)] = 1.0;
    for code in 1..FIRST_OTHER {
        means[code as usize + 1] = decode(code, steps);
    }
    means
}

fn other(cursor: &mut Cursor<'_>, steps: u32) -> Result<f32> {
    match cursor.varint()? {
        code @ 0..=MAX_CODE => Ok(decode(code, steps)),
        code => Err(cursor.invalid(format_args!("a code of at most {MAX_CODE}"), code)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn means_stay_within_half_a_step(value in 0.0f32..100.0, height in 0u8..=20, log_sigma in -14.0f32..5.0) {
            let steps = steps(height, log_sigma.exp());
            let stored = decode(encode(value, steps), steps);
            let error = (f64::from(value) - f64::from(stored)).abs();
            prop_assert!(error <= 0.5 / f64::from(steps) + f64::from(value) / f64::from(1 << 24) || encode(value, steps) == MAX_CODE);
            prop_assert_eq!(encode(stored, steps), encode(value, steps), "encoding what was decoded changes nothing");
        }

        #[test]
        fn every_code_survives(code in 0..=MAX_CODE, steps in 1..=MAX_STEPS) {
            prop_assert_eq!(encode(decode(code, steps), steps), code);
        }

        #[test]
        fn any_bytes_give_rows_that_tile_or_an_error(
            bytes in prop::collection::vec(any::<u8>(), 0..400), rows in 0usize..20, count in 0usize..300, height in 0u8..=20,
        ) {
            let mut memory = 1 << 20;
            let mut cursor = Cursor::new("test", &bytes, &mut memory);
            if let Ok((row_offsets, heights, values)) = elements(&mut cursor, rows, count, height, 1.0) {
                prop_assert_eq!((row_offsets.len(), heights.len(), values.len()), (rows + 1, count, count));
                for row in row_offsets.windows(2) {
                    let leaves: u32 = heights[row[0] as usize..row[1] as usize].iter().map(|h| 1 << h).sum();
                    prop_assert_eq!(leaves, 1 << height);
                }
            }
        }
    }

    #[test]
    fn steps_follow_the_threshold_and_have_an_end() {
        let at = |sigma: f32| [0, 1, 2, 3, 4, 15].map(|height| steps(height, sigma));
        assert_eq!(at(2.0), [1, 2, 2, 3, 4, 182]);
        assert_eq!(at(1.0), [2, 3, 4, 6, 8, 363]);
        assert_eq!(at(1e30), [1; 6]);
        assert_eq!(at(f32::from_bits(1)), [MAX_STEPS; 6]);
        assert_eq!(at(f32::NAN), [1; 6]);
        assert_eq!(at(-1.0), [1; 6]);
    }

    #[test]
    fn nothing_and_everything_are_exact() {
        for steps in [1, 2, 3, 182, MAX_STEPS] {
            assert_eq!([0.0, 1.0].map(|v| decode(encode(v, steps), steps)), [0.0, 1.0]);
        }
        assert_eq!(
            [f32::NAN, -1.0, f32::INFINITY].map(|v| encode(v, 7)),
            [0, 0, MAX_CODE]
        );
    }

    /// Two rows over four leaves: a whole tree unseen; a leaf seen, one not, and a pair of which half is seen.
    #[test]
    fn a_node_costs_a_byte() {
        let mut bytes = Vec::new();
        put_elements(&[2, 0, 0, 1], &[0.0, 1.0, 0.0, 0.5], 2, 2.0, &mut bytes);
        assert_eq!(bytes, [0, 2 + 21, 0, 2 * 21]);
        let mut memory = 1000;
        let mut cursor = Cursor::new("test", &bytes, &mut memory);
        let (row_offsets, heights, values) = elements(&mut cursor, 2, 4, 2, 2.0).unwrap();
        assert_eq!((row_offsets, heights), (vec![0, 1, 4], vec![2, 0, 0, 1]));
        assert_eq!(values, [0.0, 1.0, 0.0, 0.5]);
        cursor.finish().unwrap();
    }

    #[test]
    fn rows_that_do_not_tile_are_refused() {
        // Too deep; no class; a row too few, too many and half a row; no code; a code too great.
        let cases: [(&[u8], usize, usize); 7] = [
            (&[3], 1, 1),
            (&[252], 1, 1),
            (&[0, 0], 1, 2),
            (&[0, 0], 3, 2),
            (&[0, 1], 2, 2),
            (&[11 * 21], 1, 1),
            (&[11 * 21, 0xff, 0xff, 0xff, 0xff, 7], 1, 1),
        ];
        for (bytes, rows, count) in cases {
            let mut memory = 1000;
            let mut cursor = Cursor::new("test", bytes, &mut memory);
            assert!(elements(&mut cursor, rows, count, 2, 2.0).is_err(), "{bytes:?}");
        }
    }
}
