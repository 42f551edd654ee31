//! Cuts of all sites: a byte per element, and codes that do not fit it (SPEC 6.13).

use bincode::{Decode, Encode};

use crate::asset::Cuts;
use crate::codec::bytes::Cursor;
use crate::codec::cut::{self, MAX_HEIGHT};
use crate::codec::record::{self, Zeros};
use crate::error::Result;

/// Where cuts stand: at the points of the finest level, or, in files of earlier writers, at the vertices of meshes.
const AT_POINTS: u8 = 0;
const AT_VERTICES: u8 = 1;

/// The fields between the kind of sites and the elements.
#[derive(Encode, Decode)]
struct Head {
    height: u8,
    zeros: Zeros<2>,
    sigma: f32,
    unit: f32,
    rows: u32,
    elements: u32,
}

/// Height of the tree whose leaves the first site's nodes tile.
fn tree_height(cuts: &Cuts) -> u8 {
    let end = cuts.row_offsets.get(1).map_or(0, |&end| end as usize);
    let leaves: u32 = cuts.heights[..end].iter().map(|&height| 1 << height).sum();
    leaves.max(1).ilog2() as u8
}

pub fn encode(cuts: &Cuts, out: &mut Vec<u8>) {
    let height = tree_height(cuts);
    let head = Head {
        height,
        zeros: Zeros,
        sigma: cuts.sigma,
        unit: cuts.unit,
        rows: cuts.row_offsets.len() as u32 - 1,
        elements: cuts.heights.len() as u32,
    };
    record::put((AT_POINTS, head), out);
    cut::put_elements(&cuts.heights, &cuts.values, height, cuts.sigma, out);
}

pub fn decode(cursor: &mut Cursor<'_>) -> Result<Cuts> {
    match cursor.u8()? {
        AT_POINTS => {}
        AT_VERTICES => {
            return Err(cursor.unsupported("cuts at points", "cuts at vertices, which are no longer read"));
        }
        kind => return Err(cursor.invalid("sites of kind 0", kind)),
    }
    let Head {
        height,
        sigma,
        unit,
        rows,
        elements,
        ..
    } = record::fixed(cursor)?;
    if height > MAX_HEIGHT {
        return Err(cursor.invalid(format_args!("a tree of height up to {MAX_HEIGHT}"), height));
    }
    let (rows, elements) = (rows as usize, elements as usize);
    let (row_offsets, heights, values) = cut::elements(cursor, rows, elements, height, sigma)?;
    Ok(Cuts {
        sigma,
        unit,
        row_offsets,
        heights,
        values,
    })
}

/// The cuts that a reader of the file will see in place of `cuts`: the same nodes, each value to the nearest of
/// max(1, ⌈2·√2^height/σ⌉) steps per unit (at most 2¹⁶), so off by half a step at most; 0 and 1 are exact.
pub fn quantised_cuts(cuts: &Cuts) -> Cuts {
    let quantised = |(&height, &value): (&u8, &f32)| {
        let steps = cut::steps(height, cuts.sigma);
        cut::decode(cut::encode(value, steps), steps)
    };
    Cuts {
        values: cuts.heights.iter().zip(&cuts.values).map(quantised).collect(),
        row_offsets: cuts.row_offsets.clone(),
        heights: cuts.heights.clone(),
        ..*cuts
    }
}
