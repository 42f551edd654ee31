//! A bake by many processes: `--plan`, `--unit`, `--merge`.
//!
//! DIR/plan.json says what is baked: the command line with absolute paths, and hashes of what the files held. DIR/units has
//! the units of work, DIR/done an empty file for each unit of the plan that is done. The scene itself stays where it
//! is; if it has changed, units and merge refuse it.

use super::args::{BakeArgs, params};
use super::job::{Inputs, Job, guard, prepare, read, run_job, tell};
use super::kept::{Kept, this_program};
use super::plan::{self, Plan};
use super::{lock, slurm};
use crate::console::{BakeProgress, Console};
use crate::failure::{Failure, Outcome};
use crate::kinds::{self, Kind};
use crate::output::{self, SCHEMA};
use anyhow::{Context, anyhow};
use glam::DVec3;
use relight_bake::params::BakeParams;
use relight_bake::units::Ledger;
use relight_bake::{Portion, Request, bake_part, memory};
use relight_format::unit::write_durably;
use serde::Serialize;
use std::path::Path;
use std::time::Instant;

/// What `--plan` and `--unit` print.
#[derive(Serialize)]
struct FarmReport {
    schema: u32,
    #[serde(skip_serializing_if = "Option::is_none")]
    unit: Option<usize>,
    units: usize,
}

/// `--plan`.
pub fn plan(args: &BakeArgs, seed: u64, folder: &Path, console: &Console) -> Result<Outcome, Failure> {
    // What contradicts itself is told before anything is read.
    params(args, seed, DVec3::ZERO)?;
    prepare(args, args.replace.force)?;
    if let Some(lights) = &args.lights {
        kinds::check_file(lights, "units read it again")?;
    }
    let guard = guard(args, args.replace.force)?;
    guard.check(&folder.join("plan.json"), Kind::Plan)?;
    for script in slurm::NAMES.iter().filter(|_| args.long.slurm) {
        guard.check(&folder.join("slurm").join(script), Kind::Script)?;
    }
    output::make_folder(folder)?;
    let folder = std::path::absolute(folder)?;
    let read = read(args, console)?;
    // Before the work: a path may be one that no plan can hold.
    let words = args.words()?;
    let params = params(args, seed, read.scene.offset)?;
    let made = compute(&folder, &read, &params, args, Portion::Shared, console)?;
    console.close();
    plan::write(&folder, words, seed, &read, made)?;
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
        output::print_json(&FarmReport {
            schema: SCHEMA,
            unit: None,
            units: made,
        })?;
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
        let read = plan.checked_files(console)?;
        let params = params(&plan.args, plan.seed, read.scene.offset)?;
        let part = Portion::Piece {
            index: number - 1,
            of: plan.units,
        };
        compute(&plan.folder, &read, &params, &plan.args, part, console)?;
        output::make_folder(&plan.folder.join("done"))?;
        write_durably(&done, b"").with_context(|| format!("{}: cannot be written", done.display()))?;
        console.close();
        console.note(format!("Unit {number} of {} is done.", plan.units));
    }
    if json {
        output::print_json(&FarmReport {
            schema: SCHEMA,
            unit: Some(number),
            units: plan.units,
        })?;
    }
    Ok(Outcome::Done)
}

/// `--merge`.
pub fn merge(folder: &Path, force: bool, json: bool, console: &Console) -> Result<Outcome, Failure> {
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
    let target = plan.args.output()?;
    prepare(&plan.args, plan.args.replace.force || force)?;
    let lock = lock::lock(target, console)?;
    let start = Instant::now();
    let read = plan.checked_files(console)?;
    let params = params(&plan.args, plan.seed, read.scene.offset)?;
    let job = Job {
        params: &params,
        shading: plan.args.shading(),
        lights: read.lights.as_ref(),
        source_hash: read.source_hash,
        kept: Some(Kept::shared(plan.folder.join("units"))),
        checked: true,
        force: plan.args.replace.force || force,
        until: None,
    };
    let result = run_job(&job, read.scene, target, start.elapsed().as_secs_f64(), console)?;
    drop(lock);
    tell(&result, plan.args.strict, json, console)
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
    let units = folder.join("units");
    let progress = BakeProgress::new(console).towards(&units, args.replace.force);
    let store = Kept::shared(units.clone()).open(&note)?;
    let ledger = Ledger::new(&store, this_program());
    bake_part(&request, &ledger, part, &progress).map_err(|error| progress.failure(error))
}
