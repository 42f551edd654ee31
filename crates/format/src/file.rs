//! Assets to bytes and files.

use std::fs;
use std::io::Write;
use std::path::Path;

use xxhash_rust::xxh3::xxh3_64;

use crate::asset::Asset;
use crate::container;
use crate::disk::{self, Refused};
use crate::error::{Result, io};
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

/// Writes an asset beside its target, syncs it, renames it over the target and syncs the directory: at every moment
/// the old file or the new one is there, whole. A symbolic link is followed.
///
/// # Errors
/// As [`write_asset`], before anything is touched; `Io` when the system refuses, with the old file unharmed.
pub fn write_file(path: impl AsRef<Path>, asset: &Asset) -> Result<()> {
    let (bytes, path) = (write_asset(asset)?, path.as_ref());
    // Renaming would replace the link, not what it points to.
    let target = if path.is_symlink() {
        fs::canonicalize(path).map_err(io("follow", path, "file", 0))?
    } else {
        path.to_path_buf()
    };
    // Renaming over a device or a pipe would replace it.
    if target.exists() && !target.is_file() {
        let source = std::io::Error::new(std::io::ErrorKind::AlreadyExists, "it is not a regular file");
        return Err(io("replace", &target, "file", 0)(source));
    }
    let replaced = disk::replace(&target, ".relight-", |file| file.write_all(&bytes));
    replaced.map_err(|Refused { action, path, source }| io(action, &path, "file", 0)(source))
}
