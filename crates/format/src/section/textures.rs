//! Encoded images with their samplers (SPEC 6.4). The images' bytes are the source's own.

use crate::asset::{Filter, Texture, Wrap};
use crate::codec::bytes::Cursor;
use crate::error::Result;

const WRAPS: [Wrap; 3] = [Wrap::Repeat, Wrap::MirroredRepeat, Wrap::ClampToEdge];
const FILTERS: [Filter; 2] = [Filter::Linear, Filter::Nearest];

/// Bytes of a texture's fixed fields.
const FIXED_BYTES: usize = 16;

pub fn encode(textures: &[Texture], out: &mut Vec<u8>) {
    out.extend_from_slice(&(textures.len() as u32).to_le_bytes());
    for texture in textures {
        // Discriminants count from 0 in the order of WRAPS and FILTERS.
        out.extend_from_slice(&[
            texture.wrap_u as u8,
            texture.wrap_v as u8,
            texture.filter as u8,
            0,
        ]);
        out.extend_from_slice(&(texture.mime.len() as u32).to_le_bytes());
        out.extend_from_slice(&(texture.bytes.len() as u64).to_le_bytes());
        out.extend_from_slice(texture.mime.as_bytes());
        out.extend_from_slice(&texture.bytes);
    }
}

pub fn decode(cursor: &mut Cursor<'_>) -> Result<Vec<Texture>> {
    let count = cursor.u32()? as usize;
    let mut textures = cursor.vec(count, FIXED_BYTES)?;
    for _ in 0..count {
        let wrap = |cursor: &mut Cursor<'_>| {
            let code = cursor.u8()?;
            WRAPS
                .get(usize::from(code))
                .copied()
                .ok_or_else(|| cursor.invalid("a wrap mode of 0 to 2", code))
        };
        let wrap_u = wrap(cursor)?;
        let wrap_v = wrap(cursor)?;
        let code = cursor.u8()?;
        let filter = FILTERS
            .get(usize::from(code))
            .copied()
            .ok_or_else(|| cursor.invalid("a filter of 0 or 1", code))?;
        cursor.zero_u8()?;
        let mime_bytes = cursor.u32()? as usize;
        let image_bytes = cursor.u64()?;
        let mime = text(cursor, mime_bytes)?;
        // A length beyond the address space is also beyond the section.
        let image_bytes = usize::try_from(image_bytes).unwrap_or(usize::MAX);
        let mut bytes = cursor.vec(image_bytes, 1)?;
        bytes.extend_from_slice(cursor.take(image_bytes)?);
        textures.push(Texture {
            bytes,
            mime,
            wrap_u,
            wrap_v,
            filter,
        });
    }
    Ok(textures)
}

/// UTF-8 text of a known length.
pub fn text(cursor: &mut Cursor<'_>, length: usize) -> Result<String> {
    let mut bytes = cursor.vec(length, 1)?;
    bytes.extend_from_slice(cursor.take(length)?);
    String::from_utf8(bytes).map_err(|error| cursor.invalid("UTF-8 text", error))
}
