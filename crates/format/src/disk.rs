//! Files that are there whole or not at all.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

/// Ending of files that are not finished.
pub const UNFINISHED: &str = ".part";

/// What the system refused.
#[derive(Debug)]
pub struct Refused {
    /// What was to be done: "write", "sync" ...
    pub action: &'static str,
    /// To which file or folder.
    pub path: PathBuf,
    /// Its reason.
    pub source: io::Error,
}

/// Writes a file beside its target (its name begins with `prefix`), syncs it, renames it over the target and syncs the
/// folder: at every moment, after a crash or a loss of power too, the old file or the new one is there, whole. Any number of
/// processes may write the same file.
///
/// # Errors
/// The system refuses; nothing is left of the attempt, and the old file is unharmed.
pub fn replace(
    target: &Path,
    prefix: &str,
    write: impl FnOnce(&mut File) -> io::Result<()>,
) -> Result<(), Refused> {
    fn refused<'a>(action: &'static str, path: &'a Path) -> impl Fn(io::Error) -> Refused + use<'a> {
        move |source| Refused {
            action,
            path: path.to_path_buf(),
            source,
        }
    }
    let folder = match target.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    let mut builder = tempfile::Builder::new();
    builder.prefix(prefix).suffix(UNFINISHED);
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // What an ordinary new file gets (less the umask); tempfile's default would hide it from the group.
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    let mut file = builder
        .tempfile_in(folder)
        .map_err(refused("create a file in", folder))?;
    write(file.as_file_mut()).map_err(refused("write", target))?;
    file.as_file().sync_all().map_err(refused("sync", target))?;
    file.persist(target)
        .map_err(|error| refused("rename to", target)(error.error))?;
    #[cfg(unix)]
    File::open(folder)
        .and_then(|folder| folder.sync_all())
        .map_err(refused("sync", folder))?;
    Ok(())
}
