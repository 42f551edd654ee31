//! Files of interim results: what a bake has finished of its work, kept so that it can go on after a stop.
//!
//! They are no assets: they hold plain columns of numbers, are read by the build of relight that wrote them and by no
//! other, and may be deleted at any time. SPEC.md does not cover them. Layout, little-endian: a record (as SPEC 7.9) of magic,
//! name and number of columns (u32), then per column a record of its type (u8) and length (u64), and its numbers; at the
//! end XXH3-64 of all that.

use std::fs::{self, File};
use std::io::Write;
use std::path::Path;

use bincode::Encode;
use xxhash_rust::xxh3::xxh3_64;

use crate::codec::bytes::Cursor;
use crate::codec::record;
use crate::disk::{self, UNFINISHED};

const MAGIC: [u8; 8] = *b"RLUNIT\x02\n";
/// Bytes of the checksum at the end.
const CHECKSUM: usize = 8;

/// What a unit is of: the same name, and the same surroundings where its content depends on any, the same content.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Encode)]
pub struct UnitName {
    /// Stage of the bake, of which file names are made.
    pub stage: String,
    /// Hash of all that the unit's numbers depend on, but for the range.
    pub inputs: u128,
    /// First item.
    pub start: u64,
    /// One beyond the last item.
    pub end: u64,
}

impl UnitName {
    /// The unit's file name.
    pub fn file_name(&self) -> String {
        format!(
            "{}-{:032x}-{}-{}.unit",
            self.stage, self.inputs, self.start, self.end
        )
    }

    /// Whether a unit's file may have this name.
    pub fn is_file_name(name: &str) -> bool {
        let Some(name) = name.strip_suffix(".unit") else {
            return false;
        };
        let mut parts = name.rsplitn(4, '-');
        let mut is_number = || parts.next().is_some_and(|part| part.parse::<u64>().is_ok());
        is_number()
            && is_number()
            && (parts.next()).is_some_and(|hash| hash.len() == 32 && u128::from_str_radix(hash, 16).is_ok())
            && parts.next().is_some_and(|stage| !stage.is_empty())
    }
}

/// Numbers of one type.
#[derive(Debug, Clone, PartialEq)]
pub enum Column {
    /// Bytes.
    U8(Vec<u8>),
    /// 32-bit unsigned.
    U32(Vec<u32>),
    /// 64-bit unsigned.
    U64(Vec<u64>),
    /// Single precision, bit by bit.
    F32(Vec<f32>),
    /// Double precision, bit by bit.
    F64(Vec<f64>),
}

/// Why bytes are not the unit that was asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum UnitDamage {
    /// Shorter than its parts say.
    #[error("it ends too early")]
    Truncated,
    /// The bytes and their checksum disagree.
    #[error("its bytes do not match their checksum")]
    Checksum,
    /// It holds another unit, or another version's.
    #[error("it holds something else")]
    Other,
}

/// The bytes of a unit's file.
pub fn write_unit(name: &UnitName, columns: &[Column]) -> Vec<u8> {
    let mut out = head(name);
    record::put(columns.len() as u32, &mut out);
    for column in columns {
        let (kind, count) = column.shape();
        record::put((kind, count as u64), &mut out);
        match column {
            Column::U8(v) => out.extend(v),
            Column::U32(v) => v.iter().for_each(|x| out.extend(x.to_le_bytes())),
            Column::U64(v) => v.iter().for_each(|x| out.extend(x.to_le_bytes())),
            Column::F32(v) => v.iter().for_each(|x| out.extend(x.to_le_bytes())),
            Column::F64(v) => v.iter().for_each(|x| out.extend(x.to_le_bytes())),
        }
    }
    out.extend(xxh3_64(&out).to_le_bytes());
    out
}

/// What the file of a unit of this name begins with.
fn head(name: &UnitName) -> Vec<u8> {
    let mut out = Vec::new();
    record::put((MAGIC, name), &mut out);
    out
}

/// The columns of the unit `name` from its file's bytes.
///
/// # Errors
/// The bytes are not that unit's, whole.
pub fn read_unit(bytes: &[u8], name: &UnitName) -> Result<Vec<Column>, UnitDamage> {
    let body = bytes.len().checked_sub(CHECKSUM).ok_or(UnitDamage::Truncated)?;
    let (body, checksum) = bytes.split_at(body);
    if checksum != xxh3_64(body).to_le_bytes() {
        return Err(UnitDamage::Checksum);
    }
    let rest = body.strip_prefix(&head(name)[..]).ok_or(UnitDamage::Other)?;
    let mut memory = 0;
    let mut cursor = Cursor::new("unit", rest, &mut memory);
    let cut_short = |_| UnitDamage::Truncated;
    let count: u32 = record::fixed(&mut cursor).map_err(cut_short)?;
    let mut columns = Vec::new();
    for _ in 0..count {
        let (kind, length): (u8, u64) = record::fixed(&mut cursor).map_err(cut_short)?;
        let size = [1, 4, 8, 4, 8];
        let size: usize = *size.get(usize::from(kind)).ok_or(UnitDamage::Other)?;
        let length = usize::try_from(length).ok().and_then(|n| n.checked_mul(size));
        let numbers = cursor
            .take(length.ok_or(UnitDamage::Truncated)?)
            .map_err(cut_short)?;
        let fours = || numbers.as_chunks::<4>().0.iter().copied();
        let eights = || numbers.as_chunks::<8>().0.iter().copied();
        columns.push(match kind {
            0 => Column::U8(numbers.to_vec()),
            1 => Column::U32(fours().map(u32::from_le_bytes).collect()),
            2 => Column::U64(eights().map(u64::from_le_bytes).collect()),
            3 => Column::F32(fours().map(f32::from_le_bytes).collect()),
            _ => Column::F64(eights().map(f64::from_le_bytes).collect()),
        });
    }
    cursor.finish().map_err(|_| UnitDamage::Other)?;
    Ok(columns)
}

impl Column {
    fn shape(&self) -> (u8, usize) {
        match self {
            Column::U8(v) => (0, v.len()),
            Column::U32(v) => (1, v.len()),
            Column::U64(v) => (2, v.len()),
            Column::F32(v) => (3, v.len()),
            Column::F64(v) => (4, v.len()),
        }
    }
}

/// Writes a file of a folder of units: beside its target, synced, renamed, and the folder synced, so that after a
/// crash or a loss of power it is there whole or not at all. Any number of processes may write the same file.
///
/// # Errors
/// The system refuses; nothing is left of the attempt.
pub fn write_durably(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    write_durably_with(path, |file| file.write_all(bytes))
}

fn write_durably_with(
    path: &Path,
    write: impl FnOnce(&mut File) -> std::io::Result<()>,
) -> std::io::Result<()> {
    disk::replace(path, "unit-", write).map_err(|refused| refused.source)
}

/// Removes what killed writers left in a folder. Only for who is alone in it.
///
/// # Errors
/// The folder cannot be listed.
pub fn sweep_parts(folder: &Path) -> std::io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path
            .as_os_str()
            .as_encoded_bytes()
            .ends_with(UNFINISHED.as_bytes())
        {
            // Another sweeper may have been faster.
            let _ = fs::remove_file(path);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn name() -> UnitName {
        UnitName {
            stage: "refine".into(),
            inputs: 0x0123_4567_89ab_cdef_0011_2233_4455_6677,
            start: 64,
            end: 128,
        }
    }

    #[test]
    fn names_of_units_are_told_from_others() {
        let other = UnitName {
            stage: "light-tree_2".into(),
            inputs: u128::MAX,
            ..name()
        };
        assert!(UnitName::is_file_name(&name().file_name()) && UnitName::is_file_name(&other.file_name()));
        for others in [
            "",
            ".unit",
            "thesis.unit",
            "a-1-2.unit",
            "refine-xyz-0-8.unit",
            "-0123456789abcdef0123456789abcdef-0-8.unit",
        ] {
            assert!(!UnitName::is_file_name(others), "{others}");
        }
    }

    fn columns() -> Vec<Column> {
        vec![
            Column::U8(vec![1, 2, 3]),
            Column::U32(vec![u32::MAX, 0]),
            Column::U64(vec![u64::MAX]),
            Column::F32(vec![-0.0, f32::MIN_POSITIVE, f32::INFINITY]),
            Column::F64(vec![]),
        ]
    }

    #[test]
    fn a_unit_comes_back_as_it_was() {
        let bytes = write_unit(&name(), &columns());
        assert_eq!(read_unit(&bytes, &name()), Ok(columns()));
    }

    #[test]
    fn every_prefix_and_every_flipped_bit_is_noticed() {
        let bytes = write_unit(&name(), &columns());
        for end in 0..bytes.len() {
            assert!(read_unit(&bytes[..end], &name()).is_err(), "prefix of {end}");
        }
        for bit in 0..bytes.len() * 8 {
            let mut flipped = bytes.clone();
            flipped[bit / 8] ^= 1 << (bit % 8);
            assert_eq!(
                read_unit(&flipped, &name()),
                Err(UnitDamage::Checksum),
                "bit {bit}"
            );
        }
    }

    #[test]
    fn another_units_bytes_are_refused() {
        let bytes = write_unit(&name(), &columns());
        for other in [
            UnitName { start: 0, ..name() },
            UnitName { end: 129, ..name() },
            UnitName { inputs: 1, ..name() },
            UnitName {
                stage: "points".into(),
                ..name()
            },
        ] {
            assert_eq!(read_unit(&bytes, &other), Err(UnitDamage::Other));
        }
    }

    /// The checksums are right, the lengths are not: nothing is allocated for what is not there.
    #[test]
    fn forged_lengths_are_refused() {
        let bytes = write_unit(&name(), &columns());
        let head = head(&name()).len();
        for at in head..bytes.len() - CHECKSUM {
            for value in [0x00, 0x7f, 0xff] {
                let mut forged = bytes.clone();
                forged[at] = value;
                let body = forged.len() - CHECKSUM;
                let sum = xxh3_64(&forged[..body]).to_le_bytes();
                forged[body..].copy_from_slice(&sum);
                // No panic; what is accepted has no more numbers than bytes.
                if let Ok(columns) = read_unit(&forged, &name()) {
                    assert!(columns.iter().map(|c| c.shape().1).sum::<usize>() <= bytes.len());
                }
            }
        }
    }

    /// Writers that fail after every number of bytes, as on a full disk: the old file stays, nothing is left beside it.
    #[test]
    fn a_disk_that_fills_up_at_any_byte_leaves_the_old_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.unit");
        let bytes = write_unit(&name(), &columns());
        write_durably(&path, b"old").unwrap();
        for room in 0..bytes.len() {
            let full = |file: &mut File| {
                file.write_all(&bytes[..room])?;
                Err(std::io::Error::from(std::io::ErrorKind::StorageFull))
            };
            let error = write_durably_with(&path, full).unwrap_err();
            assert_eq!(error.kind(), std::io::ErrorKind::StorageFull);
            assert_eq!(fs::read(&path).unwrap(), b"old");
            assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
        }
        write_durably(&path, &bytes).unwrap();
        assert_eq!(read_unit(&fs::read(&path).unwrap(), &name()), Ok(columns()));
    }
}
