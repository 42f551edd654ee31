//! Records (SPEC 7.9): what bincode's derived `Encode` and `Decode` make of a structure, with little-endian numbers of
//! fixed width. Fields follow each other, lists and texts stand behind their lengths.
//!
//! A reader gives bincode a limit (`with_limit`), against which it counts what it reads and what lists and texts claim to
//! hold, before it allocates for them. The limit is a constant of bincode's configuration, so there is one per magnitude
//! of the record's length ([`lists`]). What a caller's [`Limits`](crate::Limits) allow is counted by the cursor as
//! everywhere.

use bincode::config::{Configuration, Fixint, LittleEndian, legacy};
use bincode::de::{BorrowDecoder, Decoder, read::Reader};
use bincode::enc::Encoder;
use bincode::error::{AllowedEnumVariants, DecodeError, EncodeError};
use bincode::{BorrowDecode, Decode, Encode};

use crate::codec::bytes::Cursor;
use crate::error::{FormatError, Result};
use crate::layout::MAX_RECORD_BYTES;

/// bincode's configuration: SPEC 7.9.
const CONFIGURATION: Configuration<LittleEndian, Fixint> = legacy();

/// Most memory that a record takes per byte in the file: a material takes 224 bytes of memory and at least 58 in the file, a
/// pair of empty texts 48 and 16, extensions of a material 160 and 86.
const MEMORY_PER_BYTE: usize = 4;

/// Limit of records without lists and texts: the longest, a file's header, has 56 bytes.
const FIXED_BYTES: usize = 64;

/// Appends a record.
pub fn put(record: impl Encode, out: &mut Vec<u8>) {
    let written = bincode::encode_into_std_write(record, out, CONFIGURATION);
    // A vector takes all bytes, and no record holds what bincode can refuse: locks, cells, clocks.
    debug_assert!(written.is_ok());
}

/// Reads a record that has neither lists nor texts.
///
/// # Errors
/// `Invalid` when the bytes are no such record.
pub fn fixed<T: Decode<()>>(cursor: &mut Cursor<'_>) -> Result<T> {
    within::<T, FIXED_BYTES>(cursor)
}

/// Reads a record that takes all remaining bytes, with any lists and texts.
///
/// # Errors
/// `Invalid` when the bytes are no such record, or too many; `LimitExceeded` when memory does not suffice.
pub fn lists<T: Decode<()>>(cursor: &mut Cursor<'_>) -> Result<T> {
    let bytes = cursor.remaining();
    // As much as the bytes justify stays taken. Beside it, lists may claim up to a limit before their items show that the
    // bytes don't suffice: eight times as much at most, but no less than four kibibytes.
    macro_rules! within_limit {
        ($($most:expr),*) => {
            $(if bytes <= $most {
                const LIMIT: usize = MEMORY_PER_BYTE * $most;
                cursor.charge((MEMORY_PER_BYTE * bytes) as u64)?;
                return cursor.lend(LIMIT as u64, within::<T, LIMIT>);
            })*
        };
    }
    within_limit!(1 << 10, 1 << 13, 1 << 16, 1 << 19, 1 << 22, MAX_RECORD_BYTES);
    let expected = format_args!("at most {MAX_RECORD_BYTES} bytes of records");
    Err(cursor.invalid(expected, bytes))
}

fn within<T: Decode<()>, const LIMIT: usize>(cursor: &mut Cursor<'_>) -> Result<T> {
    let read = bincode::decode_from_reader(&mut *cursor, CONFIGURATION.with_limit::<LIMIT>());
    read.map_err(|error| refused(cursor, error))
}

/// bincode's reason, with the place where it stopped.
fn refused(cursor: &Cursor<'_>, error: DecodeError) -> FormatError {
    match error {
        DecodeError::UnexpectedEnd { additional } => {
            let left = cursor.remaining();
            cursor.invalid(format_args!("{} more bytes", left + additional), left)
        }
        DecodeError::LimitExceeded | DecodeError::OutsideUsizeRange(_) => cursor.invalid(
            "a list or text that the section can hold",
            "the length of a longer one",
        ),
        DecodeError::UnexpectedVariant {
            type_name,
            allowed: AllowedEnumVariants::Range { min, max },
            found,
        } => cursor.invalid(format_args!("{min} to {max} for {type_name}"), found),
        DecodeError::InvalidBooleanValue(found) => cursor.invalid("a bool of 0 or 1", found),
        DecodeError::Utf8 { inner } => cursor.invalid("UTF-8 text", inner),
        other => cursor.invalid("a record", other),
    }
}

impl Reader for Cursor<'_> {
    fn read(&mut self, bytes: &mut [u8]) -> std::result::Result<(), DecodeError> {
        let additional = bytes.len().saturating_sub(self.remaining());
        match self.take(bytes.len()) {
            Ok(taken) => {
                bytes.copy_from_slice(taken);
                Ok(())
            }
            Err(_) => Err(DecodeError::UnexpectedEnd { additional }),
        }
    }
}

/// Bytes that must be 0, for later versions to use.
#[derive(Debug, Clone, Copy, Default)]
pub struct Zeros<const N: usize>;

impl<const N: usize> Encode for Zeros<N> {
    fn encode<E: Encoder>(&self, encoder: &mut E) -> std::result::Result<(), EncodeError> {
        [0u8; N].encode(encoder)
    }
}

impl<C, const N: usize> Decode<C> for Zeros<N> {
    fn decode<D: Decoder<Context = C>>(decoder: &mut D) -> std::result::Result<Self, DecodeError> {
        for _ in 0..N {
            one_of(decoder, "a reserved byte", &[()])?;
        }
        Ok(Zeros)
    }
}

impl<'de, C, const N: usize> BorrowDecode<'de, C> for Zeros<N> {
    fn borrow_decode<D: BorrowDecoder<'de, Context = C>>(
        decoder: &mut D,
    ) -> std::result::Result<Self, DecodeError> {
        Decode::decode(decoder)
    }
}

/// One of some values by its index, a byte; `what` is for errors.
pub fn one_of<T: Copy, const N: usize, D: Decoder>(
    decoder: &mut D,
    what: &'static str,
    all: &[T; N],
) -> std::result::Result<T, DecodeError> {
    let code = u8::decode(decoder)?;
    let allowed = const {
        &AllowedEnumVariants::Range {
            min: 0,
            max: N as u32 - 1,
        }
    };
    all.get(usize::from(code))
        .copied()
        .ok_or(DecodeError::UnexpectedVariant {
            type_name: what,
            allowed,
            found: code.into(),
        })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::{LeftOut, Material, MaterialExtensions, MaterialGlass};

    /// What the limits rest on.
    #[test]
    fn items_of_lists_take_at_most_four_times_their_bytes() {
        fn ratio<T: Encode + Default>() -> usize {
            let mut bytes = Vec::new();
            put(T::default(), &mut bytes);
            size_of::<T>().div_ceil(bytes.len())
        }
        let ratios = [
            ratio::<Material>(),
            ratio::<MaterialExtensions>(),
            ratio::<MaterialGlass>(),
            ratio::<LeftOut>(),
            ratio::<String>(),
            ratio::<(String, String)>(),
            ratio::<(String, u64)>(),
            ratio::<(String, f64)>(),
        ];
        assert!(
            ratios.into_iter().all(|ratio| ratio <= MEMORY_PER_BYTE),
            "{ratios:?}"
        );
    }

    #[test]
    fn reasons_say_where_and_what() {
        let read = |bytes: &[u8]| {
            let mut memory = 1 << 20;
            lists::<(bool, String)>(&mut Cursor::new("test", bytes, &mut memory))
                .unwrap_err()
                .to_string()
        };
        for (bytes, reason) in [
            (
                &[2][..],
                "byte 1 of the section's raw bytes: expected a bool of 0 or 1, found 2",
            ),
            (
                &[1, 9, 0, 0],
                "byte 1 of the section's raw bytes: expected 8 more bytes, found 3",
            ),
            (
                &[1, 9, 0, 0, 0, 0, 0, 0, 0],
                "byte 9 of the section's raw bytes: expected 9 more bytes, found 0",
            ),
            (
                &[1, 1, 0, 0, 0, 0, 0, 0, 0, 0xff],
                "byte 10 of the section's raw bytes: expected UTF-8 text",
            ),
            (
                &[1, 0, 0, 0, 0, 0, 1, 0, 0, 7],
                "byte 9 of the section's raw bytes: expected a list or text",
            ),
        ] {
            assert!(read(bytes).contains(reason), "{}", read(bytes));
        }
    }
}
