//! The lights that cuts cluster, in the order of the tree's leaves (SPEC 6.12).

use crate::asset::{LightSamples, LightTree};
use crate::codec::bytes::{Cursor, put_varint, unzigzag, zigzag};
use crate::codec::cut::MAX_HEIGHT;
use crate::codec::record::{self, Zeros};
use crate::error::Result;
use crate::section::points::{
    decode_normals, decode_positions, encode_normals, encode_positions, quantised_normals,
    quantised_positions,
};

/// Fewest lights: a tree of less has nothing to cluster. SPEC 6.12.
const MIN_HEIGHT: u8 = 8;

/// Whether a tree may have so many lights: a power of two, 2⁸ to 2²⁰.
pub(crate) fn is_tree_size(lights: usize) -> bool {
    lights.is_power_of_two() && (MIN_HEIGHT..=MAX_HEIGHT).contains(&(lights.ilog2() as u8))
}

const ENVIRONMENT: u8 = 0;
const SURFACE: u8 = 1;

pub fn encode(tree: &LightTree, out: &mut Vec<u8>) {
    let height = tree.lights.len().max(1).ilog2() as u8;
    match &tree.lights {
        LightSamples::Environment { order } => {
            record::put((ENVIRONMENT, height, Zeros::<2>), out);
            let mut previous = 0u32;
            for &index in order {
                put_varint(out, zigzag(index.wrapping_sub(previous)));
                previous = index;
            }
        }
        LightSamples::Surface {
            area,
            positions,
            normals,
        } => {
            record::put((SURFACE, height, Zeros::<2>, area), out);
            encode_positions(area.sqrt(), positions, out);
            encode_normals(normals, out);
        }
    }
}

pub fn decode(cursor: &mut Cursor<'_>) -> Result<LightTree> {
    let (kind, height, _): (u8, u8, Zeros<2>) = record::fixed(cursor)?;
    if !(MIN_HEIGHT..=MAX_HEIGHT).contains(&height) {
        let expected = format_args!("a tree of height {MIN_HEIGHT} to {MAX_HEIGHT}");
        return Err(cursor.invalid(expected, height));
    }
    let count = 1usize << height;
    let lights = match kind {
        ENVIRONMENT => LightSamples::Environment {
            order: decode_order(cursor, count)?,
        },
        SURFACE => LightSamples::Surface {
            area: record::fixed(cursor)?,
            positions: decode_positions(cursor, count)?,
            normals: decode_normals(cursor, count)?,
        },
        _ => return Err(cursor.invalid("lights of kind 0 or 1", kind)),
    };
    Ok(LightTree { lights })
}

/// Lattice indices below `count`; that none is there twice is for `validate` to see.
fn decode_order(cursor: &mut Cursor<'_>, count: usize) -> Result<Vec<u32>> {
    let mut order = cursor.vec(count, 1)?;
    let mut index = 0u32;
    for _ in 0..count {
        index = index.wrapping_add(unzigzag(cursor.varint()?));
        if index as usize >= count {
            return Err(cursor.invalid(format_args!("a lattice index below {count}"), index));
        }
        order.push(index);
    }
    Ok(order)
}

/// The tree that a reader of the file will see in place of `tree`: directions are exact, positions of surface lights
/// within √area/256, their normals within 1.1e-3 rad.
pub fn quantised_light_tree(tree: &LightTree) -> LightTree {
    let lights = match &tree.lights {
        LightSamples::Surface {
            area,
            positions,
            normals,
        } => LightSamples::Surface {
            area: *area,
            positions: quantised_positions(area.sqrt(), positions),
            normals: quantised_normals(normals),
        },
        directions => directions.clone(),
    };
    LightTree { lights }
}
