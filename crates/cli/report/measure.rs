//! Bakes and plays settings again and again, each time with other random numbers, until their spread is known: one repetition of all
//! settings after another, so that what the machine does beside hits all alike. What was measured is kept, and a later report goes on
//! from there.

use super::cache;
use super::doubt;
use super::measured::{Errors, Measured};
use super::reference::{LAYERS, Reference};
use super::settings::Setting;
use super::task::Task;
use crate::bake::{self, BakeArgs, Job};
use crate::console::Console;
use crate::failure::Failure;
use crate::guard::Guard;
use crate::inspection::Inspection;
use crate::kinds::Kind;
use crate::options::parsed;
use crate::output;
use crate::play::{self, FrameReport, Pace};
use crate::signals::{self, Until};
use relight_scene::image::Layers;
use relight_scene::image::flicker::{Flicker, greys};
use relight_scene::image::metrics::{Comparison, compare, relmse};
use relight_scene::image::{Limits, read_exr, write_atomically};
use relight_scene::scene::Scene;
use relight_scene::traced::Shading;
use serde::{Deserialize, Serialize};
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
    /// Least times that each setting is played.
    pub repetitions: usize,
    /// What times are of: machine, threads and program.
    pub machine: &'a str,
    /// When all must be measured: what is not done by then is stopped.
    pub until: Instant,
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

/// Share of the time that is left above which a setting is not played again.
const SLOW: f64 = 0.04;

/// Measures settings until the spread of all is known or it is time to stop; also returns those that found no time.
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
    console.begin("Measuring settings", Some(settings.len() as u64));
    let frames = runs.references.len() as f64;
    for (done, setting) in settings.iter().enumerate() {
        console.advance_to(done as u64);
        if let Some(kept) = kept(runs, setting, console)? {
            measured.push(kept);
            continue;
        }
        // Another bake takes about as long as the first one did.
        let bake =
            bake_seconds(runs.base_bake).filter(|_| !setting.bake.is_empty() && !is_baked(runs, setting));
        let ready = Instant::now() + Duration::from_secs_f64(bake.unwrap_or(0.0).clamp(0.0, 1e6));
        let left = runs.until.saturating_duration_since(Instant::now()).as_secs_f64();
        let slow = predicted(setting, &measured).is_some_and(|seconds| seconds * frames > MOST * left);
        // One is measured whatever time there is.
        let until = (!measured.is_empty()).then_some(runs.until);
        if (slow || ready > runs.until) && until.is_some() {
            skipped.push(setting.clone());
            continue;
        }
        match first(runs, setting, until, console) {
            Ok(one) => {
                console.detail(format!(
                    "{}: error {:.4}, {:.1} ms a frame",
                    setting.label(),
                    one.judged().relative(),
                    one.ms()
                ));
                measured.push(one);
            }
            Err(error) if is_over(until, &error) => skipped.push(setting.clone()),
            Err(error) => return Err(error),
        }
    }
    repeated(runs, &mut measured, console)?;
    Ok((measured, skipped))
}

/// Plays on what is not settled, one repetition of each after another.
fn repeated(runs: &Runs, measured: &mut [Measured], console: &Console) -> Result<(), Failure> {
    let until = Some(runs.until);
    console.begin("Repeating until spreads are known", Some(measured.len() as u64));
    loop {
        let (mut played, mut settled) = (false, 0);
        for one in measured.iter_mut() {
            if one.is_settled(runs.repetitions) {
                settled += 1;
                continue;
            }
            // What is slow is played fewer times, so that all that is quick is played often.
            let left = runs.until.saturating_duration_since(Instant::now());
            if one.ms() * runs.references.len() as f64 > 1e3 * SLOW * left.as_secs_f64() {
                continue;
            }
            match play_once(runs, one, until, console) {
                Ok(()) => played = true,
                Err(error) if is_over(until, &error) => return Ok(()),
                Err(error) => return Err(error),
            }
        }
        console.advance_to(settled);
        if !played {
            return Ok(());
        }
    }
}

/// Whether something failed because its time was over.
fn is_over(until: Option<Instant>, error: &Failure) -> bool {
    matches!(error, Failure::Stopped(_))
        && !signals::stopped()
        && until.is_some_and(|until| Instant::now() >= until)
}

/// Bakes a setting's asset where that is needed, and plays it once.
fn first(
    runs: &Runs,
    setting: &Setting,
    until: Option<Instant>,
    console: &Console,
) -> Result<Measured, Failure> {
    let mut one = begin(runs, setting, until, console)?;
    play_once(runs, &mut one, until, console)?;
    Ok(one)
}

/// What is kept of a setting from report to report; errors are those of the first repetition's images, which are kept, too.
#[derive(Serialize, Deserialize)]
struct Kept {
    milliseconds: Vec<f64>,
    relmse: BTreeMap<String, Vec<f64>>,
    stages: BTreeMap<String, Vec<f64>>,
    once: Vec<f64>,
    peak_memory: Option<u64>,
}

fn place_of(runs: &Runs, setting: &Setting) -> PathBuf {
    let what = format!(
        "{} {:016x} {}",
        setting.command(),
        runs.base_bake.asset_hash,
        runs.machine
    );
    cache::place(runs.task, "measured", &what, ".json")
}

/// What an earlier report measured of a setting, held against the references as they are now.
fn kept(runs: &Runs, setting: &Setting, console: &Console) -> Result<Option<Measured>, Failure> {
    let text = std::fs::read_to_string(place_of(runs, setting)).unwrap_or_default();
    let Ok(kept) = serde_json::from_str::<Kept>(&text) else {
        return Ok(None);
    };
    if !is_baked(runs, setting) || kept.milliseconds.is_empty() {
        return Ok(None);
    }
    let mut one = begin(runs, setting, None, console)?;
    let here = |frame| one.images.join(format!("frame_{frame:04}.exr")).is_file();
    if !runs.references.iter().all(|reference| here(reference.frame)) {
        return Ok(None);
    }
    judge(runs, &mut one)?;
    for (layer, values) in &kept.relmse {
        // Better references move all repetitions alike.
        let now = one.errors.get(layer.as_str()).map_or(0.0, |errors| errors.relmse);
        let moved = values.iter().map(|value| (value - values[0] + now).max(0.0));
        one.relmse.insert(layer.clone(), moved.collect());
    }
    one.milliseconds = kept.milliseconds;
    one.stages = kept.stages;
    one.once = kept.once;
    one.peak_memory = kept.peak_memory;
    average(&mut one);
    Ok(Some(one))
}

fn keep(runs: &Runs, one: &Measured) -> Result<(), Failure> {
    let file = place_of(runs, &one.setting);
    output::prepare_output(&file)?;
    let kept = Kept {
        milliseconds: one.milliseconds.clone(),
        relmse: one.relmse.clone(),
        stages: one.stages.clone(),
        once: one.once.clone(),
        peak_memory: one.peak_memory,
    };
    let _whole = signals::whole();
    Ok(write_atomically(&file, output::json_text(&kept)?.as_bytes())?)
}

/// Seconds of a bake by itself, without the search for its settings (`--target-error`).
fn bake_seconds(described: &Inspection) -> Option<f64> {
    let seconds = &described.run.as_ref()?.seconds;
    Some(seconds.total - seconds.stages.get("search").unwrap_or(&0.0))
}

/// Bakes a setting's asset, if it isn't there yet.
fn begin(
    runs: &Runs,
    setting: &Setting,
    until: Option<Instant>,
    console: &Console,
) -> Result<Measured, Failure> {
    let (asset, described) = if setting.bake.is_empty() {
        (runs.task.asset.clone(), runs.base_bake.clone())
    } else {
        baked(runs, &setting.bake, until, console)?
    };
    Ok(Measured {
        setting: setting.clone(),
        asset,
        images: cache::place(runs.task, "images", &setting.command(), ""),
        milliseconds: Vec::new(),
        relmse: BTreeMap::new(),
        doubt: BTreeMap::new(),
        stages: BTreeMap::new(),
        once: Vec::new(),
        errors: BTreeMap::new(),
        bake_seconds: bake_seconds(&described),
        described,
        peak_memory: None,
    })
}

fn place_of_asset(runs: &Runs, options: &[String]) -> PathBuf {
    cache::place(runs.task, "assets", &options.join(" "), ".relight")
}

/// Whether a setting's asset is there.
fn is_baked(runs: &Runs, setting: &Setting) -> bool {
    let asset = place_of_asset(runs, &setting.bake);
    setting.bake.is_empty() || (asset.is_file() && asset.with_extension("json").is_file())
}

/// An asset by the given options of `bake`, and what is known of it.
fn baked(
    runs: &Runs,
    options: &[String],
    until: Option<Instant>,
    console: &Console,
) -> Result<(PathBuf, Inspection), Failure> {
    let task = runs.task;
    let asset = place_of_asset(runs, options);
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
        until,
    };
    let result = bake::run_job(&job, runs.scene.clone(), &asset, 0.0, &console.silent())?;
    let known = result.report.inspection;
    let _whole = signals::whole();
    write_atomically(&said, output::json_text(&known)?.as_bytes())?;
    Ok((asset, known))
}

/// Plays a setting once more, by random numbers of this repetition.
fn play_once(
    runs: &Runs,
    one: &mut Measured,
    until: Option<Instant>,
    console: &Console,
) -> Result<(), Failure> {
    let task = runs.task;
    let repetition = one.milliseconds.len();
    // The first one's images are those that are shown.
    let name = ["frame_####.exr", "again_####.exr"][repetition.min(1)];
    let output = one.images.join(name);
    let args = task.play_args(&one.asset, &output, task.frames, &one.setting.play_words())?;
    forget_peak_memory();
    // Not the references' seed: they must not share random numbers.
    let seed = task.seed ^ (1 + repetition as u64);
    let mut errors: BTreeMap<String, f64> = BTreeMap::new();
    let mut failed = None;
    let watch = Until(until);
    let played = play::play_watched(
        &args,
        seed,
        &console.silent(),
        Pace::OneByOne,
        &watch,
        |frame, layers| {
            if let Err(error) = add_errors(runs, one, frame, layers, &mut errors) {
                failed.get_or_insert(error);
            }
        },
    )?;
    if let Some(error) = failed {
        return Err(error);
    }
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
        one.stages.entry((*name).to_owned()).or_default().push(mean(name));
    }
    one.once.push(played.once_per_shot.of_shot());
    for (layer, error) in errors {
        one.relmse.entry(layer).or_default().push(error);
    }
    if repetition == 0 {
        judge(runs, one)?;
    } else {
        for frame in task.frames.iter() {
            // What stays is written over.
            let _ = args.output_of(frame).map(std::fs::remove_file);
        }
    }
    average(one);
    keep(runs, one)
}

/// Layers by which a setting is judged.
fn layers_of(one: &Measured) -> impl Iterator<Item = &'static str> + use<> {
    let direct_only = one.setting.layer == "direct";
    LAYERS
        .into_iter()
        .filter(move |layer| !direct_only || *layer == "direct")
}

/// Adds a frame's share of relMSE by layer.
fn add_errors(
    runs: &Runs,
    one: &Measured,
    frame: u32,
    image: &Layers,
    errors: &mut BTreeMap<String, f64>,
) -> Result<(), Failure> {
    let Some(reference) = runs.references.iter().find(|reference| reference.frame == frame) else {
        return Ok(());
    };
    for layer in layers_of(one) {
        if let (Some(a), Some(b)) = (image.rgb(layer), reference.layers.rgb(layer)) {
            *errors.entry(layer.to_owned()).or_default() += relmse(&a, &b)? / runs.references.len() as f64;
        }
    }
    Ok(())
}

/// relMSE is the mean over all repetitions, the other errors are those of the first.
fn average(one: &mut Measured) {
    for (layer, errors) in &mut one.errors {
        if let Some(values) = one.relmse.get(*layer).filter(|values| !values.is_empty()) {
            errors.relmse = values.iter().sum::<f64>() / values.len() as f64;
        }
    }
}

/// Lets the system measure the most memory anew, where it can.
fn forget_peak_memory() {
    // Where it can't, the figure is that of the whole process so far: too large, never too small.
    let _ = std::fs::write("/proc/self/clear_refs", "5");
}

/// Errors of the first repetition's images, and what the references' noise may do to them.
fn judge(runs: &Runs, one: &mut Measured) -> Result<(), Failure> {
    let mut sums: BTreeMap<&'static str, Errors> = BTreeMap::new();
    let mut doubts: BTreeMap<&'static str, f64> = BTreeMap::new();
    let share = 1.0 / runs.references.len() as f64;
    let mut frames: BTreeMap<&'static str, Vec<Vec<f32>>> = BTreeMap::new();
    for reference in runs.references {
        let image = read_exr(
            &one.images.join(format!("frame_{:04}.exr", reference.frame)),
            &Limits::default(),
        )?;
        for layer in layers_of(one) {
            if let Some(found) = compared(&image, &reference.layers, layer)? {
                let sum = sums.entry(layer).or_default();
                sum.rmse += found.rmse * found.rmse * share;
                sum.relmse += found.relmse * share;
                sum.floor += reference.floor_of(layer) * share;
                sum.bias += found.bias * share;
                sum.flip += found.flip * share;
                sum.p99 = sum.p99.max(found.relative_error_p99);
            }
            if let Some(picture) = image.rgb(layer).filter(|_| runs.task.frames.step == 1) {
                frames.entry(layer).or_default().push(greys(&picture));
            }
            let halves = reference
                .halves
                .as_ref()
                .map(|halves| halves.each_ref().map(|half| half.rgb(layer)));
            if let (Some(image), Some([Some(a), Some(b)])) = (image.rgb(layer), halves) {
                *doubts.entry(layer).or_default() += (share * doubt::of_reference(&image, [&a, &b])).powi(2);
            }
        }
    }
    sums.values_mut().for_each(|sum| sum.rmse = sum.rmse.sqrt());
    for (layer, frames) in frames {
        if let Some(sum) = sums.get_mut(layer) {
            sum.flicker = Flicker::of(frames).map(|flicker| flicker.p99);
        }
    }
    doubts.values_mut().for_each(|doubt| *doubt = doubt.sqrt());
    one.errors = sums;
    one.doubt = doubts;
    Ok(())
}

/// `None` where one of them lacks the layer.
fn compared(image: &Layers, reference: &Layers, layer: &str) -> Result<Option<Comparison>, Failure> {
    let (Some(a), Some(b)) = (image.rgb(layer), reference.rgb(layer)) else {
        return Ok(None);
    };
    Ok(Some(compare(&a, &b)?))
}
