//! Sections as one zstd frame each (SPEC 4.4).

use crate::error::{Location, Result, invalid};
use crate::layout::{MAX_RATIO, ZSTD_LEVEL};

/// First bytes of a frame that is not to be skipped (RFC 8878, 3.1.1).
const MAGIC: [u8; 4] = [0x28, 0xb5, 0x2f, 0xfd];

/// The frame of a section's raw bytes, or `None` where they are better stored as they are.
///
/// # Errors
/// `Invalid` when zstd fails, which it does only without memory.
pub fn compress(section: &str, raw: &[u8]) -> Result<Option<Vec<u8>>> {
    let packed = zstd::bulk::compress(raw, ZSTD_LEVEL)
        .map_err(|error| invalid(section, Location::Raw(0), "bytes that zstd compresses", error))?;
    let worthwhile = packed.len() < raw.len() && raw.len() as u64 <= packed.len() as u64 * MAX_RATIO;
    Ok(worthwhile.then_some(packed))
}

/// The raw bytes of a section's frame, which starts at `offset` of the file. That so many are justified was checked.
///
/// # Errors
/// `Invalid` when `stored` is no frame, more than one, or one of another number of bytes.
pub fn decompress(section: &str, offset: u64, raw_bytes: u64, stored: &[u8]) -> Result<Vec<u8>> {
    let fail = |found: &dyn std::fmt::Display| {
        let expected = format_args!("a zstd frame of {raw_bytes} raw bytes");
        invalid(section, Location::File(offset), expected, found)
    };
    // zstd itself would read several frames, and skip those that it may.
    let frame = zstd::zstd_safe::find_frame_compressed_size(stored)
        .map_err(|code| fail(&zstd::zstd_safe::get_error_name(code)))?;
    if frame != stored.len() || !stored.starts_with(&MAGIC) {
        let found = format_args!("{frame} of {} stored bytes in one", stored.len());
        return Err(fail(&found));
    }
    let capacity = usize::try_from(raw_bytes).map_err(|error| fail(&error))?;
    let raw = zstd::bulk::decompress(stored, capacity).map_err(|error| fail(&error))?;
    match raw.len() == capacity {
        true => Ok(raw),
        false => Err(fail(&raw.len())),
    }
}
