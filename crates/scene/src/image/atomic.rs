//! Files that are either whole and new, or whole and old.

use super::error::ImageError;
use std::io::Write;
use std::path::Path;

/// Writes `bytes` to a temporary file beside `path`, syncs it, renames it over `path` and syncs the folder, so that
/// after a crash or a full disk the target is the old file or the new one. The folder must exist.
///
/// # Errors
/// [`ImageError::Io`], naming the target, which is not replaced if it is a device, a pipe or a folder; the temporary file is
/// removed.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> Result<(), ImageError> {
    write_atomically_with(path, |file| file.write_all(bytes))
}

/// As [`write_atomically`], of what `write` writes, piece by piece.
///
/// # Errors
/// As [`write_atomically`].
pub fn write_atomically_with(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> std::io::Result<()>,
) -> Result<(), ImageError> {
    let fail = |action| move |e| ImageError::io(path, action, e);
    if path.exists() && !path.is_file() {
        let error = std::io::Error::new(std::io::ErrorKind::AlreadyExists, "it is not a regular file");
        return Err(fail("replacing")(error));
    }
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    let mut builder = tempfile::Builder::new();
    builder.prefix(".relight-");
    // tempfile makes private files; an output should get what the user's umask gives any other file.
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    let mut file = builder
        .tempfile_in(folder)
        .map_err(fail("making a temporary file beside it"))?;
    // The plain file: errors of the other name it, which nobody has heard of.
    let mut buffer = std::io::BufWriter::new(file.as_file_mut());
    write(&mut buffer)
        .and_then(|()| buffer.flush())
        .map_err(fail("writing"))?;
    drop(buffer);
    file.as_file().sync_all().map_err(fail("syncing"))?;
    file.persist(path)
        .map_err(|e| ImageError::io(path, "renaming the finished file to it", e.error))?;
    // Elsewhere a folder cannot be opened as a file, and renames are journalled.
    #[cfg(unix)]
    std::fs::File::open(folder)
        .and_then(|folder| folder.sync_all())
        .map_err(fail("syncing its folder"))?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Truth: what `std::fs` reads back; no second file may be left beside the target.
    #[test]
    fn a_file_is_replaced_whole_and_nothing_is_left_beside_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.bin");
        write_atomically(&path, b"old").unwrap();
        write_atomically(&path, b"new content").unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"new content");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            let plain = folder.path().join("plain");
            std::fs::write(&plain, b"").unwrap();
            let mode = |p: &Path| std::fs::metadata(p).unwrap().permissions().mode();
            assert_eq!(mode(&path), mode(&plain));
        }
    }

    /// Renaming would put a file in the place of a device; a socket stands for all that are no files.
    #[cfg(unix)]
    #[test]
    fn what_is_no_file_is_not_replaced() {
        use std::os::unix::fs::FileTypeExt;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("socket");
        let _listener = std::os::unix::net::UnixListener::bind(&path).unwrap();
        let message = write_atomically(&path, b"x").unwrap_err().to_string();
        assert!(message.contains("socket"), "{message}");
        assert!(std::fs::metadata(&path).unwrap().file_type().is_socket());
    }

    #[test]
    fn a_missing_folder_is_an_error_that_names_the_target() {
        let folder = tempfile::tempdir().unwrap();
        let message = write_atomically(&folder.path().join("no/a.exr"), b"x")
            .unwrap_err()
            .to_string();
        assert!(
            message.contains("a.exr") && message.contains("temporary"),
            "{message}"
        );
    }
}
