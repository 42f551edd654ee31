//! `relight bake`: scene in, asset out.

mod args;
mod estimate;
mod farm;
pub mod job;
mod kept;
mod lock;
mod plan;
mod slurm;

use crate::console::Console;
use crate::failure::{Failure, Outcome};
use crate::target;
use glam::DVec3;
use job::{prepare, read, store, tell, timed};
use std::time::Instant;

pub use args::{BakeArgs, params};
pub use job::{Job, read_scene, run_job};
pub use kept::{Kept, this_program};

/// What a bake that was stopped leaves behind, and how to go on.
pub fn left_behind(args: &BakeArgs) -> String {
    let long = &args.long;
    let shared = long
        .plan
        .as_ref()
        .or(long.unit.as_ref().and_then(|unit| unit.get(1)));
    if let Some(folder) = shared {
        return format!(
            "what is finished is kept in {}: the same command goes on from there",
            folder.display()
        );
    }
    if let Some(folder) = &long.merge {
        return format!("nothing was written, and {} is as it was", folder.display());
    }
    match &args.output {
        Some(output) if long.resume => kept::left_behind(output),
        _ if long.dry_run => "nothing was left behind".into(),
        _ if args.target_error.is_some() => "nothing was written or left behind".into(),
        _ => "nothing was written or left behind, so the same command begins anew; a bake with --resume keeps what is finished"
            .into(),
    }
}

/// Runs the command.
pub fn run(args: &BakeArgs, seed: u64, console: &Console) -> Result<Outcome, Failure> {
    if let Some([piece, folder]) = args.long.unit.as_deref() {
        return farm::unit(piece, folder, args.json, console);
    }
    if let Some(folder) = &args.long.merge {
        return farm::merge(folder, args.replace.force, args.json, console);
    }
    if let Some(folder) = &args.long.plan {
        return farm::plan(args, seed, folder, console);
    }
    // What contradicts itself is told before anything is read.
    params(args, seed, DVec3::ZERO)?;
    let output = args.output()?;
    prepare(args, args.replace.force)?;
    if args.long.dry_run {
        let _lock = lock::lock(output, console)?;
        let read = read(args, console)?;
        let params = params(args, seed, read.scene.offset)?;
        return estimate::estimate(&read, &params, args.shading(), console)?.tell(output, args.json, console);
    }
    let lock = lock::lock(output, console)?;
    let start = Instant::now();
    let read = read(args, console)?;
    let params = params(args, seed, read.scene.offset)?;
    let kept = match args.long.resume {
        true => Some(Kept::beside(output, args.long.keep_units)?),
        false => None,
    };
    let job = Job {
        params: &params,
        shading: args.shading(),
        lights: read.lights.as_ref(),
        source_hash: read.source_hash,
        kept,
        checked: true,
        force: args.replace.force,
        until: None,
    };
    let import_seconds = start.elapsed().as_secs_f64();
    let result = match args.target_error {
        Some(target) => {
            let order = target::Order {
                job: &job,
                target,
                output,
            };
            let (mut baked, seconds) = timed(|| target::search(&order, &read.scene, console))?;
            let own: f64 = baked.stats.seconds.iter().map(|stage| stage.1).sum();
            baked.stats.seconds.push(("search", seconds - own));
            let before = import_seconds + seconds;
            store(baked, &job, output, before, import_seconds, console)?
        }
        None => run_job(&job, read.scene, output, import_seconds, console)?,
    };
    drop(lock);
    tell(&result, args.strict, args.json, console)
}
