//! `relight play`: asset and lights in, frames out.

use crate::choice::{ByCuts, by_cuts, choice, splits};
use crate::console::Console;
use crate::failure::{Failure, Outcome};
use crate::frames::{self, FrameRange, Pattern};
use crate::lightcuts::LightcutArgs;
use crate::many_lights::{self, PixelcutsArgs, PointArgs};
use crate::output::{self, SCHEMA};
use crate::session::{PIXEL_LIGHT_SAMPLES, Session, median, milliseconds};
use crate::signals;
use crate::target;
use crate::words;
use clap::{Args, ValueEnum};
use relight_play::edited::Editor;
use relight_play::load::{Loaded, check_camera, check_kept, load};
use relight_render::lightcuts::{AT_PIXELS, worthwhile};
use relight_scene::camera::CameraTrack;
use relight_scene::image::preview::tone_mapped;
use relight_scene::image::{BEAUTY, ExrHeader, ExrWarning, ImageError, Layers, write_exr, write_png};
use relight_scene::light_set::{LightRig, SceneEmitters};
use relight_scene::scene::Scene;
use relight_scene::sequence::{Sequence, SequenceCamera, read_sequence};
use serde_json::{Map, Value, json};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::thread::ScopedJoinHandle;
use std::time::Instant;

/// Relight an asset for a sequence of lights and write OpenEXR frames.
///
/// beauty = emission (light seen directly) + direct (one reflection) + indirect (two and more). Each frame is
/// written, complete or not at all, while the next one is lit.
#[derive(Args)]
#[command(after_help = "\
The JSON of --json: frames, an array of {frame, total, direct_points, bounces, transfer, flatten, direct_pixels,
reconstruct, resolve, write} in milliseconds (brute and path: {frame, total, render, write}); total is what the frame adds
to the run, which is less than its parts where the frame before is written beside it; once_per_shot, what
is done once: load, expose, weigh (with a moving camera expose and weigh are in the frames). Over lights without
extent a frame also has points (milliseconds), lights, virtual_lights and shadow_rays_per_pixel; with lightcuts also
tree and light (milliseconds), tree_bytes, nodes_per_pixel, limited_cuts_per_pixel (with --reconstruction on
eye_rays_per_pixel, samples_per_pixel, shadow_rays_per_reconstruction_cut); with pixelcuts also
nodes_per_pixel, exact_lights, and in milliseconds eye, exact, estimate, trees, cuts, scatter, shade and resolve. With --materials a
frame also has edit, the milliseconds of evaluating changed materials again.

Models and parameters for --materials: metallic_roughness (metallic, roughness, metallic_roughness_texture),
lambert, phong (specular, specular_texture, exponent or roughness), ward (specular, specular_texture, roughness or
roughness_u and roughness_v, rotation_deg); all: base_color, base_color_texture, normal_texture, normal_scale,
bump_texture with bump_scale (metres), emission.")]
pub struct PlayArgs {
    /// Asset to play.
    #[arg(value_name = "ASSET.relight")]
    pub asset: PathBuf,
    /// Lighting sequence; without it the scene's own lights play.
    #[arg(long, value_name = "SEQ.json")]
    pub lights: Option<PathBuf>,
    /// Material edits: models and parameters, with keys where they change from frame to frame, of the asset's
    /// materials by name; no new bake (see data/table_materials.json).
    #[arg(long, value_name = "EDITS.json")]
    pub materials: Option<PathBuf>,
    /// Frames to write: #### or %04d stands for the frame number.
    #[arg(short, long, value_name = "out/frame_####.exr", value_parser = frames::parse_pattern)]
    pub output: Pattern,
    /// How to make light: transfer (the asset's operators), cuts (as the asset's visibility cuts were baked: direct
    /// light of environments, or one bounce of indirect light; other direct light by shadow rays), brute (every light
    /// with its own shadow rays; direct light only, or, with --area-samples or --vpls, all light of these points), lightcuts
    /// (the same points with a bounded error, by clusters of lights), pixelcuts (the same points, each sent to clusters of
    /// pixels: fast and without sharp shadows of many lights), path (a path tracer, the reference), or auto (cuts where the asset
    /// has them: environments, or the first bounce at surfaces that are not matt; transfer for other indirect light;
    /// path without points).
    #[arg(long, value_enum, default_value_t = Integrator::Auto)]
    pub integrator: Integrator,
    /// Size of the image in pixels; keeps the camera's vertical field of view [default: 360 high, of the camera's
    /// aspect ratio].
    #[arg(long, value_name = "WxH", value_parser = frames::parse_size)]
    pub size: Option<(usize, usize)>,
    /// Camera of the scene by name [default: the sequence's, else the scene's first].
    #[arg(long, value_name = "NAME")]
    pub camera: Option<String>,
    /// Frames to play, from 0, both ends included, every Nth [default: all of the sequence].
    #[arg(long, value_name = "A-BxN", value_parser = frames::parse_range)]
    pub frames: Option<FrameRange>,
    /// Layers to write, with commas between them; lights stands for one layer per light, light.NAME.
    #[arg(long, value_enum, value_delimiter = ',', default_values_t = [LayerName::Beauty, LayerName::Direct, LayerName::Indirect])]
    pub layers: Vec<LayerName>,
    /// Write a PNG preview of the beauty beside each frame (Khronos PBR Neutral).
    #[arg(long)]
    pub png: bool,
    /// Exposure of the previews: 2^EV times the image.
    #[arg(long, value_name = "EV", default_value_t = 0.0, allow_hyphen_values = true)]
    pub exposure: f32,
    /// Write 32-bit floats instead of half precision.
    #[arg(long)]
    pub float: bool,
    /// Most nodes of the illumination cut, by which an environment, or what surfaces reflect, is taken with visibility
    /// cuts.
    #[arg(long, value_name = "N", default_value_t = ILLUMINATION_CUT, value_parser = clap::value_parser!(u32).range(1..=1_048_576))]
    pub illumination_cut: u32,
    /// Samples per pixel; of transfer and cuts four times as many where a pixel sees several things [default: transfer 16, with a moving camera 1; brute 16; lightcuts 4, with reconstruction 5 to 50; pixelcuts 1; path 64].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_048_576))]
    pub spp: Option<u32>,
    /// Most reflections of a path (path only) [default: no limit].
    #[arg(long, value_name = "N")]
    pub max_bounces: Option<u32>,
    /// Lights without extent.
    #[command(flatten)]
    pub points: PointArgs,
    /// Clusters of lights.
    #[command(flatten)]
    pub lightcuts: LightcutArgs,
    /// Pixelcuts.
    #[command(flatten)]
    pub pixelcuts: PixelcutsArgs,
    /// Print one JSON object on stdout.
    #[arg(long)]
    pub json: bool,
}

/// Ways to make light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Integrator {
    /// Cuts and transfer, whatever the asset has; else path.
    Auto,
    /// The asset's operators.
    Transfer,
    /// Visibility cuts.
    Cuts,
    /// Every light with its own shadow rays.
    Brute,
    /// Clusters of lights.
    Lightcuts,
    /// Points that stand for all lights, each sent to clusters of pixels.
    Pixelcuts,
    /// The path tracer.
    Path,
}

/// Layers that can be asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum LayerName {
    /// Emission + direct + indirect.
    Beauty,
    /// Light seen directly.
    Emission,
    /// One reflection.
    Direct,
    /// Two reflections and more.
    Indirect,
    /// Total reflectance of what is seen.
    Albedo,
    /// Shading normal, world space.
    Normal,
    /// Distance from the camera, metres.
    Depth,
    /// One layer per light.
    Lights,
}

impl LayerName {
    fn name(self) -> &'static str {
        match self {
            LayerName::Beauty => BEAUTY,
            LayerName::Emission => "emission",
            LayerName::Direct => "direct",
            LayerName::Indirect => "indirect",
            LayerName::Albedo => "albedo",
            LayerName::Normal => "normal",
            LayerName::Depth => "depth",
            LayerName::Lights => "light.",
        }
    }
}

/// Nodes of the illumination cut: 256 are no better (docs/notebook/cuts.md). The paper's 256 to 512 (Cheslack-Postava et al. 2008,
/// section 5) are of nodes whose light comes from their middles.
pub const ILLUMINATION_CUT: u32 = 128;
/// Height of an image where nobody says another.
const DEFAULT_HEIGHT: usize = 360;
/// Aspect ratio where neither user nor camera says another.
const DEFAULT_ASPECT: f32 = 16.0 / 9.0;

/// Runs the command.
pub fn run(args: &PlayArgs, seed: u64, console: &Console) -> Result<Outcome, Failure> {
    let json = play(args, seed, console, Pace::Overlapping, |_, _| {})?;
    if args.json {
        output::print_json(&json)?;
    }
    Ok(Outcome::Done)
}

/// Plays; `seen(frame, layers)` gets every frame before it is written. Returns the JSON of the command.
pub fn play(
    args: &PlayArgs,
    seed: u64,
    console: &Console,
    pace: Pace,
    mut seen: impl FnMut(u32, &Layers),
) -> Result<Value, Failure> {
    if !args.exposure.is_finite() {
        return Err(Failure::Usage("--exposure must be a finite number".into()));
    }
    let start = Instant::now();
    console.begin("Reading the asset", None);
    let given = args.lights.as_deref().map(read_sequence).transpose()?;
    let with_operators = !matches!(
        args.integrator,
        Integrator::Brute | Integrator::Lightcuts | Integrator::Pixelcuts | Integrator::Path
    );
    let mut loaded = load(&args.asset, with_operators)?;
    signals::go_on()?;
    check_kept(&loaded, given.as_ref())?;
    let mut editor = (args.materials.as_deref())
        .map(|file| Editor::new(file, &args.asset, &loaded))
        .transpose()?;
    let integrator = integrator(args, &loaded)?;
    let scene = loaded.scene.clone();
    let sequence = given.as_ref().unwrap_or(&scene.sequence);
    let track = camera(&args.asset, args.camera.as_deref(), &scene, sequence)?;
    if with_operators {
        check_camera(&loaded.provenance, &track)?;
    }
    let (width, height) = args.size.unwrap_or_else(|| default_size(&track));
    let range = frame_range(args, sequence)?;
    if let Some(editor) = &mut editor {
        editor.apply(range.first.into(), &mut loaded.player)?;
    }
    // What shines does not move with the materials: emission has no keys.
    let shining = loaded.player.scene.clone();
    let emitters = SceneEmitters::new(&shining);
    let rig = LightRig::new(&emitters, &sequence.lights)?;
    for frame in range.iter().take(1) {
        output::prepare_output(&args.output.file(frame))?;
    }
    let load_ms = milliseconds(start);
    let hash = loaded.hash;

    let by_cuts = by_cuts(integrator, args, &loaded, sequence);
    let many = !args.layers.contains(&LayerName::Lights)
        && worthwhile(&rig.at(range.first.into()), PIXEL_LIGHT_SAMPLES, AT_PIXELS);
    console.note(choice(integrator, by_cuts, many, &loaded));
    if let Some(line) = target::line(loaded.estimates.as_ref()) {
        console.note(format!("Error: {line}."));
    }
    let mut session = Session {
        args,
        splits: (by_cuts == ByCuts::Environments).then(|| splits(&rig, &loaded, sequence.lights.len())),
        by_cuts,
        loaded: &mut loaded,
        editor,
        rig: &rig,
        integrator,
        seed,
        width,
        height,
        shot: None,
        fixed: track.is_fixed(),
        once: Map::from_iter([("load".to_owned(), json!(load_ms))]),
        apart_ms: 0.0,
    };
    let total = range.iter().count();
    console.begin("Lighting frames", Some(total as u64));
    let last_frame = range.iter().last();
    let mut times: Vec<Map<String, Value>> = Vec::new();
    let mut warnings = BTreeSet::new();
    std::thread::scope(|scope| -> Result<(), Failure> {
        let mut writing: Option<ScopedJoinHandle<Result<Written, ImageError>>> = None;
        let mut since = Instant::now();
        for frame in range.iter() {
            signals::go_on()?;
            let edit_ms = session.edit(frame)?;
            let (all, mut frame_times) = session.render(frame, &track.at(frame.into()), console)?;
            signals::go_on()?;
            seen(frame, &all);
            frame_times.extend(edit_ms.map(|ms| ("edit".to_owned(), ms.into())));
            if let Some(last) = writing.take() {
                note_written(joined(last)?, &mut times, &mut warnings, console);
            }
            let header = ExrHeader {
                asset_hash: Some(format!("{hash:016x}")),
                seed: Some(seed),
                frames_per_second: Some(sequence.fps),
                frame: Some(frame),
                ..ExrHeader::new()
            };
            let file = args.output.file(frame);
            let handle = scope.spawn(move || write(args, file, &all, &header));
            let wait = pace == Pace::OneByOne || Some(frame) == last_frame;
            let written = if wait {
                Some(joined(handle)?)
            } else {
                writing = Some(handle);
                None
            };
            let total_ms = milliseconds(since) - std::mem::take(&mut session.apart_ms);
            since = Instant::now();
            frame_times.insert("total".into(), total_ms.into());
            frame_times.insert("frame".into(), frame.into());
            times.push(frame_times);
            if let Some(written) = written {
                note_written(written, &mut times, &mut warnings, console);
            }
        }
        Ok(())
    })?;
    console.close();
    for warning in warnings {
        console.note(format!("warning: {warning}"));
    }
    console.note(summary(&times, integrator, args, range));
    Ok(json!({
        "schema": SCHEMA,
        "command": "play",
        "asset": args.asset.display().to_string(),
        "asset_hash": format!("{hash:016x}"),
        "integrator": integrator.to_possible_value().map(|v| v.get_name().to_owned()),
        "width": width,
        "height": height,
        "threads": rayon::current_num_threads(),
        "fixed_camera": session.fixed,
        "once_per_shot": session.once,
        "frames": times,
    }))
}

/// When the next frame begins.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Pace {
    /// While the last one is written: compressing and syncing leave cores idle for a sixth of the time.
    Overlapping,
    /// Once the last one is written: its times are its own.
    OneByOne,
}

/// A frame's files.
struct Written {
    file: PathBuf,
    milliseconds: f64,
    warnings: Vec<ExrWarning>,
}

/// Writes the layers of a frame that are asked for.
fn write(args: &PlayArgs, file: PathBuf, all: &Layers, header: &ExrHeader) -> Result<Written, ImageError> {
    let start = Instant::now();
    let warnings = write_exr(&file, &chosen(all, &args.layers), header, args.float)?;
    if args.png {
        let beauty = all.rgb(BEAUTY).unwrap_or_default();
        write_png(&file.with_extension("png"), &tone_mapped(&beauty, args.exposure))?;
    }
    Ok(Written {
        file,
        milliseconds: milliseconds(start),
        warnings,
    })
}

fn joined(writing: ScopedJoinHandle<Result<Written, ImageError>>) -> Result<Written, ImageError> {
    writing
        .join()
        .unwrap_or_else(|panic| std::panic::resume_unwind(panic))
}

/// Notes that the last of the frames in `times` is written.
fn note_written(
    written: Written,
    times: &mut [Map<String, Value>],
    warnings: &mut BTreeSet<String>,
    console: &Console,
) {
    warnings.extend(written.warnings.iter().map(ToString::to_string));
    console.advance_to(times.len() as u64);
    if let Some(times) = times.last_mut() {
        times.insert("write".into(), written.milliseconds.into());
        let total = times.get("total").and_then(Value::as_f64).unwrap_or_default();
        console.detail(format!("{}: {total:.1} ms", written.file.display()));
    }
}

fn summary(
    times: &[Map<String, Value>],
    integrator: Integrator,
    args: &PlayArgs,
    range: FrameRange,
) -> String {
    let median = median(times.iter().filter_map(|t| t["total"].as_f64()));
    let name = integrator
        .to_possible_value()
        .map_or_else(String::new, |v| v.get_name().to_owned());
    let last = args
        .output
        .file(range.first + (range.last - range.first) / range.step * range.step);
    format!(
        "Wrote {} with {name}, {median:.1} ms each (median), up to {}.",
        words::plural(times.len(), "frame"),
        last.display()
    )
}

fn integrator(args: &PlayArgs, loaded: &Loaded) -> Result<Integrator, Failure> {
    let has_points = loaded.player.transfer.is_some();
    let integrator = match args.integrator {
        Integrator::Auto if has_points => Integrator::Transfer,
        Integrator::Auto => Integrator::Path,
        Integrator::Cuts if loaded.player.cuts.is_none() => {
            return Err(anyhow::anyhow!(
                "{}: was baked without visibility cuts; bake with --cuts environment or --cuts indirect (with --cuts auto also --keep cuts), or use \
                 --integrator transfer",
                args.asset.display()
            )
            .into());
        }
        Integrator::Transfer if !has_points => {
            return Err(anyhow::anyhow!(
                "{}: holds no points, so there is nothing to transfer; use --integrator path",
                args.asset.display()
            )
            .into());
        }
        other => other,
    };
    if args.max_bounces.is_some() && integrator != Integrator::Path {
        return Err(Failure::Usage(
            "--max-bounces belongs to --integrator path; what an asset holds is chosen by bake --bounces"
                .into(),
        ));
    }
    many_lights::check(integrator, &args.points, &args.pixelcuts)?;
    Ok(integrator)
}

fn camera(
    asset: &Path,
    wanted: Option<&str>,
    scene: &Scene,
    sequence: &Sequence,
) -> Result<CameraTrack, Failure> {
    let named = |name: &str, whence: &str| {
        scene
            .cameras
            .iter()
            .find(|track| track.name == name)
            .cloned()
            .ok_or_else(|| {
                let known: Vec<String> = scene.cameras.iter().map(|c| format!("{:?}", c.name)).collect();
                let known = if known.is_empty() {
                    "it has none".into()
                } else {
                    format!("it has {}", known.join(", "))
                };
                anyhow::anyhow!(
                    "{}: no camera is named {name:?}, as {whence} asks; {known}",
                    asset.display()
                )
            })
    };
    if let Some(name) = wanted {
        return Ok(named(name, "--camera")?);
    }
    match &sequence.camera {
        Some(SequenceCamera::Node(name)) => return Ok(named(name, "the lighting sequence")?),
        Some(SequenceCamera::Own(track)) => return Ok(track.clone()),
        None => {}
    }
    scene.cameras.first().cloned().ok_or_else(|| {
        Failure::Failed(anyhow::anyhow!(
            "{}: the scene has no camera; give the lighting sequence one: \
             \"camera\": {{\"position\": [x,y,z], \"look_at\": [x,y,z], \"up\": [0,1,0], \"vfov_deg\": 50}}",
            asset.display()
        ))
    })
}

/// Size in pixels of a play that nobody gives a size.
///
/// # Errors
/// There is no camera.
pub fn default_size_of(asset: &Path, scene: &Scene, sequence: &Sequence) -> Result<(usize, usize), Failure> {
    Ok(default_size(&camera(asset, None, scene, sequence)?))
}

fn default_size(track: &CameraTrack) -> (usize, usize) {
    let aspect = track
        .aspect
        .filter(|a| a.is_finite() && *a > 0.0)
        .unwrap_or(DEFAULT_ASPECT);
    let width = (DEFAULT_HEIGHT as f32 * aspect).round().clamp(1.0, 16384.0);
    (width as usize, DEFAULT_HEIGHT)
}

fn frame_range(args: &PlayArgs, sequence: &Sequence) -> Result<FrameRange, Failure> {
    let end = sequence.frames.max(1) - 1;
    let range = args.frames.unwrap_or(FrameRange {
        first: 0,
        last: end,
        step: 1,
    });
    if range.last > end {
        return Err(Failure::Usage(format!(
            "--frames goes up to {}, but the sequence has {} (0 to {end})",
            range.last,
            words::plural(sequence.frames as usize, "frame")
        )));
    }
    if range.iter().nth(1).is_some() && !args.output.has_number() {
        return Err(Failure::Usage(
            "several frames would be written to one file: put #### into the name of --output, or choose one with \
             --frames"
                .into(),
        ));
    }
    Ok(range)
}

/// The asked-for layers, in the order of the request.
fn chosen(all: &Layers, wanted: &[LayerName]) -> Layers {
    let mut out = Layers::new(all.width, all.height);
    for want in wanted {
        for layer in &all.layers {
            let fits = match want {
                LayerName::Lights => layer.name.starts_with(want.name()),
                _ => layer.name == want.name(),
            };
            if fits && out.layer(&layer.name).is_none() {
                out.layers.push(layer.clone());
            }
        }
    }
    out
}
