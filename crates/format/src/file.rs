//! Assets to bytes and files.

use std::fs::{self, File};
use std::io::Write;
use std::path::{Path, PathBuf};

use xxhash_rust::xxh3::xxh3_64;

use crate::asset::Asset;
use crate::container;
use crate::error::{FormatError, Result};
use crate::layout::Kind;
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
            sections.push((kind, section::version(kind, asset), raw));
        }
    }
    container::assemble(&sections)
}

/// XXH3-64 of some bytes: for telling sources and assets apart, not against attackers.
pub fn content_hash(bytes: &[u8]) -> u64 {
    xxh3_64(bytes)
}

fn io_error<'a>(action: &'static str, path: &'a Path) -> impl Fn(std::io::Error) -> FormatError + use<'a> {
    move |source| FormatError::Io {
        action,
        path: path.to_path_buf(),
        section: "file".into(),
        offset: 0,
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
            section: "file".into(),
            offset: 0,
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
