//! `relight play`: asset and lights in, frames out.

mod args;
mod daylight;
mod relevance;
mod report;
mod writing;

use args::LayerName;
pub use args::{IntegratorName, PlayArgs};
pub use report::{FrameReport, PlayReport};

use crate::console::Console;
use crate::failure::{Failure, Outcome};
use crate::frames::FrameRange;
use crate::guard::Guard;
use crate::kinds::{self, Kind, Wanted};
use crate::movie::{self, Movie};
use crate::output::{self, SCHEMA};
use crate::signals::{self, Signals};
use crate::statistics::{median, milliseconds};
use crate::words;
use glam::DVec3;
use relight_play::choice::CutUse;
use relight_play::header::{FrameOrigin, sequence_hash};
use relight_play::mattes::ShotMattes;
use relight_play::player::{FrameError, ShotError};
use relight_play::{CutSites, Player, Shot, ShotSettings};
use relight_probes::expected::{self, Expected};
use relight_render::watch::{Cancelled, Watch};
use relight_scene::camera::CameraTrack;
use relight_scene::image::{ExrHeader, Layers, light_layer_names};
use relight_scene::sequence::{Sequence, read_sequence_at};
use report::{Figures, OncePerShot, ShotReport};
use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};
use std::thread::ScopedJoinHandle;
use std::time::Instant;
use writing::{Written, exposure, write};

/// Share of fragments without points from which on it is said: rims and specks stay below.
const LACKING: f64 = 0.01;
/// Height of an image where nobody says another.
const DEFAULT_HEIGHT: usize = 360;
/// Aspect ratio where neither user nor camera says another.
const DEFAULT_ASPECT: f32 = 16.0 / 9.0;

/// Runs the command.
pub fn run(args: &PlayArgs, seed: u64, console: &Console) -> Result<Outcome, Failure> {
    let report = play(args, seed, console, Pace::Overlapping, |_, _| {})?;
    if args.json {
        output::print_json(&report)?;
    }
    Ok(Outcome::Done)
}

/// Plays; `seen(frame, layers)` gets every frame before it is written.
pub fn play(
    args: &PlayArgs,
    seed: u64,
    console: &Console,
    pace: Pace,
    seen: impl FnMut(u32, &Layers),
) -> Result<PlayReport, Failure> {
    play_watched(args, seed, console, pace, &Signals, seen)
}

/// As [`play`], until `watch` says to stop, which is a [`Failure::Stopped`].
pub fn play_watched(
    args: &PlayArgs,
    seed: u64,
    console: &Console,
    pace: Pace,
    watch: &dyn Watch,
    mut seen: impl FnMut(u32, &Layers),
) -> Result<PlayReport, Failure> {
    let go_on = || match watch.stopped() {
        true => Err(signals::failure()),
        false => Ok(()),
    };
    let start = Instant::now();
    for (file, wanted) in [
        (Some(&args.asset), Wanted::Asset),
        (args.lights.as_ref(), Wanted::Lights),
        (args.materials.as_ref(), Wanted::Materials),
    ] {
        file.map(|file| kinds::check(file, wanted)).transpose()?;
    }
    console.begin("Reading the asset", None);
    let wanted = args.integrator();
    let mut player = Player::open_for(&args.asset, &wanted)?;
    go_on()?;
    let mut sequence = match &args.lights {
        Some(file) => read_sequence_at(file, player.scene().offset)?,
        None => player.own_lights()?.clone(),
    };
    let hash = sequence_hash(&sequence);
    let renamed = match args.layers.contains(&LayerName::Lights) {
        true => name_layers(&mut sequence, console),
        false => Vec::new(),
    };
    let track = player.camera(&sequence, args.camera.as_deref())?;
    let (width, height) = args.size.unwrap_or_else(|| default_size(&track));
    let range = frame_range(args, &sequence)?;
    check_outputs(args, range)?;
    if let Some(edits) = &args.materials {
        player.edit_materials_from(edits, range.first.into())?;
    }
    if args.daylight_coefficients.is_some() {
        daylight::check(args, &sequence, &track, &player)?;
    }
    let lights = player.lights(&sequence.lights)?;
    let settings = args.frame_settings(seed);
    let choice = player.choose(&wanted, &lights, range.first.into(), &settings)?;
    let notes = relevance::check(args, &choice, player.prepared.transfer.is_some())?;
    if let Some(file) = args.output_of(range.first) {
        output::prepare_output(&file)?;
    }
    let movie = (args.movie.as_ref())
        .map(|file| Movie::begin(file, (width, height), f64::from(range.step) / sequence.fps))
        .transpose()?;
    let movie = Mutex::new(movie);
    let load = milliseconds(start);

    notes.into_iter().for_each(|note| console.note(note));
    console.note(choice.to_string());
    if let Some(line) = expected::line(player.estimates.as_ref()) {
        console.note(format!("Error: {line}."));
    }
    let moving = !track.is_fixed();
    let shot_settings = ShotSettings {
        integrator: wanted,
        width,
        height,
        samples: args.spp,
        moving,
        sites: match choice.cuts {
            CutUse::Nothing => None,
            _ if moving => Some(CutSites::Around),
            _ => Some(CutSites::Own),
        },
    };
    let mut report = PlayReport {
        schema: SCHEMA,
        command: "play",
        asset: args.asset.display().to_string(),
        asset_hash: format!("{:016x}", player.hash),
        expected: Expected::of(player.estimates.as_ref()),
        integrator: choice.integrator.name(),
        width,
        height,
        threads: rayon::current_num_threads(),
        fixed_camera: !moving,
        without_points: None,
        movie: args.movie.as_ref().map(|file| file.display().to_string()),
        exposure_ev: None,
        time_unit: "ms",
        once_per_shot: OncePerShot {
            load,
            shot: None,
            patches: None,
        },
        daylight: None,
        frames: Vec::new(),
    };
    if let Some(patches) = &args.daylight_coefficients {
        let plan = daylight::plan(args, patches, &sequence.lights, range, (width, height), console)?;
        let camera = track.at(range.first.into());
        let shot = (player.shot_watched(&camera, &shot_settings, watch)).map_err(not_looked)?;
        report.once_per_shot.shot = said(&shot, player.scene().offset, &mut report.without_points, console);
        let mattes = match args.layers.contains(&LayerName::Cryptomatte) {
            true => (player.mattes(&shot, watch)).map_err(|Cancelled| signals::failure())?,
            false => ShotMattes::default(),
        };
        let stage = daylight::Stage {
            plan: &plan,
            patches,
            args,
            player: &player,
            sequence: &sequence,
            sequence_hash: &hash,
            track: &track,
            range,
            shot: &shot,
            shot_settings: &shot_settings,
            mattes: &mattes,
            settings: &settings,
            choice: &choice,
            seed,
            movie: &movie,
            console,
            watch,
        };
        let warnings = daylight::play(&stage, &mut report, seen)?;
        return finished(report, args, range, movie, warnings, console);
    }
    let mut shot: Option<Shot> = None;
    let mut mattes = ShotMattes::default();
    let total = range.iter().count();
    console.begin("Lighting frames", Some(total as u64));
    let last_frame = range.iter().last();
    let mut warnings = BTreeSet::new();
    std::thread::scope(|scope| -> Result<(), Failure> {
        let mut writing: Option<ScopedJoinHandle<anyhow::Result<Written>>> = None;
        let mut since = Instant::now();
        for frame in range.iter() {
            go_on()?;
            let start = Instant::now();
            player.set_time(frame.into())?;
            if let Some(shot) = shot.as_mut().filter(|_| !moving) {
                player.refresh(shot)?;
            }
            let edit = player.is_edited().then(|| milliseconds(start));
            let (mut apart, mut own_shot) = (0.0, None);
            if shot.is_none() || moving {
                let looked = player
                    .shot_watched(&track.at(frame.into()), &shot_settings, watch)
                    .map_err(not_looked)?;
                let times = said(
                    &looked,
                    player.scene().offset,
                    &mut report.without_points,
                    console,
                );
                if moving {
                    own_shot = times;
                } else {
                    report.once_per_shot.shot = times;
                    apart = report.once_per_shot.of_shot();
                }
                if args.layers.contains(&LayerName::Cryptomatte) {
                    let made = player.mattes(&looked, watch);
                    mattes = made.map_err(|Cancelled| signals::failure())?;
                }
                shot = Some(looked);
            }
            let Some(shot) = &shot else {
                unreachable!("made above")
            };
            let lit = player
                .frame_watched(shot, &lights, frame.into(), &settings, watch)
                .map_err(stopped)?;
            go_on()?;
            seen(frame, &lit.layers);
            if let Some(last) = writing.take() {
                note_written(joined(last)?, &mut report.frames, &mut warnings, console);
            }
            let header = ExrHeader {
                lights: renamed.clone(),
                texts: mattes.attributes.clone(),
                ..player.header(&FrameOrigin {
                    camera: (&track.at(frame.into()), &track.name),
                    shot: &shot_settings,
                    choice: &choice,
                    seed,
                    fps: sequence.fps,
                    frame,
                    sequence_hash: &hash,
                })
            };
            if (args.png || args.movie.is_some()) && report.exposure_ev.is_none() {
                report.exposure_ev = exposure(args, &lit.layers, console);
            }
            let exposure = report.exposure_ev.unwrap_or_default();
            let file = args.output_of(frame);
            let figures = Figures::from(&lit.stats);
            let mut layers = lit.layers;
            layers.layers.extend(mattes.layers.iter().cloned());
            let movie = &movie;
            let handle = scope.spawn(move || {
                let mut written = write(args, file, &layers, &header, exposure)?;
                written.show(movie)?;
                Ok(written)
            });
            let wait = pace == Pace::OneByOne || Some(frame) == last_frame;
            let written = if wait {
                Some(joined(handle)?)
            } else {
                writing = Some(handle);
                None
            };
            let total = milliseconds(since) - apart;
            since = Instant::now();
            report.frames.push(FrameReport {
                frame,
                total,
                write: 0.0,
                edit,
                shot: own_shot,
                figures,
            });
            if let Some(written) = written {
                note_written(written, &mut report.frames, &mut warnings, console);
            }
        }
        Ok(())
    })?;
    finished(report, args, range, movie, warnings, console)
}

/// Ends the movie, and says what was done.
fn finished(
    report: PlayReport,
    args: &PlayArgs,
    range: FrameRange,
    movie: Mutex<Option<Movie>>,
    warnings: BTreeSet<String>,
    console: &Console,
) -> Result<PlayReport, Failure> {
    let movie = movie.into_inner().unwrap_or_else(PoisonError::into_inner);
    movie.map(Movie::finish).transpose()?;
    console.close();
    for warning in warnings {
        console.note(format!("warning: {warning}"));
    }
    console.note(summary(&report, args, range));
    Ok(report)
}

/// Refuses to replace what is read or is no image.
fn check_outputs(args: &PlayArgs, range: FrameRange) -> Result<(), Failure> {
    let inputs = [Some(&args.asset), args.lights.as_ref(), args.materials.as_ref()];
    let guard = Guard::new(args.replace.force).reads(inputs.into_iter().flatten().map(PathBuf::as_path));
    if let Some((movie, kind)) = args
        .movie
        .as_ref()
        .and_then(|file| Some((file, movie::kind(file)?)))
    {
        guard.check(movie, kind)?;
    }
    for file in range.iter().filter_map(|frame| args.output_of(frame)) {
        guard.check(&file, Kind::Exr)?;
        if args.png {
            guard.check(&file.with_extension("png"), Kind::Png)?;
        }
    }
    Ok(())
}

/// Gives lights names that layers of OpenEXR can have, tells whose names had to change, and returns those: the layer's name and the light's.
fn name_layers(sequence: &mut Sequence, console: &Console) -> Vec<(String, String)> {
    let mut renamed = Vec::new();
    let names: Vec<&str> = sequence.lights.iter().map(|light| light.name.as_str()).collect();
    let layers = light_layer_names(&names);
    for (light, name) in sequence.lights.iter_mut().zip(layers) {
        if light.name != name {
            console.note(format!(
                "note: light {:?} has a name that no layer can have, so its layer is light.{name}",
                light.name
            ));
            renamed.push((name.clone(), std::mem::replace(&mut light.name, name)));
        }
    }
    renamed
}

fn not_looked(error: ShotError) -> Failure {
    match error {
        ShotError::Cancelled(_) => signals::failure(),
        other => other.into(),
    }
}

fn stopped(error: FrameError) -> Failure {
    match error {
        FrameError::Cancelled(_) => signals::failure(),
        other => other.into(),
    }
}

/// Tells what a shot lacks, and notes the largest share that any did; its times.
fn said(shot: &Shot, offset: DVec3, largest: &mut Option<f64>, console: &Console) -> Option<ShotReport> {
    let Shot::Relit(shot) = shot else {
        return None;
    };
    let (uncovered, all) = (shot.uncovered(), shot.seen.len());
    let share = uncovered as f64 / all.max(1) as f64;
    let text = format!(
        "{} of {} fragments ({:.1} %) have no point near them and get no indirect light",
        words::count(uncovered as u64),
        words::count(all as u64),
        100.0 * share
    );
    if share > LACKING && largest.is_none_or(|largest| largest <= LACKING) {
        let [x, y, z] = match offset {
            DVec3::ZERO => shot.seen.eye.to_array().map(|v| v.to_string()),
            // In the file's coordinates.
            _ => (shot.seen.eye.as_dvec3() + offset)
                .to_array()
                .map(|v| v.to_string()),
        };
        console.note(format!(
            "warning: {text}, since the asset was baked for other places: bake it with --viewpoint={x},{y},{z}, where this \
             camera stands"
        ));
    } else if uncovered > 0 {
        console.detail(text);
    }
    *largest = Some(largest.map_or(share, |largest| largest.max(share)));
    Some(shot.times.into())
}

/// When the next frame begins.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Pace {
    /// While the last one is written: compressing and syncing leave cores idle for a sixth of the time.
    Overlapping,
    /// Once the last one is written: its times are its own.
    OneByOne,
}

fn joined(writing: ScopedJoinHandle<anyhow::Result<Written>>) -> anyhow::Result<Written> {
    writing
        .join()
        .unwrap_or_else(|panic| std::panic::resume_unwind(panic))
}

/// Notes that the last of the frames is written.
fn note_written(
    written: Written,
    frames: &mut [FrameReport],
    warnings: &mut BTreeSet<String>,
    console: &Console,
) {
    warnings.extend(written.warnings.iter().map(ToString::to_string));
    console.advance_to(frames.len() as u64);
    if let Some(frame) = frames.last_mut() {
        frame.write = written.milliseconds;
        let name = (written.file).map_or_else(
            || format!("frame {}", frame.frame),
            |file| file.display().to_string(),
        );
        console.detail(format!("{name}: {:.1} ms", frame.total));
    }
}

fn summary(report: &PlayReport, args: &PlayArgs, range: FrameRange) -> String {
    let last = args.output_of(range.first + (range.last - range.first) / range.step * range.step);
    let files = [
        last.map(|file| format!("up to {}", file.display())),
        report.movie.as_ref().map(|movie| format!("as {movie}")),
    ];
    format!(
        "Wrote {} with {}, {:.1} ms each (median), {}.",
        words::plural(report.frames.len(), "frame"),
        report.integrator,
        median(report.totals()),
        files.into_iter().flatten().collect::<Vec<_>>().join(" and ")
    )
}

/// Size in pixels of a play that nobody gives a size.
pub fn default_size(track: &CameraTrack) -> (usize, usize) {
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
    range.check(sequence.frames)?;
    let one_file = args.output.as_ref().is_some_and(|output| !output.has_number());
    if range.iter().nth(1).is_some() && one_file {
        return Err(Failure::Usage(
            "several frames would be written to one file: put #### into the name of --output, or choose one with \
             --frames"
                .into(),
        ));
    }
    Ok(range)
}
