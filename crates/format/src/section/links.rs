//! Links of T and S: rows, columns, vectors (SPEC 6.7).

use crate::asset::Links;
use crate::codec::bytes::Cursor;
use crate::codec::vector::{self, Code, quantised_vector};
use crate::error::Result;
use crate::section::rows;

pub fn encode(links: &Links, out: &mut Vec<u8>) {
    let count = links.columns.len();
    out.reserve(12 + links.row_offsets.len() + 8 * count);
    for number in [links.receivers, links.senders, count as u32] {
        out.extend_from_slice(&number.to_le_bytes());
    }
    rows::encode(&links.row_offsets, &links.columns, out);
    // Six planes: exponents; the high bits and signs of x and y together, those of z; three of low bytes.
    let start = out.len();
    out.resize(start + 6 * count, 0);
    let (exponents, rest) = out[start..].split_at_mut(count);
    let (high_xy, rest) = rest.split_at_mut(count);
    let (high_z, rest) = rest.split_at_mut(count);
    let (low_x, rest) = rest.split_at_mut(count);
    let (low_y, low_z) = rest.split_at_mut(count);
    for (i, &v) in links.vectors.iter().enumerate() {
        let Code {
            exponent,
            mantissas: [x, y, z],
            negative,
        } = vector::encode(v);
        let high = |m: u16, negative: bool| (m >> 8) as u8 | u8::from(negative) << 2;
        exponents[i] = exponent;
        high_xy[i] = high(x, negative[0]) | high(y, negative[1]) << 3;
        high_z[i] = high(z, negative[2]);
        low_x[i] = x as u8;
        low_y[i] = y as u8;
        low_z[i] = z as u8;
    }
}

pub fn decode(cursor: &mut Cursor<'_>) -> Result<Links> {
    let receivers = cursor.u32()?;
    let senders = cursor.u32()?;
    let count = cursor.u32()? as usize;
    let (row_offsets, columns) = rows::decode(cursor, receivers as usize, count, senders)?;
    let mut vectors = cursor.vec(count, 6)?;
    let mut planes = [&[][..]; 6];
    for plane in &mut planes {
        *plane = cursor.take(count)?;
    }
    let [exponents, high_xy, high_z, low_x, low_y, low_z] = planes;
    for i in 0..count {
        if exponents[i] == 255 || high_xy[i] > 63 || high_z[i] > 7 {
            let found = [exponents[i], high_xy[i], high_z[i]];
            return Err(cursor.invalid(
                format_args!("a finite vector at link {i}"),
                format_args!("{found:?}"),
            ));
        }
        let component = |high: u8, low: u8| (u16::from(high & 3) << 8 | u16::from(low), high & 4 != 0);
        let (x, negative_x) = component(high_xy[i] & 7, low_x[i]);
        let (y, negative_y) = component(high_xy[i] >> 3, low_y[i]);
        let (z, negative_z) = component(high_z[i], low_z[i]);
        vectors.push(vector::decode(Code {
            exponent: exponents[i],
            mantissas: [x, y, z],
            negative: [negative_x, negative_y, negative_z],
        }));
    }
    Ok(Links {
        receivers,
        senders,
        row_offsets,
        columns,
        vectors,
    })
}

/// The links that a reader of the file will see in place of `links`: the same rows and columns, each vector through
/// [`quantised_vector`].
pub fn quantised_links(links: &Links) -> Links {
    Links {
        vectors: links.vectors.iter().map(|&v| quantised_vector(v)).collect(),
        ..links.clone()
    }
}
