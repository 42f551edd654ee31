//! Environments in two parts: the few brightest directions, which want shadow rays of their own, and the rest, which
//! many even directions stand for.
//!
//! 32 768 directions are 1.1° apart and the sun is 0.5° wide: what would put a noticeable share of
//! all light into one direction stays a light, everything else becomes a smooth map.

use super::map::TurnedMap;
use crate::environment::{EnvironmentSampler, luminance};
use crate::light::EnvironmentMap;
use glam::Vec3;
use std::sync::Arc;

/// Share of an environment's flux that one of the even directions may carry at most; what is brighter by that much
/// stays a light. At 1 % a shadow's edge that is off by one direction is off by 1 % of the light.
const BRIGHT_SHARE: f64 = 0.01;

/// Columns of the smooth map at most: 3 for each of the some 320 directions along the equator of 32 768.
const SMOOTH_WIDTH: usize = 1024;

/// An environment map in two parts that add up to it.
#[derive(Clone, Debug)]
pub struct Split {
    /// What exceeds the threshold radiance; `None` if nothing does.
    pub(super) bright: Option<(Arc<EnvironmentMap>, Arc<EnvironmentSampler>)>,
    /// The rest, reduced to [`SMOOTH_WIDTH`].
    pub(super) smooth: Arc<EnvironmentMap>,
}

impl Split {
    /// Splits a map for `directions` even directions.
    pub fn new(map: &EnvironmentMap, sampler: &EnvironmentSampler, directions: u32) -> Split {
        let flux = f64::from(luminance(sampler.flux()));
        let leaf = 4.0 * std::f64::consts::PI / f64::from(directions);
        let threshold = (BRIGHT_SHARE * flux / leaf) as f32;
        // The part of a pixel below the threshold keeps the pixel's colour.
        let kept = |pixel: Vec3| {
            let bright = luminance(pixel);
            if bright > threshold {
                threshold / bright
            } else {
                1.0
            }
        };
        let part = |share: &dyn Fn(f32) -> f32| EnvironmentMap {
            width: map.width,
            height: map.height,
            pixels: map.pixels.iter().map(|&p| p * share(kept(p))).collect(),
        };
        let bright = part(&|kept| 1.0 - kept);
        let sampler = EnvironmentSampler::new(&bright);
        Split {
            bright: sampler.map(|sampler| (Arc::new(bright), Arc::new(sampler))),
            smooth: Arc::new(reduced(part(&|kept| kept))),
        }
    }
}

/// The part of a light that comes from even directions, at one frame.
pub struct DistantLight {
    pub(super) environment: TurnedMap,
}

impl DistantLight {
    /// Radiance from a direction (unit, world space, away from the scene).
    pub fn radiance(&self, direction: Vec3) -> Vec3 {
        self.environment.radiance(self.environment.map_uv(direction))
    }
}

/// A map of at most [`SMOOTH_WIDTH`] columns, each pixel the mean of what it covers.
fn reduced(map: EnvironmentMap) -> EnvironmentMap {
    if map.width <= SMOOTH_WIDTH {
        return map;
    }
    let factor = map.width as f64 / SMOOTH_WIDTH as f64;
    let height = ((map.height as f64 / factor).round() as usize).max(1);
    let mut narrow = vec![Vec3::ZERO; SMOOTH_WIDTH * map.height];
    let columns = spans(map.width, SMOOTH_WIDTH);
    for (row, out) in map.pixels.chunks(map.width).zip(narrow.chunks_mut(SMOOTH_WIDTH)) {
        for (span, out) in columns.iter().zip(out) {
            *out = span.iter().map(|&(x, share)| row[x] * share).sum();
        }
    }
    let pixels = spans(map.height, height)
        .iter()
        .flat_map(|span| {
            let narrow = &narrow;
            (0..SMOOTH_WIDTH).map(move |x| {
                span.iter()
                    .map(|&(y, share)| narrow[y * SMOOTH_WIDTH + x] * share)
                    .sum()
            })
        })
        .collect();
    EnvironmentMap {
        width: SMOOTH_WIDTH,
        height,
        pixels,
    }
}

/// For each of `to` equal parts of a row of `from` pixels, the pixels that it covers and their shares, which sum to 1.
fn spans(from: usize, to: usize) -> Vec<Vec<(usize, f32)>> {
    let length = from as f64 / to as f64;
    (0..to)
        .map(|i| {
            let (start, end) = (i as f64 * length, (i + 1) as f64 * length);
            (start as usize..(end.ceil() as usize).min(from))
                .map(|x| {
                    let covered = end.min((x + 1) as f64) - start.max(x as f64);
                    (x, (covered / length) as f32)
                })
                .filter(|pixel| pixel.1 > 0.0)
                .collect()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map(width: usize, height: usize, pixel: impl Fn(usize, usize) -> f32) -> EnvironmentMap {
        EnvironmentMap {
            width,
            height,
            pixels: (0..width * height)
                .map(|i| Vec3::new(1.0, 2.0, 0.5) * pixel(i % width, i / width))
                .collect(),
        }
    }

    #[test]
    fn the_parts_of_a_map_add_up_and_only_the_sun_is_bright() {
        let sun = (17, 5);
        let sunny = map(64, 32, |x, y| if (x, y) == sun { 1e6 } else { 1.0 + y as f32 });
        let split = Split::new(&sunny, &EnvironmentSampler::new(&sunny).unwrap(), 32_768);
        let (bright, _) = split.bright.unwrap();
        for (i, &whole) in sunny.pixels.iter().enumerate() {
            let sum = bright.pixels[i] + split.smooth.pixels[i];
            // Two products of shares that sum to 1, in f32.
            assert!((sum - whole).abs().max_element() <= 2e-6 * whole.max_element());
            assert_eq!(bright.pixels[i] != Vec3::ZERO, i == sun.1 * 64 + sun.0);
        }
    }

    #[test]
    fn an_even_sky_has_no_bright_part() {
        let even = map(64, 32, |_, _| 3.0);
        assert!(
            Split::new(&even, &EnvironmentSampler::new(&even).unwrap(), 32_768)
                .bright
                .is_none()
        );
    }

    #[test]
    fn a_reduced_map_keeps_its_mean() {
        let fine = map(1500, 7, |x, y| ((x * 31 + y * 17) % 101) as f32);
        let mean =
            |m: &EnvironmentMap| m.pixels.iter().map(|p| f64::from(p.x)).sum::<f64>() / m.pixels.len() as f64;
        let coarse = reduced(fine.clone());
        assert_eq!((coarse.width, coarse.height), (SMOOTH_WIDTH, 5));
        // Shares are rounded to f32.
        assert!((mean(&coarse) / mean(&fine) - 1.0).abs() < 1e-5);
    }
}
