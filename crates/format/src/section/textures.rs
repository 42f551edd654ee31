//! Encoded images with their samplers (SPEC 6.4). The images' bytes are the source's own.

use bincode::de::Decoder;
use bincode::enc::Encoder;
use bincode::error::{DecodeError, EncodeError};
use bincode::{Decode, Encode};

use crate::asset::{Filter, Texture, Wrap};
use crate::codec::bytes::Cursor;
use crate::codec::record::{self, Zeros};
use crate::error::Result;

/// A value of few as a byte, its place among all: where bincode would derive four bytes.
macro_rules! as_byte {
    ($type:ty, $what:literal, $all:expr) => {
        impl Encode for $type {
            fn encode<E: Encoder>(&self, encoder: &mut E) -> std::result::Result<(), EncodeError> {
                // Discriminants count from 0 in the order of `all`.
                (*self as u8).encode(encoder)
            }
        }

        impl<C> Decode<C> for $type {
            fn decode<D: Decoder<Context = C>>(decoder: &mut D) -> std::result::Result<Self, DecodeError> {
                record::one_of(decoder, $what, &$all)
            }
        }

        bincode::impl_borrow_decode!($type);
    };
}

as_byte!(
    Wrap,
    "a wrap mode",
    [Wrap::Repeat, Wrap::MirroredRepeat, Wrap::ClampToEdge]
);
as_byte!(Filter, "a filter", [Filter::Linear, Filter::Nearest]);

/// A texture's fixed fields.
#[derive(Encode, Decode)]
struct TextureHead {
    wrap_u: Wrap,
    wrap_v: Wrap,
    filter: Filter,
    zeros: Zeros<1>,
    mime_bytes: u32,
    image_bytes: u64,
}

/// Bytes of a texture's fixed fields.
const FIXED_BYTES: usize = 16;

pub fn encode(textures: &[Texture], out: &mut Vec<u8>) {
    record::put(textures.len() as u32, out);
    for texture in textures {
        let head = TextureHead {
            wrap_u: texture.wrap_u,
            wrap_v: texture.wrap_v,
            filter: texture.filter,
            zeros: Zeros,
            mime_bytes: texture.mime.len() as u32,
            image_bytes: texture.bytes.len() as u64,
        };
        record::put(head, out);
        out.extend_from_slice(texture.mime.as_bytes());
        out.extend_from_slice(&texture.bytes);
    }
}

pub fn decode(cursor: &mut Cursor<'_>) -> Result<Vec<Texture>> {
    let count = record::fixed::<u32>(cursor)? as usize;
    let mut textures = cursor.vec(count, FIXED_BYTES)?;
    for _ in 0..count {
        let head: TextureHead = record::fixed(cursor)?;
        let mime = text(cursor, head.mime_bytes as usize)?;
        // A length beyond the address space is also beyond the section.
        let image_bytes = usize::try_from(head.image_bytes).unwrap_or(usize::MAX);
        let mut bytes = cursor.vec(image_bytes, 1)?;
        bytes.extend_from_slice(cursor.take(image_bytes)?);
        textures.push(Texture {
            bytes,
            mime,
            wrap_u: head.wrap_u,
            wrap_v: head.wrap_v,
            filter: head.filter,
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
