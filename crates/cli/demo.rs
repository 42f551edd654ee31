//! `relight demo`: the main job on a scene of `data/`, from glTF to frames.

use crate::bake::{self, Job};
use crate::compare::results_table;
use crate::console::Console;
use crate::failure::{Failure, Outcome};
use crate::frames;
use crate::guard::Guard;
use crate::kinds::Kind;
use crate::options::LightUnitsName;
use crate::options::ReplaceArgs;
use crate::output::{self, log_path};
use crate::play::{self, IntegratorName, Pace, PlayArgs, PlayReport};
use crate::signals;
use crate::statistics::median;
use crate::words;
use clap::Args;
use relight_bake::params::{BakeParams, Preset};
use relight_scene::image::metrics::{Comparison, compare};
use relight_scene::image::preview::{contact_sheet, tone_mapped};
use relight_scene::image::{BEAUTY, FloatImage, Layers, write_png};
use relight_scene::sequence::read_sequence;
use relight_scene::traced::Shading;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Show the main job on a scene of our own: bake it, replay a moving light, measure the error.
///
/// Bakes data/atrium.glb, plays its lighting sequence into OpenEXR and PNG frames with a contact sheet, prints
/// what the asset holds, and compares a small frame with the path tracer. Takes less than a minute on two cores.
/// Must run within a clone of the repository, or beside its data folder.
#[derive(Args)]
pub struct DemoArgs {
    /// Folder for everything that is written.
    #[arg(short, long, value_name = "DIR", default_value = FOLDER)]
    pub output: PathBuf,
    #[command(flatten)]
    pub replace: ReplaceArgs,
}

/// The demo's scene and sequence in `data/`.
const SCENE: &str = "atrium.glb";
const SEQUENCE: &str = "atrium.lights.json";
/// Where its outputs go, and what its asset is called there.
const FOLDER: &str = "out/demo";
const ASSET: &str = "atrium.relight";
/// Frames side by side on the contact sheet, and how much smaller each is.
const SHEET_COLUMNS: usize = 6;
const SHEET_SHRINK: usize = 2;
/// Size of the compared frame, samples of each of two path-traced halves, and which frame it is: small and few,
/// because the whole demo is to take less than a minute.
const CHECK_SIZE: (usize, usize) = (160, 90);
const CHECK_SPP: u32 = 32;
const CHECK_FRAME: u32 = 8;

/// Runs the command.
pub fn run(args: &DemoArgs, seed: u64, console: &Console) -> Result<Outcome, Failure> {
    let start = Instant::now();
    let data = find_data()?;
    let folder = args.output.as_path();
    let asset = folder.join(ASSET);
    let inputs = [data.join(SCENE), data.join(SEQUENCE)];
    let guard = Guard::new(args.replace.force).reads(inputs.iter().map(PathBuf::as_path));
    for (file, kind) in [
        (asset.clone(), Kind::Asset),
        (log_path(&asset), Kind::Log),
        (folder.join("contact_sheet.png"), Kind::Png),
    ] {
        guard.check(&file, kind)?;
    }
    output::prepare_output(&asset)?;

    let result = bake_scene(&data, &asset, seed, console)?;
    output::print_text(&format!("{}\n\n", result.text))?;

    let mut thumbnails = Vec::new();
    let frames = PlayArgs {
        png: true,
        replace: args.replace,
        ..play_args(&asset, &data, folder, "frame_####.exr")?
    };
    let played = play::play(&frames, seed, console, Pace::Overlapping, |_, layers| {
        thumbnails.push(shrunk(&layers.rgb(BEAUTY).unwrap_or_default(), SHEET_SHRINK));
    })?;
    let sheet = contact_sheet(&thumbnails, SHEET_COLUMNS)?;
    let whole = signals::whole();
    let shown = tone_mapped(&sheet, played.exposure_ev.unwrap_or_default());
    write_png(&folder.join("contact_sheet.png"), &shown)?;

    drop(whole);
    let errors = check(&asset, &data, folder, seed, console)?;
    output::print_text(&format!("{errors}\n"))?;
    output::print_text(&format!(
        "Baked in {:.1} s, then {:.0} ms a frame (median of {}).\n",
        (result.report.inspection.run).map_or(0.0, |run| run.seconds.total),
        median(played.totals()),
        words::plural(thumbnails.len(), "frame"),
    ))?;
    console.note(format!(
        "Everything is in {}: {}, its log {}, frame_*.exr, frame_*.png, contact_sheet.png. {:.0} s in all.",
        folder.display(),
        asset.display(),
        log_path(&asset).display(),
        start.elapsed().as_secs_f64()
    ));
    Ok(Outcome::Done)
}

/// Bakes the demo's scene.
fn bake_scene(
    data: &Path,
    asset: &Path,
    seed: u64,
    console: &Console,
) -> Result<bake::job::JobResult, Failure> {
    let params = BakeParams {
        seed,
        ..BakeParams::preset(Preset::Draft)
    };
    let reading = Instant::now();
    let lights = read_sequence(&data.join(SEQUENCE))?;
    let (scene, source_hash) = bake::read_scene(&data.join(SCENE), LightUnitsName::Spec, None)?;
    let job = Job {
        params: &params,
        shading: Shading::Full,
        lights: Some(&lights),
        source_hash,
        kept: None,
        checked: true,
        force: true,
        until: None,
    };
    bake::run_job(&job, scene, asset, reading.elapsed().as_secs_f64(), console)
}

/// The demo's asset, baked if it wasn't yet, and its lights.
///
/// # Errors
/// There is no data folder, or the bake failed.
pub fn asset(seed: u64, console: &Console) -> Result<(PathBuf, PathBuf), Failure> {
    let data = find_data()?;
    let asset = Path::new(FOLDER).join(ASSET);
    if !asset.is_file() {
        output::prepare_output(&asset)?;
        bake_scene(&data, &asset, seed, console)?;
    }
    Ok((asset, data.join(SEQUENCE)))
}

/// The data folder of the clone that we run in, or of the one that the program was built in.
fn find_data() -> Result<PathBuf, Failure> {
    let places = [std::env::current_dir(), std::env::current_exe()];
    for place in places.into_iter().flatten() {
        let found = place
            .ancestors()
            .map(|a| a.join("data"))
            .find(|d| d.join(SCENE).is_file());
        if let Some(data) = found {
            return Ok(data);
        }
    }
    Err(anyhow::anyhow!(
        "no data folder with {SCENE} here or above, nor above the program: run the demo within a clone of the \
         repository"
    )
    .into())
}

fn play_args(asset: &Path, data: &Path, folder: &Path, name: &str) -> Result<PlayArgs, Failure> {
    Ok(PlayArgs {
        lights: Some(data.join(SEQUENCE)),
        size: Some((640, 360)),
        ..PlayArgs::new(asset, &folder.join(name))?
    })
}

/// A table of errors of one small frame against the path tracer, the path tracer's own noise taken off.
fn check(asset: &Path, data: &Path, folder: &Path, seed: u64, console: &Console) -> Result<String, Failure> {
    let frame = |name: &str, integrator, spp, seed| -> Result<(Layers, PlayReport), Failure> {
        let args = PlayArgs {
            integrator,
            spp,
            size: Some(CHECK_SIZE),
            frames: Some(frames::FrameRange {
                first: CHECK_FRAME,
                last: CHECK_FRAME,
                step: 1,
            }),
            ..play_args(asset, data, &folder.join("check"), name)?
        };
        let mut kept = Layers::default();
        let played = play::play(&args, seed, console, Pace::Overlapping, |_, layers| {
            kept = layers.clone()
        })?;
        Ok((kept, played))
    };
    // 16 primary rays: the reference is a mean over the pixel.
    let (relit, _) = frame("relit.exr", IntegratorName::Auto, Some(16), seed)?;
    let (a, played) = frame("path_a.exr", IntegratorName::Path, Some(CHECK_SPP), seed)?;
    let (b, _) = frame(
        "path_b.exr",
        IntegratorName::Path,
        Some(CHECK_SPP),
        seed ^ u64::MAX,
    )?;
    let mut rows: Vec<(String, Comparison)> = Vec::new();
    let mut noise = Vec::new();
    for layer in ["direct", "indirect", BEAUTY] {
        let rgb = |layers: &Layers| layers.rgb(layer).unwrap_or_default();
        let (a, b) = (rgb(&a), rgb(&b));
        // The mean of two independent halves has a quarter of the squared difference between them.
        noise.push(format!("{layer} {:.4}", compare(&a, &b)?.relmse / 4.0));
        rows.push((layer.to_owned(), compare(&rgb(&relit), &mean(&a, &b))?));
    }
    Ok(format!(
        "Frame {CHECK_FRAME} at {} x {} against the path tracer ({} samples a pixel, {:.0} ms):\n\n{}\n\n\
         The path tracer's own noise is part of each relMSE: {}.",
        CHECK_SIZE.0,
        CHECK_SIZE.1,
        2 * CHECK_SPP,
        2.0 * median(played.totals()),
        results_table(&rows),
        noise.join(", ")
    ))
}

fn mean(a: &FloatImage, b: &FloatImage) -> FloatImage {
    let pixels = a
        .pixels
        .iter()
        .zip(&b.pixels)
        .map(|(a, b)| std::array::from_fn(|k| 0.5 * (a[k] + b[k])));
    FloatImage {
        pixels: pixels.collect(),
        ..*a
    }
}

/// Every `by` × `by` pixels as their mean.
fn shrunk(image: &FloatImage, by: usize) -> FloatImage {
    let mut out = FloatImage::black(image.width / by, image.height / by);
    for (i, pixel) in out.pixels.iter_mut().enumerate() {
        let (x, y) = (i % out.width * by, i / out.width * by);
        for dy in 0..by {
            for dx in 0..by {
                let from = image.pixels[(y + dy) * image.width + x + dx];
                (0..3).for_each(|k| pixel[k] += from[k] / (by * by) as f32);
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thumbnail_is_the_mean_of_its_pixels() {
        let image = FloatImage {
            width: 2,
            height: 2,
            pixels: vec![[1.0; 3], [3.0; 3], [0.0; 3], [0.0; 3]],
        };
        assert_eq!(shrunk(&image, 2).pixels, [[1.0; 3]]);
    }
}
