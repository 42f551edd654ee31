//! Today's figures, docs/results.md: what bakes and frames take and how far they are from references.
//!
//! `cargo run --release --example results -- [--fast] [--only NAME]`
//!
//! Plays scenes of `data/` against our own path tracer, and, where `../shared` has `scenes` and `reference`, scenes of others
//! against images of another renderer; `--fast` leaves these out. `--only` takes the cases whose name holds NAME. All is made by
//! the program as users run it, one thing at a time.

use relight_scene::image::metrics::{bias, relmse};
use relight_scene::image::preview::{contact_sheet, display_encoded, pbr_neutral};
use relight_scene::image::{FloatImage, Limits, error_map, read_exr, write_png};
use serde_json::Value;
use std::collections::BTreeSet;
use std::error::Error;
use std::fmt::Write;
use std::path::Path;
use std::process::Command;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// Where everything is made, and a picture of each of our own scenes.
const FOLDER: &str = "target/results";
/// Frames of the same light: the first for the time to it, the others for the time of each.
const FRAMES: usize = 9;
/// Where scenes and references of others are.
const SHARED: &str = "../shared";
/// Name of the lights, scene, options of the bake, size, samples per pixel of each of two path tracings.
const OWN: [(&str, &str, &str, &str, &str); 6] = [
    ("atrium_point", "atrium.glb", "", "480x270", "96"),
    ("atrium_sun", "atrium.glb", "--cuts environment", "240x135", "256"),
    ("cornell", "cornell.glb", "", "180x180", "256"),
    ("table", "table.glb", "", "240x135", "256"),
    ("two_rooms_near", "two_rooms.glb", "", "240x135", "256"),
    ("isosurface", "isosurface.scene.json", "", "240x135", "256"),
];
/// Name of the reference, options of the bake. All surfaces are matt in these references.
const OTHERS: [(&str, &str); 9] = [
    ("sponza_dabrovic_point", "--lambert"),
    ("sponza_dabrovic_sun", "--lambert"),
    ("sponza_crytek_point", "--lambert"),
    ("sibenik_points", "--lambert"),
    ("modern_hall_emissive", "--lambert"),
    ("pbr_table_panel", "--lambert"),
    ("white_room", "--lambert"),
    ("country_kitchen", "--lambert"),
    ("stanford_bunny_env", "--lambert --cuts environment"),
];

/// Emission and direct light; light of two and more reflections; all.
type Parts = [FloatImage; 3];

/// The lines of the page.
#[derive(Default)]
struct Page {
    baked: BTreeSet<String>,
    bakes: String,
    frames: String,
    errors: String,
    absent: String,
}

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let fast = arguments.iter().any(|a| a == "--fast");
    let only = arguments.windows(2).find(|pair| pair[0] == "--only");
    let wanted = |name: &str| only.is_none_or(|pair| name.contains(&pair[1]));
    let profile = if cfg!(debug_assertions) { "dev" } else { "release" };
    let build = ["build", "--bin", "relight", "--profile", profile];
    if !Command::new(env!("CARGO")).args(build).status()?.success() {
        return Err("cargo could not build relight".into());
    }
    std::fs::create_dir_all(FOLDER)?;
    let mut page = Page::default();
    for (name, scene, options, size, spp) in OWN.into_iter().filter(|case| wanted(case.0)) {
        let lights = format!("data/{name}.lights.json");
        let asset = page.bake(&format!("data/{scene}"), options)?;
        let image = page.play(name, &asset, &lights, size)?;
        let (a, seconds) = traced(&asset, &lights, size, spp, 1)?;
        let (b, _) = traced(&asset, &lights, size, spp, 2)?;
        // Each of two errs by half of what they differ by, their mean by half of that.
        let noise = [0, 1, 2].map(|k| relmse(&a[k], &b[k]).ok().map(|error| error / 4.0));
        let mean = [0, 1, 2].map(|k| combined(&a[k], &b[k], |a, b| 0.5 * (a + b)));
        let by = format!("two path tracings of {spp} samples a pixel, {seconds:.0} s each");
        page.judge(name, &by, &image, &mean, noise)?;
        // What the README shows of the first scene: relit, path traced, and the error.
        let [mut relit, mut traced] = [&image[2], &mean[2]].map(FloatImage::clone);
        for panel in [&mut relit, &mut traced] {
            panel.pixels.iter_mut().for_each(|p| *p = pbr_neutral(*p));
        }
        let error = error_map(&image[2], &mean[2])?;
        let picture = display_encoded(&contact_sheet(&[relit, traced, error], 3)?);
        write_png(Path::new(&format!("{FOLDER}/{name}.png")), &picture)?;
    }
    for (name, options) in OTHERS.into_iter().filter(|case| wanted(case.0)) {
        let file = |suffix: &str| format!("{SHARED}/reference/{name}{suffix}");
        if fast || !Path::new(&file(".json")).exists() {
            let why = ["its reference is not there", "--fast"][usize::from(fast)];
            writeln!(page.absent, "- Left out: {name}: {why}.")?;
            continue;
        }
        let about: Value = serde_json::from_slice(&std::fs::read(file(".json"))?)?;
        let text = |key: &str| about[key].as_str().ok_or(format!("{name}.json has no {key}"));
        let asset = page.bake(&format!("{SHARED}/scenes/{}", text("scene")?), options)?;
        let image = page.play(name, &asset, &file(".lights.json"), text("size")?)?;
        let truth = parts(&file(".full.exr"), &file(".indirect.exr"), "beauty")?;
        let by = format!("{}, {} samples a pixel", text("renderer")?, about["spp"]);
        let noise = ["", "indirect", "full"].map(|of| about[of]["noise_relmse"].as_f64());
        page.judge(name, &by, &image, &truth, noise)?;
    }
    std::fs::write("docs/results.md", page.text()?)?;
    Ok(())
}

/// Runs the program that was built in the same profile as this example; no path here has a space in it.
fn relight(command: String) -> Result<Value> {
    eprintln!("relight {command}");
    let beside = std::env::current_exe()?.with_file_name("../relight");
    let command = command.split_whitespace().chain(["--json", "--quiet"]);
    let output = Command::new(beside).args(command).output()?;
    if !output.status.success() {
        return Err(String::from_utf8_lossy(&output.stderr).into_owned().into());
    }
    Ok(serde_json::from_slice(&output.stdout)?)
}

/// A path tracing, and its seconds.
fn traced(asset: &str, lights: &str, size: &str, spp: &str, seed: u32) -> Result<(Parts, f64)> {
    let image = format!("{FOLDER}/path.exr");
    let play = format!("play {asset} --lights {lights} -o {image} --size {size} --frames 0-0 --float");
    let said = relight(format!("{play} --integrator path --spp {spp} --seed {seed}"))?;
    Ok((
        parts(&image, &image, "indirect")?,
        number(&said, "/frames/0/total")? / 1e3,
    ))
}

/// The sequence's first frame, [`FRAMES`] times.
fn still(lights: &str) -> Result<String> {
    let mut sequence: Value = serde_json::from_slice(&std::fs::read(lights)?)?;
    sequence["frames"] = FRAMES.into();
    for light in sequence["lights"].as_array_mut().ok_or("no lights")? {
        for (_, value) in light.as_object_mut().ok_or("a light that is no object")? {
            *value = value.pointer("/keys/0/1").unwrap_or(value).clone();
        }
        if let Some(file) = light["file"].as_str() {
            let file = std::path::absolute(Path::new(lights).with_file_name(file))?;
            light["file"] = file.display().to_string().into();
        }
    }
    let still = format!("{FOLDER}/still.lights.json");
    std::fs::write(&still, sequence.to_string())?;
    Ok(still)
}

impl Page {
    /// The asset of a scene, baked once for the same options.
    fn bake(&mut self, scene: &str, options: &str) -> Result<String> {
        let name = Path::new(scene).file_name().unwrap_or_default().display();
        let asset = format!("{FOLDER}/{name}{}.relight", options.replace(' ', ""));
        if !self.baked.insert(asset.clone()) {
            return Ok(asset);
        }
        let said = relight(format!("bake {scene} -o {asset} {options}"))?;
        let n = |at: &str| number(&said, at);
        let points: f64 = numbers(&said["points"]).iter().sum();
        let counts = [n("/triangles")?, points, n("/rays")?].map(grouped).join(" | ");
        let (rays, all) = (n("/seconds/ray_tracing")?, n("/seconds/total")?);
        let links = grouped(n("/links_by_operator/transfer")?);
        let (file, memory) = (n("/bytes/total")? / 1e6, n("/peak_memory_bytes")? / 1e6);
        let line = format!("{counts} | {rays:.1} | {all:.1} | {links} | {file:.1} | {memory:.0}");
        writeln!(self.bakes, "| {name} {options} | {line} |")?;
        Ok(asset)
    }

    /// The first of [`FRAMES`] frames in the first light of a sequence; their times go to the page.
    fn play(&mut self, name: &str, asset: &str, lights: &str, size: &str) -> Result<Parts> {
        let (still, frames) = (still(lights)?, format!("{FOLDER}/frame_####.exr"));
        let said = relight(format!(
            "play {asset} --lights {still} -o {frames} --size {size} --float"
        ))?;
        let once: f64 = numbers(&said["once_per_shot"]).iter().sum();
        let first = (once + number(&said, "/frames/0/total")?) / 1e3;
        let frames = &said["frames"].as_array().ok_or("play said no frames")?[1..];
        let median = |stage: &str| {
            let mut all: Vec<f64> = frames.iter().filter_map(|f| f[stage].as_f64()).collect();
            all.sort_by(f64::total_cmp);
            all.get(all.len() / 2).copied().unwrap_or(0.0)
        };
        let stages = frames[0].as_object().into_iter().flat_map(|f| f.keys());
        let stages = stages.filter(|s| !["frame", "total", "write"].contains(&s.as_str()));
        let of = |stage: &String| format!("{} {:.1}", stage.replace('_', " "), median(stage));
        let stages = stages.map(of).collect::<Vec<_>>().join(", ");
        let each = median("total");
        writeln!(
            self.frames,
            "| {name} | {size} | {first:.2} | {each:.0} | {stages} |"
        )?;
        let frame = format!("{FOLDER}/frame_0000.exr");
        parts(&frame, &frame, "indirect")
    }

    fn judge(&mut self, name: &str, by: &str, image: &Parts, truth: &Parts, noise: Noise) -> Result<()> {
        write!(self.errors, "| {name} |")?;
        for k in 0..3 {
            let own = noise[k].map_or("–".into(), |noise| format!("{noise:.4}"));
            let (error, bias) = (relmse(&image[k], &truth[k])?, bias(&image[k], &truth[k])?.1);
            write!(self.errors, " {error:.4} | {own} | {:+.1} % |", 100.0 * bias)?;
        }
        Ok(writeln!(self.errors, " {by} |")?)
    }

    fn text(&self) -> Result<String> {
        let commit = says("git", &["describe", "--always", "--dirty", "--exclude=*"]);
        let (rustc, system) = (says("rustc", &["--version"]), std::env::consts::OS);
        let cpu = says(
            "sh",
            &["-c", "sed -n 's/^model name.*: //p' /proc/cpuinfo | head -n 1"],
        );
        let (threads, medians) = (std::thread::available_parallelism()?, FRAMES - 1);
        let build = if cfg!(debug_assertions) { "dev" } else { "release" };
        let Page {
            bakes,
            frames,
            errors,
            absent,
            ..
        } = self;
        let [nine, five, eleven] = [9, 5, 11].map(|columns| format!("|{}", " --- |".repeat(columns)));
        Ok(format!(
            "# Results

Written by `cargo run --release --example results`.

- Commit {commit}, {rustc}, {build} build.
- {cpu}, {system}, {threads} threads.
- Preset `standard`. Seeds: 0 for bakes and frames, 1 and 2 for path tracings. Bakes: one each; frames: medians of {medians}.
{absent}
## Bakes

| scene, options | triangles | points | rays | their s | s | links | MB | peak MB |
{nine}
{bakes}
## Frames

The first frame with loading and all else that is done once; each further frame, which is written beside the next one.

| lights | size | first, s | each, ms | its stages, ms |
{five}
{frames}
## Errors

relMSE as measured, and how much of it is the reference's noise; bias of the mean. `direct` holds emission.

| lights | direct | noise | bias | indirect | noise | bias | beauty | noise | bias | reference |
{eleven}
{errors}"
        ))
    }
}

/// relMSE that is a reference's own noise, where it is known.
type Noise = [Option<f64>; 3];

fn says(program: &str, arguments: &[&str]) -> String {
    let output = Command::new(program).args(arguments).output();
    let text = output.map_or(String::new(), |o| {
        String::from_utf8_lossy(&o.stdout).trim().into()
    });
    if text.is_empty() { "unknown".into() } else { text }
}

fn number(value: &Value, at: &str) -> Result<f64> {
    let number = value.pointer(at).and_then(Value::as_f64);
    Ok(number.ok_or(format!("relight said no {at}"))?)
}

/// The numbers of an array or an object.
fn numbers(value: &Value) -> Vec<f64> {
    let of_array = value.as_array().into_iter().flatten();
    let of_object = value.as_object().into_iter().flat_map(|o| o.values());
    of_array.chain(of_object).filter_map(Value::as_f64).collect()
}

/// With commas between thousands.
fn grouped(number: f64) -> String {
    let digits = format!("{number:.0}");
    let groups = digits.as_bytes().rchunks(3).rev();
    groups.map(String::from_utf8_lossy).collect::<Vec<_>>().join(",")
}

/// From an image of everything and one whose layer `name` is the indirect light.
fn parts(full: &str, indirect: &str, name: &str) -> Result<Parts> {
    let layer = |file: &str, name: &str| -> Result<FloatImage> {
        let layer = read_exr(Path::new(file), &Limits::default())?.rgb(name);
        Ok(layer.ok_or(format!("{file}: no {name}"))?)
    };
    let (full, indirect) = (layer(full, "beauty")?, layer(indirect, name)?);
    Ok([combined(&full, &indirect, |f, i| f - i), indirect, full])
}

fn combined(a: &FloatImage, b: &FloatImage, f: impl Fn(f32, f32) -> f32) -> FloatImage {
    let mut out = a.clone();
    let both = out.pixels.iter_mut().zip(&b.pixels);
    both.for_each(|(a, b)| *a = [0, 1, 2].map(|k| f(a[k], b[k])));
    out
}
