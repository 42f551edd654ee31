//! `relight play --daylight-coefficients`: frames as sums of the images of the sky's patches.

use super::args::{LayerName, PlayArgs};
use super::report::{DaylightReport, Figures, FrameReport, PlayReport};
use super::writing::{Written, exposure, write};
use crate::console::Console;
use crate::failure::Failure;
use crate::frames::FrameRange;
use crate::movie::Movie;
use crate::signals;
use crate::statistics::milliseconds;
use crate::words;
use rayon::prelude::*;
use relight_play::choice::Choice;
use relight_play::daylight::{DaylightError, DaylightLayers, DaylightOrder, lit_patches, most_bytes};
use relight_play::frame::stats::Figure;
use relight_play::header::FrameOrigin;
use relight_play::mattes::ShotMattes;
use relight_play::player::FrameError;
use relight_play::{FrameSettings, Player, Shot, ShotSettings};
use relight_render::watch::Watch;
use relight_scene::camera::CameraTrack;
use relight_scene::daylight::patches_at;
use relight_scene::image::{ExrHeader, Layers};
use relight_scene::light::{LightKind, LightTrack};
use relight_scene::sequence::Sequence;
use relight_scene::sky_patches::SkyPatches;
use std::collections::BTreeSet;
use std::sync::Mutex;
use std::time::Instant;

/// Which images are made.
pub struct Plan {
    /// Which patches ever shine.
    lit: Vec<bool>,
    /// Names of the layers that are wanted of frames.
    wanted: Vec<&'static str>,
}

/// What frames are made of.
pub struct Stage<'a> {
    pub plan: &'a Plan,
    pub patches: &'a SkyPatches,
    pub args: &'a PlayArgs,
    pub player: &'a Player,
    pub sequence: &'a Sequence,
    pub sequence_hash: &'a str,
    pub track: &'a CameraTrack,
    pub range: FrameRange,
    pub shot: &'a Shot,
    pub shot_settings: &'a ShotSettings,
    pub mattes: &'a ShotMattes,
    pub settings: &'a FrameSettings,
    pub choice: &'a Choice,
    pub seed: u64,
    pub movie: &'a Mutex<Option<Movie>>,
    pub console: &'a Console,
    pub watch: &'a dyn Watch,
}

/// Which images a play takes, before any is made.
///
/// # Errors
/// They take too much memory.
pub fn plan(
    args: &PlayArgs,
    patches: &SkyPatches,
    lights: &[LightTrack],
    range: FrameRange,
    size: (usize, usize),
    console: &Console,
) -> Result<Plan, Failure> {
    let shown = args.png || args.movie.is_some();
    let plan = Plan {
        lit: lit_patches(lights, patches, range.iter()),
        wanted: (args.layers.iter().map(|layer| layer.name()))
            .chain(shown.then(|| LayerName::Beauty.name()))
            .collect(),
    };
    let shining = plan.lit.iter().filter(|lit| **lit).count();
    let most = most_bytes(shining, &plan.wanted, size)?;
    console.note(format!(
        "Daylight: {shining} of {} patches shine; their images take up to {}.",
        patches.len(),
        words::bytes(most)
    ));
    Ok(plan)
}

/// Refuses what is no sum of patches.
///
/// # Errors
/// [`Failure::Usage`].
pub fn check(
    args: &PlayArgs,
    sequence: &Sequence,
    track: &CameraTrack,
    player: &Player,
) -> Result<(), Failure> {
    let refused = |why: String| Err(Failure::Usage(format!("--daylight-coefficients {why}")));
    let is_sky =
        |light: &&LightTrack| matches!(light.kind, LightKind::SunSky { .. } | LightKind::Weather { .. });
    let (skies, others): (Vec<_>, Vec<_>) = sequence.lights.iter().partition(is_sky);
    if let Some(first) = others.first() {
        let more = match others.len() - 1 {
            0 => String::new(),
            more => format!(" and {}", words::plural(more, "other light")),
        };
        return refused(format!(
            "makes light of suns and skies alone (lights of type weather and sun_sky), but there is {}, of type {}{more}; play those in \
             a sequence of their own and add the frames: light adds up",
            first.name,
            kind(first)
        ));
    }
    if skies.is_empty() {
        return refused("makes light of suns and skies alone, and the sequence has none: add a light of type weather or sun_sky".into());
    }
    if !track.is_fixed() {
        return refused(
            "keeps images of what one standing camera sees, and this camera moves: choose another with --camera, or leave the option out".into(),
        );
    }
    if player.materials_move() {
        return refused(
            "keeps images of one state of the materials, and --materials has keys: leave one of both out"
                .into(),
        );
    }
    for layer in [LayerName::Lights, LayerName::CutSize, LayerName::Nodes] {
        if args.layers.contains(&layer) {
            return refused(format!(
                "makes no layers {}: it adds up images of patches, not of lights",
                match layer {
                    LayerName::Lights => "lights",
                    other => other.name(),
                }
            ));
        }
    }
    Ok(())
}

/// A light's type as it stands in a sequence.
fn kind(light: &LightTrack) -> String {
    let value = serde_json::to_value(light).unwrap_or_default();
    value["type"].as_str().unwrap_or_default().to_owned()
}

/// Plays; returns what the files hold that nobody asked for.
///
/// # Errors
/// Images take too much memory, or files can't be written.
pub fn play(
    stage: &Stage<'_>,
    report: &mut PlayReport,
    mut seen: impl FnMut(u32, &Layers),
) -> Result<BTreeSet<String>, Failure> {
    let layers = images(stage, report)?;
    let mut warnings = BTreeSet::new();
    let frames: Vec<u32> = stage.range.iter().collect();
    stage.console.begin("Adding up frames", Some(frames.len() as u64));
    for some in frames.chunks(layers.at_once()) {
        if stage.watch.stopped() {
            return Err(signals::failure());
        }
        for written in summed(stage, &layers, some, report, &mut seen)? {
            warnings.extend(written.warnings.iter().map(ToString::to_string));
        }
        stage.console.advance_to(report.frames.len() as u64);
    }
    Ok(warnings)
}

/// The images of all patches that ever shine.
fn images(stage: &Stage<'_>, report: &mut PlayReport) -> Result<DaylightLayers, Failure> {
    let start = Instant::now();
    let Plan { lit, wanted } = stage.plan;
    let shining = lit.iter().filter(|lit| **lit).count();
    stage.console.begin("Lighting patches", Some(shining as u64));
    let order = DaylightOrder {
        patches: stage.patches,
        lit,
        wanted,
        frame: *stage.settings,
    };
    let watch = Told(stage);
    let layers =
        DaylightLayers::new(stage.player, stage.shot, &order, &watch).map_err(|error| match error {
            DaylightError::Frame(FrameError::Cancelled(_)) => signals::failure(),
            other => other.into(),
        })?;
    let took = milliseconds(start);
    stage.console.note(format!(
        "Daylight: {} in {:.1} s, {}; {} on nothing that is seen.",
        words::plural(layers.len(), "image"),
        took / 1e3,
        words::bytes(layers.bytes()),
        match layers.unseen() {
            1 => "1 patch shines".to_owned(),
            unseen => format!("{unseen} patches shine"),
        }
    ));
    report.once_per_shot.patches = Some(took);
    report.daylight = Some(DaylightReport {
        patches: stage.patches.len(),
        images: layers.len(),
        unseen: layers.unseen(),
        bytes: layers.bytes(),
    });
    Ok(layers)
}

/// Adds up and writes some frames.
fn summed(
    stage: &Stage<'_>,
    layers: &DaylightLayers,
    some: &[u32],
    report: &mut PlayReport,
    seen: &mut impl FnMut(u32, &Layers),
) -> Result<Vec<Written>, Failure> {
    let start = Instant::now();
    let lights = &stage.sequence.lights;
    let skies: Vec<_> = (some.par_iter())
        .map(|&frame| patches_at(lights, stage.patches, frame.into()))
        .collect();
    let sky = milliseconds(start);
    let mut frames = layers.frames(&skies);
    let sum = milliseconds(start) - sky;
    for (&frame, layers) in some.iter().zip(&mut frames) {
        seen(frame, layers);
        if (stage.args.png || stage.args.movie.is_some()) && report.exposure_ev.is_none() {
            report.exposure_ev = exposure(stage.args, layers, stage.console);
        }
        layers.layers.extend(stage.mattes.layers.iter().cloned());
    }
    let exposure_ev = report.exposure_ev.unwrap_or_default();
    let written = (some.par_iter().zip(&frames))
        .map(|(&frame, layers)| {
            let file = stage.args.output_of(frame);
            write(stage.args, file, layers, &header(stage, frame), exposure_ev)
        })
        .collect::<anyhow::Result<Vec<Written>>>()?;
    let mut all = Vec::with_capacity(written.len());
    for mut written in written {
        written.show(stage.movie)?;
        all.push(written);
    }
    // What is done for several frames at once is shared out among them.
    let each = some.len() as f64;
    let total = milliseconds(start) / each;
    for (&frame, written) in some.iter().zip(&all) {
        let figures = [("sky", sky / each), ("sum", sum / each)];
        report.frames.push(FrameReport {
            frame,
            total,
            write: written.milliseconds,
            edit: None,
            shot: None,
            figures: Figures(
                figures
                    .map(|(name, time)| (name, Figure::Milliseconds(time)))
                    .to_vec(),
            ),
        });
    }
    Ok(all)
}

fn header(stage: &Stage<'_>, frame: u32) -> ExrHeader {
    let mut texts = stage.mattes.attributes.clone();
    texts.push(("relightDaylight".into(), stage.patches.len().to_string()));
    ExrHeader {
        texts,
        ..stage.player.header(&FrameOrigin {
            camera: (&stage.track.at(frame.into()), &stage.track.name),
            shot: stage.shot_settings,
            choice: stage.choice,
            seed: stage.seed,
            fps: stage.sequence.fps,
            frame,
            sequence_hash: stage.sequence_hash,
        })
    }
}

/// Shows how many patches are done.
struct Told<'a>(&'a Stage<'a>);

impl Watch for Told<'_> {
    fn advance_to(&self, done: usize, _: usize) {
        self.0.console.advance_to(done as u64);
    }

    fn stopped(&self) -> bool {
        self.0.watch.stopped()
    }
}
