//! What a bake will take, from a small bake of the same scene: `--dry-run`, `--memory-limit`.
//!
//! The small bake has all levels and four times the distances, so a sixteenth of the points. What grows with them is
//! scaled up by powers that were fitted on the scenes of docs/reliability.md.

use super::{Read, baking_failed};
use crate::console::{BakeProgress, Console};
use crate::failure::{Failure, Outcome};
use crate::output::{self, SCHEMA};
use crate::words;
use anyhow::anyhow;
use relight_bake::params::BakeParams;
use relight_bake::{Baked, Request, bake_in_units, coarse_radius};
use relight_format as format;
use relight_scene::traced::Shading;
use serde_json::json;
use std::time::Instant;

/// Ratio of distances of the small bake to those of the real one, and so of the numbers of points.
const COARSER: f32 = 4.0;
const POINTS: f64 = (COARSER * COARSER) as f64;

/// What a bake will take.
#[derive(Clone, Debug)]
pub struct Estimate {
    /// Points on all levels.
    points: u64,
    /// Rays of all stages.
    rays: u64,
    /// Links of T, bounces and solution.
    links: u64,
    /// Wall-clock seconds on this machine, as busy as it is now.
    seconds: f64,
    /// Bytes of the asset.
    bytes: u64,
    /// Most memory in one go.
    memory: u64,
    /// Of that what reconstructed rows take, which batches divide.
    rows: u64,
}

/// Most batches: each makes anew the coarse rows that it shares with its neighbours, and rows of the coarsest levels are
/// needed by all.
const MOST_BATCHES: usize = 16;
/// Share of the rows that a batch of n needs, beyond an n-th: those along its border, and the coarsest.
const SHARED_ROWS: f64 = 0.2;

impl Estimate {
    fn memory_in(&self, batches: usize) -> u64 {
        let share = if batches > 1 {
            (1.0 / batches as f64 + SHARED_ROWS).min(1.0)
        } else {
            1.0
        };
        self.memory - self.rows + (self.rows as f64 * share) as u64
    }

    /// The fewest batches that keep within a limit.
    ///
    /// # Errors
    /// None does; the message says what limit would.
    pub fn batches(&self, limit: Option<u64>) -> Result<usize, Failure> {
        let Some(limit) = limit else { return Ok(1) };
        let fits = (1..=MOST_BATCHES).find(|&n| self.memory_in(n) <= limit);
        fits.ok_or_else(|| {
            anyhow!(
                "--memory-limit {limit}: the bake needs about {}; the smallest limit that would do is {}. A larger \
                 --coarse-radius or fewer --levels take less",
                words::bytes(self.memory),
                self.memory_in(MOST_BATCHES)
            )
            .into()
        })
    }

    /// Prints it.
    pub fn tell(&self, json: bool, console: &Console) -> Result<Outcome, Failure> {
        console.close();
        if json {
            output::print_json(&json!({
                "schema": SCHEMA,
                "command": "bake",
                "dry_run": true,
                "points": self.points,
                "rays": self.rays,
                "links": self.links,
                "seconds": self.seconds,
                "bytes": self.bytes,
                "memory_bytes": self.memory,
                "smallest_memory_limit": self.memory_in(MOST_BATCHES),
            }))?;
        } else {
            output::print_text(&format!(
                "points   {}\nrays     {}\nlinks    {}\nseconds  {:.0}\nasset    {}\nmemory   {} (at least {} with --memory-limit)\n",
                words::count(self.points),
                words::count(self.rays),
                words::count(self.links),
                self.seconds,
                words::bytes(self.bytes),
                words::bytes(self.memory),
                words::bytes(self.memory_in(MOST_BATCHES)),
            ))?;
        }
        Ok(Outcome::Done)
    }
}

/// Bakes small and scales up.
///
/// # Errors
/// As the bake itself.
pub fn estimate(
    read: &Read,
    params: &BakeParams,
    shading: Shading,
    console: &Console,
) -> Result<Estimate, Failure> {
    let request = Request {
        scene: read.scene.clone(),
        shading,
        params,
        lights: read.lights.as_ref(),
        source_hash: read.source_hash,
        batches: 1,
    };
    let quiet = console.silent();
    let progress = BakeProgress::new(&quiet);
    console.begin("Baking small, to see what it takes", None);
    let radius = coarse_radius(&request, &progress).map_err(baking_failed)?;
    let before = output::resident_bytes();
    let small = BakeParams {
        coarse_radius: Some(radius * COARSER),
        ..params.clone()
    };
    let request = Request {
        params: &small,
        ..request
    };
    let baked = bake_in_units(&request, None, &progress).map_err(baking_failed)?;
    let peak = output::peak_memory_bytes().unwrap_or(0);
    let writing = Instant::now();
    let bytes = format::write_asset(&baked.asset)?;
    let written = writing.elapsed().as_secs_f64();
    console.close();
    let estimate = scaled(&baked, &bytes, written, before.unwrap_or(0), peak)?;
    console.detail(format!(
        "small bake: {:?} points, {} bytes, seconds {:?}, memory {before:?} to {peak}, of it rows {}",
        baked
            .asset
            .points
            .iter()
            .map(|l| l.positions.len())
            .collect::<Vec<_>>(),
        bytes.len(),
        baked.stats.seconds,
        baked.stats.row_bytes,
    ));
    Ok(estimate)
}

/// Links per point fall as points get denser: coarse rows say more of finer ones.
const LINKS_POWER: f64 = 0.95;
/// Matrices between clusters hold more entries per row where clusters are smaller.
const BOUNCE_POWER: f64 = 1.3;
/// Reconstructed rows get longer where senders are smaller.
const ROWS_POWER: f64 = 1.3;
/// So does the time that a row takes.
const SECONDS_POWER: f64 = 1.1;

fn scaled(baked: &Baked, bytes: &[u8], written: f64, before: u64, peak: u64) -> Result<Estimate, Failure> {
    let asset = &baked.asset;
    let links = asset.transfer.as_ref().map_or(0, |t| t.columns.len()) as f64;
    let bounce = asset.bounce.as_ref().map_or(0, |b| b.matrix.columns.len())
        + asset
            .solution
            .iter()
            .flat_map(|s| &s.channels)
            .map(|c| c.columns.len())
            .sum::<usize>();
    let count = |name: &str| {
        let counts = asset.provenance.counts.iter();
        counts.filter(|c| c.0 == name).map(|c| c.1).sum::<u64>() as f64
    };
    let seconds_of = |stage: &str| {
        let seconds = baked.stats.seconds.iter();
        seconds.filter(|s| s.0 == stage).map(|s| s.1).sum::<f64>()
    };
    let link_growth = POINTS.powf(LINKS_POWER);
    let mut size = 0.0;
    for section in &format::summarise(bytes)?.sections {
        size += section.stored_bytes as f64
            * match section.name.as_str() {
                "points" | "senders" | "cuts" => POINTS,
                "links_transfer" => link_growth,
                "links_bounce" | "links_solution" => POINTS.powf(BOUNCE_POWER),
                _ => 1.0,
            };
    }
    let rows = baked.stats.row_bytes as f64 * POINTS.powf(ROWS_POWER);
    let rest = (peak.saturating_sub(before) as f64 - baked.stats.row_bytes as f64).max(0.0);
    let seconds = seconds_of("load")
        + POINTS * (seconds_of("points") + seconds_of("cuts") + written)
        + POINTS.powf(SECONDS_POWER) * seconds_of("refine")
        + POINTS.powf(2.0 * BOUNCE_POWER) * seconds_of("solve");
    let points: usize = asset.points.iter().map(|l| l.positions.len()).sum();
    Ok(Estimate {
        points: (points as f64 * POINTS) as u64,
        rays: (count("rays") * POINTS) as u64,
        links: (links * link_growth + bounce as f64 * POINTS.powf(BOUNCE_POWER)) as u64,
        seconds,
        bytes: size as u64,
        memory: (before as f64 + rest * POINTS + rows) as u64,
        rows: rows as u64,
    })
}
