//! One random scene: generated, baked, played, and held against the path tracer.

use crate::bake::job::{Job, bake_job};
use crate::console::Console;
use crate::failure::Failure;
use crate::guard::Guard;
use crate::kinds::Kind;
use crate::signals::{self, Signals};
use crate::statistics::milliseconds;
use relight_bake::params::{BakeParams, Preset};
use relight_data_generate::random;
use relight_format::{self as format, Limits};
use relight_play::open::Sections;
use relight_play::player::FrameError;
use relight_play::{FrameSettings, Integrator, Lights, Player, ShotSettings};
use relight_render::layers::RenderSize;
use relight_render::path;
use relight_render::picture::Picture;
use relight_scene::camera::Camera;
use relight_scene::gltf::{ImportOptions, import};
use relight_scene::image::metrics::{bias, relmse};
use relight_scene::image::{FloatImage, Layers, write_atomically};
use relight_scene::sequence::read_sequence_at;
use relight_scene::traced::{Shading, TracedScene};
use serde::Serialize;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

/// The image: some three thousand pixels tell an error of tenths from one of hundredths.
const SIZE: RenderSize = RenderSize {
    width: 64,
    height: 48,
};
/// Path-traced samples a pixel of a half's first pass, each further pass doubles them; and most of a half.
const FIRST_PASS: u32 = 64;
const MOST: u32 = 256;
/// Noise of the reference that is little enough: a tenth of the error that is asked for, which it then changes by 0.5 %.
const QUIET: f64 = 0.025;
/// Names of the layers that are judged.
const LAYERS: [&str; 2] = ["indirect", "direct"];

/// How far a layer is from the path tracer.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Distance {
    /// Root of relMSE, less the reference's own.
    pub error: f64,
    /// Root of the reference's own relMSE.
    pub noise: f64,
    /// Relative error of the mean.
    pub bias: f64,
}

/// What a seed gave.
#[derive(Clone, Debug, Serialize)]
pub struct Trial {
    /// The seed.
    pub seed: u64,
    /// What its scene holds.
    pub says: String,
    /// Why there is no image, if so.
    pub failed: Option<String>,
    /// Light of two and more reflections.
    pub indirect: Distance,
    /// Direct light, without what shines itself.
    pub direct: Distance,
    /// Triangles of the scene.
    pub triangles: usize,
    /// Points of all levels.
    pub points: usize,
    /// Seconds of the bake.
    pub bake_seconds: f64,
    /// Milliseconds of a frame after the first.
    pub frame_ms: f64,
    /// Seconds of the path tracing.
    pub reference_seconds: f64,
}

/// Relit and path traced, each all light; to look at.
pub type Pictures = [FloatImage; 2];

impl Trial {
    /// Nothing known yet.
    fn new(seed: u64, says: String) -> Trial {
        // What was not measured is as far off as can be.
        let unknown = Distance {
            error: f64::INFINITY,
            noise: f64::INFINITY,
            bias: f64::INFINITY,
        };
        Trial {
            seed,
            says,
            failed: None,
            indirect: unknown,
            direct: unknown,
            triangles: 0,
            points: 0,
            bake_seconds: 0.0,
            frame_ms: 0.0,
            reference_seconds: 0.0,
        }
    }
}

/// Tries a seed, whose files go to `folder`.
///
/// # Errors
/// A signal asks to stop. What fails by itself is told in the trial.
pub fn tried(
    seed: u64,
    folder: &Path,
    guard: &Guard,
    console: &Console,
) -> Result<(Trial, Option<Pictures>), Failure> {
    let scene = random(seed);
    let mut trial = Trial::new(seed, scene.says.clone());
    let (file, lights) = (
        folder.join(format!("random_{seed}.glb")),
        folder.join(format!("random_{seed}.lights.json")),
    );
    for (path, kind, bytes) in [
        (&file, Kind::Scene, &scene.glb.to_bytes()[..]),
        (&lights, Kind::Sequence, &scene.sequence[..]),
    ] {
        guard.check(path, kind)?;
        let _whole = signals::whole();
        write_atomically(path, bytes)?;
    }
    match measured(&mut trial, &file, &lights, scene.has_sky, console) {
        Ok(pictures) => Ok((trial, Some(pictures))),
        Err(Failure::Failed(error)) => {
            trial.failed = Some(format!("{error:#}"));
            Ok((trial, None))
        }
        Err(stopped) => Err(stopped),
    }
}

fn measured(
    trial: &mut Trial,
    file: &Path,
    lights: &Path,
    has_sky: bool,
    console: &Console,
) -> Result<Pictures, Failure> {
    // As a user would who knows no option but the preset, less its finest level, which is three quarters of the time: what
    // a pixel of so small an image spans is wider.
    let scene = Arc::new(import(file, &ImportOptions::default())?);
    let sequence = read_sequence_at(lights, scene.offset)?;
    let draft = BakeParams::preset(Preset::Draft);
    let params = BakeParams {
        levels: draft.levels - 1,
        ..draft
    };
    let job = Job {
        params: &params,
        shading: Shading::Full,
        lights: None,
        source_hash: trial.seed,
        kept: None,
        checked: false,
        force: true,
        until: None,
    };
    let start = Instant::now();
    let baked = bake_job(&job, &params, scene.clone(), None, None, &console.silent())?;
    trial.bake_seconds = start.elapsed().as_secs_f64();
    trial.points = baked.asset.points.iter().map(|level| level.positions.len()).sum();
    let bytes = format::write_asset(&baked.asset)?;
    let asset = format::read_asset(&bytes, &Limits::default())?;
    let player = Player::of_asset(asset, format::content_hash(&bytes), file, Sections::All)?;

    let camera = player.camera(&sequence, None)?.at(0.0);
    let own = if has_sky { &sequence } else { player.own_lights()? };
    let lights = player.lights(&own.lights)?;
    let relit = relit(trial, &player, &lights, &camera)?;

    let traced = TracedScene::new(scene, Shading::Full)?;
    trial.triangles = traced.triangle_count();
    let lights = Lights::new(&traced, &own.lights, 0)?;
    let start = Instant::now();
    let reference = Reference::new(&traced, &lights, &camera)?;
    trial.reference_seconds = start.elapsed().as_secs_f64();
    trial.indirect = reference.distance(0, &relit)?;
    trial.direct = reference.distance(1, &relit)?;
    Ok([relit.rgb("beauty").unwrap_or_default(), reference.beauty])
}

fn relit(trial: &mut Trial, player: &Player, lights: &Lights, camera: &Camera) -> Result<Layers, Failure> {
    let settings = ShotSettings {
        integrator: Integrator::Auto,
        width: SIZE.width,
        height: SIZE.height,
        ..ShotSettings::default()
    };
    let shot = player.shot(camera, &settings)?;
    let frame = || {
        (player.frame_watched(&shot, lights, 0.0, &FrameSettings::default(), &Signals)).map_err(|error| {
            match error {
                FrameError::Cancelled(_) => signals::failure(),
                other => other.into(),
            }
        })
    };
    // The first pays for what is done once.
    frame()?;
    player.forget(&shot);
    let start = Instant::now();
    let layers = frame()?.layers;
    trial.frame_ms = milliseconds(start);
    Ok(layers)
}

/// Path traced in two halves that tell their noise.
struct Reference {
    layers: [FloatImage; 2],
    /// relMSE of each by its own noise.
    noise: [f64; 2],
    beauty: FloatImage,
}

impl Reference {
    fn new(scene: &TracedScene, lights: &Lights, camera: &Camera) -> Result<Reference, Failure> {
        let lights = lights.at(0.0);
        // Indirect light, direct light, all; of each half, so many samples.
        let mut sums: [[Vec<[f64; 3]>; 3]; 2] = Default::default();
        let mut spp = 0;
        loop {
            let more = spp.max(FIRST_PASS);
            for (half, sums) in sums.iter_mut().enumerate() {
                let picture = Picture {
                    spp: Some(more),
                    seed: format::content_hash(format!("{half} {spp}").as_bytes()),
                    watch: &Signals,
                    ..Picture::new(scene, &lights, camera, SIZE)
                };
                let layers = path::render(&picture, None).map_err(|_| signals::failure())?;
                for (sum, name) in sums.iter_mut().zip([LAYERS[0], LAYERS[1], "beauty"]) {
                    let image = layers.rgb(name).unwrap_or_default();
                    sum.resize(image.pixels.len(), [0.0; 3]);
                    for (sum, pixel) in sum.iter_mut().zip(image.pixels) {
                        *sum = [0, 1, 2].map(|k| sum[k] + f64::from(pixel[k]) * f64::from(more));
                    }
                }
            }
            spp += more;
            let mean = |layer: usize, halves: &[usize]| {
                let samples = f64::from(spp) * halves.len() as f64;
                let of = |pixel: usize| {
                    let sum = |k: usize| halves.iter().map(|&h| sums[h][layer][pixel][k]).sum::<f64>();
                    [0, 1, 2].map(|k| (sum(k) / samples) as f32)
                };
                FloatImage {
                    width: SIZE.width,
                    height: SIZE.height,
                    pixels: (0..SIZE.width * SIZE.height).map(of).collect(),
                }
            };
            // The mean of two independent halves has a quarter of the squared difference between them.
            let noise = |layer| relmse(&mean(layer, &[0]), &mean(layer, &[1])).map(|error| error / 4.0);
            let noise = [noise(0)?, noise(1)?];
            if spp >= MOST || noise.iter().all(|&noise| noise <= QUIET * QUIET) {
                let [indirect, direct, beauty] = [0, 1, 2].map(|layer| mean(layer, &[0, 1]));
                return Ok(Reference {
                    layers: [indirect, direct],
                    noise,
                    beauty,
                });
            }
        }
    }

    /// How far a layer of an image is from this.
    fn distance(&self, layer: usize, image: &Layers) -> Result<Distance, Failure> {
        let (image, reference) = (image.rgb(LAYERS[layer]).unwrap_or_default(), &self.layers[layer]);
        let noise = self.noise[layer];
        Ok(Distance {
            error: (relmse(&image, reference)? - noise).max(0.0).sqrt(),
            noise: noise.sqrt(),
            bias: bias(&image, reference)?.1,
        })
    }
}
