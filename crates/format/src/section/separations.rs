//! Points that surfaces separate from each other (SPEC 6.14).

use crate::asset::Separations;
use crate::codec::bytes::{Cursor, Planes, put_planes, width_of};
use crate::codec::record;
use crate::error::Result;

/// Fewest raw bytes of a pair.
const MIN_PAIR_BYTES: usize = 2;

pub fn encode(separations: &Separations, out: &mut Vec<u8>) {
    let column = |i: usize| separations.pairs.iter().map(|pair| pair[i]).collect::<Vec<u32>>();
    let (pairs, near) = (separations.pairs.len(), separations.near.len());
    record::put((pairs as u32, near as u32), out);
    for numbers in [steps(&column(0)), column(1), steps(&separations.near)] {
        let width = width_of(numbers.iter().copied().max().unwrap_or(0));
        out.push(width as u8);
        put_planes(out, width, &numbers);
    }
}

pub fn decode(cursor: &mut Cursor<'_>) -> Result<Separations> {
    let (pairs, near): (u32, u32) = record::fixed(cursor)?;
    let (pairs, near) = (pairs as usize, near as usize);
    let mut separations = Separations {
        pairs: cursor.vec(pairs, MIN_PAIR_BYTES)?,
        near: Vec::new(),
    };
    let mut point = 0u32;
    let width = cursor.plane_width()?;
    let points = Planes::take(cursor, width, pairs)?;
    let width = cursor.plane_width()?;
    let parents = Planes::take(cursor, width, pairs)?;
    separations
        .pairs
        .extend(points.values().zip(parents.values()).map(|(step, parent)| {
            point = point.wrapping_add(step);
            [point, parent]
        }));
    let width = cursor.plane_width()?;
    separations.near = cursor.vec(near, 1)?;
    let mut last = 0u32;
    separations
        .near
        .extend(Planes::take(cursor, width, near)?.values().map(|step| {
            last = last.wrapping_add(step);
            last
        }));
    Ok(separations)
}

/// Differences of ascending numbers, the first from 0.
fn steps(numbers: &[u32]) -> Vec<u32> {
    let mut last = 0;
    let step = |&number: &u32| number.wrapping_sub(std::mem::replace(&mut last, number));
    numbers.iter().map(step).collect()
}
