//! Files of interim results: what a bake has finished of its work, kept so that it can go on after a stop.
//!
//! They are no assets: they hold plain columns of numbers, are read by the build of relight that wrote them and by no
//! other, and may be deleted at any time. SPEC.md does not cover them. Layout, little-endian: magic, name of the stage
//! (length byte and bytes), hash of the inputs (16 bytes), range (two u64), number of columns (u32), then per column
//! its type (u8), length (u64) and numbers; at the end XXH3-64 of all that.

use std::fs::{self, File};
use std::io::Write;
use std::path::Path;
use xxhash_rust::xxh3::xxh3_64;

const MAGIC: [u8; 8] = *b"RLUNIT\x01\n";
/// Bytes of the checksum at the end.
const CHECKSUM: usize = 8;

/// What a unit is of: the same name, and the same surroundings where its content depends on any, the same content.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct UnitName {
    /// Stage of the bake; at most 255 bytes, of which file names are made.
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
    let mut out = MAGIC.to_vec();
    let stage = &name.stage.as_bytes()[..name.stage.len().min(255)];
    out.push(stage.len() as u8);
    out.extend(stage);
    out.extend(name.inputs.to_le_bytes());
    out.extend(name.start.to_le_bytes());
    out.extend(name.end.to_le_bytes());
    out.extend((columns.len() as u32).to_le_bytes());
    for column in columns {
        let (kind, count) = column.shape();
        out.push(kind);
        out.extend((count as u64).to_le_bytes());
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
    let head = write_unit(name, &[]);
    // Less the number of columns and the checksum.
    let head = &head[..head.len() - 4 - CHECKSUM];
    let mut rest = body.strip_prefix(head).ok_or(UnitDamage::Other)?;
    let count = u32::from_le_bytes(array(take(&mut rest, 4)?));
    let mut columns = Vec::new();
    for _ in 0..count {
        let kind = take(&mut rest, 1)?[0];
        let length = u64::from_le_bytes(array(take(&mut rest, 8)?));
        let size = [1u64, 4, 8, 4, 8];
        let size = size.get(usize::from(kind)).ok_or(UnitDamage::Other)?;
        let length = length.checked_mul(*size).ok_or(UnitDamage::Truncated)?;
        let numbers = take(
            &mut rest,
            usize::try_from(length).map_err(|_| UnitDamage::Truncated)?,
        )?;
        let fours = || numbers.chunks_exact(4).map(array::<4>);
        let eights = || numbers.chunks_exact(8).map(array::<8>);
        columns.push(match kind {
            0 => Column::U8(numbers.to_vec()),
            1 => Column::U32(fours().map(u32::from_le_bytes).collect()),
            2 => Column::U64(eights().map(u64::from_le_bytes).collect()),
            3 => Column::F32(fours().map(f32::from_le_bytes).collect()),
            _ => Column::F64(eights().map(f64::from_le_bytes).collect()),
        });
    }
    if rest.is_empty() {
        Ok(columns)
    } else {
        Err(UnitDamage::Other)
    }
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

fn take<'a>(rest: &mut &'a [u8], count: usize) -> Result<&'a [u8], UnitDamage> {
    let (taken, left) = rest.split_at_checked(count).ok_or(UnitDamage::Truncated)?;
    *rest = left;
    Ok(taken)
}

/// `bytes` has `N` bytes wherever this is called.
fn array<const N: usize>(bytes: &[u8]) -> [u8; N] {
    let mut out = [0; N];
    out.copy_from_slice(bytes);
    out
}

/// Ending of files that are not finished.
pub const PART: &str = ".part";

/// Writes a file of a folder of units: beside its target, synced, renamed, and the folder synced, so that after a
/// crash or a loss of power it is there whole or not at all. Any number of processes may write the same file.
///
/// # Errors
/// The system refuses; nothing is left of the attempt.
pub fn write_durably(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    write_durably_with(path, bytes, |file, bytes| file.write_all(bytes))
}

fn write_durably_with(
    path: &Path,
    bytes: &[u8],
    write: impl FnOnce(&mut File, &[u8]) -> std::io::Result<()>,
) -> std::io::Result<()> {
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    let mut builder = tempfile::Builder::new();
    builder.prefix("unit-").suffix(PART);
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // Whoever may work on the same plan may read it (less the umask).
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    let mut file = builder.tempfile_in(folder)?;
    write(file.as_file_mut(), bytes)?;
    file.as_file().sync_all()?;
    file.persist(path).map_err(|error| error.error)?;
    #[cfg(unix)]
    File::open(folder)?.sync_all()?;
    Ok(())
}

/// Removes what killed writers left in a folder. Only for who is alone in it.
///
/// # Errors
/// The folder cannot be listed.
pub fn sweep_parts(folder: &Path) -> std::io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.as_os_str().as_encoded_bytes().ends_with(PART.as_bytes()) {
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
        let head = write_unit(&name(), &[]).len() - 4 - CHECKSUM;
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
            let full = |file: &mut File, bytes: &[u8]| {
                file.write_all(&bytes[..room])?;
                Err(std::io::Error::from(std::io::ErrorKind::StorageFull))
            };
            let error = write_durably_with(&path, &bytes, full).unwrap_err();
            assert_eq!(error.kind(), std::io::ErrorKind::StorageFull);
            assert_eq!(fs::read(&path).unwrap(), b"old");
            assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
        }
        write_durably(&path, &bytes).unwrap();
        assert_eq!(read_unit(&fs::read(&path).unwrap(), &name()), Ok(columns()));
    }
}
