//! Sections of small records (SPEC 6.1, 6.3, 6.10): bincode 2 in its fixed-width little-endian configuration,
//! under a byte limit. bincode is no longer maintained; it stays behind this one module, and SPEC 7.9 specifies its
//! bytes in five lines, so that it can be replaced without changing the file.

use serde::{Serialize, de::DeserializeOwned};

use crate::codec::bytes::Cursor;
use crate::error::{Place, Result, invalid, limit};
use crate::layout::{Kind, MAX_RECORD_BYTES};

fn config() -> impl bincode::config::Config {
    // Without a limit a ten-byte file can ask for gigabytes.
    bincode::config::standard()
        .with_little_endian()
        .with_fixed_int_encoding()
        .with_limit::<MAX_RECORD_BYTES>()
}

/// Appends the records' bytes.
///
/// # Errors
/// `LimitExceeded` when they take more than [`MAX_RECORD_BYTES`].
pub fn encode<T: Serialize>(kind: Kind, records: &T, out: &mut Vec<u8>) -> Result<()> {
    let bytes = bincode::serde::encode_to_vec(records, config()).map_err(|error| {
        invalid(
            kind.name(),
            Place::Raw(0),
            "records that bincode can write",
            error,
        )
    })?;
    if bytes.len() > MAX_RECORD_BYTES {
        let expected = format_args!("at most {MAX_RECORD_BYTES} bytes");
        return Err(limit(kind.name(), Place::Raw(0), expected, bytes.len()));
    }
    out.extend_from_slice(&bytes);
    Ok(())
}

/// Reads records that take all remaining bytes.
///
/// # Errors
/// `Invalid` when the bytes are no such records; `LimitExceeded` when memory does not suffice.
pub fn decode<T: DeserializeOwned>(cursor: &mut Cursor<'_>) -> Result<T> {
    let bytes = cursor.take(cursor.remaining())?;
    // A record in memory takes less than 16 times its bytes (a pair of empty strings: 16 bytes in the file, 48 in
    // memory; vectors may have grown to twice their length).
    cursor.charge(bytes.len() as u64 * 16)?;
    match bincode::serde::decode_from_slice(bytes, config()) {
        Ok((records, used)) if used == bytes.len() => Ok(records),
        Ok((_, used)) => Err(cursor.invalid(format_args!("records of {} bytes", bytes.len()), used)),
        Err(error) => Err(cursor.invalid("records as SPEC 7.9 has them", error)),
    }
}
