//! What a bake will take, from a small bake of the same scene: `--dry-run`.
//!
//! The small bake has all levels and four times the distances, so a tenth to a sixteenth of the points. How many a bake will
//! have is seen by spreading those of all levels but the finest. What grows with them is scaled up by powers that were
//! fitted on the scenes of docs/notebook/reliability.md.

use super::job::Inputs;
use crate::console::{BakeProgress, Console};
use crate::failure::{Failure, Outcome};
use crate::output::{self, SCHEMA};
use crate::words;
use relight_bake::links::operators::bounce_levels;
use relight_bake::memory::{self, of_points};
use relight_bake::params::BakeParams;
use relight_bake::{Baked, Request, bake, coarse_radius, disk, point_counts};
use relight_format as format;
use relight_scene::traced::Shading;
use serde::Serialize;
use std::path::Path;
use std::time::Instant;

/// Ratio of distances of the small bake to those of the real one: two levels.
const COARSER: f32 = 4.0;

/// What a bake will take.
#[derive(Clone, Debug, Serialize)]
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
    /// Most memory at once, bytes.
    memory_bytes: u64,
    /// Of that what reconstructed rows take.
    row_bytes: u64,
}

/// What `--dry-run` prints.
#[derive(Serialize)]
struct DryRunReport<'a> {
    schema: u32,
    command: &'static str,
    dry_run: bool,
    #[serde(flatten)]
    estimate: &'a Estimate,
}

impl Estimate {
    /// Prints it; `target` is where the asset would be.
    pub fn tell(&self, target: &Path, json: bool, console: &Console) -> Result<Outcome, Failure> {
        console.close();
        if let Some(text) = disk::lacks(target, self.bytes) {
            console.note(format!("warning: {text}; the bake refuses unless --force"));
        }
        if let Some(machine) = memory::of_this_machine().filter(|machine| self.memory_bytes > *machine) {
            let machine = words::bytes(machine);
            console.note(format!(
                "That is more memory than this machine has ({machine}): take fewer --levels or a larger --coarse-radius."
            ));
        }
        if json {
            output::print_json(&DryRunReport {
                schema: SCHEMA,
                command: "bake",
                dry_run: true,
                estimate: self,
            })?;
        } else {
            output::print_text(&format!(
                "points   {}\nrays     {}\nlinks    {}\nseconds  {:.0}\nasset    {}\nmemory   {}\n",
                words::count(self.points),
                words::count(self.rays),
                words::count(self.links),
                self.seconds,
                words::bytes(self.bytes),
                words::bytes(self.memory_bytes),
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
    read: &Inputs,
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
        memory: memory::of_this_machine(),
    };
    let quiet = console.silent();
    let progress = BakeProgress::new(&quiet);
    console.begin("Baking small, to see what it takes", None);
    let (traced, radius) = coarse_radius(&request, &progress).map_err(|error| progress.failure(error))?;
    // With the ray caster and decoded textures, which the bake will have, too.
    let before = output::resident_bytes().unwrap_or(0);
    let without_finest = BakeParams {
        levels: params.levels.saturating_sub(1).max(1),
        coarse_radius: Some(radius),
        ..params.clone()
    };
    let request_of = |params| Request {
        params,
        ..request.clone()
    };
    let coarser = point_counts(&traced, &request_of(&without_finest), &progress)
        .map_err(|error| progress.failure(error))?;
    drop(traced);
    let small = BakeParams {
        coarse_radius: Some((radius * COARSER).min(f32::MAX)),
        ..params.clone()
    };
    let baked = bake(&request_of(&small), None, &progress).map_err(|error| progress.failure(error))?;
    let writing = Instant::now();
    let bytes = format::write_asset(&baked.asset)?;
    let written = writing.elapsed().as_secs_f64();
    console.close();
    let estimate = scaled(params, &baked, &coarser, &bytes, (written, before))?;
    console.detail(format!(
        "small bake: {:?} points ({coarser:?} without the finest level), {} bytes, seconds {:?}, memory {before} with the \
         scene, {} for rows",
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

/// Growth of what depends on points with their number; fitted on the scenes of docs/notebook/reliability.md.
///
/// Links per point fall as points get denser, because coarse rows say more of finer ones.
const LINKS_POWER: f64 = 0.775;
/// Matrices between clusters of the bounce level hold more entries per row where these are more: K, and S, whose rows are
/// fuller.
const BOUNCE_POWER: f64 = 1.65;
const SOLUTION_POWER: f64 = 1.8;
/// Reconstructed rows get longer where senders are smaller, but more of them go before the last are made.
const ROWS_POWER: f64 = 0.98;
/// Rays and bytes of points grow a little less than points.
const RAYS: f64 = 0.89;
const POINT_BYTES: f64 = 0.8;
/// Memory per link and per element of a cut
/// (each in the row that made it, in the asset, and in the file), and per light of the cuts' tree.
const MEMORY_PER_LINK: f64 = 32.0;
const MEMORY_PER_ELEMENT: f64 = 10.0;
const MEMORY_PER_LIGHT: f64 = 512.0;
/// What the allocator keeps beside what is in use, whatever the scene: a bake with 67 MB in use took 135.
const MEMORY_KEPT: f64 = 32.0 * 1024.0 * 1024.0;

/// Points of the real bake, and how many times the small bake's they are.
struct Growth {
    points: f64,
    /// Of the finest level.
    finest: f64,
    /// Of each coarser one, which is the small bake's two levels on.
    coarser: Vec<f64>,
}

impl Growth {
    /// From the counts of the small bake and of all levels but the finest at the real distances.
    ///
    /// Were points everywhere, each level had four times as many as the one before; where distances are near the size of
    /// things, the growth from level to level goes on as it was. The finest level of each run is the one that has points
    /// in crevices.
    fn new(small: &[usize], coarser: &[usize]) -> Growth {
        let count = |counts: &[usize], level: usize| counts.get(level).map_or(1.0, |&n| n.max(1) as f64);
        let last = small.len().saturating_sub(1);
        let finest = if last == 0 {
            // The only level was counted.
            count(coarser, 0)
        } else {
            let step = count(coarser, last - 1) / count(small, last);
            count(small, last) * step * step.powf(0.75) * 4.0f64.powf(0.25)
        };
        // Of the level above the finest only those in the open count.
        let in_the_open = match last {
            2.. => count(coarser, last - 2) / count(small, last),
            _ => 1.0,
        };
        let real = |level: usize| count(coarser, level) * if level + 1 == last { in_the_open } else { 1.0 };
        Growth {
            points: (0..last).map(real).sum::<f64>() + finest,
            finest: finest / count(small, last),
            coarser: (0..last).map(|level| real(level) / count(small, level)).collect(),
        }
    }

    fn of_level(&self, level: usize) -> f64 {
        self.coarser.get(level).copied().unwrap_or(self.finest)
    }
}

fn scaled(
    params: &BakeParams,
    baked: &Baked,
    coarser: &[usize],
    bytes: &[u8],
    (written, before): (f64, u64),
) -> Result<Estimate, Failure> {
    let asset = &baked.asset;
    let counts: Vec<usize> = asset.points.iter().map(|l| l.positions.len()).collect();
    let growths = Growth::new(&counts, coarser);
    let growth = growths.finest;
    let points = growths.points;
    let link_growth = growth.powf(LINKS_POWER);
    let links = asset.transfer.as_ref().map_or(0, |t| t.columns.len()) as f64 * link_growth;
    let (bounce_level, _) = bounce_levels(counts.len(), params.sender_levels);
    let clusters = growths.of_level(bounce_level);
    let (bounce_growth, solution_growth) = (clusters.powf(BOUNCE_POWER), clusters.powf(SOLUTION_POWER));
    let bounce = asset.bounce.as_ref().map_or(0, |b| b.matrix.columns.len()) as f64 * bounce_growth;
    let solution = asset.solution.iter().flat_map(|s| &s.channels);
    let solution = solution.map(|c| c.columns.len()).sum::<usize>() as f64 * solution_growth;
    let links = links + bounce + solution;
    let elements = asset.cuts.as_ref().map_or(0, |c| c.heights.len()) as f64 * growth;
    let lights = match asset.light_tree.as_ref().map(|t| &t.lights) {
        Some(format::LightSamples::Environment { order }) => order.len(),
        Some(format::LightSamples::Surface { positions, .. }) => positions.len(),
        None => 0,
    };
    let count = |name: &str| {
        let counts = asset.provenance.counts.iter();
        counts.filter(|c| c.0 == name).map(|c| c.1).sum::<u64>() as f64
    };
    let seconds_of = |stage: &str| {
        let seconds = baked.stats.seconds.iter();
        seconds.filter(|s| s.0 == stage).map(|s| s.1).sum::<f64>()
    };
    let mut size = 0.0;
    for section in &format::summarise(bytes)?.sections {
        size += section.stored_bytes as f64
            * match section.name.as_str() {
                "points" => POINT_BYTES * growth,
                "senders" | "cuts" => growth,
                "links_transfer" => link_growth,
                "links_bounce" => bounce_growth,
                "links_solution" => solution_growth,
                _ => 1.0,
            };
    }
    let rows = baked.stats.row_bytes as f64 * growth.powf(ROWS_POWER);
    let bounce_clusters = clusters * counts.get(bounce_level).map_or(0.0, |&n| n as f64);
    let memory = before as f64
        + MEMORY_KEPT
        + of_points(points, bounce_clusters)
        + MEMORY_PER_LINK * links
        + MEMORY_PER_ELEMENT * elements
        + MEMORY_PER_LIGHT * lights as f64
        + rows;
    let seconds = seconds_of("load")
        + growth * (seconds_of("points") + seconds_of("refine") + seconds_of("cuts") + written)
        // Rows of the solution are as many as clusters, and each as long as the matrix.
        + clusters.powf(1.0 + SOLUTION_POWER) * seconds_of("solve");
    Ok(Estimate {
        points: points as u64,
        rays: (count("rays") * RAYS * growth) as u64,
        links: links as u64,
        seconds,
        bytes: size as u64,
        memory_bytes: memory as u64,
        row_bytes: rows as u64,
    })
}
