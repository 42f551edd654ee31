//! Where a bake keeps its units of work, and whose they are.

use crate::failure::Failure;
use crate::output;
use relight_bake::units::folder::UnitFolder;
use relight_bake::units::key::Key;
use relight_format::unit::UnitName;
use std::collections::BTreeSet;
use std::io::Read;
use std::path::{Path, PathBuf};

/// Where `--resume` keeps units.
fn beside(asset: &Path) -> PathBuf {
    let mut name = asset.as_os_str().to_owned();
    name.push(".units");
    name.into()
}

/// What a bake with `--resume` that was stopped leaves behind.
pub fn left_behind(asset: &Path) -> String {
    let folder = beside(asset);
    let entries = std::fs::read_dir(&folder).into_iter().flatten().flatten();
    let units = entries.filter(|entry| UnitName::is_file_name(&entry.file_name().to_string_lossy()));
    match units.count() {
        0 => {
            // Only if it is empty.
            let _ = std::fs::remove_dir(&folder);
            "no unit of work was finished yet, so nothing was left behind".into()
        }
        count => format!(
            "{} of finished work in {}: the same command goes on from there",
            if count == 1 {
                "1 unit is kept".into()
            } else {
                format!("{count} units are kept")
            },
            folder.display()
        ),
    }
}

/// A folder of units and what becomes of it when the asset is written.
pub struct Kept {
    folder: PathBuf,
    after: After,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum After {
    /// The folder goes.
    Nothing,
    /// The units of this bake stay.
    Own,
    /// All stays: others may use it.
    Everything,
}

impl Kept {
    /// `ASSET.relight.units` beside an asset. Only one process at a time uses it (see [`super::lock`]).
    ///
    /// # Errors
    /// The folder cannot be made.
    pub fn beside(asset: &Path, keep: bool) -> Result<Kept, Failure> {
        let kept = Kept {
            folder: beside(asset),
            after: if keep { After::Own } else { After::Nothing },
        };
        // Whoever was killed here left parts behind.
        kept.open(&|_| ())?.sweep()?;
        Ok(kept)
    }

    /// A plan's.
    pub fn shared(folder: PathBuf) -> Kept {
        Kept {
            folder,
            after: After::Everything,
        }
    }

    /// The store; `note` is told of damaged units.
    ///
    /// # Errors
    /// The folder cannot be made.
    pub fn open<'a>(&self, note: &'a (dyn Fn(String) + Sync)) -> Result<UnitFolder<'a>, Failure> {
        // So that it goes again where nothing came to be in it.
        output::make_folder(&self.folder)?;
        Ok(UnitFolder::open(&self.folder, note)?)
    }

    /// The asset is written: what was kept for it goes. What cannot be removed is no reason to fail now.
    pub fn done(&self, folder: &UnitFolder, used: &BTreeSet<String>) {
        match self.after {
            After::Nothing => {
                folder.keep_only(&BTreeSet::new());
                // Only if it is empty: whatever else is in there is not ours.
                let _ = std::fs::remove_dir(&self.folder);
            }
            After::Own => folder.keep_only(used),
            After::Everything => {}
        }
    }
}

/// Identifies this build of relight by its own bytes: another one's numbers may differ in the last bit.
pub fn this_program() -> u128 {
    let mut key = Key::default();
    key.bytes(env!("CARGO_PKG_VERSION").as_bytes());
    // Piece by piece: with its debug information a program may be larger than what it bakes.
    let mut piece = vec![0; 1 << 16];
    if let Ok(mut file) = std::env::current_exe().and_then(std::fs::File::open) {
        while let Ok(length @ 1..) = file.read(&mut piece) {
            key.bytes(&piece[..length]);
        }
    }
    key.hash()
}
