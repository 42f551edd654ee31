//! Where results go: JSON on stdout, files beside their targets.

use crate::signals;
use anyhow::{Context, Result};
use comfy_table::presets;
use comfy_table::{CellAlignment, Table};
use serde::Serialize;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use tempfile::TempDir;

/// Version of the JSON that commands print: raised when a field changes its meaning or goes.
pub const SCHEMA: u32 = 1;

/// A JSON object as text for people: its keys in alphabetical order, one a line.
///
/// # Errors
/// A map's key is no text.
pub fn json_text(value: &impl Serialize) -> Result<String> {
    // By way of a value, whose keys are in order.
    Ok(format!("{:#}\n", serde_json::to_value(value)?))
}

/// Prints one JSON object on stdout, as [`json_text`]. A reader that has gone away is no failure of ours.
///
/// # Errors
/// stdout cannot be written, as on a full disk.
pub fn print_json(value: &impl Serialize) -> Result<()> {
    print_text(&json_text(value)?)
}

/// Prints text on stdout, as [`print_json`].
///
/// # Errors
/// As [`print_json`].
pub fn print_text(text: &str) -> Result<()> {
    let _whole = signals::whole();
    let mut out = std::io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(error).context("cannot write to standard output")
        }
        _ => Ok(()),
    }
}

/// A table whose first column is words and whose others are numbers.
pub fn table(header: &[&str], rows: impl IntoIterator<Item = Vec<String>>) -> String {
    let mut table = Table::new();
    table.load_style(presets::NOTHING).set_header(header.to_vec());
    table.add_rows(rows);
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table.trim_fmt()
}

/// Folders that this process has made.
static MADE: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// Removes a lock that is held, while it is.
pub fn releases(lock: &Path) {
    let mut locks = LOCKS.lock().unwrap_or_else(PoisonError::into_inner);
    // What another process makes there from now on is not ours.
    locks.retain(|held| held != lock);
    let _ = std::fs::remove_file(lock);
}

/// Makes a folder and those above it; [`tidy`] removes those in which nothing is.
///
/// # Errors
/// The system refuses.
pub fn make_folder(folder: &Path) -> Result<()> {
    let missing = folder
        .ancestors()
        .take_while(|f| !f.as_os_str().is_empty() && !f.exists());
    let missing: Vec<PathBuf> = missing.map(Path::to_owned).collect();
    std::fs::create_dir_all(folder).with_context(|| {
        format!(
            "{}: cannot make the folder; check the path and its permissions",
            folder.display()
        )
    })?;
    let mut made = MADE.lock().unwrap_or_else(PoisonError::into_inner);
    made.extend(missing.into_iter().rev());
    Ok(())
}

/// Files that hold locks of this process.
static LOCKS: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// Lets [`tidy`] remove a lock, wherever the process ends.
pub fn holds(lock: &Path) {
    LOCKS
        .lock()
        .unwrap_or_else(PoisonError::into_inner)
        .push(lock.to_owned());
}

/// Folders of this process that nobody else sees.
static SCRATCH: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// A folder for what is only needed for a while, which [`tidy`] removes wherever the process ends; whoever writes into it says
/// so ([`signals::whole`]).
///
/// # Errors
/// The system has no room for it.
pub fn scratch() -> Result<TempDir> {
    let of_system = std::env::temp_dir();
    scratch_in(&of_system)
}

/// As [`scratch`], in a folder that is there.
///
/// # Errors
/// As [`scratch`].
pub fn scratch_in(place: &Path) -> Result<TempDir> {
    let mut scratch = SCRATCH.lock().unwrap_or_else(PoisonError::into_inner);
    let made = tempfile::Builder::new().prefix(".relight-").tempdir_in(place);
    let made = made.with_context(|| {
        format!(
            "{}: cannot write into it; check permissions and free space",
            place.display()
        )
    })?;
    scratch.push(made.path().to_owned());
    Ok(made)
}

/// Removes scratch folders, locks that are still held, and folders that were made and stayed empty, because the command failed or was stopped.
pub fn tidy() {
    for lock in LOCKS.lock().unwrap_or_else(PoisonError::into_inner).drain(..) {
        let _ = std::fs::remove_file(lock);
    }
    for folder in (SCRATCH.lock().unwrap_or_else(PoisonError::into_inner)).drain(..) {
        let _ = std::fs::remove_dir_all(folder);
    }
    let mut made = MADE.lock().unwrap_or_else(PoisonError::into_inner);
    for folder in made.drain(..).rev() {
        // Only if it is empty.
        let _ = std::fs::remove_dir(folder);
    }
}

/// Makes the folder of an output and checks that files can be made in it, so that nobody waits for a result
/// that cannot be kept.
///
/// # Errors
/// The folder cannot be made or written; `path` is a folder, a device or a pipe, which renaming would replace.
pub fn prepare_output(path: &Path) -> Result<()> {
    if path.is_dir() {
        anyhow::bail!("{}: is a folder; give the name of a file", path.display());
    }
    if path.exists() && !path.is_file() {
        anyhow::bail!(
            "{}: is a device or a pipe, which a result would replace; give the name of a file",
            path.display()
        );
    }
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    make_folder(folder).with_context(|| path.display().to_string())?;
    let _whole = signals::whole();
    // The name itself, which may be too long or have what the file system can't.
    if let Err(error) = path.symlink_metadata()
        && error.kind() != std::io::ErrorKind::NotFound
    {
        anyhow::bail!(
            "{}: cannot be a file's name: {error}; give another",
            path.display()
        );
    }
    tempfile::Builder::new()
        .prefix(".relight-")
        .tempfile_in(folder)
        .with_context(|| {
            format!(
                "{}: cannot write into its folder; check permissions and free space",
                path.display()
            )
        })?;
    Ok(())
}

/// Name of the log beside an asset.
pub fn log_path(asset: &Path) -> PathBuf {
    let mut name = asset.as_os_str().to_owned();
    name.push(".log.json");
    name.into()
}

/// Most memory that this process has used so far, bytes; `None` where the system does not say.
pub fn peak_memory_bytes() -> Option<u64> {
    memory("VmHWM:")
}

/// Memory that this process uses now, bytes; `None` where the system does not say.
pub fn resident_bytes() -> Option<u64> {
    memory("VmRSS:")
}

fn memory(field: &str) -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix(field))?;
    let kib: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib * 1024)
}
