//! Images by reconstruction cuts: lightcuts at the corners of blocks, everything else from them.
//!
//! Source: Walter et al. 2005, section 7, "Image blocks", and adaptive antialiasing after Painter and Sloan 1989.
//! Tiles of 16 × 16 pixels share no samples. They start as cells of 4 × 4 pixels, which are split while their eye rays
//! and corners don't match: materials of different kinds, normals that differ by more than 30°, or a point within the
//! cone over another (the paper gives no angle; 60° about the normal passes what curves by less than 30° and fails
//! steps that are deeper than some half of their distance).

use super::cut::Cut;
use super::lit::{LightcutSettings, Lit};
use super::sample::{MOST_SAMPLES, ReconstructionStats, Sample, Traversal};
use super::sights::Sights;
use super::{View, add, follow_mirrors};
use crate::layers::{PixelSum, TILE, Tile};
use crate::many_lights::PointLights;
use crate::picture::{Picture, Seen};
use crate::sampler::Sampler;
use crate::sum::Total;
use crate::watch::Cancelled;
use glam::{Vec2, Vec3};
use relight_scene::image::Layers;
use relight_transport::light_clusters::LightClusters;
use std::ops::AddAssign;

/// Sides of the cells that a tile starts as, pixels.
const CELL: usize = 4;
/// Cosine of the angle that normals of one block may differ by (the paper: 30°).
const ALIKE: f32 = 0.866;
/// Cosine of the cones' half angle.
const CONE: f32 = 0.5;
/// Where antialiasing stops: the standard error of a pixel's mean relative to its light, or to what of the tile's light
/// counts as dark.
const NOISE: f64 = 0.02;
const DARK: f64 = 0.1;

/// Eye rays per pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EyeRays {
    /// Of every pixel.
    pub least: u32,
    /// Of pixels whose rays disagree.
    pub most: u32,
}

impl Default for EyeRays {
    /// The paper's.
    fn default() -> Self {
        EyeRays { least: 5, most: 50 }
    }
}

/// Renders an image by reconstruction cuts; as [`super::render`] but with `eye_rays` in place of the picture's samples.
///
/// # Errors
/// [`Cancelled`] if the picture's watch says so.
pub fn render(
    picture: &Picture<'_>,
    points: &PointLights,
    clusters: &LightClusters,
    settings: &LightcutSettings,
    eye_rays: EyeRays,
) -> Result<(Layers, ReconstructionStats), Cancelled> {
    let image = Image {
        lit: Lit {
            scene: picture.scene,
            points,
            clusters,
            settings: *settings,
        },
        picture,
        eye_rays: EyeRays {
            least: eye_rays.least.max(1),
            most: eye_rays.most.max(eye_rays.least).max(1),
        },
    };
    let total = Total::<ReconstructionStats>::default();
    let layers = picture.by_tiles(State::default, |state, tile, sums| {
        total.add(image.tile(state, tile, sums));
    })?;
    Ok((layers, total.sum()))
}

impl AddAssign for ReconstructionStats {
    fn add_assign(&mut self, other: ReconstructionStats) {
        self.cuts += other.cuts;
        self.shadow_rays += other.shadow_rays;
        self.interpolations += other.interpolations;
        self.samples += other.samples;
        self.sample_rays += other.sample_rays;
        self.sample_nodes += other.sample_nodes;
        self.eye_rays += other.eye_rays;
    }
}

struct Image<'a> {
    lit: Lit<'a>,
    picture: &'a Picture<'a>,
    eye_rays: EyeRays,
}

/// A sample at a corner of pixels.
#[derive(Clone, Copy, Default)]
enum Corner {
    #[default]
    Unknown,
    /// Nothing to light there.
    Empty,
    At(u32),
}

/// An eye ray that met something to light.
struct EyeHit {
    view: View,
    /// In pixels, within the tile.
    place: Vec2,
    /// Place in [`State::values`].
    ray: u32,
}

/// What a worker keeps from tile to tile.
#[derive(Default)]
struct State {
    cut: Cut,
    sights: Sights,
    estimates: Vec<(Vec3, Vec3)>,
    traversal: Traversal,
    samples: Vec<Sample>,
    corners: Vec<Corner>,
    hits: Vec<EyeHit>,
    /// Where each pixel's hits start, and their end.
    starts: Vec<u32>,
    /// Light of each ray of `eye_rays.least` per pixel, in the largest channel.
    values: Vec<f64>,
    /// Samples made at eye rays of the pixel at hand.
    own: Vec<u32>,
    stats: ReconstructionStats,
}

impl Image<'_> {
    fn tile(&self, state: &mut State, tile: &Tile, sums: &mut [PixelSum]) -> ReconstructionStats {
        let width = tile.end[0] - tile.start[0];
        let height = tile.end[1] - tile.start[1];
        state.samples.clear();
        state.hits.clear();
        state.starts.clear();
        state.values.clear();
        state.corners.clear();
        state.corners.resize((TILE + 1) * (TILE + 1), Corner::Unknown);
        state.stats = ReconstructionStats::default();
        for (index, ((x, y), sums)) in tile.pixels().zip(sums.iter_mut()).enumerate() {
            state.starts.push(state.hits.len() as u32);
            sums.samples = self.eye_rays.least;
            for sample in 0..self.eye_rays.least {
                let before = sums.largest();
                let ray = index as u32 * self.eye_rays.least + sample;
                let hit = self.eye(state, tile, x, y, sample, ray, sums);
                state.hits.extend(hit);
                state.values.push(sums.largest() - before);
            }
        }
        state.starts.push(state.hits.len() as u32);
        for y in (0..height).step_by(CELL) {
            for x in (0..width).step_by(CELL) {
                self.block(state, tile, sums, [x, y], CELL);
            }
        }
        self.antialias(state, tile, sums);
        state.stats
    }

    /// Casts an eye ray; what is seen directly goes into the sums.
    fn eye(
        &self,
        state: &mut State,
        tile: &Tile,
        x: usize,
        y: usize,
        sample: u32,
        ray: u32,
        sums: &mut PixelSum,
    ) -> Option<EyeHit> {
        state.stats.eye_rays += 1;
        let picture = self.picture;
        let offset = Sampler::new(picture.seed, picture.pixel((x, y)), sample).next_2d();
        let (eye, _) = picture.eye_ray((x, y), sample);
        let view = follow_mirrors(picture, picture.see(&eye, sums)?, sums)?;
        let start = Vec2::new(tile.start[0] as f32, tile.start[1] as f32);
        Some(EyeHit {
            view,
            place: Vec2::new(x as f32, y as f32) - start + Vec2::from(offset),
            ray,
        })
    }

    /// The sample at a corner, `at` in pixels within the tile.
    fn corner(&self, state: &mut State, tile: &Tile, at: [usize; 2]) -> Option<u32> {
        let index = at[1] * (TILE + 1) + at[0];
        match state.corners[index] {
            Corner::At(sample) => return Some(sample),
            Corner::Empty => return None,
            Corner::Unknown => {}
        }
        let place = Vec2::new((tile.start[0] + at[0]) as f32, (tile.start[1] + at[1]) as f32);
        let eye = self.picture.ray_through(place);
        // What shines there is no pixel's light.
        let mut nowhere = PixelSum::nowhere();
        let look = self.lit.scene.look(&eye, |_, _, _| ());
        let view = (Seen::of(&look)).and_then(|seen| follow_mirrors(self.picture, seen, &mut nowhere));
        let sample = view.map(|view| self.sample(state, view));
        state.corners[index] = sample.map_or(Corner::Empty, Corner::At);
        sample
    }

    fn sample(&self, state: &mut State, view: View) -> u32 {
        state.stats.samples += 1;
        let rays = &mut state.stats.sample_rays;
        let buffers = (&mut state.cut, &mut state.sights);
        let sample = Sample::new(&self.lit, view, buffers, &mut state.estimates, rays);
        state.stats.sample_nodes += state.cut.len() as u64;
        state.samples.push(sample);
        state.samples.len() as u32 - 1
    }

    /// Lights the hits of a square of pixels, or splits it.
    fn block(&self, state: &mut State, tile: &Tile, sums: &mut [PixelSum], at: [usize; 2], side: usize) {
        let width = tile.end[0] - tile.start[0];
        let height = tile.end[1] - tile.start[1];
        if at[0] >= width || at[1] >= height {
            return;
        }
        let end = [(at[0] + side).min(width), (at[1] + side).min(height)];
        let pixels = move || (at[1]..end[1]).flat_map(move |y| (at[0]..end[0]).map(move |x| y * width + x));
        let range =
            |state: &State, pixel: usize| state.starts[pixel] as usize..state.starts[pixel + 1] as usize;
        if pixels().all(|pixel| range(state, pixel).is_empty()) {
            return;
        }
        let corners = [[at[0], at[1]], [end[0], at[1]], [at[0], end[1]], [end[0], end[1]]]
            .map(|corner| self.corner(state, tile, corner));
        if side > 1 {
            let complete = match corners {
                [Some(a), Some(b), Some(c), Some(d)] => Some([a, b, c, d]),
                _ => None,
            };
            let found = complete.filter(|corners| {
                let views: Vec<&View> = (corners.iter().map(|&c| &state.samples[c as usize].view))
                    .chain(pixels().flat_map(|p| state.hits[range(state, p)].iter().map(|hit| &hit.view)))
                    .collect();
                views_match(&views)
            });
            let Some(corners) = found else {
                let half = side / 2;
                for [x, y] in [[0, 0], [half, 0], [0, half], [half, half]] {
                    self.block(state, tile, sums, [at[0] + x, at[1] + y], half);
                }
                return;
            };
            let State {
                hits, starts, sights, ..
            } = state;
            let places = pixels().flat_map(|pixel| {
                let range = starts[pixel] as usize..starts[pixel + 1] as usize;
                hits[range].iter().map(|hit| &hit.view.hit)
            });
            sights.begin(&self.lit, places);
            let low = Vec2::new(at[0] as f32, at[1] as f32);
            let extent = Vec2::new(end[0] as f32, end[1] as f32) - low;
            for pixel in pixels() {
                for index in range(state, pixel) {
                    let t = (state.hits[index].place - low) / extent;
                    let weights = [
                        (1.0 - t.x) * (1.0 - t.y),
                        t.x * (1.0 - t.y),
                        (1.0 - t.x) * t.y,
                        t.x * t.y,
                    ];
                    let samples: [(u32, f32); 4] = std::array::from_fn(|k| (corners[k], weights[k]));
                    let hits = std::mem::take(&mut state.hits);
                    let before = sums[pixel].largest();
                    self.reconstruct(state, &hits[index].view, &samples, &mut sums[pixel]);
                    state.values[hits[index].ray as usize] += sums[pixel].largest() - before;
                    state.hits = hits;
                }
            }
            return;
        }
        let pixel = at[1] * width + at[0];
        state.own.clear();
        let hits = std::mem::take(&mut state.hits);
        for index in range(state, pixel) {
            let before = sums[pixel].largest();
            self.alone(state, &corners, &hits[index].view, &mut sums[pixel]);
            state.values[hits[index].ray as usize] += sums[pixel].largest() - before;
        }
        state.hits = hits;
    }

    /// Lights a view from those of a pixel's samples that match it, or from a new sample.
    fn alone(&self, state: &mut State, corners: &[Option<u32>; 4], view: &View, sums: &mut PixelSum) {
        let mut found = [(0u32, 0.0f32); MOST_SAMPLES];
        let mut count = 0;
        let candidates = corners.iter().flatten().chain(state.own.iter().rev());
        for &sample in candidates {
            let other = &state.samples[sample as usize].view;
            if count < MOST_SAMPLES && alike(view, other) {
                // Inverse squared distance; a sample at the very place gets nearly all.
                let squared = view.hit.position.distance_squared(other.hit.position);
                let clearance = view.hit.position_error.length_squared();
                found[count] = (sample, 1.0 / (squared + clearance).max(f32::MIN_POSITIVE));
                count += 1;
            }
        }
        if count < 2 {
            let sample = self.sample(state, *view);
            state.own.push(sample);
            let light = self.picture.light_layers;
            state.samples[sample as usize].light(&self.lit, |root, radiance| {
                add(&self.lit, light, view, root, radiance, sums);
            });
            return;
        }
        let largest = found[..count].iter().map(|f| f.1).fold(0.0, f32::max);
        let sum: f32 = found[..count].iter().map(|f| f.1 / largest).sum();
        for f in &mut found[..count] {
            f.1 = f.1 / largest / sum;
        }
        state.sights.begin(&self.lit, std::iter::once(&view.hit));
        self.reconstruct(state, view, &found[..count], sums);
    }

    /// Lights a view; [`State::sights`] have begun at places with it among them.
    fn reconstruct(&self, state: &mut State, view: &View, samples: &[(u32, f32)], sums: &mut PixelSum) {
        let mut near = [(&state.samples[0], 0.0); MOST_SAMPLES];
        for (near, &(sample, weight)) in near.iter_mut().zip(samples) {
            *near = (&state.samples[sample as usize], weight);
        }
        let near = &near[..samples.len().min(MOST_SAMPLES)];
        let light = self.picture.light_layers;
        state.traversal.light(
            &self.lit,
            view,
            near,
            &mut state.sights,
            &mut state.stats,
            |root, radiance| {
                add(&self.lit, light, view, root, radiance, sums);
            },
        );
    }

    /// More eye rays for pixels whose rays disagree, from the samples at the pixel's corners, if there are any.
    fn antialias(&self, state: &mut State, tile: &Tile, sums: &mut [PixelSum]) {
        if self.eye_rays.most <= self.eye_rays.least {
            return;
        }
        let width = tile.end[0] - tile.start[0];
        let mean = state.values.iter().sum::<f64>() / state.values.len().max(1) as f64;
        for (pixel, (x, y)) in tile.pixels().enumerate() {
            state.own.clear();
            let at = [pixel % width, pixel / width];
            let first = pixel * self.eye_rays.least as usize;
            let mut light = Spread::default();
            for &value in &state.values[first..first + self.eye_rays.least as usize] {
                light.add(value);
            }
            let mut corners = None;
            while sums[pixel].samples < self.eye_rays.most
                && light.standard_error() > NOISE * light.mean().max(DARK * mean)
            {
                let taken = sums[pixel].samples;
                let more = self.eye_rays.least.min(self.eye_rays.most - taken);
                for sample in taken..taken + more {
                    let before = sums[pixel].largest();
                    let hit = self.eye(state, tile, x, y, sample, 0, &mut sums[pixel]);
                    if let Some(hit) = hit {
                        let corners = *corners.get_or_insert_with(|| {
                            [[0, 0], [1, 0], [0, 1], [1, 1]]
                                .map(|[i, j]| self.corner(state, tile, [at[0] + i, at[1] + j]))
                        });
                        self.alone(state, &corners, &hit.view, &mut sums[pixel]);
                    }
                    light.add(sums[pixel].largest() - before);
                }
                sums[pixel].samples = taken + more;
            }
        }
    }
}

/// Mean and variance of values as they come (Welford 1962).
#[derive(Default)]
struct Spread {
    count: f64,
    mean: f64,
    squares: f64,
}

impl Spread {
    fn add(&mut self, value: f64) {
        self.count += 1.0;
        let off = value - self.mean;
        self.mean += off / self.count;
        self.squares += off * (value - self.mean);
    }

    fn mean(&self) -> f64 {
        self.mean
    }

    /// Of the mean.
    fn standard_error(&self) -> f64 {
        if self.count < 2.0 {
            return 0.0;
        }
        (self.squares / (self.count - 1.0) / self.count).sqrt()
    }
}

/// Whether light at one view says something of light at the other.
fn alike(a: &View, b: &View) -> bool {
    let kind = |v: &View| (v.point.lambert, std::mem::discriminant(&v.point.gloss));
    let same = a.mirrors == b.mirrors
        && kind(a) == kind(b)
        && (a.point.lambert || a.point.material == b.point.material);
    same && a.point.normal.dot(b.point.normal) >= ALIKE
}

/// Whether all views are alike and none lies in the cone over another.
fn views_match(views: &[&View]) -> bool {
    let apart = |a: &View, b: &View| {
        let way = b.hit.position - a.hit.position;
        let squared = way.length_squared();
        // The cosine with the normal above the cone's, without a root; equal places are in no cone.
        let height = way.dot(a.hit.geometric_normal);
        height <= 0.0 || height * height <= CONE * CONE * squared
    };
    views.iter().enumerate().all(|(i, a)| {
        views[..i]
            .iter()
            .all(|b| alike(a, b) && apart(a, b) && apart(b, a))
    })
}
