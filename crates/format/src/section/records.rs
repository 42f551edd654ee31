//! Sections of small records (SPEC 6.1, 6.3, 6.10, 7.9): fields in order, lists and strings behind their lengths.

use crate::asset::{AlphaMode, Estimates, LeftOut, Material, Provenance, TextureRef};
use crate::codec::bytes::Cursor;
use crate::error::{Location, Result, limit};
use crate::layout::{Kind, MAX_RECORD_BYTES};
use crate::section::textures::text;

/// One record, or a part of one.
pub trait Record: Sized {
    /// Fewest bytes that one takes: counts are checked against it before anything is allocated.
    const LEAST_BYTES: usize;

    /// Appends the record's bytes.
    fn put(&self, out: &mut Vec<u8>);

    /// Reads one.
    ///
    /// # Errors
    /// The bytes are no such record, or memory does not suffice.
    fn take(cursor: &mut Cursor<'_>) -> Result<Self>;
}

/// Appends the records' bytes.
///
/// # Errors
/// `LimitExceeded` when they take more than [`MAX_RECORD_BYTES`].
pub fn encode<T: Record>(kind: Kind, records: &T, out: &mut Vec<u8>) -> Result<()> {
    let start = out.len();
    records.put(out);
    let bytes = out.len() - start;
    if bytes > MAX_RECORD_BYTES {
        let expected = format_args!("at most {MAX_RECORD_BYTES} bytes");
        return Err(limit(kind.name(), Location::Raw(0), expected, bytes));
    }
    Ok(())
}

/// Reads records that take all remaining bytes.
///
/// # Errors
/// `Invalid` when the bytes are no such records; `LimitExceeded` when memory does not suffice.
pub fn decode<T: Record>(cursor: &mut Cursor<'_>) -> Result<T> {
    if cursor.remaining() > MAX_RECORD_BYTES {
        let found = cursor.remaining();
        return Err(cursor.invalid(format_args!("at most {MAX_RECORD_BYTES} bytes of records"), found));
    }
    T::take(cursor)
}

/// A number in little-endian bytes.
macro_rules! number {
    ($type:ty, $bytes:literal, $read:expr) => {
        impl Record for $type {
            const LEAST_BYTES: usize = $bytes;

            fn put(&self, out: &mut Vec<u8>) {
                out.extend_from_slice(&self.to_le_bytes());
            }

            fn take(cursor: &mut Cursor<'_>) -> Result<Self> {
                $read(cursor)
            }
        }
    };
}

number!(u8, 1, Cursor::u8);
number!(u32, 4, Cursor::u32);
number!(u64, 8, Cursor::u64);
number!(f32, 4, Cursor::f32);
number!(f64, 8, |cursor: &mut Cursor<'_>| cursor.u64().map(f64::from_bits));

impl Record for bool {
    const LEAST_BYTES: usize = 1;

    fn put(&self, out: &mut Vec<u8>) {
        out.push((*self).into());
    }

    fn take(cursor: &mut Cursor<'_>) -> Result<Self> {
        match cursor.u8()? {
            0 => Ok(false),
            1 => Ok(true),
            found => Err(cursor.invalid("a bool of 0 or 1", found)),
        }
    }
}

/// A length beyond the address space is also beyond the section.
fn length(cursor: &mut Cursor<'_>) -> Result<usize> {
    Ok(usize::try_from(cursor.u64()?).unwrap_or(usize::MAX))
}

impl Record for String {
    const LEAST_BYTES: usize = 8;

    fn put(&self, out: &mut Vec<u8>) {
        (self.len() as u64).put(out);
        out.extend_from_slice(self.as_bytes());
    }

    fn take(cursor: &mut Cursor<'_>) -> Result<Self> {
        let length = length(cursor)?;
        text(cursor, length)
    }
}

impl<T: Record> Record for Vec<T> {
    const LEAST_BYTES: usize = 8;

    fn put(&self, out: &mut Vec<u8>) {
        (self.len() as u64).put(out);
        self.iter().for_each(|item| item.put(out));
    }

    fn take(cursor: &mut Cursor<'_>) -> Result<Self> {
        let count = length(cursor)?;
        let mut items = cursor.vec(count, T::LEAST_BYTES)?;
        for _ in 0..count {
            items.push(T::take(cursor)?);
        }
        Ok(items)
    }
}

impl<T: Record> Record for Option<T> {
    const LEAST_BYTES: usize = 1;

    fn put(&self, out: &mut Vec<u8>) {
        self.is_some().put(out);
        self.iter().for_each(|item| item.put(out));
    }

    fn take(cursor: &mut Cursor<'_>) -> Result<Self> {
        Ok(if bool::take(cursor)? {
            Some(T::take(cursor)?)
        } else {
            None
        })
    }
}

impl<A: Record, B: Record> Record for (A, B) {
    const LEAST_BYTES: usize = A::LEAST_BYTES + B::LEAST_BYTES;

    fn put(&self, out: &mut Vec<u8>) {
        self.0.put(out);
        self.1.put(out);
    }

    fn take(cursor: &mut Cursor<'_>) -> Result<Self> {
        Ok((A::take(cursor)?, B::take(cursor)?))
    }
}

impl<const N: usize> Record for [f32; N] {
    const LEAST_BYTES: usize = 4 * N;

    fn put(&self, out: &mut Vec<u8>) {
        self.iter().for_each(|number| number.put(out));
    }

    fn take(cursor: &mut Cursor<'_>) -> Result<Self> {
        let mut numbers = [0.0; N];
        for number in &mut numbers {
            *number = cursor.f32()?;
        }
        Ok(numbers)
    }
}

/// A structure of records: its fields in the order in which they are listed, which is the file's.
macro_rules! record {
    ($type:ident { $($field:ident: $kind:ty),* $(,)? }) => {
        impl Record for $type {
            const LEAST_BYTES: usize = 0 $(+ <$kind>::LEAST_BYTES)*;

            fn put(&self, out: &mut Vec<u8>) {
                $(self.$field.put(out);)*
            }

            fn take(cursor: &mut Cursor<'_>) -> Result<Self> {
                Ok($type { $($field: Record::take(cursor)?),* })
            }
        }
    };
}

record!(Provenance {
    tool_version: String,
    settings: Vec<(String, String)>,
    source_hash: u64,
    seed: u64,
    lambert: bool,
    left_out: Vec<LeftOut>,
    counts: Vec<(String, u64)>,
    notes: Vec<String>,
});

record!(LeftOut {
    what: String,
    why: String,
    saved_bytes: u64,
});

record!(Material {
    name: String,
    base_color: [f32; 4],
    metallic: f32,
    roughness: f32,
    emissive: [f32; 3],
    alpha_mode: AlphaMode,
    double_sided: bool,
    unlit: bool,
    normal_scale: f32,
    base_color_texture: Option<TextureRef>,
    metallic_roughness_texture: Option<TextureRef>,
    normal_texture: Option<TextureRef>,
    emissive_texture: Option<TextureRef>,
});

record!(TextureRef {
    texture: u32,
    uv_set: u8,
    transform: [f32; 6],
});

record!(Estimates {
    values: Vec<(String, f64)>,
});

/// Variants of [`AlphaMode`] in the file.
const OPAQUE: u32 = 0;
const MASK: u32 = 1;
const BLEND: u32 = 2;

impl Record for AlphaMode {
    const LEAST_BYTES: usize = 4;

    fn put(&self, out: &mut Vec<u8>) {
        match self {
            AlphaMode::Opaque => OPAQUE.put(out),
            AlphaMode::Mask(cutoff) => (MASK, *cutoff).put(out),
            AlphaMode::Blend => BLEND.put(out),
        }
    }

    fn take(cursor: &mut Cursor<'_>) -> Result<Self> {
        match cursor.u32()? {
            OPAQUE => Ok(AlphaMode::Opaque),
            MASK => Ok(AlphaMode::Mask(cursor.f32()?)),
            BLEND => Ok(AlphaMode::Blend),
            found => Err(cursor.invalid("an alpha mode of 0 to 2", found)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn read<T: Record>(bytes: &[u8]) -> Result<T> {
        let mut memory = 1 << 24;
        let mut cursor = Cursor::new("test", bytes, &mut memory);
        let record = decode(&mut cursor)?;
        cursor.finish()?;
        Ok(record)
    }

    proptest! {
        #[test]
        fn provenance_is_kept_to_the_letter(
            words in prop::collection::vec(".{0,9}", 8), numbers in any::<[u64; 4]>(), lambert in any::<bool>(), n in 0usize..3,
        ) {
            let word = |i: usize| words[i].clone();
            let provenance = Provenance {
                tool_version: word(0),
                settings: vec![(word(1), word(2)); n],
                source_hash: numbers[0],
                seed: numbers[1],
                lambert,
                left_out: vec![LeftOut { what: word(3), why: word(4), saved_bytes: numbers[2] }; n],
                counts: vec![(word(5), numbers[3]); n],
                notes: vec![word(6), word(7)],
            };
            let mut bytes = Vec::new();
            encode(Kind::Provenance, &provenance, &mut bytes).unwrap();
            prop_assert_eq!(read::<Provenance>(&bytes).unwrap(), provenance);
            for end in 0..bytes.len() {
                prop_assert!(read::<Provenance>(&bytes[..end]).is_err());
            }
        }

        #[test]
        fn materials_keep_their_bits(numbers in prop::array::uniform9(-1e9f32..1e9), flags in any::<[bool; 4]>()) {
            let reference = TextureRef { texture: 3, uv_set: 2, transform: [numbers[0]; 6] };
            let material = Material {
                name: "m".into(),
                base_color: [numbers[1], numbers[2], -0.0, numbers[3]],
                metallic: numbers[4],
                emissive: [numbers[5]; 3],
                alpha_mode: if flags[0] { AlphaMode::Mask(numbers[6]) } else { AlphaMode::Blend },
                double_sided: flags[1],
                normal_scale: numbers[7],
                normal_texture: flags[2].then_some(reference),
                emissive_texture: flags[3].then_some(reference),
                ..Material::default()
            };
            let mut bytes = Vec::new();
            let materials = vec![Material::default(), material];
            encode(Kind::Materials, &materials, &mut bytes).unwrap();
            prop_assert_eq!(read::<Vec<Material>>(&bytes).unwrap(), materials);
        }
    }

    #[test]
    fn counts_that_nothing_stands_behind_are_refused() {
        for bytes in [
            &[0xff; 8][..],
            &[1, 0, 0, 0, 0, 0, 0, 0, 5],
            &[0, 0, 0, 0, 0, 0, 0, 1],
        ] {
            assert!(read::<Vec<(String, u64)>>(bytes).is_err());
        }
        assert!(read::<Option<u8>>(&[2, 1]).is_err() && read::<bool>(&[2]).is_err());
    }

    #[test]
    fn records_of_too_many_bytes_are_not_written() {
        let provenance = Provenance {
            notes: vec!["x".repeat(MAX_RECORD_BYTES)],
            ..Provenance::default()
        };
        let error = encode(Kind::Provenance, &provenance, &mut Vec::new()).unwrap_err();
        assert!(
            matches!(error, crate::error::FormatError::LimitExceeded(_)),
            "{error}"
        );
    }
}
