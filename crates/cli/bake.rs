//! `relight bake`: scene in, asset out.

use crate::console::{BakeProgress, Console};
use crate::failure::{Failure, Outcome};
use crate::inspect;
use crate::output::{self, SCHEMA};
use crate::signals;
use crate::target;
use crate::words;
use anyhow::Context;
use clap::{Args, ValueEnum};
use glam::Vec3;
use relight_bake::error::BakeError;
use relight_bake::params::{BakeParams, CutMode, CutParams, CutSites, Part, Preset};
use relight_bake::{BakeStats, Baked, bake};
use relight_format as format;
use relight_scene::gltf::{ImportOptions, LightUnits, import};
use relight_scene::image::write_atomically;
use relight_scene::scene::Scene;
use relight_scene::sequence::{Sequence, read_sequence};
use relight_scene::traced::Shading;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

/// Turn a glTF scene into an asset that can be relit.
///
/// Spreads a hierarchy of points over the surfaces that light can carry to the viewer, finds how strongly they
/// light each other, and writes geometry, materials, points and links into one file. Times and memory go into
/// ASSET.relight.log.json beside it.
#[derive(Args)]
#[command(after_help = "\
The JSON of --json: points (per level, coarsest first), links, potential_links, rays, seconds (per stage, total,
ray_tracing: thread-seconds in rays / threads), bytes (per section raw and stored, total), peak_memory_bytes,
left_out (what, why, saved_bytes, saved_rays, and with the bake's log saved_seconds: those rays at the bake's own pace).")]
pub struct BakeArgs {
    /// Scene to bake: .glb or .gltf.
    #[arg(value_name = "SCENE")]
    pub scene: PathBuf,
    /// Asset to write; an existing one is replaced when the new one is complete.
    #[arg(short, long, value_name = "ASSET.relight")]
    pub output: PathBuf,
    /// Quality: draft (seconds, to try lights and cameras), standard, or fine (half the standard error, several
    /// times the bake). The options below win over it.
    #[arg(long, value_enum, default_value_t = PresetName::Standard)]
    pub preset: PresetName,
    /// Choose levels, sender levels, epsilon and rays for this error of indirect light, such as 0.08 or 8%: the root of relMSE of
    /// the indirect layer, as `report` lists it, estimated at other viewpoints near the camera that `play` takes by itself, under --lights (or the
    /// scene's own lights, or a lamp). Bakes ever finer settings until one will do. A result's estimate is stored.
    #[arg(long, value_name = "E", value_parser = target::parse, conflicts_with_all = ["preset", "levels", "sender_levels", "epsilon"])]
    pub target_error: Option<f64>,
    /// Keep only what this lighting sequence can use. Without it the asset keeps what any light could use.
    #[arg(long, value_name = "SEQ.json")]
    pub lights: Option<PathBuf>,
    /// Receiver levels, 1 to 12: each halves the distance of the points of the one before [standard: 6].
    #[arg(long, value_name = "N")]
    pub levels: Option<usize>,
    /// Sender levels: so many of the coarsest levels send light [standard: 4].
    #[arg(long, value_name = "N")]
    pub sender_levels: Option<usize>,
    /// Distance of the points of the coarsest level, metres [default: from the scene].
    #[arg(long, value_name = "R")]
    pub coarse_radius: Option<f32>,
    /// Links of the finest level below this strength, for a reflectance of 0.8, are left out [standard: 0.025].
    #[arg(long, value_name = "E")]
    pub epsilon: Option<f32>,
    /// Bounces of indirect light [default: to convergence].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub bounces: Option<u32>,
    /// Solve the bounces now instead of at play time: frames get faster, and reflectances can no longer be
    /// edited.
    #[arg(long)]
    pub solution: bool,
    /// Visibility cuts: none; environment, for shadows and glossy reflections of environment maps and skies; auto, the same
    /// if --lights has one or is not given; or indirect, for glossy reflections of lit surfaces, by one bounce of any
    /// light.
    #[arg(long, value_enum, default_value_t = CutsName::None)]
    pub cuts: CutsName,
    /// Where the cuts stand: at the finest points, whose number follows the lighting, or at the vertices of the meshes,
    /// between which triangles interpolate [default: points].
    #[arg(long, value_enum)]
    pub cut_sites: Option<CutSitesName>,
    /// Even directions, or even samples of the surfaces, that the cuts cluster: a power of two, 256 to 1048576 [default: 32768].
    #[arg(long, value_name = "N")]
    pub cut_lights: Option<u32>,
    /// Threshold of a cut's nodes, for 32768 lights: 1.5 to 3 is usual; larger makes cuts shorter and shadows
    /// coarser [default: 2].
    #[arg(long, value_name = "S")]
    pub sigma: Option<f32>,
    /// What the tree of those lights minds: 1 geometry alone, 0 visibility alone [default: 0.45].
    #[arg(long, value_name = "B")]
    pub beta: Option<f32>,
    /// A place from which the scene is looked at: surfaces that light cannot carry to it get no points. May be
    /// given several times [default: the scene's cameras, or a place in open space].
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_point, allow_hyphen_values = true)]
    pub viewpoint: Vec<Vec3>,
    /// Keep what the scene and --lights cannot use, with commas between them: all, lights (the scene's own), emission,
    /// materials (maps, textures, coordinates, colours), points (on surfaces that no light path joins to the viewpoints), senders
    /// (levels that no link uses), bounces (the operator of the third bounce and further ones), cuts (of environments,
    /// with --cuts auto), precision (bits of links far below --epsilon, colour of grey points). Links below significance are
    /// kept by a smaller --epsilon.
    #[arg(long, value_enum, value_delimiter = ',', value_name = "WHAT")]
    pub keep: Vec<KeepName>,
    /// Only the cameras of the scene and of --lights will look: surfaces that none of them sees get no fine receivers.
    #[arg(long)]
    pub cameras_only: bool,
    /// Treat every material as Lambert with its base colour, for comparison with other renderers: metallic,
    /// roughness and normal maps are ignored, emission and alpha are kept.
    #[arg(long)]
    pub lambert: bool,
    /// How the exporter wrote light intensities: spec (candela and lux, as KHR_lights_punctual has them),
    /// unitless (W/sr), or raw (watts).
    #[arg(long, value_enum, default_value_t = Units::Spec)]
    pub light_units: Units,
    /// Print one JSON object on stdout.
    #[arg(long)]
    pub json: bool,
}

/// Names of presets.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum PresetName {
    /// Seconds instead of tens of seconds.
    Draft,
    /// The default.
    Standard,
    /// Half the standard error or less.
    Fine,
}

/// What visibility cuts are made for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum CutsName {
    /// No cuts.
    None,
    /// Environment maps and skies.
    Environment,
    /// Those, if one may shine.
    Auto,
    /// The first bounce of any light.
    Indirect,
}

/// What to keep although nothing uses it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum KeepName {
    /// Everything.
    All,
    /// The scene's own lights.
    Lights,
    /// Emission of materials.
    Emission,
    /// What materials look up.
    Materials,
    /// Points on unreachable surfaces.
    Points,
    /// Sender levels without links.
    Senders,
    /// The bounce operator.
    Bounces,
    /// Cuts of environments.
    Cuts,
    /// Bits.
    Precision,
}

impl KeepName {
    fn parts(self) -> Vec<Part> {
        let name = self.to_possible_value();
        let named = |part: &Part| name.as_ref().is_some_and(|n| n.matches(part.name(), false));
        match self {
            KeepName::All => Part::ALL.to_vec(),
            _ => Part::ALL.into_iter().filter(named).collect(),
        }
    }
}

/// Where visibility cuts stand.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum CutSitesName {
    /// At the finest points.
    Points,
    /// At the vertices of the meshes.
    Vertices,
}

/// Names of [`LightUnits`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Units {
    /// Candela and lux.
    Spec,
    /// W/sr and W/m².
    Unitless,
    /// Watts and W/m².
    Raw,
}

fn parse_point(text: &str) -> Result<Vec3, String> {
    let numbers: Option<Vec<f32>> = text
        .split(',')
        .map(|part| part.trim().parse().ok().filter(|x: &f32| x.is_finite()))
        .collect();
    match numbers.as_deref() {
        Some(&[x, y, z]) => Ok(Vec3::new(x, y, z)),
        _ => Err("expected three numbers with commas between them, such as 1.5,2,-3".into()),
    }
}

/// The parameters that the options make.
pub fn params(args: &BakeArgs, seed: u64) -> Result<BakeParams, Failure> {
    let mut params = BakeParams::preset(match args.preset {
        PresetName::Draft => Preset::Draft,
        PresetName::Standard => Preset::Standard,
        PresetName::Fine => Preset::Fine,
    });
    params.levels = args.levels.unwrap_or(params.levels);
    params.sender_levels = args
        .sender_levels
        .unwrap_or(params.sender_levels.min(params.levels));
    params.coarse_radius = args.coarse_radius;
    params.epsilon = args.epsilon.unwrap_or(params.epsilon);
    params.bounces = args.bounces;
    params.solution = args.solution;
    params.cuts = cut_params(args)?;
    params.viewpoints = args.viewpoint.clone();
    params.cameras_only = args.cameras_only;
    params.keep = Part::ALL.to_vec();
    (params.keep).retain(|part| args.keep.iter().any(|name| name.parts().contains(part)));
    params.seed = seed;
    relight_bake::settings::validate(&params).map_err(|error| Failure::Usage(error.to_string()))?;
    Ok(params)
}

fn cut_params(args: &BakeArgs) -> Result<Option<CutParams>, Failure> {
    let given = [
        ("--cut-sites", args.cut_sites.is_some()),
        ("--cut-lights", args.cut_lights.is_some()),
        ("--sigma", args.sigma.is_some()),
        ("--beta", args.beta.is_some()),
    ];
    let mode = match args.cuts {
        CutsName::Environment | CutsName::Auto => CutMode::Environment,
        CutsName::Indirect => CutMode::Indirect,
        CutsName::None => {
            return match given.iter().find(|option| option.1) {
                None => Ok(None),
                Some((option, _)) => Err(Failure::Usage(format!(
                    "{option} belongs to visibility cuts, which --cuts environment and --cuts indirect bake"
                ))),
            };
        }
    };
    let defaults = CutParams::default();
    Ok(Some(CutParams {
        mode,
        sites: match args.cut_sites {
            Some(CutSitesName::Vertices) => CutSites::Vertices,
            Some(CutSitesName::Points) | None => CutSites::Points,
        },
        lights: args.cut_lights.unwrap_or(defaults.lights),
        sigma: args.sigma.unwrap_or(defaults.sigma),
        beta: args.beta.unwrap_or(defaults.beta),
        if_used: args.cuts == CutsName::Auto,
        ..defaults
    }))
}

/// Runs the command.
pub fn run(args: &BakeArgs, seed: u64, console: &Console) -> Result<Outcome, Failure> {
    let params = params(args, seed)?;
    output::prepare_output(&args.output)?;
    let start = Instant::now();
    console.begin("Reading the scene", None);
    let lights = args.lights.as_deref().map(read_sequence).transpose()?;
    let (scene, source_hash) = read_scene(&args.scene, args.light_units)?;
    signals::go_on()?;
    let import_seconds = start.elapsed().as_secs_f64();
    let shading = if args.lambert {
        Shading::Lambert
    } else {
        Shading::Full
    };
    let job = Job {
        params: &params,
        shading,
        lights: lights.as_ref(),
        source_hash,
    };
    let result = match args.target_error {
        Some(target) => {
            let order = target::Order { job: &job, target };
            let (mut baked, seconds) = timed(|| target::search(&order, &scene, console))?;
            let own: f64 = baked.stats.seconds.iter().map(|stage| stage.1).sum();
            baked.stats.seconds.push(("search", seconds - own));
            store(
                baked,
                &args.output,
                import_seconds + seconds,
                import_seconds,
                console,
            )?
        }
        None => run_job(&job, scene, &args.output, import_seconds, console)?,
    };
    console.close();
    console.note(format!("{}\n\n{}", result.text, result.saved));
    if args.json {
        output::print_json(&result.json)?;
    }
    Ok(Outcome::Done)
}

/// Reads a scene and the hash of its file.
///
/// # Errors
/// The file cannot be read or is no scene that can be baked.
pub fn read_scene(path: &Path, units: Units) -> Result<(Arc<Scene>, u64), Failure> {
    let options = ImportOptions {
        light_units: match units {
            Units::Spec => LightUnits::Spec,
            Units::Unitless => LightUnits::Unitless,
            Units::Raw => LightUnits::Raw,
        },
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
}

/// What a bake tells.
pub struct JobResult {
    /// The fixed summary.
    pub text: String,
    /// One line on what was written.
    pub saved: String,
    /// The JSON of the command.
    pub json: Value,
}

/// Bakes, writes the asset and its log.
pub fn run_job(
    job: &Job,
    scene: Arc<Scene>,
    target: &Path,
    import_seconds: f64,
    console: &Console,
) -> Result<JobResult, Failure> {
    let (baked, seconds) = timed(|| bake_job(job, job.params, scene, console))?;
    store(baked, target, import_seconds + seconds, import_seconds, console)
}

/// Runs something and says how many seconds it took.
fn timed<T>(act: impl FnOnce() -> Result<T, Failure>) -> Result<(T, f64), Failure> {
    let start = Instant::now();
    let done = act()?;
    Ok((done, start.elapsed().as_secs_f64()))
}

/// Bakes with parameters of the caller's.
pub fn bake_job(
    job: &Job,
    params: &BakeParams,
    scene: Arc<Scene>,
    console: &Console,
) -> Result<Baked, Failure> {
    let progress = BakeProgress(console);
    let baked = bake(scene, job.shading, params, job.lights, job.source_hash, &progress);
    baked.map_err(|error| match error {
        BakeError::Stopped => signals::failure(),
        other => other.into(),
    })
}

/// Writes an asset and its log; `seconds` is what all before took, `import_seconds` of it reading the scene.
fn store(
    baked: Baked,
    target: &Path,
    seconds: f64,
    import_seconds: f64,
    console: &Console,
) -> Result<JobResult, Failure> {
    signals::go_on()?;
    console.begin("Writing the asset", None);
    let encode = Instant::now();
    format::write_file(target, &baked.asset)?;
    let mut stats = baked.stats;
    stats.seconds.push(("encode", encode.elapsed().as_secs_f64()));
    if let Some(load) = stats.seconds.first_mut() {
        load.1 += import_seconds;
    }
    let total = seconds + encode.elapsed().as_secs_f64();
    let log = log_json(&stats, total);
    let mut json = inspect::asset_json(target, &baked.asset)?;
    merge(&mut json, &log);
    inspect::add_saved_seconds(&mut json);
    json["command"] = "bake".into();
    let log_path = log_path(target);
    write_atomically(&log_path, format!("{log:#}\n").as_bytes())?;
    console.close();
    let text = inspect::describe(&json);
    let size = json["bytes"]["total"].as_u64().unwrap_or(0);
    let saved = format!("Wrote {} ({}).", target.display(), words::bytes(size));
    Ok(JobResult { text, saved, json })
}

/// Name of the log beside an asset.
pub fn log_path(asset: &Path) -> PathBuf {
    let mut name = asset.as_os_str().to_owned();
    name.push(".log.json");
    name.into()
}

/// What varies from run to run.
fn log_json(stats: &BakeStats, total: f64) -> Value {
    let mut seconds = serde_json::Map::new();
    for &(stage, value) in &stats.seconds {
        seconds.insert(stage.into(), value.into());
    }
    seconds.insert("total".into(), total.into());
    seconds.insert("ray_tracing".into(), stats.ray_tracing_seconds.into());
    json!({
        "schema": SCHEMA,
        "seconds": seconds,
        "peak_memory_bytes": output::peak_memory_bytes(),
        "threads": stats.threads,
    })
}

/// Adds the fields of `more` to `object`.
pub fn merge(object: &mut Value, more: &Value) {
    if let (Some(object), Some(more)) = (object.as_object_mut(), more.as_object()) {
        for (key, value) in more {
            object.insert(key.clone(), value.clone());
        }
    }
}
