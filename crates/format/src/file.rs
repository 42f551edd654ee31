//! Assets to and from bytes and files.

use std::fs::{self, File};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use xxhash_rust::xxh3::xxh3_64;

use crate::asset::{Asset, Provenance};
use crate::container::{self, Limits, SectionInfo};
use crate::error::{FormatError, Place, Result, limit};
use crate::layout::{Codec, ENTRY_BYTES, HEADER_BYTES, Kind};
use crate::section;

/// The bytes of an asset's file. Equal assets give equal bytes; writing what was read gives the bytes that were
/// read.
///
/// # Errors
/// `Invalid` when the asset breaks a rule of [`Asset::validate`], with the element concerned; `LimitExceeded` when
/// provenance or materials exceed [`layout::MAX_RECORD_BYTES`](crate::layout::MAX_RECORD_BYTES).
pub fn write_asset(asset: &Asset) -> Result<Vec<u8>> {
    asset.validate()?;
    let mut sections = Vec::new();
    for kind in Kind::ALL {
        if let Some(raw) = section::encode(kind, asset)? {
            sections.push((kind, raw));
        }
    }
    container::assemble(&sections)
}

/// Reads and validates all of an asset.
///
/// # Errors
/// `Invalid` when a byte is not what SPEC.md asks for or the content breaks a rule of [`Asset::validate`];
/// `Unsupported` when a required section needs a newer reader; `LimitExceeded` before anything is allocated that
/// passes `limits` or that the file's length does not justify.
pub fn read_asset(bytes: &[u8], limits: &Limits) -> Result<Asset> {
    let header_bytes = bytes.get(..HEADER_BYTES as usize).unwrap_or(bytes);
    let header = container::parse_header(header_bytes, bytes.len() as u64, limits)?;
    // In range: the header's check compared both with the file's length.
    let table = &bytes[header.table_offset as usize..];
    let sections = container::parse_table(table, &header, limits)?;
    let mut asset = Asset::default();
    let mut memory = limits.total_bytes;
    for (index, info) in sections.iter().enumerate() {
        let stored = &bytes[info.offset as usize..(info.offset + info.stored_bytes) as usize];
        container::verify(info, stored)?;
        let entry_offset = header.table_offset + index as u64 * ENTRY_BYTES;
        match info.readable(entry_offset)? {
            None => {}
            Some((kind, Codec::Stored)) => section::decode(kind, stored, &mut memory, &mut asset)?,
            Some((kind, Codec::Zstd)) => {
                if info.raw_bytes > memory {
                    let expected = format_args!("at most {memory} more bytes of memory");
                    return Err(limit(
                        &info.name,
                        Place::File(info.offset),
                        expected,
                        info.raw_bytes,
                    ));
                }
                memory -= info.raw_bytes;
                let raw = container::decompress(info, stored)?;
                section::decode(kind, &raw, &mut memory, &mut asset)?;
                memory += info.raw_bytes;
            }
        }
    }
    asset.validate()?;
    Ok(asset)
}

/// XXH3-64 of some bytes: for telling sources and assets apart, not against attackers.
pub fn content_hash(bytes: &[u8]) -> u64 {
    xxh3_64(bytes)
}

/// What a file holds and what it costs, read from header, table and provenance alone.
#[derive(Debug, Clone, PartialEq)]
pub struct Summary {
    /// Version of the specification that the file needs.
    pub format_version: u32,
    /// Length of the file.
    pub file_bytes: u64,
    /// The table of contents, in file order.
    pub sections: Vec<SectionInfo>,
    /// Where the asset came from.
    pub provenance: Provenance,
}

fn io_error<'a>(action: &'static str, path: &'a Path) -> impl Fn(std::io::Error) -> FormatError + use<'a> {
    move |source| FormatError::Io {
        action,
        path: path.to_path_buf(),
        source,
    }
}

/// Writes an asset beside its target, syncs it, renames it over the target and syncs the directory: at every moment
/// the old file or the new one is there, whole. A symbolic link is followed.
///
/// # Errors
/// As [`write_asset`], before anything is touched; `Io` when the system refuses, with the old file unharmed.
pub fn write_file(path: impl AsRef<Path>, asset: &Asset) -> Result<()> {
    let bytes = write_asset(asset)?;
    write_atomically(path.as_ref(), &bytes)
}

fn write_atomically(path: &Path, bytes: &[u8]) -> Result<()> {
    // Renaming would replace the link, not what it points to.
    let target = if path.is_symlink() {
        fs::canonicalize(path).map_err(io_error("follow", path))?
    } else {
        path.to_path_buf()
    };
    // Renaming over a device or a pipe would replace it.
    if target.exists() && !target.is_file() {
        let source = std::io::Error::new(std::io::ErrorKind::AlreadyExists, "it is not a regular file");
        return Err(FormatError::Io {
            action: "replace",
            path: target,
            source,
        });
    }
    let directory = match target.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent.to_path_buf(),
        _ => PathBuf::from("."),
    };
    let mut builder = tempfile::Builder::new();
    builder.prefix(".relight-").suffix(".part");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // What an ordinary new file gets (less the umask); tempfile's default would hide it from the group.
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    let mut file = builder
        .tempfile_in(&directory)
        .map_err(io_error("create a file in", &directory))?;
    file.write_all(bytes).map_err(io_error("write", &target))?;
    file.as_file().sync_all().map_err(io_error("sync", &target))?;
    file.persist(&target)
        .map_err(|error| io_error("rename to", &target)(error.error))?;
    // Not every file system lets a directory be opened or synced; the rename itself has succeeded.
    #[cfg(unix)]
    File::open(&directory)
        .and_then(|d| d.sync_all())
        .map_err(io_error("sync", &directory))?;
    Ok(())
}

/// Reads and validates all of an asset from a file.
///
/// # Errors
/// As [`read_asset`]; `Io` when the file cannot be opened or read.
pub fn read_file(path: impl AsRef<Path>, limits: &Limits) -> Result<Asset> {
    let path = path.as_ref();
    let file = File::open(path).map_err(io_error("open", path))?;
    let length = file.metadata().map_err(io_error("read", path))?.len();
    if length > limits.file_bytes {
        let expected = format_args!("a file of at most {} bytes", limits.file_bytes);
        return Err(limit("file", Place::File(0), expected, length));
    }
    let mut bytes = Vec::with_capacity(usize::try_from(length).unwrap_or(0));
    // `take`: a file that grows meanwhile, or a pipe, stays within the limit.
    file.take(limits.file_bytes)
        .read_to_end(&mut bytes)
        .map_err(io_error("read", path))?;
    read_asset(&bytes, limits)
}

/// Reads header, table of contents and provenance of a file, and nothing else of it.
///
/// # Errors
/// `Io`, `Invalid` and `Unsupported` (header, table or provenance) as [`read_asset`]; sections other than provenance
/// are not checked.
pub fn read_summary(path: impl AsRef<Path>) -> Result<Summary> {
    let path = path.as_ref();
    let mut file = File::open(path).map_err(io_error("open", path))?;
    let length = file.metadata().map_err(io_error("read", path))?.len();
    summarise_from(&mut file, length).map_err(|error| match error {
        SummaryError::Io(source) => io_error("read", path)(source),
        SummaryError::Format(error) => error,
    })
}

/// The summary of a file's bytes.
///
/// # Errors
/// As [`read_summary`], without `Io`.
pub fn summarise(bytes: &[u8]) -> Result<Summary> {
    summarise_from(&mut std::io::Cursor::new(bytes), bytes.len() as u64).map_err(|error| match error {
        SummaryError::Io(source) => io_error("read", Path::new("memory"))(source),
        SummaryError::Format(error) => error,
    })
}

enum SummaryError {
    Io(std::io::Error),
    Format(FormatError),
}

impl From<std::io::Error> for SummaryError {
    fn from(error: std::io::Error) -> Self {
        SummaryError::Io(error)
    }
}

impl From<FormatError> for SummaryError {
    fn from(error: FormatError) -> Self {
        SummaryError::Format(error)
    }
}

fn summarise_from(
    source: &mut (impl Read + Seek),
    length: u64,
) -> std::result::Result<Summary, SummaryError> {
    // A summary takes no memory that a limit would guard: the table and provenance are bounded by the format.
    let limits = Limits {
        file_bytes: u64::MAX,
        section_bytes: u64::MAX,
        total_bytes: u64::MAX,
    };
    let mut read = |offset: u64, count: u64| -> std::io::Result<Vec<u8>> {
        source.seek(SeekFrom::Start(offset))?;
        let mut bytes = Vec::new();
        source.take(count).read_to_end(&mut bytes)?;
        Ok(bytes)
    };
    let header_bytes = read(0, HEADER_BYTES)?;
    let header = container::parse_header(&header_bytes, length, &limits)?;
    let table = read(header.table_offset, header.table_bytes)?;
    let sections = container::parse_table(&table, &header, &limits)?;
    let mut asset = Asset::default();
    // Provenance is first, or the table's check would have failed.
    if let Some(info) = sections.first() {
        let most = crate::layout::MAX_RECORD_BYTES as u64;
        if info.raw_bytes > most || info.stored_bytes > most {
            let expected = format_args!("at most {most} bytes");
            return Err(limit(&info.name, Place::File(info.offset), expected, info.raw_bytes).into());
        }
        let stored = read(info.offset, info.stored_bytes)?;
        container::verify(info, &stored)?;
        let mut memory = u64::MAX;
        match info.readable(header.table_offset)? {
            None => {}
            Some((kind, Codec::Stored)) => section::decode(kind, &stored, &mut memory, &mut asset)?,
            Some((kind, Codec::Zstd)) => {
                let raw = container::decompress(info, &stored)?;
                section::decode(kind, &raw, &mut memory, &mut asset)?;
            }
        }
    }
    Ok(Summary {
        format_version: header.version,
        file_bytes: length,
        sections,
        provenance: asset.provenance,
    })
}
