//! Cluster numbers of points in a spatially coherent order: how long ago the number was last seen (SPEC 7.8).
//!
//! Move-to-front coding (Bentley et al., "A locally adaptive data compression scheme", CACM 1986): a point mostly
//! shares the cluster of the one before it or of one shortly before, so that most codes are 0 to 3 and zstd's
//! entropy coder gives them a few bits. Lossless. docs/notebook/format.md compares it with differences.

use crate::codec::bytes::{Cursor, put_varint, unzigzag, zigzag};
use crate::error::Result;

/// Most numbers that are remembered: codes below this are places among them.
const REMEMBERED: usize = 255;
/// The number is not among them and follows in a list of its own.
const NEW: u8 = 255;

/// Moves the number at `place` to the front.
fn to_front(recent: &mut [u32], place: usize) {
    recent[..=place].rotate_right(1);
}

/// Puts a number in front and forgets the oldest.
fn remember(recent: &mut Vec<u32>, value: u32) {
    if recent.len() == REMEMBERED {
        recent.pop();
    }
    recent.insert(0, value);
}

/// Appends a code for each value, then the new values as zigzag differences from the new value before.
pub fn encode(values: &[u32], out: &mut Vec<u8>) {
    let mut recent = Vec::with_capacity(REMEMBERED);
    let mut fresh = Vec::new();
    let mut previous = 0u32;
    for &value in values {
        if let Some(place) = recent.iter().position(|&r| r == value) {
            out.push(place as u8);
            to_front(&mut recent, place);
        } else {
            out.push(NEW);
            put_varint(&mut fresh, zigzag(value.wrapping_sub(previous)));
            previous = value;
            remember(&mut recent, value);
        }
    }
    out.extend_from_slice(&fresh);
}

/// `count` values below `end`.
///
/// # Errors
/// A code stands for no remembered number, a number is out of range, or the bytes end.
pub fn decode(cursor: &mut Cursor<'_>, count: usize, end: u32) -> Result<Vec<u32>> {
    let mut values = cursor.vec(count, 1)?;
    let mut recent = Vec::with_capacity(REMEMBERED);
    let mut previous = 0u32;
    for &code in cursor.take(count)? {
        if code == NEW {
            previous = previous.wrapping_add(unzigzag(cursor.varint()?));
            if previous >= end {
                return Err(cursor.invalid(format_args!("a cluster below {end}"), previous));
            }
            remember(&mut recent, previous);
        } else {
            let place = usize::from(code);
            if place >= recent.len() {
                let expected = format_args!("one of {} clusters seen before", recent.len());
                return Err(cursor.invalid(expected, code));
            }
            to_front(&mut recent, place);
        }
        values.push(recent[0]);
    }
    Ok(values)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn numbers_come_back(values in prop::collection::vec(0u32..700, 0..2000)) {
            let mut bytes = Vec::new();
            encode(&values, &mut bytes);
            let mut memory = 1 << 20;
            let mut cursor = Cursor::new("test", &bytes, &mut memory);
            prop_assert_eq!(decode(&mut cursor, values.len(), 700).unwrap(), values);
            cursor.finish().unwrap();
        }
    }

    #[test]
    fn a_run_costs_a_zero_per_point() {
        let mut bytes = Vec::new();
        encode(&[5, 5, 5, 6, 5, 6], &mut bytes);
        assert_eq!(bytes, [NEW, 0, 0, NEW, 1, 1, 10, 2]);
    }

    #[test]
    fn numbers_never_seen_or_out_of_range_are_refused() {
        for bytes in [&[0u8][..], &[NEW, 1, 10], &[NEW, 10], &[NEW]] {
            let mut memory = 1 << 20;
            let mut cursor = Cursor::new("test", bytes, &mut memory);
            let count = bytes.iter().take_while(|&&b| b != 10).count();
            assert!(decode(&mut cursor, count, 5).is_err(), "{bytes:?}");
        }
    }
}
