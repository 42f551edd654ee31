//! A bake that is settled: its files read, baked, written and told of.

use super::args::BakeArgs;
use super::kept::{Kept, this_program};
use crate::console::{BakeProgress, Console};
use crate::failure::{Failure, Outcome};
use crate::guard::Guard;
use crate::inspect;
use crate::inspection::{BakeLog, BakeRun, Inspection, Seconds};
use crate::kinds::{self, Kind, Wanted};
use crate::options::LightUnitsName;
use crate::output::{self, SCHEMA, log_path};
use crate::signals::{self, Signals};
use crate::words;
use anyhow::Context;
use relight_bake::params::BakeParams;
use relight_bake::units::Ledger;
use relight_bake::{BakeStats, Baked, Request, bake, memory};
use relight_format as format;
use relight_probes::{Expected, ProbeError, Verdict, check};
use relight_scene::gltf::{ImportOptions, LightUnits, import};
use relight_scene::image::write_atomically;
use relight_scene::scene::Scene;
use relight_scene::sequence::{Sequence, read_sequence_at};
use relight_scene::surface_scene::read_meshed;
use relight_scene::traced::Shading;
use serde::Serialize;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

/// What a bake's files hold.
pub struct Inputs {
    /// The scene.
    pub scene: Arc<Scene>,
    /// Hash of its file.
    pub source_hash: u64,
    /// The only sequence that will be played, if given.
    pub lights: Option<Sequence>,
}

/// Makes sure that a bake's asset and its log can be written, and replace nothing that is lost.
///
/// # Errors
/// One would replace what is read, or something else than what is written, or cannot be written.
pub fn prepare(args: &BakeArgs, force: bool) -> Result<(), Failure> {
    let output = args.output()?;
    let guard = guard(args, force)?;
    for (file, kind) in [(output.to_owned(), Kind::Asset), (log_path(output), Kind::Log)] {
        guard.check(&file, kind)?;
        output::prepare_output(&file)?;
    }
    Ok(())
}

/// Knows what a bake reads.
///
/// # Errors
/// There is no scene.
pub fn guard(args: &BakeArgs, force: bool) -> Result<Guard, Failure> {
    let inputs = [Some(args.scene()?), args.lights.as_deref()];
    Ok(Guard::new(force).reads(inputs.into_iter().flatten()))
}

/// Reads a bake's files.
///
/// # Errors
/// One cannot be read, or a signal asks to stop.
pub fn read(args: &BakeArgs, console: &Console) -> Result<Inputs, Failure> {
    kinds::check(args.scene()?, Wanted::Scene)?;
    if let Some(lights) = &args.lights {
        kinds::check(lights, Wanted::Lights)?;
    }
    console.begin("Reading the scene", None);
    let (scene, source_hash) = read_scene(args.scene()?, args.light_units, args.variant.as_deref())?;
    let read = |file| read_sequence_at(file, scene.offset);
    let lights = args.lights.as_deref().map(read).transpose()?;
    signals::go_on()?;
    Ok(Inputs {
        scene,
        source_hash,
        lights,
    })
}

/// How files end that describe surfaces instead of holding triangles.
const DESCRIPTION: &str = ".scene.json";

/// Reads a scene and the hash of its file.
///
/// # Errors
/// The file cannot be read or is no scene that can be baked.
pub fn read_scene(
    path: &Path,
    units: LightUnitsName,
    variant: Option<&str>,
) -> Result<(Arc<Scene>, u64), Failure> {
    if path.to_string_lossy().ends_with(DESCRIPTION) || Kind::of(path) == Kind::Description {
        if variant.is_some() {
            return Err(Failure::Usage(
                "--variant is for glTF files: descriptions have no variants".into(),
            ));
        }
        let (scene, bytes) = read_meshed(path)?;
        return Ok((Arc::new(scene), format::content_hash(&bytes)));
    }
    let options = ImportOptions {
        light_units: match units {
            LightUnitsName::Spec => LightUnits::Spec,
            LightUnitsName::Unitless => LightUnits::Unitless,
            LightUnitsName::Raw => LightUnits::Raw,
        },
        variant: variant.map(str::to_owned),
    };
    let scene = import(path, &options)?;
    let bytes = std::fs::read(path).with_context(|| format!("{}: cannot be read", path.display()))?;
    Ok((Arc::new(scene), format::content_hash(&bytes)))
}

/// A bake, settled.
pub struct Job<'a> {
    /// Parameters.
    pub params: &'a BakeParams,
    /// How materials are evaluated.
    pub shading: Shading,
    /// The only sequence that will be played, if given.
    pub lights: Option<&'a Sequence>,
    /// Identifies the scene.
    pub source_hash: u64,
    /// Where units of work are kept, if they are.
    pub kept: Option<Kept>,
    /// Whether the bake ends with a check of its own.
    pub checked: bool,
    /// Whether it goes on although the asset's disk has too little room.
    pub force: bool,
    /// When it is to be over, if it has not all the time that it needs.
    pub until: Option<Instant>,
}

impl<'a> Job<'a> {
    /// What it asks of the library, with parameters of the caller's.
    pub fn request(&self, params: &'a BakeParams, scene: Arc<Scene>) -> Request<'a> {
        Request {
            scene,
            shading: self.shading,
            params,
            lights: self.lights,
            source_hash: self.source_hash,
            memory: memory::of_this_machine(),
        }
    }
}

/// What a bake tells.
pub struct JobResult {
    /// The fixed summary.
    pub text: String,
    /// One line on what was written.
    pub saved: String,
    /// What is wrong with the asset, or cannot be told, in words.
    pub complaint: Option<String>,
    /// What the command prints.
    pub report: BakeReport,
}

/// What `relight bake` prints.
#[derive(Clone, Debug, Serialize)]
pub struct BakeReport {
    command: &'static str,
    /// The asset, with what its bake took.
    #[serde(flatten)]
    pub inspection: Inspection,
    /// Units of work, if they were kept.
    #[serde(skip_serializing_if = "Option::is_none")]
    units: Option<UnitCounts>,
}

/// Units of work.
#[derive(Clone, Copy, Debug, Serialize)]
struct UnitCounts {
    /// All.
    all: u64,
    /// Those that were taken from an earlier run.
    reused: u64,
}

/// Bakes, writes the asset and its log.
///
/// # Errors
/// As the bake and the writing.
pub fn run_job(
    job: &Job,
    scene: Arc<Scene>,
    target: &Path,
    import_seconds: f64,
    console: &Console,
) -> Result<JobResult, Failure> {
    let note = |text| console.note(text);
    let folder = job.kept.as_ref().map(|kept| kept.open(&note)).transpose()?;
    let ledger = folder.as_ref().map(|folder| Ledger::new(folder, this_program()));
    let (mut baked, mut seconds) = timed(|| {
        bake_job(
            job,
            job.params,
            scene.clone(),
            ledger.as_ref(),
            Some(target),
            console,
        )
    })?;
    if job.checked {
        signals::go_on()?;
        let checked = timed(|| checked(&mut baked, &job.request(job.params, scene), console))?;
        baked.stats.seconds.push(("check", checked.1));
        seconds += checked.1;
    }
    let mut result = store(
        baked,
        job,
        target,
        import_seconds + seconds,
        import_seconds,
        console,
    )?;
    if let (Some(kept), Some(folder), Some(ledger)) = (&job.kept, &folder, &ledger) {
        let (taken, made) = ledger.counts();
        result.report.units = Some(UnitCounts {
            all: taken + made,
            reused: taken,
        });
        result.saved += &format!(" {taken} of {} units reused.", taken + made);
        kept.done(folder, &ledger.used());
    }
    Ok(result)
}

/// Lets a bake measure itself; says so where nothing can be told.
fn checked(baked: &mut Baked, request: &Request, console: &Console) -> Result<(), Failure> {
    console.begin("Checking with probes", None);
    let told = |words| console.detail(words);
    if check(baked, request, &Signals, &told)
        .map_err(unjudged)?
        .is_none()
    {
        console.note("note: no camera sees anything, so that this bake cannot measure itself.");
    }
    console.close();
    Ok(())
}

/// Why an asset could not be judged, as the command's failure.
pub fn unjudged(error: ProbeError) -> Failure {
    match error {
        ProbeError::Stopped => signals::failure(),
        other => other.into(),
    }
}

/// Runs something and says how many seconds it took.
///
/// # Errors
/// As what is run.
pub fn timed<T>(act: impl FnOnce() -> Result<T, Failure>) -> Result<(T, f64), Failure> {
    let start = Instant::now();
    let done = act()?;
    Ok((done, start.elapsed().as_secs_f64()))
}

/// Bakes with parameters of the caller's; `target`: where the asset will be, if it will.
///
/// # Errors
/// As the bake.
pub fn bake_job(
    job: &Job,
    params: &BakeParams,
    scene: Arc<Scene>,
    ledger: Option<&Ledger>,
    target: Option<&Path>,
    console: &Console,
) -> Result<Baked, Failure> {
    let request = job.request(params, scene);
    let progress = BakeProgress::new(console).until(job.until);
    let progress = match target {
        Some(target) => progress.towards(target, job.force),
        None => progress,
    };
    bake(&request, ledger, &progress).map_err(|error| progress.failure(error))
}

/// Writes an asset and its log; `seconds` is what all before took, `import_seconds` of it reading the scene.
///
/// # Errors
/// A file cannot be written, or a signal asks to stop.
pub fn store(
    baked: Baked,
    job: &Job,
    target: &Path,
    seconds: f64,
    import_seconds: f64,
    console: &Console,
) -> Result<JobResult, Failure> {
    signals::go_on()?;
    console.begin("Writing the asset", None);
    let whole = signals::whole();
    let encode = Instant::now();
    format::write_file(target, &baked.asset)?;
    let mut stats = baked.stats;
    stats.seconds.push(("encode", encode.elapsed().as_secs_f64()));
    if let Some(load) = stats.seconds.first_mut() {
        load.1 += import_seconds;
    }
    let total = seconds + encode.elapsed().as_secs_f64();
    let run = run_of(&stats, total);
    let log = BakeLog {
        schema: SCHEMA,
        run: run.clone(),
    };
    let inspection = Inspection::of_asset(target, &baked.asset)?.with_run(run);
    write_atomically(&log_path(target), output::json_text(&log)?.as_bytes())?;
    drop(whole);
    console.close();
    let expected = Expected::of(baked.asset.estimates.as_ref());
    Ok(JobResult {
        text: inspect::describe(&inspection),
        complaint: expected.and_then(|expected| expected.complaint(job.params.coarse_radius)),
        saved: format!(
            "Wrote {} ({}).",
            target.display(),
            words::bytes(inspection.bytes.total)
        ),
        report: BakeReport {
            command: "bake",
            inspection,
            units: None,
        },
    })
}

/// What a bake took.
fn run_of(stats: &BakeStats, total: f64) -> BakeRun {
    BakeRun {
        seconds: Seconds {
            stages: (stats.seconds.iter())
                .map(|&(stage, seconds)| (stage.to_owned(), seconds))
                .collect(),
            total,
            ray_tracing: Some(stats.ray_tracing_seconds),
        },
        peak_memory_bytes: output::peak_memory_bytes(),
        row_bytes: Some(stats.row_bytes),
        threads: stats.threads,
    }
}

/// Tells what was baked, and prints its JSON where asked to; falls short of `strict` where the bake finds itself wrong, and of
/// `--target-error` where that was missed.
///
/// # Errors
/// stdout cannot be written.
pub fn tell(result: &JobResult, strict: bool, json: bool, console: &Console) -> Result<Outcome, Failure> {
    console.close();
    console.note(format!("{}\n\n{}", result.text, result.saved));
    let expected = result.report.inspection.expected;
    let wrong = expected.is_some_and(|expected| expected.verdict() == Verdict::Wrong);
    if let Some(complaint) = &result.complaint {
        if wrong {
            console.warn(format!("WARNING: {complaint}"));
        } else {
            console.note(format!("note: {complaint}"));
        }
    }
    if json {
        output::print_json(&result.report)?;
    }
    let missed = expected.is_some_and(|expected| expected.missed());
    Ok(match (wrong && strict) || missed {
        true => Outcome::FellShort,
        false => Outcome::Done,
    })
}
