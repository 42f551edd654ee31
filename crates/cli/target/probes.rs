//! Windows of images from other viewpoints than the cameras', path-traced in two halves that tell their own noise.

use crate::choice::splits;
use crate::console::Console;
use crate::failure::Failure;
use crate::play::ILLUMINATION_CUT;
use crate::session::{FIXED_SPP, PIXEL_LIGHT_SAMPLES, POINT_LIGHT_SAMPLES};
use crate::signals;
use glam::{Vec2, Vec3};
use relight_bake::params::BakeParams;
use relight_bake::points::viewpoints::in_open_space;
use relight_format::{self as format, Asset, Limits};
use relight_play::cuts::Lights;
use relight_play::frame::{Distant, LightingSettings};
use relight_play::load::from_asset;
use relight_play::reflections::FIXED_RAYS;
use relight_play::shot::{Shot, expose};
use relight_render::layers::{RenderSize, Watch};
use relight_render::path::{self, PathSettings};
use relight_scene::camera::{Camera, CameraTrack};
use relight_scene::image::FloatImage;
use relight_scene::image::metrics::relmse;
use relight_scene::light::LightTrack;
use relight_scene::light_set::{LightRig, SceneEmitters};
use relight_scene::rays::Ray;
use relight_scene::scene::Scene;
use relight_scene::sequence::{Sequence, SequenceCamera};
use relight_scene::surface::Surfaces;
use relight_scene::traced::{Shading, TracedScene};
use relight_transport::random::Stream;
use std::path::Path;
use std::sync::Arc;

/// Windows that see something in their middle: many, so that they hold what images hold.
const WINDOWS: u64 = 72;
/// Most windows in all, where few see something.
const MOST_WINDOWS: u64 = 8 * WINDOWS;
/// Pixels across and down in each.
const WINDOW: RenderSize = RenderSize {
    width: 16,
    height: 12,
};
/// Rows of the image that a window is a part of: what a pixel spans.
const ROWS: f32 = 180.0;
/// Width over height where the camera says none.
const ASPECT: f32 = 16.0 / 9.0;
/// How far from the camera other viewpoints lie, as a share of the distance to what it sees.
const APART: f32 = 0.15;
/// Most of the free way there that is taken, so that none lies in a wall.
const FREE: f32 = 0.5;
/// Tangent of half the vertical field of view where there is no camera: that of 60°.
const TAN_HALF_VFOV: f32 = 0.577;
/// Frames that are looked at: first, middle and last.
const FRAMES: u32 = 3;
/// Samples a pixel of a half's first pass, and the most of a half where all windows see something.
const FIRST_PASS: u32 = 32;
const MOST: u32 = 256;
/// Stage number of the random stream.
const STAGE: u32 = 12;

/// Where probes look from.
pub struct Places {
    scene: TracedScene,
    /// Frame and camera of each window.
    windows: Vec<(u32, Camera)>,
    /// Where a lamp would light what is seen.
    lamp: Vec3,
    /// Share of the windows that see something in their middle.
    seen: f32,
}

impl Places {
    /// Other viewpoints near those of the camera that `play` takes by itself, or, without one, in open space.
    ///
    /// # Errors
    /// The scene cannot be traced, or there is nothing to see.
    pub fn new(
        scene: &Arc<Scene>,
        shading: Shading,
        lights: Option<&Sequence>,
        params: &BakeParams,
    ) -> Result<Places, Failure> {
        let traced = TracedScene::new(scene.clone(), shading)?;
        let frames = lights.map_or(scene.sequence.frames, |s| s.frames).max(1);
        let track = played(scene, lights);
        let open = in_open_space(&traced, params.seed).0.unwrap_or(Vec3::ZERO);
        let mut windows = Vec::new();
        let mut seen = 0;
        for i in 0..MOST_WINDOWS {
            if seen == WINDOWS {
                break;
            }
            let mut s = Stream::new(params.seed, STAGE, i);
            let frame = (frames - 1) * (i as u32 % FRAMES) / (FRAMES - 1);
            let base = match track {
                Some(track) => (track.at(frame.into()), track.aspect.unwrap_or(ASPECT)),
                None => (looking(open, uniform_sphere(two(&mut s))), ASPECT),
            };
            let camera = window(&traced, base, &mut s);
            seen += u64::from(distance(&traced, camera.position, camera.forward).is_some());
            windows.push((frame, camera));
        }
        if seen == 0 {
            return Err(
                anyhow::anyhow!("no camera sees anything by which --target-error could judge").into(),
            );
        }
        let lamp = match track {
            Some(track) => track.at(0.0).position,
            None => open,
        };
        Ok(Places {
            scene: traced,
            lamp,
            seen: seen as f32 / windows.len() as f32,
            windows,
        })
    }

    /// A place from which a lamp would light what is seen.
    pub fn lamp(&self) -> Vec3 {
        self.lamp
    }

    fn frames(&self) -> Vec<u32> {
        let mut frames: Vec<u32> = self.windows.iter().map(|w| w.0).collect();
        frames.sort_unstable();
        frames.dedup();
        frames
    }
}

/// A direction, all alike (Archimedes).
fn uniform_sphere(u: Vec2) -> Vec3 {
    let z = 1.0 - 2.0 * u.x;
    let (sin, cos) = (u.y * std::f32::consts::TAU).sin_cos();
    let r = (1.0 - z * z).max(0.0).sqrt();
    Vec3::new(r * cos, z, r * sin)
}

/// The camera that `play` takes by itself: the sequence's, else the scene's first. Errors of several cameras together would
/// be those of the darkest room that any sees.
fn played<'a>(scene: &'a Scene, lights: Option<&'a Sequence>) -> Option<&'a CameraTrack> {
    match &lights.unwrap_or(&scene.sequence).camera {
        Some(SequenceCamera::Own(track)) => Some(track),
        Some(SequenceCamera::Node(name)) => scene.cameras.iter().find(|track| track.name == *name),
        None => scene.cameras.first(),
    }
}

fn two(s: &mut Stream) -> Vec2 {
    Vec2::new(s.uniform(), s.uniform())
}

fn looking(position: Vec3, forward: Vec3) -> Camera {
    Camera::looking(position, forward, Vec3::Y, TAN_HALF_VFOV)
}

fn distance(scene: &TracedScene, origin: Vec3, direction: Vec3) -> Option<f32> {
    let ray = Ray {
        origin,
        direction,
        t_min: 0.0,
        t_max: f32::INFINITY,
    };
    scene.closest_hit(&ray).map(|hit| hit.t)
}

/// A window somewhere in the image that a camera would make from a place nearby.
fn window(scene: &TracedScene, (camera, aspect): (Camera, f32), s: &mut Stream) -> Camera {
    let aspect = if aspect.is_finite() && aspect > 0.0 {
        aspect
    } else {
        ASPECT
    };
    let size = Vec2::new(aspect, 1.0);
    let toward = camera.direction(two(s) * size, size);
    let aside = uniform_sphere(two(s));
    let away = distance(scene, camera.position, toward).unwrap_or(0.0) * APART * s.uniform();
    let free = distance(scene, camera.position, aside).map_or(away, |t| away.min(t * FREE));
    let turned = looking(camera.position + aside * free, toward);
    Camera {
        tan_half_vfov: camera.tan_half_vfov * WINDOW.height as f32 / ROWS,
        ..turned
    }
}

/// An error and how much of it is not known.
#[derive(Clone, Copy, Debug)]
pub struct Estimate {
    /// Root of relMSE of the indirect layer, less the reference's.
    pub error: f64,
    /// Root of the reference's own relMSE.
    pub noise: f64,
}

/// Windows with their references.
pub struct Probes {
    places: Places,
    sequence: Sequence,
    /// Mean of two halves, all windows one below the other.
    reference: FloatImage,
    /// Its own relMSE.
    floor: f64,
}

impl Probes {
    /// Path-traces the windows until their noise is below `target`, or no pass is worth its time.
    ///
    /// # Errors
    /// A signal asks to stop; a light cannot be sampled.
    pub fn trace(
        places: Places,
        sequence: &Sequence,
        params: &BakeParams,
        target: f64,
        console: &Console,
    ) -> Result<Probes, Failure> {
        let mut halves: [Vec<[f64; 3]>; 2] = Default::default();
        // Pixels that see nothing add no noise but count in the mean: the more there are, the noisier the others may be, and
        // the more they are of what is sought.
        let most = MOST as f32 * places.seen.recip().sqrt();
        let mut spp = 0;
        let (mut reference, mut floor);
        loop {
            let more = spp.max(FIRST_PASS);
            for (half, sum) in halves.iter_mut().enumerate() {
                let seed = format::content_hash(format!("{} {half} {spp}", params.seed).as_bytes());
                let image = path_traced(&places, sequence, more, params.bounces, seed)?;
                sum.resize(image.len(), [0.0; 3]);
                for (sum, pixel) in sum.iter_mut().zip(image) {
                    for k in 0..3 {
                        sum[k] += f64::from(pixel[k]) * f64::from(more);
                    }
                }
            }
            spp += more;
            let over = |sum: &[[f64; 3]], spp: u32| {
                image_of(
                    sum.iter()
                        .map(|p| p.map(|v| (v / f64::from(spp)) as f32))
                        .collect(),
                )
            };
            let [a, b] = halves.each_ref().map(|sum| over(sum, spp));
            let both: Vec<[f64; 3]> = (halves[0].iter().zip(&halves[1]))
                .map(|(a, b)| std::array::from_fn(|k| a[k] + b[k]))
                .collect();
            reference = over(&both, 2 * spp);
            // The mean of two independent halves has a quarter of the squared difference between them.
            floor = relmse(&a, &b)? / 4.0;
            console.detail(format!(
                "{} samples a pixel: the probes' own error is {:.2} %",
                2 * spp,
                100.0 * floor.sqrt()
            ));
            if floor <= target * target || spp as f32 >= most {
                break;
            }
        }
        Ok(Probes {
            places,
            sequence: sequence.clone(),
            reference,
            floor,
        })
    }

    /// Pixels of all windows.
    pub fn pixels(&self) -> usize {
        self.reference.pixels.len()
    }

    /// How an asset errs.
    ///
    /// # Errors
    /// It cannot be played.
    pub fn estimate(&self, asset: &Asset) -> Result<Estimate, Failure> {
        // As a reader will see it.
        let asset = format::read_asset(&format::write_asset(asset)?, &Limits::default())?;
        let image = image_of(self.relit(asset)?);
        let found = relmse(&image, &self.reference)?;
        Ok(Estimate {
            error: (found - self.floor).max(0.0).sqrt(),
            noise: self.floor.sqrt(),
        })
    }

    /// Indirect light of all windows.
    fn relit(&self, asset: Asset) -> Result<Vec<[f32; 3]>, Failure> {
        let loaded = from_asset(asset, 0, Path::new("the new asset"), true)?;
        let player = &loaded.player;
        // Emission may have been left out: what shines does so in the scene as it was.
        let emitters = SceneEmitters::new(&self.places.scene);
        let rig = LightRig::new(&emitters, &self.sequence.lights)?;
        let cuts = player.cuts.as_ref().map(|cuts| &cuts.lights);
        let surface = matches!(cuts, Some(Lights::Surface(_)));
        let by_directions = matches!(cuts, Some(Lights::Directions(_)))
            && self.sequence.lights.iter().any(LightTrack::is_distant);
        let most = ILLUMINATION_CUT as usize;
        let settings = LightingSettings {
            pixel_samples: PIXEL_LIGHT_SAMPLES,
            point_samples: POINT_LIGHT_SAMPLES,
            seed: 0,
            per_light: false,
            indirect: true,
            bounce_cuts: surface.then_some(most),
        };
        let mut pixels = vec![[0.0; 3]; self.reference.pixels.len()];
        for frame in self.places.frames() {
            let of_frame: Vec<usize> = (0..self.places.windows.len())
                .filter(|&i| self.places.windows[i].0 == frame)
                .collect();
            let shots = of_frame.iter().map(|&i| {
                let camera = &self.places.windows[i].1;
                expose(&player.scene, camera, WINDOW.width, WINDOW.height, FIXED_SPP)
            });
            let mut shot = Shot::default();
            shots.for_each(|more| shot.append(more));
            if let Some(transfer) = &player.transfer {
                shot.weigh(transfer, &player.scene, FIXED_RAYS);
            }
            if player.cuts.is_some() && (surface || by_directions) {
                shot.choose_sites();
            }
            let lights = rig.at(frame.into());
            let distant = by_directions.then(|| {
                let parts = splits(&rig, &loaded, self.sequence.lights.len());
                Distant::at(&rig, frame.into(), |light| parts[light].clone(), most)
            });
            let (lit, _) = player.light(&shot, &lights, distant.as_ref(), &settings);
            let light = shot.resolve(&lit.indirect);
            let count = WINDOW.width * WINDOW.height;
            for (at, &i) in of_frame.iter().enumerate() {
                for k in 0..count {
                    pixels[i * count + k] = light[at * count + k].max(Vec3::ZERO).to_array();
                }
            }
        }
        Ok(pixels)
    }
}

fn image_of(pixels: Vec<[f32; 3]>) -> FloatImage {
    FloatImage {
        width: WINDOW.width,
        height: pixels.len() / WINDOW.width,
        pixels,
    }
}

/// Indirect light of all windows.
fn path_traced(
    places: &Places,
    sequence: &Sequence,
    spp: u32,
    bounces: Option<u32>,
    seed: u64,
) -> Result<Vec<[f32; 3]>, Failure> {
    let emitters = SceneEmitters::new(&places.scene);
    let rig = LightRig::new(&emitters, &sequence.lights)?;
    let watch = Watch {
        cancel: signals::stop_flag(),
        progress: &|_, _| {},
    };
    let mut pixels = Vec::new();
    for (i, (frame, camera)) in places.windows.iter().enumerate() {
        let settings = PathSettings {
            spp,
            // T to the N is N + 1 reflections.
            max_bounces: bounces.map(|n| n.saturating_add(1)),
            // Windows share pixel numbers.
            seed: format::content_hash(format!("{seed} {i}").as_bytes()),
            light_layers: false,
        };
        let lights = rig.at((*frame).into());
        let layers = path::render(&places.scene, &lights, camera, WINDOW, &settings, &watch)
            .map_err(|_| signals::failure())?;
        pixels.extend(layers.rgb("indirect").unwrap_or_default().pixels);
    }
    Ok(pixels)
}
