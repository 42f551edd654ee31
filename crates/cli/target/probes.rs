//! Windows of images from other viewpoints than the cameras', path-traced in two halves that tell their own noise.

use crate::console::Console;
use crate::failure::Failure;
use crate::signals::{self, Signals};
use glam::{Vec2, Vec3};
use relight_bake::params::BakeParams;
use relight_bake::points::viewpoints::{focus, in_open_space};
use relight_format::{self as format, Asset, Limits};
use relight_play::camera::camera_of;
use relight_play::open::Sections;
use relight_play::shot::STANDING_SAMPLES;
use relight_play::{CutSites, FrameSettings, Lights, Player, ShotSettings};
use relight_render::expose::expose;
use relight_render::exposure::Exposure;
use relight_render::layers::RenderSize;
use relight_render::path;
use relight_render::picture::Picture;
use relight_scene::camera::Camera;
use relight_scene::image::FloatImage;
use relight_scene::image::metrics::relmse;
use relight_scene::rays::Ray;
use relight_scene::scene::Scene;
use relight_scene::sequence::Sequence;
use relight_scene::surface::Surfaces;
use relight_scene::traced::{Shading, TracedScene};
use relight_transport::random::Stream;
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
pub struct Viewpoints {
    scene: TracedScene,
    /// Frame and camera of each window.
    windows: Vec<(u32, Camera)>,
    /// Where a lamp would light what is seen.
    lamp: Vec3,
    /// Share of the windows that see something in their middle.
    seen: f32,
}

impl Viewpoints {
    /// Other viewpoints near those of the camera that `play` takes by itself, or, without one, in open space.
    ///
    /// # Errors
    /// The scene cannot be traced, or there is nothing to see.
    pub fn new(
        scene: &Arc<Scene>,
        shading: Shading,
        lights: Option<&Sequence>,
        params: &BakeParams,
    ) -> Result<Viewpoints, Failure> {
        let traced = TracedScene::new(scene.clone(), shading)?;
        let frames = lights.map_or(scene.sequence.frames, |s| s.frames).max(1);
        // That which `play` takes by itself: errors of several cameras together would be those of the darkest room that any sees.
        let track = camera_of(scene, lights.unwrap_or(&scene.sequence), None).ok();
        // Only where no camera says where to look from.
        let open = (traced.bounds().filter(|_| track.is_none()))
            .and_then(|bounds| {
                let places = in_open_space(&traced, focus(scene, bounds), params.seed).0;
                places.first().copied()
            })
            .unwrap_or(Vec3::ZERO);
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
        Ok(Viewpoints {
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
    viewpoints: Viewpoints,
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
        viewpoints: Viewpoints,
        sequence: &Sequence,
        params: &BakeParams,
        target: f64,
        console: &Console,
    ) -> Result<Probes, Failure> {
        let mut halves: [Vec<[f64; 3]>; 2] = Default::default();
        // Pixels that see nothing add no noise but count in the mean: the more there are, the noisier the others may be, and
        // the more they are of what is sought.
        let most = MOST as f32 * viewpoints.seen.recip().sqrt();
        let mut spp = 0;
        let (mut reference, mut floor);
        loop {
            let more = spp.max(FIRST_PASS);
            for (half, sum) in halves.iter_mut().enumerate() {
                let seed = format::content_hash(format!("{} {half} {spp}", params.seed).as_bytes());
                let image = path_traced(&viewpoints, sequence, more, params.bounces, seed)?;
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
            viewpoints,
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
        let player = Player::of_asset(asset, 0, "the new asset", Sections::All)?;
        // Emission may have been left out: what shines does so in the scene as it was.
        let directions = player.prepared.directions();
        let lights = Lights::new(&self.viewpoints.scene, &self.sequence.lights, directions)?;
        let shot_settings = ShotSettings {
            sites: Some(CutSites::Around),
            ..ShotSettings::default()
        };
        let mut pixels = vec![[0.0; 3]; self.reference.pixels.len()];
        for frame in self.viewpoints.frames() {
            let of_frame: Vec<usize> = (0..self.viewpoints.windows.len())
                .filter(|&i| self.viewpoints.windows[i].0 == frame)
                .collect();
            let mut seen = Exposure::default();
            for &i in &of_frame {
                let camera = &self.viewpoints.windows[i].1;
                let scene = &player.prepared.scene;
                seen.append(expose(
                    scene,
                    camera,
                    WINDOW.width,
                    WINDOW.height,
                    STANDING_SAMPLES,
                ));
            }
            let shot = player.shot_of(seen, &shot_settings);
            let settings = FrameSettings::default();
            let (lit, _) = player.light(&shot, &lights, frame.into(), &settings, &())?;
            let light = shot.seen.resolve(&lit.indirect);
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
    viewpoints: &Viewpoints,
    sequence: &Sequence,
    spp: u32,
    bounces: Option<u32>,
    seed: u64,
) -> Result<Vec<[f32; 3]>, Failure> {
    let lights = Lights::new(&viewpoints.scene, &sequence.lights, 0)?;
    let mut pixels = Vec::new();
    for (i, (frame, camera)) in viewpoints.windows.iter().enumerate() {
        let lights = lights.at((*frame).into());
        let picture = Picture {
            spp: Some(spp),
            // Windows share pixel numbers.
            seed: format::content_hash(format!("{seed} {i}").as_bytes()),
            watch: &Signals,
            ..Picture::new(&viewpoints.scene, &lights, camera, WINDOW)
        };
        // T to the N is N + 1 reflections.
        let reflections = bounces.map(|n| n.saturating_add(1));
        let layers = path::render(&picture, reflections).map_err(|_| signals::failure())?;
        pixels.extend(layers.rgb("indirect").unwrap_or_default().pixels);
    }
    Ok(pixels)
}
