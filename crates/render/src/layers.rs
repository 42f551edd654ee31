//! What integrators share: the size of an image, its layers, and rendering tile by tile on all cores.
//!
//! A pixel is a function of its place, so that the image does not depend on the number of threads.

use crate::watch::{Cancelled, Watch};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use relight_scene::image::{ALPHA, BEAUTY, DEPTH, Layers, RAY_DEPTH};
use relight_scene::light_set::LightSet;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Size of an image in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RenderSize {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

/// Sums over the samples of one pixel, f64.
pub(crate) struct PixelSum {
    /// Light seen directly, after one reflection, after two and more; W/(m² sr).
    transported: [DVec3; 3],
    /// All of it by light; empty if light layers aren't wanted.
    lights: Vec<DVec3>,
    /// Of `transported[0]` what comes from where nothing is.
    background: DVec3,
    albedo: DVec3,
    normal: DVec3,
    /// Along the ray, and from the camera's plane.
    depth: [f64; 2],
    hits: u32,
    /// Samples taken: what the sums of light are divided by.
    pub samples: u32,
}

impl PixelSum {
    fn new(lights: usize) -> PixelSum {
        PixelSum {
            transported: [DVec3::ZERO; 3],
            lights: vec![DVec3::ZERO; lights],
            background: DVec3::ZERO,
            albedo: DVec3::ZERO,
            normal: DVec3::ZERO,
            depth: [0.0; 2],
            hits: 0,
            samples: 0,
        }
    }

    /// Sums that belong to no pixel.
    pub fn nowhere() -> PixelSum {
        PixelSum::new(0)
    }

    /// All light so far, in the largest channel.
    pub fn largest(&self) -> f64 {
        self.transported.iter().sum::<DVec3>().max_element()
    }

    /// Adds light that came from `light` (`None`: from no light, an unlit material) over `reflections`.
    pub fn add(&mut self, light: Option<usize>, reflections: u32, radiance: Vec3) {
        // What f32 cannot hold is dropped rather than spread: a single NaN would blacken the pixel.
        if !radiance.is_finite() {
            return;
        }
        let radiance = radiance.as_dvec3();
        self.transported[reflections.min(2) as usize] += radiance;
        if let Some(light) = light
            && let Some(sum) = self.lights.get_mut(light)
        {
            *sum += radiance;
        }
    }

    /// Says of light that was added that it comes from where nothing is.
    pub fn add_background(&mut self, radiance: Vec3) {
        if radiance.is_finite() {
            self.background += radiance.as_dvec3();
        }
    }

    /// Adds what an eye ray found first: total reflectance, shading normal, distance along the ray and from the camera's plane.
    pub fn add_surface(&mut self, albedo: Vec3, normal: Vec3, depth: [f32; 2]) {
        self.albedo += albedo.as_dvec3();
        self.normal += normal.as_dvec3();
        (self.depth.iter_mut().zip(depth)).for_each(|(sum, depth)| *sum += f64::from(depth));
        self.hits += 1;
    }
}

/// Tiles are squares of this many pixels: large enough to keep rays together, small enough to share out.
pub(crate) const TILE: usize = 16;

/// Names and channels of the layers that every integrator makes, in order; light layers follow.
const LAYERS: [(&str, usize); 10] = [
    (BEAUTY, 3),
    (ALPHA, 1),
    ("emission", 3),
    ("direct", 3),
    ("indirect", 3),
    ("background", 3),
    ("albedo", 3),
    ("normal", 3),
    (DEPTH, 1),
    (RAY_DEPTH, 1),
];

/// A rectangle of pixels, at most [`TILE`] wide and high.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tile {
    /// First column and row.
    pub start: [usize; 2],
    /// One past the last column and row.
    pub end: [usize; 2],
}

impl Tile {
    fn new(tile: usize, columns: usize, size: RenderSize) -> Tile {
        let start = [tile % columns * TILE, tile / columns * TILE];
        Tile {
            start,
            end: [
                (start[0] + TILE).min(size.width),
                (start[1] + TILE).min(size.height),
            ],
        }
    }

    /// Columns and rows of its pixels, row by row.
    pub fn pixels(&self) -> impl Iterator<Item = (usize, usize)> + use<> {
        let Tile { start, end } = *self;
        (start[1]..end[1]).flat_map(move |y| (start[0]..end[0]).map(move |x| (x, y)))
    }
}

/// Calls `block` for every tile to fill the sums of its pixels, row by row, with the number of samples of each, and makes
/// layers of their means: beauty = emission + direct + indirect, `A` (the share of samples that met a surface), background (what of emission
/// others saw), albedo, normal, depth (distance from the camera's plane in metres), `depth.ray` (along the eye ray), and
/// `light.<name>` where `light_layers`. Albedo, normal and depths are means over the samples that met a surface,
/// 0 where none did. The state, made by `state` for every worker now and then, carries buffers, no light.
pub(crate) fn render_blocks<S>(
    size: RenderSize,
    lights: &LightSet<'_>,
    light_layers: bool,
    watch: &dyn Watch,
    state: impl Fn() -> S + Sync + Send,
    block: impl Fn(&mut S, &Tile, &mut [PixelSum]) + Sync,
) -> Result<Layers, Cancelled> {
    let light_count = if light_layers { lights.len() } else { 0 };
    let channels = LAYERS.iter().map(|layer| layer.1).sum::<usize>() + 3 * light_count;
    let (columns, rows) = (size.width.div_ceil(TILE), size.height.div_ceil(TILE));
    let done = AtomicUsize::new(0);
    let tiles: Vec<Vec<f32>> = (0..columns * rows)
        .into_par_iter()
        .map_init(state, |state, tile| {
            if watch.stopped() {
                return Vec::new();
            }
            let tile = Tile::new(tile, columns, size);
            let mut sums: Vec<PixelSum> = tile.pixels().map(|_| PixelSum::new(light_count)).collect();
            block(state, &tile, &mut sums);
            let mut values = Vec::with_capacity(TILE * TILE * channels);
            for sums in &sums {
                finish(sums, &mut values);
            }
            watch.advance_to(done.fetch_add(1, Ordering::Relaxed) + 1, columns * rows);
            values
        })
        .collect();
    if watch.stopped() {
        return Err(Cancelled);
    }

    let mut layers = Layers::new(size.width, size.height);
    let light_names = (0..light_count).map(|light| format!("light.{}", lights.name(light)));
    let names = LAYERS.iter().map(|&(name, width)| (name.to_string(), width));
    let mut first = 0;
    for (name, width) in names.chain(light_names.map(|name| (name, 3))) {
        let mut data = vec![0.0; size.width * size.height * width];
        for (tile, values) in tiles.iter().enumerate() {
            let pixels = Tile::new(tile, columns, size).pixels();
            for ((x, y), pixel) in pixels.zip(values.chunks_exact(channels)) {
                let at = (y * size.width + x) * width;
                data[at..at + width].copy_from_slice(&pixel[first..first + width]);
            }
        }
        match width {
            3 => layers.push_rgb(&name, data.as_chunks::<3>().0),
            _ => layers.push_scalar(&name, &data),
        }
        first += width;
    }
    Ok(layers)
}

/// Appends the values of one pixel in the order of [`LAYERS`].
fn finish(sums: &PixelSum, values: &mut Vec<f32>) {
    let samples = sums.samples;
    let mean = |sum: DVec3, count: u32| (sum / f64::from(count.max(1))).as_vec3();
    let [emission, direct, indirect] = sums.transported.map(|sum| mean(sum, samples));
    // Summed in f32, so that the layers of a file add up exactly.
    let beauty = emission + direct + indirect;
    let normal = mean(sums.normal, sums.hits).normalize_or_zero();
    values.extend(beauty.to_array());
    values.push((f64::from(sums.hits) / f64::from(samples.max(1))) as f32);
    for v in [
        emission,
        direct,
        indirect,
        mean(sums.background, samples),
        mean(sums.albedo, sums.hits),
        normal,
    ] {
        values.extend(v.to_array());
    }
    let [along, planar] = sums.depth.map(|sum| (sum / f64::from(sums.hits.max(1))) as f32);
    values.extend([planar, along]);
    for light in &sums.lights {
        values.extend(mean(*light, samples).to_array());
    }
}
