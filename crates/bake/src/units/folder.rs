//! Units as files of one folder.

use super::UnitStore;
use crate::error::BakeError;
use relight_format::unit::{self, Column, UnitName};
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// A folder of unit files. Any number of processes, on any number of machines, may share one.
pub struct UnitFolder<'a> {
    folder: PathBuf,
    note: &'a (dyn Fn(String) + Sync),
}

impl<'a> UnitFolder<'a> {
    /// Makes the folder if it is not there. `note` is told of units that turn out to be damaged.
    ///
    /// # Errors
    /// [`BakeError::Unit`]: it cannot be made.
    pub fn open(folder: &Path, note: &'a (dyn Fn(String) + Sync)) -> Result<UnitFolder<'a>, BakeError> {
        fs::create_dir_all(folder).map_err(|source| failed("make the folder", folder, source))?;
        Ok(UnitFolder {
            folder: folder.to_owned(),
            note,
        })
    }

    /// Removes what killed processes left half written. Only for who is alone in the folder.
    ///
    /// # Errors
    /// [`BakeError::Unit`]: the folder cannot be read.
    pub fn sweep(&self) -> Result<(), BakeError> {
        unit::sweep_parts(&self.folder).map_err(|source| failed("tidy", &self.folder, source))
    }

    /// Removes all units but `used` (file names). What cannot be removed stays, as do files that are no units.
    pub fn keep_only(&self, used: &BTreeSet<String>) {
        for entry in fs::read_dir(&self.folder).into_iter().flatten().flatten() {
            let name = entry.file_name().to_string_lossy().into_owned();
            if UnitName::is_file_name(&name) && !used.contains(&name) {
                let _ = fs::remove_file(entry.path());
            }
        }
    }
}

fn failed(action: &'static str, path: &Path, source: std::io::Error) -> BakeError {
    BakeError::Unit {
        action,
        path: path.to_owned(),
        source,
    }
}

impl UnitStore for UnitFolder<'_> {
    fn load(&self, name: &UnitName) -> Option<Vec<Column>> {
        let path = self.folder.join(name.file_name());
        let bytes = match fs::read(&path) {
            Ok(bytes) => bytes,
            Err(error) => {
                if error.kind() != std::io::ErrorKind::NotFound {
                    (self.note)(format!("{}: {error}; it is computed anew", path.display()));
                }
                return None;
            }
        };
        unit::read_unit(&bytes, name)
            .inspect_err(|damage| (self.note)(format!("{}: {damage}; it is computed anew", path.display())))
            .ok()
    }

    fn save(&self, name: &UnitName, columns: &[Column]) -> Result<(), BakeError> {
        let path = self.folder.join(name.file_name());
        unit::write_durably(&path, &unit::write_unit(name, columns))
            .map_err(|source| failed("write", &path, source))
    }
}
