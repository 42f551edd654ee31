//! The study of visibility cuts in docs/notebook/cuts.md: tables in Markdown, from the program as users run it.
//!
//! `cargo build --release && cargo run --release --example cut_study -- WHAT [OPTIONS] SCENE.glb=MAP.hdr …`
//!
//! WHAT is
//! - `table`: sites, mean length, error, bytes and bake time under a tree by geometry and one by pilots, play times for
//!   illumination cuts of 128, 256 and 512 nodes (figure 10 of Cheslack-Postava et al. 2008, for our scenes);
//! - `size`: image error and time against the size of the illumination cut (their figure 7);
//! - `judge`: nothing is made; the three arguments are an image and two path tracings.
//!
//! Options: `--size WxH` (160x90), `--spp N` of each of the two path tracings (64), `--cut-lights N` (4096), `--levels N`
//! of points (4), `--block N` (1): images are compared by the
//! means of N × N pixels, against the noise of path tracing, `--keep DIR` for what is made on the way. Direct light only,
//! so that bakes leave the transfer operator out. relMSE is that to the mean of the two path tracings less a quarter of that
//! between them, which is the noise of their mean.

use relight_scene::image::{FloatImage, Limits, metrics, read_exr};
use serde_json::Value;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::Command;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

struct Study {
    size: String,
    spp: String,
    lights: String,
    levels: String,
    block: usize,
    folder: PathBuf,
    scenes: Vec<(PathBuf, PathBuf)>,
}

fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let what = arguments.next().unwrap_or_default();
    let temporary = tempfile::tempdir()?;
    let mut study = Study {
        size: "160x90".into(),
        spp: "64".into(),
        lights: "4096".into(),
        levels: "4".into(),
        block: 1,
        folder: temporary.path().into(),
        scenes: Vec::new(),
    };
    while let Some(argument) = arguments.next() {
        let mut value = || arguments.next().ok_or(format!("{argument} wants a value"));
        match argument.as_str() {
            "--size" => study.size = value()?,
            "--spp" => study.spp = value()?,
            "--cut-lights" => study.lights = value()?,
            "--levels" => study.levels = value()?,
            "--block" => study.block = value()?.parse::<usize>()?.max(1),
            "--keep" => study.folder = value()?.into(),
            _ if what == "judge" => study.scenes.push((argument.into(), PathBuf::new())),
            _ => {
                let (scene, map) = argument
                    .split_once('=')
                    .ok_or("scenes are given as SCENE.glb=MAP.hdr")?;
                study.scenes.push((scene.into(), std::path::absolute(map)?));
            }
        }
    }
    println!(
        "{} directions, {}, path tracings of {} samples\n",
        study.lights, study.size, study.spp
    );
    match what.as_str() {
        "table" => study.table(),
        "size" => study.illumination(),
        "judge" => study.judgement(),
        _ => Err("the first argument is table, size or judge".into()),
    }
}

/// The mean of two path tracings and what it is worth.
struct Reference {
    image: FloatImage,
    /// relMSE of one tracing to the other, over 4.
    noise: f64,
}

/// An image against a reference.
struct Judged {
    /// Less the reference's noise.
    relmse: f64,
    bias: f64,
    flip: f64,
}

impl Study {
    fn table(&self) -> Result<()> {
        println!(
            "| scene | tree | sites | mean length | RMS error | bytes | an element | cuts s | relMSE | bias | \
             shade 128 | 256 | 512 |"
        );
        println!("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |");
        for (scene, map) in &self.scenes {
            let lights = self.sequence(map)?;
            let mut reference = None;
            for (tree, beta) in [("geometry", "1"), ("pilots", "0.45")] {
                let asset = self.path(scene, &format!("{tree}.relight"));
                let said = self.bake(scene, &asset, &["--levels", &self.levels, "--beta", beta])?;
                let reference = match &mut reference {
                    Some(reference) => reference,
                    none => none.insert(self.reference(&asset, &lights)?),
                };
                let mut times = Vec::new();
                let mut judged = None;
                for nodes in ["128", "256", "512"] {
                    let (image, said) = self.play(&asset, &lights, nodes)?;
                    times.push(format!("{:.0} ms", of(&said["frames"][0], "shade")?));
                    judged = Some(self.judge(&image, reference)?);
                }
                let judged = judged.ok_or("no image")?;
                let bytes = stored(&said, "cuts")? + stored(&said, "light_tree")?;
                println!(
                    "| {} | {tree} | {} | {:.0} | {:.3} | {:.0} kB | {:.2} | {:.1} | {:.4} | {:+.1} % | {} |",
                    name(scene),
                    of(&said["cuts"], "sites")?,
                    of(&said["cuts"], "mean_length")?,
                    of(&said["cuts"], "rms_error")?,
                    bytes / 1e3,
                    bytes / of(&said["cuts"], "elements")?,
                    of(&said["seconds"], "cuts")?,
                    judged.relmse,
                    100.0 * judged.bias,
                    times.join(" | "),
                );
            }
        }
        Ok(())
    }

    fn illumination(&self) -> Result<()> {
        println!("| scene | nodes asked for | merged | relMSE | bias | FLIP | illumination cut | shade |");
        println!("| --- | --- | --- | --- | --- | --- | --- | --- |");
        for (scene, map) in &self.scenes {
            let lights = self.sequence(map)?;
            let asset = self.path(scene, "size.relight");
            self.bake(scene, &asset, &["--levels", &self.levels])?;
            let reference = self.reference(&asset, &lights)?;
            println!(
                "| {} | reference's noise | | {:.4} | | | | |",
                name(scene),
                reference.noise
            );
            for nodes in ["32", "64", "128", "256", "512", "1024", "2048", "4096"] {
                let (image, said) = self.play(&asset, &lights, nodes)?;
                let judged = self.judge(&image, &reference)?;
                let frame = &said["frames"][0];
                println!(
                    "| | {nodes} | {:.0} | {:.4} | {:+.1} % | {:.3} | {:.1} ms | {:.0} ms |",
                    of(frame, "merged_nodes_per_fragment")?,
                    judged.relmse,
                    100.0 * judged.bias,
                    judged.flip,
                    of(frame, "illumination_cut")?,
                    of(frame, "shade")?,
                );
            }
        }
        Ok(())
    }

    fn path(&self, scene: &Path, end: &str) -> PathBuf {
        self.folder.join(format!("{}.{end}", name(scene)))
    }

    fn sequence(&self, map: &Path) -> Result<PathBuf> {
        let path = self.folder.join(format!("{}.lights.json", name(map)));
        let sequence = serde_json::json!({
            "relight_sequence": 1,
            "lights": [{ "name": "sky", "type": "environment", "file": map }],
        });
        std::fs::write(&path, sequence.to_string())?;
        Ok(path)
    }

    fn bake(&self, scene: &Path, asset: &Path, options: &[&str]) -> Result<Value> {
        // No link is worth as much as that: direct light needs none.
        let common = [
            "--sender-levels",
            "1",
            "--epsilon",
            "1e9",
            "--cuts",
            "environment",
        ];
        relight(
            Command::new(program()?)
                .arg("bake")
                .arg(scene)
                .arg("-o")
                .arg(asset)
                .args(common)
                .args(["--cut-lights", &self.lights, "--json"])
                .args(options),
        )
    }

    fn frame(&self, asset: &Path, lights: &Path, image: &Path, options: &[&str]) -> Result<Value> {
        relight(
            Command::new(program()?)
                .arg("play")
                .arg(asset)
                .arg("--lights")
                .arg(lights)
                .arg("-o")
                .arg(image)
                .args(["--size", &self.size, "--layers", "direct", "--float", "--json"])
                .args(options),
        )
    }

    fn play(&self, asset: &Path, lights: &Path, nodes: &str) -> Result<(PathBuf, Value)> {
        let image = asset.with_extension("exr");
        let options = ["--integrator", "cuts", "--illumination-cut", nodes];
        let said = self.frame(asset, lights, &image, &options)?;
        Ok((image, said))
    }

    fn reference(&self, asset: &Path, lights: &Path) -> Result<Reference> {
        let tracing = |seed: &str| -> Result<PathBuf> {
            let image = asset.with_extension(format!("path{seed}.exr"));
            let options = [
                "--integrator",
                "path",
                "--spp",
                &self.spp,
                "--max-bounces",
                "1",
                "--seed",
                seed,
            ];
            self.frame(asset, lights, &image, &options)?;
            Ok(image)
        };
        self.mean_of(&tracing("1")?, &tracing("2")?)
    }

    fn mean_of(&self, one: &Path, other: &Path) -> Result<Reference> {
        let (one, other) = (self.read(one)?, self.read(other)?);
        let noise = metrics::compare(&other, &one)?.relmse / 4.0;
        let mean = |(a, b): (&[f32; 3], &[f32; 3])| [0, 1, 2].map(|c| 0.5 * (a[c] + b[c]));
        let image = FloatImage {
            pixels: one.pixels.iter().zip(&other.pixels).map(mean).collect(),
            ..one
        };
        Ok(Reference { image, noise })
    }

    fn judge(&self, image: &Path, reference: &Reference) -> Result<Judged> {
        let found = metrics::compare(&self.read(image)?, &reference.image)?;
        Ok(Judged {
            relmse: found.relmse - reference.noise,
            bias: found.bias,
            flip: found.flip,
        })
    }

    fn judgement(&self) -> Result<()> {
        let [image, one, other] = self.scenes.as_slice() else {
            return Err("judge wants an image and two path tracings".into());
        };
        let reference = self.mean_of(&one.0, &other.0)?;
        let Judged { relmse, bias, flip } = self.judge(&image.0, &reference)?;
        println!(
            "noise {:.4}, relMSE less noise {relmse:.4}, bias {:+.1} %, FLIP {flip:.3}",
            reference.noise,
            100.0 * bias
        );
        Ok(())
    }

    /// Direct light in an image, by the means of blocks of pixels; what fills no block is left out.
    fn read(&self, path: &Path) -> Result<FloatImage> {
        let layers = read_exr(path, &Limits::default())?;
        let whole = layers.rgb("direct").ok_or("an image without a direct layer")?;
        let block = self.block;
        let (width, height) = (whole.width / block, whole.height / block);
        let mean = |i: usize| {
            let (x, y) = (i % width * block, i / width * block);
            let mut sum = [0.0; 3];
            for row in y..y + block {
                for pixel in &whole.pixels[row * whole.width + x..][..block] {
                    (0..3).for_each(|c| sum[c] += pixel[c] / (block * block) as f32);
                }
            }
            sum
        };
        Ok(FloatImage {
            width,
            height,
            pixels: (0..width * height).map(mean).collect(),
        })
    }
}

/// The program, which cargo puts beside the folder of examples.
fn program() -> Result<PathBuf> {
    let own = std::env::current_exe()?;
    let folder = own
        .parent()
        .and_then(Path::parent)
        .ok_or("examples have a folder")?;
    let program = folder.join(format!("relight{}", std::env::consts::EXE_SUFFIX));
    if program.exists() {
        Ok(program)
    } else {
        Err(format!(
            "{}: not there; run cargo build --release first",
            program.display()
        )
        .into())
    }
}

/// Runs it; the JSON that it prints.
fn relight(command: &mut Command) -> Result<Value> {
    let output = command.output()?;
    if output.status.success() {
        Ok(serde_json::from_slice(&output.stdout)?)
    } else {
        Err(String::from_utf8_lossy(&output.stderr).into_owned().into())
    }
}

fn of(object: &Value, key: &str) -> Result<f64> {
    object[key]
        .as_f64()
        .ok_or_else(|| format!("no number {key} in {object}").into())
}

fn stored(said: &Value, section: &str) -> Result<f64> {
    of(&said["bytes"][section], "stored")
}

fn name(path: &Path) -> String {
    path.file_stem()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned()
}
