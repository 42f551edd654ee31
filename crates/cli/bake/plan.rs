//! plan.json: what the processes of a farm bake.

use super::args::BakeArgs;
use super::job::{Inputs, read};
use super::kept::this_program;
use crate::console::Console;
use crate::failure::Failure;
use crate::kinds::Kind;
use crate::output;
use crate::signals;
use anyhow::{Context, anyhow};
use clap::Parser;
use relight_bake::units::key;
use relight_format::unit::write_durably;
use serde::{Deserialize, Serialize};
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

/// The file's name in the plan's folder.
const NAME: &str = "plan.json";
/// Version of plan.json.
const VERSION: u64 = 1;

/// What plan.json says first of all, whatever its version.
#[derive(Deserialize)]
struct PlanHead {
    relight_plan: Option<u64>,
    program: Option<String>,
}

/// plan.json.
#[derive(Serialize, Deserialize)]
struct PlanFile {
    /// [`VERSION`].
    relight_plan: u64,
    /// The build of relight that made it.
    program: String,
    seed: u64,
    /// The command line of the bake.
    words: Vec<String>,
    files: FileHashes,
    units: NonZeroUsize,
}

/// Hashes of what the files of a bake hold, hexadecimal.
#[derive(Serialize, Deserialize)]
struct FileHashes {
    /// Bytes of the scene's file.
    scene: String,
    /// What it says.
    scene_content: String,
    lights: Option<String>,
}

/// A plan, read.
pub struct Plan {
    /// Where it lies, absolute.
    pub folder: PathBuf,
    /// What is baked.
    pub args: BakeArgs,
    /// Seed of the bake.
    pub seed: u64,
    /// Into how many units the bake is divided.
    pub units: usize,
    files: FileHashes,
    /// Tells it from others in the same folder.
    identity: u128,
}

/// The options of a plan's bake, parsed again.
#[derive(Parser)]
struct Line {
    #[command(flatten)]
    args: BakeArgs,
}

/// Writes the plan of a bake by the options `words` in `units` units.
///
/// # Errors
/// The file cannot be written.
pub fn write(
    folder: &Path,
    words: Vec<String>,
    seed: u64,
    read: &Inputs,
    units: usize,
) -> Result<(), Failure> {
    let file = PlanFile {
        relight_plan: VERSION,
        program: format!("{:032x}", this_program()),
        seed,
        words,
        files: FileHashes::of(read),
        units: NonZeroUsize::new(units).context("a plan has a unit or more")?,
    };
    let _whole = signals::whole();
    write_durably(&folder.join(NAME), output::json_text(&file)?.as_bytes())
        .with_context(|| format!("{}: the plan cannot be written", folder.display()))?;
    Ok(())
}

impl FileHashes {
    fn of(read: &Inputs) -> FileHashes {
        let lights = read.lights.as_ref().map(|lights| {
            let mut key = key::Key::default();
            format!("{:032x}", key.bytes(format!("{lights:?}").as_bytes()).hash())
        });
        FileHashes {
            scene: format!("{:016x}", read.source_hash),
            scene_content: format!("{:032x}", key::scene(&read.scene)),
            lights,
        }
    }
}

impl Plan {
    /// Reads the plan in a folder.
    ///
    /// # Errors
    /// There is none, or it is of another version or build of relight.
    pub fn read(folder: &Path) -> Result<Plan, Failure> {
        if folder.is_file() {
            return Err(anyhow!(
                "{}: is {}, not the folder of a plan; give what --plan named",
                folder.display(),
                Kind::of(folder).name()
            )
            .into());
        }
        let path = folder.join(NAME);
        let text = std::fs::read_to_string(&path).with_context(|| {
            format!(
                "{}: cannot be read; is {} a plan?",
                path.display(),
                folder.display()
            )
        })?;
        let head: PlanHead = serde_json::from_str(&text).with_context(|| format!("{}", path.display()))?;
        let broken = |why: String| {
            anyhow!(
                "{}: it is no plan of this version of relight ({why}); plan again",
                path.display()
            )
        };
        if head.relight_plan != Some(VERSION) {
            let found = (head.relight_plan).map_or("no version".into(), |v| format!("version {v}"));
            return Err(broken(format!("{found}, expected {VERSION}")).into());
        }
        if head.program != Some(format!("{:032x}", this_program())) {
            return Err(anyhow!(
                "{}: the plan was made by another build of relight, whose numbers may differ; use that one, or plan \
                 again with this one",
                path.display()
            )
            .into());
        }
        let file: PlanFile = serde_json::from_str(&text).map_err(|error| broken(error.to_string()))?;
        let line = Line::try_parse_from(std::iter::once("bake").chain(file.words.iter().map(String::as_str)));
        Ok(Plan {
            folder: std::path::absolute(folder)?,
            args: line
                .map_err(|_| broken("`words` are no options of bake".into()))?
                .args,
            seed: file.seed,
            units: file.units.get(),
            files: file.files,
            identity: key::Key::default().bytes(text.as_bytes()).hash(),
        })
    }

    /// Reads the scene and the lights, which must be those that were planned.
    ///
    /// # Errors
    /// They cannot be read, or have changed.
    pub fn checked_files(&self, console: &Console) -> Result<Inputs, Failure> {
        let read = read(&self.args, console)?;
        let (now, then) = (FileHashes::of(&read), &self.files);
        let changed = if (&now.scene, &now.scene_content) != (&then.scene, &then.scene_content) {
            self.args.scene()?
        } else if now.lights != then.lights {
            self.args.lights.as_deref().unwrap_or(Path::new("the lights"))
        } else {
            return Ok(read);
        };
        Err(anyhow!(
            "{}: it has changed since the plan in {} was made; plan again",
            changed.display(),
            self.folder.display()
        )
        .into())
    }

    /// The file that says that a unit is done. Another plan in the same folder has others.
    pub fn done(&self, number: usize) -> PathBuf {
        let name = format!("{:032x}-{number}", self.identity);
        self.folder.join("done").join(name)
    }
}
