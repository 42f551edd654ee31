//! `relight report`: error against run time, bake time and size, over settings and integrators.
//!
//! The way of a report: [`settings`] lists what to try, [`mod@reference`] path-traces what all are judged by, [`measure`]
//! bakes and plays them, [`findings`] finds the Pareto fronts and says in words what they mean, [`page`] and [`plot`]
//! show it.

mod bitmap;
mod cache;
mod doubt;
mod drawing;
mod findings;
mod measure;
mod measured;
mod page;
mod pictures;
mod plot;
mod reference;
mod settings;
mod shape;
mod summary;
mod tables;
mod task;
mod ticks;

use crate::bake;
use crate::console::Console;
use crate::failure::{Failure, Outcome};
use crate::frames::{self, FrameRange};
use crate::guard::Guard;
use crate::inspection::{BakeLog, Inspection};
use crate::kinds::{self, Kind, Wanted};
use crate::options::{ReplaceArgs, whole};
use crate::output::{self, SCHEMA};
use crate::play;
use crate::signals;
use crate::words;
use anyhow::Context;
use clap::Args;
use measure::Runs;
use measured::Measured;
use reference::Reference;
use relight_format::{self as format, Estimates, Limits};
use relight_play::Player;
use relight_play::open::{Sections, asset_hash};
use relight_scene::image::{write_atomically, write_png};
use relight_scene::sequence::{Sequence, read_sequence_at};
use settings::{Facts, Setting};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use summary::Summary;
use task::Task;

/// Measure error against run time, bake time and size, and show it.
///
/// Path-traces references of some frames, whose own error is known from two independent halves; plays the asset with
/// every integrator over a range of its options, and bakes the scene in it again with other options; writes
/// report.html (plots, pictures with error maps, tables; opens offline), report.json, report.csv, plots/*.svg and *.png.
/// Settings are played again and again, with other random numbers, until the spread of times and errors is known; what differs by less
/// counts as equal. References, bakes and measurements are kept in DIR by what they are of: a report that was stopped, or had too
/// little time, goes on when it is run again.
#[derive(Args)]
pub struct ReportArgs {
    /// Asset to report on.
    #[arg(value_name = "ASSET.relight")]
    pub asset: PathBuf,
    /// Lighting sequence.
    #[arg(long, value_name = "SEQ.json")]
    pub lights: PathBuf,
    /// Folder for everything that is written.
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// One frame, 240 pixels wide, the most telling settings, within 8 minutes; the default.
    #[arg(long, conflicts_with = "full")]
    pub quick: bool,
    /// Three frames, 480 pixels wide, all settings, within 2 hours.
    #[arg(long)]
    pub full: bool,
    /// Time for everything, such as 90s, 10m or 2h, which is kept: a third at most goes into references; settings that find no time
    /// any more are named. At least one pass of each reference and one setting are measured.
    #[arg(long, value_name = "TIME", value_parser = parse_duration)]
    pub budget: Option<Duration>,
    /// Frames that will be played with a bake, over which its time counts [default: those of the sequence].
    #[arg(long, value_name = "N", value_parser = whole::<u32>(1, 1_000_000_000))]
    pub frames_planned: Option<u32>,
    /// Folder with references instead of path tracing them: frame_0000.exr, or two independent halves,
    /// frame_0000_a.exr and frame_0000_b.exr, by which their own error is known.
    #[arg(long, value_name = "DIR")]
    pub reference: Option<PathBuf>,
    /// Frames to measure, both ends included, every Nth [default: one or three, evenly over the sequence].
    #[arg(long, value_name = "A-BxN", value_parser = frames::parse_range)]
    pub frames: Option<FrameRange>,
    /// Size of the images in pixels.
    #[arg(long, value_name = "WxH", value_parser = frames::parse_size)]
    pub size: Option<(usize, usize)>,
    #[command(flatten)]
    pub replace: ReplaceArgs,
    /// Print report.json on stdout, too.
    #[arg(long)]
    pub json: bool,
}

/// What a preset means.
struct Preset {
    name: &'static str,
    width: usize,
    frames: u32,
    budget: Duration,
    /// Repetitions of each timing.
    repetitions: usize,
}

const QUICK: Preset = Preset {
    name: "quick",
    width: 240,
    frames: 1,
    // Less than the ten minutes that are promised: the setting that is being measured at the end is finished.
    budget: Duration::from_secs(8 * 60),
    repetitions: 3,
};
const FULL: Preset = Preset {
    name: "full",
    width: 480,
    frames: 3,
    budget: Duration::from_secs(2 * 3600),
    repetitions: 5,
};

/// Share of the budget that references may take.
const REFERENCE_SHARE: f64 = 1.0 / 3.0;
/// Share of the budget that is left to draw and write pages.
const PAGES_SHARE: f64 = 0.05;

fn parse_duration(text: &str) -> Result<Duration, String> {
    let expected = || "expected a time such as 90s, 10m or 2h".to_owned();
    let (number, unit) = text.split_at(text.find(|c: char| c.is_ascii_alphabetic()).unwrap_or(text.len()));
    let seconds = match unit {
        "s" => 1.0,
        "m" => 60.0,
        "h" => 3600.0,
        _ => return Err(expected()),
    };
    match number.parse::<f64>() {
        Ok(n) if n > 0.0 && n * seconds < 1e9 => Ok(Duration::from_secs_f64(n * seconds)),
        _ => Err(expected()),
    }
}

/// Runs the command.
pub fn run(args: &ReportArgs, seed: u64, console: &Console) -> Result<Outcome, Failure> {
    let preset = if args.full { FULL } else { QUICK };
    let start = Instant::now();
    let budget = args.budget.unwrap_or(preset.budget);
    kinds::check(&args.asset, Wanted::Asset)?;
    kinds::check(&args.lights, Wanted::Lights)?;
    kinds::check_file(&args.lights, "a report reads it for every frame")?;
    let guard = guard(args);
    for (name, kind) in PAGES {
        guard.check(&args.output.join(name), kind)?;
    }
    output::prepare_output(&args.output.join("report.json"))?;
    let asset = format::read_file(&args.asset, &Limits::default())
        .with_context(|| args.asset.display().to_string())?;
    let sequence = read_sequence_at(&args.lights, asset.provenance.offset().unwrap_or_default().into())?;
    let described = described(&args.asset, &asset)?;
    let facts = Facts::new(&asset, &sequence);
    let frames = args
        .frames
        .unwrap_or_else(|| evenly(sequence.frames, preset.frames));
    frames.check(sequence.frames)?;
    let planned = args.frames_planned.unwrap_or(sequence.frames.max(1));
    let scene_key = cache::scene_key(&asset, &sequence, &args.lights)?;
    let player = Player::of_asset(asset, asset_hash(&args.asset)?, &args.asset, Sections::Scene)?;
    let size = match args.size {
        Some(size) => size,
        None => default_size(&player, &sequence, preset.width)?,
    };
    let task = Task {
        folder: args.output.clone(),
        asset: args.asset.clone(),
        lights: args.lights.clone(),
        frames,
        size,
        seed,
        key: cache::task_key(scene_key, frames, size, seed),
    };
    let until = start + budget.mul_f64(REFERENCE_SHARE);
    let references: Vec<Reference> = match &args.reference {
        Some(folder) => reference::read(&task, folder)?,
        None => reference::converge(&task, until, console)?,
    };
    let settings = settings::sweep(&facts, args.full);
    let times_of = format!(
        "{} {} {:x}",
        machine(),
        rayon::current_num_threads(),
        bake::this_program()
    );
    let runs = Runs {
        task: &task,
        scene: player.scene().clone(),
        shading: facts.shading,
        references: &references,
        base_bake: &described,
        repetitions: preset.repetitions,
        machine: &times_of,
        until: start + budget.mul_f64(1.0 - PAGES_SHARE),
    };
    let (measured, skipped) = measure::all(&runs, &settings, console)?;
    let summary = summary(
        args,
        &preset,
        &task,
        &described,
        player.estimates.as_ref(),
        &references,
        &measured,
        &skipped,
        planned,
        start,
    );
    write_report(&task, &summary, &measured, &references, &guard)?;
    console.close();
    for sentence in &summary.findings {
        console.note(sentence);
    }
    console.note(format!("Wrote {}.", task.folder.join("report.html").display()));
    if args.json {
        output::print_json(&summary)?;
    }
    Ok(Outcome::Done)
}

/// The files of a report, but for plots.
const PAGES: [(&str, Kind); 3] = [
    ("report.json", Kind::Json),
    ("report.csv", Kind::Table),
    ("report.html", Kind::Html),
];

/// Knows what a report reads.
fn guard(args: &ReportArgs) -> Guard {
    let references = args.reference.iter().flat_map(std::fs::read_dir).flatten();
    let references: Vec<PathBuf> = references.flatten().map(|entry| entry.path()).collect();
    let inputs = [&args.asset, &args.lights].into_iter().chain(&references);
    Guard::new(args.replace.force).reads(inputs.map(PathBuf::as_path))
}

/// What is known of the asset, with what its bake took from the log beside it, if there is one.
fn described(path: &Path, asset: &format::Asset) -> Result<Inspection, Failure> {
    let inspection = Inspection::of_asset(path, asset)?;
    Ok(match BakeLog::beside(path) {
        Ok(Some(log)) => inspection.with_run(log.run),
        _ => inspection,
    })
}

/// So many frames of a sequence, the first among them.
fn evenly(frames: u32, wanted: u32) -> FrameRange {
    let step = frames.div_ceil(wanted).max(1);
    FrameRange {
        first: 0,
        last: (frames.max(1) - 1) / step * step,
        step,
    }
}

fn default_size(player: &Player, sequence: &Sequence, width: usize) -> Result<(usize, usize), Failure> {
    let (w, h) = play::default_size(&player.camera(sequence, None)?);
    Ok((width, (width * h).div_ceil(w).max(1)))
}

fn summary<'a>(
    args: &ReportArgs,
    preset: &Preset,
    task: &Task,
    asset: &'a Inspection,
    estimates: Option<&Estimates>,
    references: &[Reference],
    measured: &'a [Measured],
    skipped: &[Setting],
    planned: u32,
    start: Instant,
) -> Summary<'a> {
    let front = findings::pareto(measured);
    let settings = measured.iter().zip(&front);
    Summary {
        schema: SCHEMA,
        command: "report",
        preset: preset.name,
        asset,
        lights: args.lights.display().to_string(),
        frames: task.frames.iter().collect(),
        frames_planned: planned,
        width: task.size.0,
        height: task.size.1,
        seed: task.seed,
        machine: machine(),
        threads: rayon::current_num_threads(),
        error_measure: "root of relMSE less the reference's own error",
        references: references.iter().map(Reference::summary).collect(),
        settings: settings.map(|(m, &pareto)| m.summary(pareto)).collect(),
        not_measured: skipped.iter().map(Setting::command).collect(),
        findings: findings::sentences(measured, references, skipped.len(), planned, estimates),
        commands: commands(task, references, measured),
        seconds: start.elapsed().as_secs_f64(),
    }
}

/// Every command that does by hand what was done.
fn commands(task: &Task, references: &[Reference], measured: &[Measured]) -> Vec<String> {
    let frames = task.frames;
    let common = format!(
        "--lights {} --size {}x{} --frames {}-{}x{} --float",
        task.lights.display(),
        task.size.0,
        task.size.1,
        frames.first,
        frames.last,
        frames.step
    );
    let asset = task.asset.display();
    let traced = references.iter().filter_map(|r| r.spp.map(|spp| (r.frame, spp))).flat_map(|(frame, spp)| {
        ["a", "b"].map(|half| {
            format!(
                "relight play {asset} --integrator path --spp {} {common} -o frame_{frame:04}_{half}.exr --seed ...",
                spp / 2
            )
        })
    });
    let all = measured
        .iter()
        .map(|m| m.setting.command_of(&asset.to_string(), &common, task.seed));
    traced.chain(all).collect()
}

/// Processor and number of cores, as far as the system says.
fn machine() -> String {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let info = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = info
        .lines()
        .find_map(|line| line.strip_prefix("model name")?.split_once(':'))
        .map_or("unknown processor", |(_, name)| name.trim());
    format!("{model}, {}", words::plural(cores, "core"))
}

fn write_report(
    task: &Task,
    summary: &Summary,
    measured: &[Measured],
    references: &[Reference],
    guard: &Guard,
) -> Result<(), Failure> {
    let write = |name: &str, kind: Kind, text: &str| -> Result<(), Failure> {
        let path = task.folder.join(name);
        guard.check(&path, kind)?;
        output::prepare_output(&path)?;
        Ok(write_atomically(&path, text.as_bytes())?)
    };
    let plots = plot::all(measured, references);
    let _whole = signals::whole();
    for plot in &plots {
        write(&format!("plots/{}.svg", plot.name), Kind::Svg, &plot.svg)?;
        let picture = task.folder.join(format!("plots/{}.png", plot.name));
        guard.check(&picture, Kind::Png)?;
        write_png(&picture, &plot.png)?;
    }
    let texts = [
        output::json_text(summary)?,
        page::csv(measured),
        page::html(task, summary, measured, references, &plots)?,
    ];
    for ((name, kind), text) in PAGES.iter().zip(&texts) {
        write(name, *kind, text)?;
    }
    Ok(())
}
