//! Probes with their references: windows path-traced in quarters, which tell their own noise.
//!
//! relMSE is estimated from pairs of quarters, (x − a)(x − b) / c² with independent a, b and c: what is noise in them cancels, and a bake
//! without error has an estimate of 0 on average, however noisy they are.

use crate::error::ProbeError;
use crate::expected::Expected;
use crate::viewpoints::Viewpoints;
use glam::Vec3;
use rayon::prelude::*;
use relight_bake::params::BakeParams;
use relight_format::{self as format, Asset, Limits};
use relight_play::open::Sections;
use relight_play::shot::{RelitShot, STANDING_SAMPLES};
use relight_play::transfer::Transfer;
use relight_play::{CutSites, FrameSettings, Lights, Player, ShotSettings};
use relight_render::expose::expose;
use relight_render::exposure::Exposure;
use relight_render::path;
use relight_render::picture::Picture;
use relight_render::watch::{Cancelled, Watch, go_on};
use relight_scene::image::metrics::RELMSE_EPSILON;
use relight_scene::sequence::Sequence;
use relight_transport::sparse::row;

/// Independent parts of a reference.
const PARTS: usize = 4;
/// Samples a pixel of a part's first pass.
const FIRST_PASS: u32 = 8;
/// Pixels side by side whose mean light errors are relative to: one whose few paths found no light says nothing about how dark it is.
const TOGETHER: usize = 4;
/// A pixel without indirect light that should have this share of the mean has lost it.
const LOST: f64 = 0.1;

/// Windows with their references.
pub struct Probes {
    viewpoints: Viewpoints,
    sequence: Sequence,
    /// Indirect light of the parts, windows one below the other, in order.
    parts: [Vec<[f64; 3]>; PARTS],
    /// Root of the relMSE of their mean.
    noise: f64,
}

/// Who hears what the probes find out, in words.
pub type Told<'a> = &'a dyn Fn(String);

/// How far to go with a reference.
#[derive(Clone, Copy, Debug)]
pub struct Effort {
    /// Root of its own relMSE that will do.
    pub noise: f64,
    /// Most samples of a pixel.
    pub most: u32,
}

impl Probes {
    /// Path-traces the windows until their noise will do, or they had the most samples.
    ///
    /// # Errors
    /// [`ProbeError::Stopped`], [`ProbeError::Lights`].
    pub fn trace(
        viewpoints: Viewpoints,
        sequence: &Sequence,
        params: &BakeParams,
        effort: Effort,
        watch: &dyn Watch,
        told: Told,
    ) -> Result<Probes, ProbeError> {
        let mut sums: [Vec<[f64; 3]>; PARTS] = Default::default();
        let mut spp = 0;
        loop {
            let more = spp.max(FIRST_PASS);
            for (part, sum) in sums.iter_mut().enumerate() {
                let seed = format::content_hash(format!("probes {} {part} {spp}", params.seed).as_bytes());
                let image = path_traced(&viewpoints, sequence, more, params.bounces, seed, watch)?;
                sum.resize(image.len(), [0.0; 3]);
                for (sum, pixel) in sum.iter_mut().zip(image) {
                    *sum = std::array::from_fn(|k| sum[k] + f64::from(pixel[k]) * f64::from(more));
                }
            }
            spp += more;
            let parts = sums.each_ref().map(|sum| {
                sum.iter()
                    .map(|p| p.map(|v| v / f64::from(spp)))
                    .collect::<Vec<_>>()
            });
            let noise = noise(&parts);
            let all = spp * PARTS as u32;
            told(format!(
                "{all} samples a pixel: the probes' own error is {:.2} %",
                100.0 * noise
            ));
            if noise <= effort.noise || 2 * all > effort.most {
                return Ok(Probes {
                    viewpoints,
                    sequence: sequence.clone(),
                    parts,
                    noise,
                });
            }
        }
    }

    /// Pixels of all windows.
    pub fn pixels(&self) -> usize {
        self.parts[0].len()
    }

    /// Root of the reference's own relMSE.
    pub fn noise(&self) -> f64 {
        self.noise
    }

    /// How an asset errs.
    ///
    /// # Errors
    /// [`ProbeError`].
    pub fn estimate(&self, asset: &Asset, watch: &dyn Watch) -> Result<Expected, ProbeError> {
        // As a reader will see it.
        let asset = format::read_asset(&format::write_asset(asset)?, &Limits::default())?;
        let relit = self.relit(asset, watch)?;
        let mean = mean(&self.parts);
        let all = mean.iter().map(grey).sum::<f64>() / mean.len().max(1) as f64;
        if all <= 0.0 {
            return Ok(Expected::default());
        }
        let floor = RELMSE_EPSILON * all * all;
        let each = self.viewpoints.pixels();
        let [a, b, c, d] = &self.parts;
        let light = |one: &[[f64; 3]], other: &[[f64; 3]], i: usize| {
            let first = i - i % TOGETHER;
            let pixels = first..(first + TOGETHER).min(one.len());
            let count = pixels.len() as f64;
            let light = pixels.map(|i| grey(&middle(&one[i], &other[i]))).sum::<f64>() / count;
            light.powi(2) + floor
        };
        let squares: Vec<f64> = (0..relit.pixels.len())
            .map(|i| {
                let x = &relit.pixels[i];
                let one = apart(x, &a[i], &b[i]) / light(c, d, i);
                let other = apart(x, &c[i], &d[i]) / light(a, b, i);
                0.5 * (one + other)
            })
            .collect();
        let windows = self.viewpoints.windows.len() as f64;
        let of_windows = |values: &[f64]| -> Vec<f64> {
            let means = values.chunks(each);
            means.map(|w| w.iter().sum::<f64>() / w.len() as f64).collect()
        };
        let spread = |values: &[f64], middle: f64| {
            let squares: f64 = values.iter().map(|v| (v - middle).powi(2)).sum();
            (squares / (windows * (windows - 1.0).max(1.0))).sqrt()
        };
        let squares = of_windows(&squares);
        let square = squares.iter().sum::<f64>() / windows;
        let error = square.max(0.0).sqrt();
        let found = relit.pixels.iter().map(grey).sum::<f64>() / mean.len() as f64;
        let bias = found / all - 1.0;
        // Of a ratio, from what each window departs from it.
        let departures: Vec<f64> = (relit.pixels.iter().zip(&mean))
            .map(|(x, m)| (grey(x) - (1.0 + bias) * grey(m)) / all)
            .collect();
        let lost = (relit.pixels.iter().zip(&mean)).filter(|(x, m)| grey(x) <= 0.0 && grey(m) > LOST * all);
        let lit = mean.iter().filter(|m| grey(m) > LOST * all).count().max(1);
        let of_seen = |n: usize| n as f64 / relit.seen.max(1) as f64;
        Ok(Expected {
            error,
            error_noise: (square.max(0.0) + spread(&squares, square)).sqrt() - error,
            bias,
            bias_noise: spread(&of_windows(&departures), 0.0),
            without_light: lost.count() as f64 / lit as f64,
            without_points: of_seen(relit.uncovered),
            wide: of_seen(relit.wide),
            target: None,
        })
    }

    /// Indirect light of all windows.
    fn relit(&self, asset: Asset, watch: &dyn Watch) -> Result<Relit, ProbeError> {
        let player = Player::of_asset(asset, 0, "the new asset", Sections::All)?;
        // Emission may have been left out: what shines does so in the scene as it was.
        let directions = player.prepared.directions();
        let lights = Lights::new(&self.viewpoints.scene, &self.sequence.lights, directions)?;
        let shot_settings = ShotSettings {
            sites: Some(CutSites::Around),
            ..ShotSettings::default()
        };
        let (size, count) = (self.viewpoints.size, self.viewpoints.pixels());
        let mut relit = Relit {
            pixels: vec![[0.0; 3]; self.pixels()],
            ..Relit::default()
        };
        for frame in self.viewpoints.frames() {
            go_on(watch)?;
            let of_frame: Vec<usize> = (0..self.viewpoints.windows.len())
                .filter(|&i| self.viewpoints.windows[i].0 == frame)
                .collect();
            let mut seen = Exposure::default();
            for &i in &of_frame {
                let camera = &self.viewpoints.windows[i].1;
                let scene = &player.prepared.scene;
                seen.append(expose(scene, camera, size.width, size.height, STANDING_SAMPLES));
            }
            let shot = player.shot_of(seen, &shot_settings);
            let settings = FrameSettings::default();
            let (lit, _) = player.light(&shot, &lights, frame.into(), &settings, watch)?;
            let light = shot.seen.resolve(&lit.indirect);
            for (at, &i) in of_frame.iter().enumerate() {
                for k in 0..count {
                    relit.pixels[i * count + k] =
                        light[at * count + k].max(Vec3::ZERO).to_array().map(f64::from);
                }
            }
            relit.count(&player, &shot);
        }
        Ok(relit)
    }
}

/// What the player makes of the windows.
#[derive(Default)]
struct Relit {
    pixels: Vec<[f64; 3]>,
    /// Fragments on surfaces.
    seen: usize,
    /// Of those, what has no point near it.
    uncovered: usize,
    /// Of those, what has no point as narrow as the finest level has them.
    wide: usize,
}

impl Relit {
    fn count(&mut self, player: &Player, shot: &RelitShot) {
        self.seen += shot.seen.hits.iter().filter(|hit| hit.is_some()).count();
        self.uncovered += match &shot.functions {
            Some(_) => shot.uncovered(),
            None => shot.seen.hits.iter().filter(|hit| hit.is_some()).count(),
        };
        if let (Some(functions), Some(transfer)) = (&shot.functions, &player.prepared.transfer) {
            let wide = |p: u32| is_wide(transfer, p as usize);
            self.wide += (0..shot.seen.len())
                .filter(|&f| {
                    let mut points = row(&functions.weights, f).map(|(p, _)| p);
                    points.len() > 0 && points.all(wide)
                })
                .count();
        }
    }
}

/// Whether a finest point is wider than its level, and not since it is a coarser level's that stands for its surroundings.
fn is_wide(transfer: &Transfer, point: usize) -> bool {
    let (parents, ranges) = transfer.parents();
    let mut widening = transfer.finest.widenings.get(point).copied().unwrap_or(0);
    let mut at = ranges.range(ranges.levels() - 1).start + point;
    while widening > 0 {
        let mut own = row(parents, at);
        match (own.next(), own.next()) {
            (Some((parent, 1.0)), None) => at = parent as usize,
            _ => return true,
        }
        widening -= 1;
    }
    false
}

/// Mean over RGB.
fn grey(p: &[f64; 3]) -> f64 {
    p.iter().sum::<f64>() / 3.0
}

fn middle(a: &[f64; 3], b: &[f64; 3]) -> [f64; 3] {
    std::array::from_fn(|k| 0.5 * (a[k] + b[k]))
}

/// Mean over RGB of the product of how far x is from two others.
fn apart(x: &[f64; 3], a: &[f64; 3], b: &[f64; 3]) -> f64 {
    (0..3).map(|k| (x[k] - a[k]) * (x[k] - b[k])).sum::<f64>() / 3.0
}

fn mean(parts: &[Vec<[f64; 3]>; PARTS]) -> Vec<[f64; 3]> {
    let [a, b, c, d] = parts;
    (0..a.len())
        .map(|i| middle(&middle(&a[i], &b[i]), &middle(&c[i], &d[i])))
        .collect()
}

/// Root of the relMSE of the mean of parts, from how they differ.
fn noise(parts: &[Vec<[f64; 3]>; PARTS]) -> f64 {
    let mean = mean(parts);
    let all = mean.iter().map(grey).sum::<f64>() / mean.len().max(1) as f64;
    if all <= 0.0 {
        return 0.0;
    }
    let floor = RELMSE_EPSILON * all * all;
    let of_pixel = |(i, m): (usize, &[f64; 3])| {
        let squares: f64 = parts.iter().map(|part| apart(m, &part[i], &part[i])).sum();
        squares / (PARTS * (PARTS - 1)) as f64 / (grey(m).powi(2) + floor)
    };
    (mean.iter().enumerate().map(of_pixel).sum::<f64>() / mean.len() as f64).sqrt()
}

/// Indirect light of all windows.
fn path_traced(
    viewpoints: &Viewpoints,
    sequence: &Sequence,
    spp: u32,
    bounces: Option<u32>,
    seed: u64,
    watch: &dyn Watch,
) -> Result<Vec<[f32; 3]>, ProbeError> {
    let lights = Lights::new(&viewpoints.scene, &sequence.lights, 0)?;
    // T to the N is N + 1 reflections.
    let reflections = bounces.map(|n| n.saturating_add(1));
    let images: Vec<_> = (viewpoints.windows.par_iter().enumerate())
        .map(|(i, (frame, camera))| {
            let lights = lights.at((*frame).into());
            let picture = Picture {
                spp: Some(spp),
                // Windows share pixel numbers.
                seed: format::content_hash(format!("{seed} {i}").as_bytes()),
                watch,
                ..Picture::new(&viewpoints.scene, &lights, camera, viewpoints.size)
            };
            let layers = path::render(&picture, reflections)?;
            Ok(layers.rgb("indirect").unwrap_or_default().pixels)
        })
        .collect::<Result<_, Cancelled>>()?;
    Ok(images.concat())
}
