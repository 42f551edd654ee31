//! A bake by many processes: `--plan`, `--unit`, `--merge`.
//!
//! DIR/plan.json says what is baked: the command line with absolute paths, and hashes of what the files held. DIR/units has
//! the units of work, DIR/done an empty file for each unit of the plan that is done. The scene itself stays where it
//! is; if it has changed, units and merge refuse it.

use super::args::{BakeArgs, params};
use super::job::{Inputs, Job, baking_failed, read, run_job, tell};
use super::kept::{Kept, this_program};
use super::{lock, memory, slurm};
use crate::console::{BakeProgress, Console};
use crate::failure::{Failure, Outcome};
use crate::output::{self, SCHEMA};
use anyhow::{Context, anyhow};
use clap::Parser;
use relight_bake::params::BakeParams;
use relight_bake::units::{Ledger, key};
use relight_bake::{Portion, Request, bake_part};
use relight_format::unit::write_durably;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Version of plan.json.
const VERSION: u64 = 1;

/// A plan, read.
struct Plan {
    folder: PathBuf,
    args: BakeArgs,
    seed: u64,
    units: usize,
    json: Value,
}

/// The options of a plan's bake, parsed again.
#[derive(Parser)]
struct Line {
    #[command(flatten)]
    args: BakeArgs,
}

/// `--plan`.
pub fn plan(args: &BakeArgs, seed: u64, folder: &Path, console: &Console) -> Result<Outcome, Failure> {
    let params = params(args, seed)?;
    output::prepare_output(args.output()?)?;
    std::fs::create_dir_all(folder.join("done")).with_context(|| {
        format!(
            "{}: cannot be made; check the path and its permissions",
            folder.display()
        )
    })?;
    let folder = std::path::absolute(folder)?;
    let read = read(args, console)?;
    let mut json = json!({
        "relight_plan": VERSION,
        "program": format!("{:032x}", this_program()),
        "seed": seed,
        "words": args.words()?,
        "files": files(&read),
    });
    let made = compute(&folder, &read, &params, args, Portion::Shared, console)?;
    json["units"] = made.into();
    console.close();
    write_durably(&folder.join("plan.json"), format!("{json:#}\n").as_bytes())
        .with_context(|| format!("{}: the plan cannot be written", folder.display()))?;
    if args.long.slurm {
        slurm::write(&folder, made)?;
        console.note(format!(
            "Submit with: {}",
            folder.join("slurm/submit.sh").display()
        ));
    }
    console.note(format!(
        "Planned {made} units in {}. For I = 1 to {made}: relight bake --unit I/{made} DIR; then: relight bake --merge DIR.",
        folder.display()
    ));
    if args.json {
        output::print_json(&json!({ "schema": SCHEMA, "units": made }))?;
    }
    Ok(Outcome::Done)
}

/// `--unit`.
pub fn unit(piece: &Path, folder: &Path, json: bool, console: &Console) -> Result<Outcome, Failure> {
    let plan = Plan::read(folder)?;
    let text = piece.to_string_lossy();
    let numbers = text
        .split_once('/')
        .and_then(|(i, n)| Some((i.parse::<usize>().ok()?, n.parse::<usize>().ok()?)));
    let number = match numbers {
        Some((i, n)) if n == plan.units && (1..=n).contains(&i) => i,
        Some((_, n)) if n != plan.units => {
            return Err(Failure::Usage(format!(
                "{}: the plan has {} units, not {n}",
                folder.display(),
                plan.units
            )));
        }
        _ => {
            return Err(Failure::Usage(format!(
                "--unit {text}: expected I/N with I from 1 to N"
            )));
        }
    };
    let done = plan.done(number);
    if done.exists() {
        console.note(format!("Unit {number} of {} is done already.", plan.units));
    } else {
        let params = params(&plan.args, plan.seed)?;
        let read = plan.checked_files(console)?;
        let part = Portion::Piece {
            index: number - 1,
            of: plan.units,
        };
        compute(&plan.folder, &read, &params, &plan.args, part, console)?;
        write_durably(&done, b"").with_context(|| format!("{}: cannot be written", done.display()))?;
        console.close();
        console.note(format!("Unit {number} of {} is done.", plan.units));
    }
    if json {
        output::print_json(&json!({ "schema": SCHEMA, "unit": number, "units": plan.units }))?;
    }
    Ok(Outcome::Done)
}

/// `--merge`.
pub fn merge(folder: &Path, json: bool, console: &Console) -> Result<Outcome, Failure> {
    let plan = Plan::read(folder)?;
    let missing: Vec<String> = (1..=plan.units)
        .filter(|&number| !plan.done(number).exists())
        .map(|number| number.to_string())
        .collect();
    if !missing.is_empty() {
        return Err(anyhow!(
            "{}: {} of {} units are not done: {}; run each with relight bake --unit I/{} DIR",
            folder.display(),
            missing.len(),
            plan.units,
            missing.join(", "),
            plan.units
        )
        .into());
    }
    let params = params(&plan.args, plan.seed)?;
    let target = plan.args.output()?;
    output::prepare_output(target)?;
    let lock = lock::lock(target, console)?;
    let start = Instant::now();
    let read = plan.checked_files(console)?;
    let job = Job {
        params: &params,
        shading: plan.args.shading(),
        lights: read.lights.as_ref(),
        source_hash: read.source_hash,
        kept: Some(Kept::shared(plan.folder.join("units"))),
    };
    let result = run_job(&job, read.scene, target, start.elapsed().as_secs_f64(), console)?;
    drop(lock);
    tell(&result, json, console)
}

/// Computes a part of a plan; returns how many units the plan should have.
fn compute(
    folder: &Path,
    read: &Inputs,
    params: &BakeParams,
    args: &BakeArgs,
    part: Portion,
    console: &Console,
) -> Result<usize, Failure> {
    let request = Request {
        scene: read.scene.clone(),
        shading: args.shading(),
        params,
        lights: read.lights.as_ref(),
        source_hash: read.source_hash,
        memory: memory::of_this_machine(),
    };
    let note = |text| console.note(text);
    let store = Kept::shared(folder.join("units")).open(&note)?;
    let ledger = Ledger::new(&store, this_program());
    bake_part(&request, &ledger, part, &BakeProgress::new(console)).map_err(baking_failed)
}

/// Hashes of what the files of a bake hold, by what they are.
fn files(read: &Inputs) -> Value {
    let lights = read.lights.as_ref().map(|lights| {
        let mut key = key::Key::default();
        format!("{:032x}", key.bytes(format!("{lights:?}").as_bytes()).hash())
    });
    json!({
        "scene": format!("{:016x}", read.source_hash),
        "scene_content": format!("{:032x}", key::scene(&read.scene)),
        "lights": lights,
    })
}

impl Plan {
    fn read(folder: &Path) -> Result<Plan, Failure> {
        let path = folder.join("plan.json");
        let text = std::fs::read_to_string(&path).with_context(|| {
            format!(
                "{}: cannot be read; is {} a plan?",
                path.display(),
                folder.display()
            )
        })?;
        let json: Value = serde_json::from_str(&text).with_context(|| format!("{}", path.display()))?;
        let broken = || {
            anyhow!(
                "{}: it is no plan of this version of relight; plan again",
                path.display()
            )
        };
        if json["relight_plan"] != VERSION {
            return Err(broken().into());
        }
        if json["program"] != format!("{:032x}", this_program()) {
            return Err(anyhow!(
                "{}: the plan was made by another build of relight, whose numbers may differ; use that one, or plan \
                 again with this one",
                path.display()
            )
            .into());
        }
        let words: Option<Vec<&str>> = json["words"]
            .as_array()
            .and_then(|words| words.iter().map(Value::as_str).collect());
        let line = Line::try_parse_from(std::iter::once("bake").chain(words.ok_or_else(broken)?));
        Ok(Plan {
            folder: std::path::absolute(folder)?,
            args: line.map_err(|_| broken())?.args,
            seed: json["seed"].as_u64().ok_or_else(broken)?,
            units: json["units"].as_u64().filter(|&n| n > 0).ok_or_else(broken)? as usize,
            json,
        })
    }

    /// Reads the scene and the lights, which must be those that were planned.
    fn checked_files(&self, console: &Console) -> Result<Inputs, Failure> {
        let read = read(&self.args, console)?;
        let (now, then) = (files(&read), &self.json["files"]);
        let changed = if now["scene"] != then["scene"] || now["scene_content"] != then["scene_content"] {
            self.args.scene()?
        } else if now["lights"] != then["lights"] {
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
    fn done(&self, number: usize) -> PathBuf {
        let mut key = key::Key::default();
        let plan = key.bytes(self.json.to_string().as_bytes()).hash();
        self.folder.join("done").join(format!("{plan:032x}-{number}"))
    }
}
