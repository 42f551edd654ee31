//! Sections of small records (SPEC 6.1, 6.3, 6.10): provenance, materials, estimates.

use bincode::{Decode, Encode};

use crate::codec::bytes::Cursor;
use crate::codec::record;
use crate::error::{Location, Result, limit};
use crate::layout::{Kind, MAX_RECORD_BYTES};

/// Appends the records' bytes.
///
/// # Errors
/// `LimitExceeded` when they take more than [`MAX_RECORD_BYTES`].
pub fn encode(kind: Kind, records: &impl Encode, out: &mut Vec<u8>) -> Result<()> {
    let start = out.len();
    record::put(records, out);
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
pub fn decode<T: Decode<()>>(cursor: &mut Cursor<'_>) -> Result<T> {
    record::lists(cursor)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::{AlphaMode, LeftOut, Material, Provenance, TextureRef};
    use proptest::prelude::*;

    fn read<T: Decode<()>>(bytes: &[u8]) -> Result<T> {
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
    fn a_materials_bytes_are_those_of_the_specification() {
        let material = Material {
            name: "Ä".into(),
            unlit: true,
            emissive_texture: Some(TextureRef {
                texture: 7,
                uv_set: 1,
                transform: TextureRef::IDENTITY,
            }),
            ..Material::default()
        };
        let mut bytes = Vec::new();
        record::put(&material, &mut bytes);
        let (one, zero) = ([0, 0, 0x80, 0x3f], [0; 4]);
        let mut expected = vec![2, 0, 0, 0, 0, 0, 0, 0, 0xc3, 0x84];
        // Base colour, metallic, roughness; emission; opaque.
        expected.extend([[one; 6].concat(), [zero; 3].concat(), vec![0; 4]].concat());
        // Double-sided, unlit; scale of normals; three textures that are not there.
        expected.extend([&[0, 1][..], &one, &[0, 0, 0]].concat());
        expected.extend(
            [
                &[1, 7, 0, 0, 0, 1][..],
                &[one, zero, zero, zero, one, zero].concat(),
            ]
            .concat(),
        );
        assert_eq!(bytes, expected);
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
