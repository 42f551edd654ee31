//! Today's figures, docs/results.md: what bakes and frames take and how far they are from references.
//!
//! `cargo run --release --example results -- [--fast] [--only NAME]`
//!
//! Plays scenes of `data/` against our own path tracer, and, where `../shared` has `scenes` and `reference`, scenes of others
//! against images of another renderer: some 25 minutes on two cores. `--fast` takes the first three cases alone, five minutes;
//! `--only` those whose name holds NAME. One thing at a time; bakes by the program, for the memory of each.

use relight_play::frame::stats::Figure;
use relight_play::{FrameSettings, Integrator, Player, ShotSettings, Tracer};
use relight_scene::image::metrics::{bias, relmse};
use relight_scene::image::preview::{contact_sheet, display_encoded, pbr_neutral};
use relight_scene::image::{FloatImage, Layers, Limits, error_map, read_exr, write_png};
use relight_scene::sequence::read_sequence;
use serde_json::Value;
use std::collections::BTreeSet;
use std::error::Error;
use std::fmt::Write;
use std::path::Path;
use std::process::Command;
use std::time::Instant;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// Of this build, and of the program that it runs.
const PROFILE: &str = ["release", "dev"][cfg!(debug_assertions) as usize];
/// Where assets go, and a picture of each of our own scenes.
const FOLDER: &str = "target/results";
/// Where scenes and references of others are.
const SHARED: &str = "../shared";
/// Frames after the first, of the same light, for the time of each.
const FRAMES: usize = 8;
/// Cases that `--fast` takes.
const FAST: usize = 3;
const CUTS: &str = "--cuts environment";
/// Name of the lights, options of the bake, scene, size, samples a pixel of each of two path tracings, which take some ten
/// seconds on two cores, the first half a minute: it is the README's picture.
const OWN: [Own; 6] = [
    ("atrium_point", "", "atrium.glb", [480, 270], 96),
    ("cornell", "", "cornell.glb", [180, 180], 256),
    ("table", "", "table.glb", [240, 135], 128),
    ("atrium_sun", CUTS, "atrium.glb", [240, 135], 128),
    ("two_rooms_near", "", "two_rooms.glb", [240, 135], 128),
    ("isosurface", "", "isosurface.scene.json", [160, 128], 96),
];
/// Names of references in `../shared`, in which all surfaces are matt.
const OTHERS: &str = "sponza_dabrovic_point sponza_dabrovic_sun sponza_crytek_point sibenik_points modern_hall_emissive \
    pbr_table_panel white_room country_kitchen stanford_bunny_env";

type Own = (&'static str, &'static str, &'static str, [usize; 2], u32);
/// Emission and direct light; light of two and more reflections; all.
type Parts = [FloatImage; 3];

/// The lines of the page.
#[derive(Default)]
struct Page {
    baked: BTreeSet<String>,
    bakes: String,
    frames: String,
    errors: String,
}

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let fast = arguments.iter().any(|a| a == "--fast");
    let only = arguments.windows(2).find(|pair| pair[0] == "--only");
    let wanted = |name: &str| only.is_none_or(|pair| name.contains(&pair[1]));
    let build = ["build", "--bin", "relight", "--profile", PROFILE];
    if !Command::new(env!("CARGO")).args(build).status()?.success() {
        return Err("cargo could not build relight".into());
    }
    std::fs::create_dir_all(FOLDER)?;
    let mut page = Page::default();
    let (own, other) = if fast { (FAST, 0) } else { (OWN.len(), usize::MAX) };
    for case in OWN.into_iter().take(own).filter(|case| wanted(case.0)) {
        page.own(case)?;
    }
    for name in OTHERS.split(' ').take(other).filter(|name| wanted(name)) {
        page.other(name)?;
    }
    let text = page.text(&arguments.join(" "))?;
    Ok(std::fs::write("docs/results.md", text)?)
}

impl Page {
    /// A case against the mean of two path tracings.
    fn own(&mut self, (name, options, scene, size, spp): Own) -> Result<()> {
        let asset = self.bake(&format!("data/{scene}"), options)?;
        let lights = format!("data/{name}.lights.json");
        let image = self.play(name, &asset, &lights, size)?;
        let traced = |seed| lit(&asset, &lights, size, (Some(spp), seed), 0);
        let ((a, seconds, _), (b, ..)) = (traced(1)?, traced(2)?);
        // Each of two errs by half of what they differ by, their mean by half of that.
        let noise = [0, 1, 2].map(|k| relmse(&a[k], &b[k]).ok().map(|error| error / 4.0));
        let mean = [0, 1, 2].map(|k| combined(&a[k], &b[k], |a, b| 0.5 * (a + b)));
        let by = format!("two path tracings of {spp} samples a pixel, {seconds:.0} s each");
        self.judge(name, &by, [&image, &mean], noise)?;
        // What the README shows of the first scene: relit, path traced, and the error.
        let mut panels = [image[2].clone(), mean[2].clone(), error_map(&image[2], &mean[2])?];
        for pixel in panels[..2].iter_mut().flat_map(|panel| &mut panel.pixels) {
            *pixel = pbr_neutral(*pixel);
        }
        let picture = display_encoded(&contact_sheet(&panels, 3)?);
        Ok(write_png(Path::new(&format!("{FOLDER}/{name}.png")), &picture)?)
    }

    /// A case against an image of another renderer, if it is there.
    fn other(&mut self, name: &str) -> Result<()> {
        let file = |suffix: &str| format!("{SHARED}/reference/{name}.{suffix}");
        if !Path::new(&file("json")).exists() {
            return Ok(());
        }
        let about: Value = serde_json::from_slice(&std::fs::read(file("json"))?)?;
        let text = |key: &str| about[key].as_str().ok_or(format!("{name}.json has no {key}"));
        let options = format!("--lambert {}", if name.ends_with("_env") { CUTS } else { "" });
        let asset = self.bake(&format!("{SHARED}/scenes/{}", text("scene")?), &options)?;
        let layers = |of: &str| read_exr(Path::new(&file(of)), &Limits::default());
        let (full, indirect) = (layers("full.exr")?, layers("indirect.exr")?);
        let image = self.play(name, &asset, &file("lights.json"), [full.width, full.height])?;
        let by = format!("{}, {} samples a pixel", text("renderer")?, about["spp"]);
        let noise = ["", "indirect", "full"].map(|of| about[of]["noise_relmse"].as_f64());
        self.judge(name, &by, [&image, &parts(&full, &indirect, "beauty")?], noise)
    }

    /// The asset of a scene, baked once for the same options by the program, of the profile of this example.
    fn bake(&mut self, scene: &str, options: &str) -> Result<String> {
        let name = Path::new(scene).file_name().unwrap_or_default().display();
        let asset = format!("{FOLDER}/{name}{}.relight", options.replace(' ', ""));
        if self.baked.insert(asset.clone()) {
            eprintln!("baking {name} {options}");
            let program = std::env::current_exe()?.with_file_name("../relight");
            let mut command = Command::new(program);
            command.args(["bake", scene, "-o", &asset, "--json", "--quiet"]);
            let output = command.args(options.split_whitespace()).output()?;
            if !output.status.success() {
                return Err(String::from_utf8_lossy(&output.stderr).into_owned().into());
            }
            let said: Value = serde_json::from_slice(&output.stdout)?;
            let n = |at: &str| said.pointer(at).and_then(Value::as_f64).unwrap_or(f64::NAN);
            let points = said["points"].as_array().into_iter().flatten();
            let points: f64 = points.filter_map(Value::as_f64).sum();
            let links = n("/links_by_operator/transfer") / 1e3;
            let (triangles, points, rays) = (n("/triangles") / 1e3, points / 1e3, n("/rays") / 1e6);
            let (traced, all) = (n("/seconds/ray_tracing"), n("/seconds/total"));
            let (file, memory) = (n("/bytes/total") / 1e6, n("/peak_memory_bytes") / 1e6);
            let counts = format!("{triangles:.1} | {points:.1} | {rays:.1}");
            let line = format!("{counts} | {traced:.1} | {all:.1} | {links:.0} | {file:.1} | {memory:.0}");
            self.bakes += &format!("| {name} {options} | {line} |\n");
        }
        Ok(asset)
    }

    /// What the player makes of the first light of a sequence; the times go to the page.
    fn play(&mut self, name: &str, asset: &str, lights: &str, size: [usize; 2]) -> Result<Parts> {
        let (parts, first, each) = lit(asset, lights, size, (None, 0), FRAMES)?;
        let [width, height] = size;
        self.frames += &format!("| {name} | {width}x{height} | {first:.2} | {each} |\n");
        Ok(parts)
    }

    fn judge(&mut self, name: &str, by: &str, pair: [&Parts; 2], noise: [Option<f64>; 3]) -> Result<()> {
        write!(self.errors, "| {name} |")?;
        for k in 0..3 {
            let own = noise[k].map_or("–".into(), |noise| format!("{noise:.4}"));
            let (error, bias) = (
                relmse(&pair[0][k], &pair[1][k])?,
                bias(&pair[0][k], &pair[1][k])?.1,
            );
            write!(self.errors, " {error:.4} | {own} | {:+.1} % |", 100.0 * bias)?;
        }
        Ok(writeln!(self.errors, " {by} |")?)
    }

    fn text(&self, arguments: &str) -> Result<String> {
        let command = format!("cargo run --release --example results -- {arguments}");
        let command = command.trim_end_matches([' ', '-']);
        let commit = says("git", &["describe", "--always", "--dirty", "--exclude=*"]);
        let (rustc, system) = (says("rustc", &["--version"]), std::env::consts::OS);
        let model = "sed -n 's/^model name.*: //p' /proc/cpuinfo | head -n 1";
        let (cpu, threads) = (says("sh", &["-c", model]), std::thread::available_parallelism()?);
        let (bakes, frames, errors, medians) = (&self.bakes, &self.frames, &self.errors, FRAMES);
        let [nine, five, eleven] = [9, 5, 11].map(|columns| format!("|{}", " --- |".repeat(columns)));
        Ok(format!(
            "# Results

Written by `{command}`.

- Commit {commit}, {rustc}, {PROFILE} build.
- {cpu}, {system}, {threads} threads.
- Preset `standard`. Seeds: 0 for bakes and frames, 1 and 2 for path tracings. Bakes: one each; frames: medians of {medians}.

## Bakes

| scene, options | 10³ triangles | 10³ points | 10⁶ rays | their s | s | 10³ links | MB | peak MB |
{nine}
{bakes}
## Frames

Seconds from the asset's file to the first frame; milliseconds of each further one, and the stages of the last.

| lights | size | first, s | each, ms | stages, ms |
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

fn says(program: &str, arguments: &[&str]) -> String {
    let output = Command::new(program).args(arguments).output().ok();
    let text = output.and_then(|output| String::from_utf8(output.stdout).ok());
    text.unwrap_or("unknown".into()).trim().into()
}

/// A frame of a sequence's first light, as the asset has it or of so many path traced samples; seconds from the file to it; and,
/// of `more` frames, the median of milliseconds and the stages of the last.
fn lit(
    asset: &str,
    lights: &str,
    [width, height]: [usize; 2],
    (samples, seed): (Option<u32>, u64),
    more: usize,
) -> Result<(Parts, f64, String)> {
    let start = Instant::now();
    let path = |_| Integrator::Traced(Tracer::Path { max_bounces: None });
    let settings = ShotSettings {
        integrator: samples.map_or(Integrator::Auto, path),
        width,
        height,
        samples,
        ..ShotSettings::default()
    };
    let player = Player::open_for(asset, &settings.integrator)?;
    let sequence = read_sequence(Path::new(lights))?;
    let lights = player.lights(&sequence.lights)?;
    let shot = player.shot(&player.camera(&sequence, None)?.at(0.0), &settings)?;
    let settings = FrameSettings {
        seed,
        ..FrameSettings::default()
    };
    let mut frame = player.frame(&shot, &lights, 0.0, &settings)?;
    let first = start.elapsed().as_secs_f64();
    let mut times = vec![0.0; more];
    for time in &mut times {
        let start = Instant::now();
        frame = player.frame(&shot, &lights, 0.0, &settings)?;
        *time = 1e3 * start.elapsed().as_secs_f64();
    }
    times.sort_by(f64::total_cmp);
    let mut each = format!("{:.0} |", times.get(more / 2).unwrap_or(&0.0));
    for (stage, figure) in frame.stats.figures() {
        if let Figure::Milliseconds(time) = figure {
            write!(each, " {} {time:.0},", stage.replace('_', " "))?;
        }
    }
    let parts = parts(&frame.layers, &frame.layers, "indirect")?;
    Ok((parts, first, each))
}

/// From an image of everything and one whose layer `name` is the indirect light.
fn parts(full: &Layers, indirect: &Layers, name: &str) -> Result<Parts> {
    let full = full.rgb("beauty").ok_or("an image has no beauty")?;
    let indirect = indirect.rgb(name).ok_or("an image has no indirect light")?;
    Ok([combined(&full, &indirect, |f, i| f - i), indirect, full])
}

fn combined(a: &FloatImage, b: &FloatImage, f: impl Fn(f32, f32) -> f32) -> FloatImage {
    let mut out = a.clone();
    let both = out.pixels.iter_mut().zip(&b.pixels);
    both.for_each(|(a, b)| *a = [0, 1, 2].map(|k| f(a[k], b[k])));
    out
}
