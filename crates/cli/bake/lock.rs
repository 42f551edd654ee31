//! One bake at a time for each output.

use crate::console::Console;
use crate::failure::Failure;
use crate::output;
use anyhow::Context;
use std::fs::{self, File, TryLockError};
use std::path::{Path, PathBuf};

/// Held while a bake works for an output. The system frees it when the process ends, however it ends.
pub struct Lock {
    path: PathBuf,
    // Closing it frees the lock.
    _file: File,
}

/// Takes the lock of an output: a hidden file beside it, which goes when the bake ends. One that a killed process
/// left lying about is free.
///
/// # Errors
/// Another process holds it, or the file cannot be made.
pub fn lock(output: &Path, console: &Console) -> Result<Lock, Failure> {
    let name = output.file_name().unwrap_or_default().to_string_lossy();
    let path = output.with_file_name(format!(".{name}.lock"));
    loop {
        let file = File::options()
            .create(true)
            .write(true)
            .truncate(false)
            .open(&path)
            .with_context(|| {
                format!(
                    "{}: cannot be made; check permissions and free space",
                    path.display()
                )
            })?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                return Err(anyhow::anyhow!(
                    "{}: another bake is writing it; wait for it or give another -o",
                    output.display()
                )
                .into());
            }
            // Some network file systems have no locks.
            Err(TryLockError::Error(error)) => {
                console.detail(format!("{}: cannot be locked ({error})", path.display()));
            }
        }
        // Who held it before may have removed it between our opening and locking it.
        if is_at(&file, &path) {
            output::holds(&path);
            return Ok(Lock { path, _file: file });
        }
    }
}

#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let place = |m: &fs::Metadata| (m.dev(), m.ino());
    matches!((file.metadata(), fs::metadata(path)), (Ok(a), Ok(b)) if place(&a) == place(&b))
}

#[cfg(not(unix))]
fn is_at(_: &File, _: &Path) -> bool {
    true
}

impl Drop for Lock {
    fn drop(&mut self) {
        // Still locked: nobody else can take what is removed for theirs.
        output::releases(&self.path);
    }
}
