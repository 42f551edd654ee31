//! Links of T: rows, columns, vectors (SPEC 6.7). In layout version 2 mantissas have 8 bits, so that there is no plane of
//! their high bits.

use crate::asset::{Coding, Links};
use crate::codec::bytes::Cursor;
use crate::codec::record;
use crate::codec::vector::{self, Code, Mantissa};
use crate::error::Result;
use crate::section::rows;

/// `short`: mantissas of 8 bits instead of 10.
pub fn encode(links: &Links, short: bool, out: &mut Vec<u8>) {
    let count = links.columns.len();
    out.reserve(12 + links.row_offsets.len() + 8 * count);
    record::put((links.receivers, links.senders, count as u32), out);
    rows::encode(&links.row_offsets, &links.columns, out);
    // Planes: exponents, signs, high bits of the mantissas if they have any, and their low bytes for x, y and z. Signs and
    // high bits of the three components are modelled together: they know of each other.
    let high_count = if short { 0 } else { count };
    let start = out.len();
    out.resize(start + 5 * count + high_count, 0);
    let (exponents, rest) = out[start..].split_at_mut(count);
    let (signs, rest) = rest.split_at_mut(count);
    let (highs, rest) = rest.split_at_mut(high_count);
    let (low_x, rest) = rest.split_at_mut(count);
    let (low_y, low_z) = rest.split_at_mut(count);
    for (i, &v) in links.vectors.iter().enumerate() {
        let Code {
            exponent,
            mantissas: [x, y, z],
            negative,
        } = vector::encode(v, Mantissa::new(short));
        exponents[i] = exponent;
        signs[i] = (0..3).fold(0, |bits, axis| bits | u8::from(negative[axis]) << axis);
        if !short {
            highs[i] = (x >> 8 | (y >> 8) << 2 | (z >> 8) << 4) as u8;
        }
        low_x[i] = x as u8;
        low_y[i] = y as u8;
        low_z[i] = z as u8;
    }
}

/// Inverse of [`encode`].
pub fn decode(cursor: &mut Cursor<'_>, short: bool) -> Result<Links> {
    let (receivers, senders, count): (u32, u32, u32) = record::fixed(cursor)?;
    let count = count as usize;
    let (row_offsets, columns) = rows::decode(cursor, receivers as usize, count, senders)?;
    let mut vectors = cursor.vec(count, 5)?;
    let mut plane = |stored: bool| cursor.take(if stored { count } else { 0 });
    let (exponents, signs, highs) = (plane(true)?, plane(true)?, plane(!short)?);
    let [low_x, low_y, low_z] = [plane(true)?, plane(true)?, plane(true)?];
    let high = |i: usize| highs.get(i).copied().unwrap_or(0);
    for i in 0..count {
        if exponents[i] == 255 || signs[i] > 7 || high(i) > 63 {
            let found = [exponents[i], signs[i], high(i)];
            return Err(cursor.invalid(
                format_args!("a finite vector at link {i}"),
                format_args!("{found:?}"),
            ));
        }
        let mantissa = |axis: u32, low: u8| u16::from(high(i) >> (2 * axis) & 3) << 8 | u16::from(low);
        let code = Code {
            exponent: exponents[i],
            mantissas: [
                mantissa(0, low_x[i]),
                mantissa(1, low_y[i]),
                mantissa(2, low_z[i]),
            ],
            negative: [0, 1, 2].map(|axis| signs[i] >> axis & 1 != 0),
        };
        vectors.push(vector::decode(code, Mantissa::new(short)));
    }
    Ok(Links {
        receivers,
        senders,
        row_offsets,
        columns,
        vectors,
    })
}

/// The vector that a reader of the file will see in place of `vector`: relative error ≤ 2⁻⁹, or 2⁻⁷ where links are short
/// ([`Coding::short_links`]). Quantising once more changes nothing.
pub fn quantised_vector(vector: [f32; 3], coding: Coding) -> [f32; 3] {
    vector::quantised(vector, Mantissa::new(coding.short_links))
}

/// The links that a reader of the file will see in place of `links`: the same rows and columns, each vector through
/// [`quantised_vector`].
pub fn quantised_links(links: &Links, coding: Coding) -> Links {
    let vectors = links.vectors.iter().map(|&v| quantised_vector(v, coding));
    Links {
        receivers: links.receivers,
        senders: links.senders,
        row_offsets: links.row_offsets.clone(),
        columns: links.columns.clone(),
        vectors: vectors.collect(),
    }
}
