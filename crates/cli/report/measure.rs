//! Bakes and plays settings: errors once, times again and again, one repetition of all settings after another, so that
//! what the machine does beside hits all alike.

use super::cache;
use super::reference::{LAYERS, Reference};
use super::settings::Setting;
use super::task::Task;
use crate::bake::{self, BakeArgs, Job};
use crate::console::Console;
use crate::failure::Failure;
use crate::guard::Guard;
use crate::inspection::{Bytes, Inspection};
use crate::kinds::Kind;
use crate::options::parsed;
use crate::output;
use crate::play::{self, FrameReport, Pace};
use crate::signals;
use crate::statistics::median;
use relight_scene::image::Layers;
use relight_scene::image::metrics::{Comparison, compare};
use relight_scene::image::{Limits, read_exr, write_atomically};
use relight_scene::scene::Scene;
use relight_scene::traced::Shading;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// How to measure.
pub struct Runs<'a> {
    /// What all have in common.
    pub task: &'a Task,
    /// The scene of the asset, for other bakes.
    pub scene: Arc<Scene>,
    /// How the asset evaluates materials.
    pub shading: Shading,
    /// What they are judged by.
    pub references: &'a [Reference],
    /// What is known of the asset's own bake.
    pub base_bake: &'a Inspection,
    /// Times each setting is timed.
    pub repetitions: usize,
    /// When no new setting is begun.
    pub until: Instant,
}

/// Errors of a layer over all frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Errors {
    /// Root of the mean square over the frames.
    pub rmse: f64,
    /// Mean over the frames.
    pub relmse: f64,
    /// The references' own, mean over the frames.
    #[serde(rename = "floor_relmse")]
    pub floor: f64,
    /// Mean over the frames.
    pub bias: f64,
    /// Mean over the frames.
    pub flip: f64,
    /// Largest of the frames.
    pub p99: f64,
}

impl Errors {
    /// Root of relMSE less the reference's own error.
    pub fn relative(&self) -> f64 {
        (self.relmse - self.floor).max(0.0).sqrt()
    }
}

/// A setting and what came of it.
pub struct Measured {
    /// What was tried.
    pub setting: Setting,
    /// The asset that was played.
    pub asset: PathBuf,
    /// Where frames are: one EXR per frame, `frame_0000.exr`.
    pub images: PathBuf,
    /// Milliseconds a frame (mean over the frames), one per repetition.
    pub milliseconds: Vec<f64>,
    /// Stages of a frame, likewise.
    pub stages: BTreeMap<&'static str, Vec<f64>>,
    /// Milliseconds of what a standing camera needs once.
    pub once: Vec<f64>,
    /// By the names of [`LAYERS`]; those that the integrator makes.
    pub errors: BTreeMap<&'static str, Errors>,
    /// Seconds of the bake; `None` where no log says.
    pub bake_seconds: Option<f64>,
    /// What `inspect` says of the asset.
    pub described: Inspection,
    /// Most memory during play, bytes.
    pub peak_memory: Option<u64>,
}

impl Measured {
    /// Errors of the layer by which the setting is judged.
    pub fn judged(&self) -> Errors {
        self.errors.get(self.setting.layer).copied().unwrap_or_default()
    }

    /// Error of indirect light, which `bake --target-error` speaks of.
    pub fn indirect(&self) -> Option<f64> {
        self.errors.get("indirect").map(Errors::relative)
    }

    /// Whether it is the first that plays its asset in the order of measuring: the asset itself, or one baked for it.
    pub fn is_another_asset(&self) -> bool {
        self.needs_bake() && self.setting.play.is_empty() && matches!(self.setting.integrator, "auto")
    }

    /// Rays of the bake, or nothing where nothing was baked.
    pub fn bake_rays(&self) -> Option<u64> {
        self.described.rays.filter(|_| self.needs_bake())
    }

    /// Median milliseconds a frame.
    pub fn ms(&self) -> f64 {
        median(self.milliseconds.iter().copied())
    }

    /// Median milliseconds of what a standing camera needs once.
    pub fn once_ms(&self) -> f64 {
        median(self.once.iter().copied())
    }

    /// Bytes of the asset file.
    pub fn asset_bytes(&self) -> u64 {
        self.described.bytes.total
    }

    /// Whether the integrator needs what the bake made.
    pub fn needs_bake(&self) -> bool {
        !matches!(
            self.setting.integrator,
            "path" | "brute" | "lightcuts" | "pixelcuts"
        )
    }

    /// For the report; `pareto`: nothing is both faster and nearer.
    pub fn summary(&self, pareto: bool) -> SettingSummary<'_> {
        let judged = self.judged();
        let knobs = self.setting.varied.iter().chain(&self.setting.play);
        SettingSummary {
            integrator: self.setting.integrator,
            knobs: knobs
                .map(|(option, value)| {
                    let number = value.parse().map(Knob::Number);
                    let name = option.trim_start_matches('-').replace('-', "_");
                    (name, number.unwrap_or(Knob::Word(value)))
                })
                .collect(),
            label: self.setting.label(),
            command: self.setting.command(),
            layer: self.setting.layer,
            ms_per_frame: self.ms(),
            ms_by_stage: (self.stages.iter())
                .map(|(name, values)| (*name, median(values.iter().copied())))
                .collect(),
            ms_once_per_shot: self.once_ms(),
            repetitions: &self.milliseconds,
            bake_seconds: self.bake_seconds,
            asset_bytes: self.asset_bytes(),
            bytes: &self.described.bytes,
            rays: self.described.rays,
            error: judged.relative(),
            error_indirect: self.indirect(),
            rmse: judged.rmse,
            relmse: judged.relmse,
            bias: judged.bias,
            flip: judged.flip,
            p99: judged.p99,
            layers: &self.errors,
            peak_memory_bytes: self.peak_memory,
            pareto,
        }
    }
}

/// What a report's JSON says of a setting.
#[derive(Serialize)]
pub struct SettingSummary<'a> {
    integrator: &'static str,
    /// What differs from the asset and from the integrator's defaults, by the options' names.
    knobs: BTreeMap<String, Knob<'a>>,
    label: String,
    command: String,
    layer: &'static str,
    ms_per_frame: f64,
    ms_by_stage: BTreeMap<&'static str, f64>,
    ms_once_per_shot: f64,
    repetitions: &'a [f64],
    bake_seconds: Option<f64>,
    asset_bytes: u64,
    bytes: &'a Bytes,
    rays: Option<u64>,
    error: f64,
    error_indirect: Option<f64>,
    rmse: f64,
    relmse: f64,
    bias: f64,
    flip: f64,
    p99: f64,
    layers: &'a BTreeMap<&'static str, Errors>,
    peak_memory_bytes: Option<u64>,
    pareto: bool,
}

/// An option's value.
#[derive(Serialize)]
#[serde(untagged)]
enum Knob<'a> {
    Number(f64),
    Word(&'a str),
}

/// Seconds of a frame that a setting with more samples will take, if one with fewer was measured.
fn predicted(setting: &Setting, measured: &[Measured]) -> Option<f64> {
    fn split(setting: &Setting) -> (Option<f64>, Vec<&(&'static str, String)>) {
        let spp = setting.play.iter().find(|o| o.0 == "--spp");
        let others = setting.play.iter().filter(|o| o.0 != "--spp").collect();
        (spp.and_then(|o| o.1.parse().ok()), others)
    }
    let (spp, others) = split(setting);
    let alike = |m: &&Measured| {
        m.setting.integrator == setting.integrator
            && m.setting.bake == setting.bake
            && split(&m.setting).1 == others
    };
    let last = measured.iter().rfind(alike)?;
    Some(last.ms() * 1e-3 * spp? / split(&last.setting).0?)
}

/// Share of the time that is left that a single setting may take.
const MOST: f64 = 0.15;

/// Share of the time that is left above which a setting is not timed again.
const SLOW: f64 = 0.04;

/// Measures settings until all are or it is time to stop; also returns those that found no time.
///
/// # Errors
/// A bake or a play fails; a signal asks to stop.
pub fn all(
    runs: &Runs,
    settings: &[Setting],
    console: &Console,
) -> Result<(Vec<Measured>, Vec<Setting>), Failure> {
    let mut measured: Vec<Measured> = Vec::new();
    let mut skipped = Vec::new();
    console.begin(
        "Measuring settings",
        Some((settings.len() * runs.repetitions) as u64),
    );
    let mut done = 0;
    let frames = runs.references.len() as f64;
    for setting in settings {
        // Another bake takes about as long as the first one did.
        let bake = bake_seconds(runs.base_bake).filter(|_| !setting.bake.is_empty());
        let ready = Instant::now() + Duration::from_secs_f64(bake.unwrap_or(0.0).clamp(0.0, 1e6));
        let left = runs.until.saturating_duration_since(Instant::now()).as_secs_f64();
        let slow = predicted(setting, &measured).is_some_and(|seconds| seconds * frames > MOST * left);
        if (slow || ready > runs.until) && !measured.is_empty() {
            skipped.push(setting.clone());
            continue;
        }
        let mut one = begin(runs, setting, console)?;
        play_once(runs, &mut one, console)?;
        one.errors = errors(runs, &one)?;
        console.detail(format!(
            "{}: error {:.4}, {:.1} ms a frame",
            setting.label(),
            one.judged().relative(),
            one.ms()
        ));
        measured.push(one);
        done += 1;
        console.advance_to(done);
    }
    for _ in 1..runs.repetitions {
        if Instant::now() > runs.until {
            break;
        }
        for one in &mut measured {
            // What is slow is timed fewer times, so that all that is quick is timed often.
            let left = runs.until.saturating_duration_since(Instant::now());
            if one.ms() * runs.references.len() as f64 > 1e3 * SLOW * left.as_secs_f64() {
                continue;
            }
            play_once(runs, one, console)?;
            done += 1;
            console.advance_to(done);
        }
    }
    Ok((measured, skipped))
}

/// Seconds of a bake by itself, without the search for its settings (`--target-error`).
fn bake_seconds(described: &Inspection) -> Option<f64> {
    let seconds = &described.run.as_ref()?.seconds;
    Some(seconds.total - seconds.stages.get("search").unwrap_or(&0.0))
}

/// Bakes a setting's asset, if it isn't there yet.
fn begin(runs: &Runs, setting: &Setting, console: &Console) -> Result<Measured, Failure> {
    let (asset, described) = if setting.bake.is_empty() {
        (runs.task.asset.clone(), runs.base_bake.clone())
    } else {
        baked(runs, &setting.bake, console)?
    };
    Ok(Measured {
        setting: setting.clone(),
        asset,
        images: cache::place(runs.task, "images", &setting.command(), ""),
        milliseconds: Vec::new(),
        stages: BTreeMap::new(),
        once: Vec::new(),
        errors: BTreeMap::new(),
        bake_seconds: bake_seconds(&described),
        described,
        peak_memory: None,
    })
}

/// An asset by the given options of `bake`, and what is known of it.
fn baked(runs: &Runs, options: &[String], console: &Console) -> Result<(PathBuf, Inspection), Failure> {
    let task = runs.task;
    let asset = cache::place(task, "assets", &options.join(" "), ".relight");
    let said = asset.with_extension("json");
    let kept = std::fs::read_to_string(&said).ok();
    if let Some(known) = kept.and_then(|text| serde_json::from_str(&text).ok())
        && asset.exists()
    {
        return Ok((asset, known));
    }
    // Reports of assets of other reports.
    Guard::new(false)
        .reads([task.asset.as_path()])
        .check(&asset, Kind::Asset)?;
    output::prepare_output(&asset)?;
    let words: Vec<String> = [
        task.asset.display().to_string(),
        "-o".into(),
        asset.display().to_string(),
    ]
    .into_iter()
    .chain(options.iter().cloned())
    .collect();
    let args: BakeArgs = parsed(&words)?;
    let params = bake::params(&args, task.seed, runs.scene.offset)?;
    let job = Job {
        params: &params,
        shading: runs.shading,
        lights: None,
        source_hash: runs.base_bake.source_hash,
        kept: None,
        // By the references, which know better.
        checked: false,
        force: false,
    };
    let result = bake::run_job(&job, runs.scene.clone(), &asset, 0.0, &console.silent())?;
    let known = result.report.inspection;
    let _whole = signals::whole();
    write_atomically(&said, output::json_text(&known)?.as_bytes())?;
    Ok((asset, known))
}

/// Plays a setting once more.
fn play_once(runs: &Runs, one: &mut Measured, console: &Console) -> Result<(), Failure> {
    let task = runs.task;
    let output = one.images.join("frame_####.exr");
    let args = task.play_args(&one.asset, &output, task.frames, &one.setting.play_words())?;
    forget_peak_memory();
    // Not the references' seed: they must not share random numbers.
    let played = play::play(&args, task.seed ^ 1, &console.silent(), Pace::OneByOne, |_, _| {})?;
    one.peak_memory = one.peak_memory.max(output::peak_memory_bytes());
    let share = 1.0 / played.frames.len().max(1) as f64;
    let mut sums: BTreeMap<&'static str, f64> = BTreeMap::new();
    for (name, value) in played.frames.iter().flat_map(FrameReport::entries) {
        *sums.entry(name).or_default() += value;
    }
    let mean = |name: &str| sums.get(name).copied().unwrap_or(0.0) * share;
    // Writing the picture costs the same for all and is no part of making light.
    one.milliseconds.push(mean("total") - mean("write"));
    for name in sums.keys() {
        one.stages.entry(name).or_default().push(mean(name));
    }
    one.once.push(played.once_per_shot.of_shot());
    Ok(())
}

/// Lets the system measure the most memory anew, where it can.
fn forget_peak_memory() {
    // Where it can't, the figure is that of the whole process so far: too large, never too small.
    let _ = std::fs::write("/proc/self/clear_refs", "5");
}

fn errors(runs: &Runs, one: &Measured) -> Result<BTreeMap<&'static str, Errors>, Failure> {
    let direct_only = one.setting.layer == "direct";
    let mut sums: BTreeMap<&'static str, Errors> = BTreeMap::new();
    for reference in runs.references {
        let image = read_exr(
            &one.images.join(format!("frame_{:04}.exr", reference.frame)),
            &Limits::default(),
        )?;
        for layer in LAYERS.into_iter().filter(|l| !direct_only || *l == "direct") {
            if let Some(found) = compared(&image, &reference.layers, layer)? {
                let sum = sums.entry(layer).or_default();
                let share = 1.0 / runs.references.len() as f64;
                sum.rmse += found.rmse * found.rmse * share;
                sum.relmse += found.relmse * share;
                sum.floor += reference.floor_of(layer) * share;
                sum.bias += found.bias * share;
                sum.flip += found.flip * share;
                sum.p99 = sum.p99.max(found.relative_error_p99);
            }
        }
    }
    sums.values_mut().for_each(|sum| sum.rmse = sum.rmse.sqrt());
    Ok(sums)
}

/// `None` where one of them lacks the layer.
fn compared(image: &Layers, reference: &Layers, layer: &str) -> Result<Option<Comparison>, Failure> {
    let (Some(a), Some(b)) = (image.rgb(layer), reference.rgb(layer)) else {
        return Ok(None);
    };
    Ok(Some(compare(&a, &b)?))
}
