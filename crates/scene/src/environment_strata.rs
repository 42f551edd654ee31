//! An environment map as a number of directions, one for each of as many parts of it.
//!
//! Source: the importance is that of Agarwal et al. 2003, *Structured Importance Sampling of Environment Maps*,
//! section 3: L ΔΩ^¼ for a part with flux L and solid angle ΔΩ, since importance by flux alone would spend nearly all
//! directions on the sun and leave noise in its shade, by area alone the reverse. Parts come from cutting rectangles of
//! the map in two halves of equal flux, as in Debevec 2005, *A Median Cut Algorithm for Light Probe Sampling*, the most
//! important first. **Deviations:** Agarwal et al. threshold the map into layers and cluster each; here cuts alone do
//! both. Within its part a direction is drawn by flux instead of put into the middle, so that the sum over all parts
//! is unbiased for any receiver.
//!
//! The map is bilinear between pixel centres, so it is a sum of tents, one per pixel: a part is the tents of its pixels,
//! and a direction is a pixel, then a place in its tent, as in [`crate::environment::EnvironmentSampler`].

use crate::environment::{direction_from_uv, luminance, pick, tent};
use crate::light::EnvironmentMap;
use glam::{DVec3, Vec3};
use std::cmp::Ordering;
use std::collections::BinaryHeap;
use std::f64::consts::PI;

/// Light of one part of an environment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stratum {
    /// Unit, towards the light.
    pub towards: Vec3,
    /// Irradiance on a surface that faces it, RGB, W/m².
    pub flux: DVec3,
}

/// Rows of rising sums of the pixels' weights, luminance × sin θ relative to the brightest channel.
struct Weights<'a> {
    map: &'a EnvironmentMap,
    /// Per row `width` + 1 entries, the first 0.
    sums: Vec<f64>,
}

impl Weights<'_> {
    fn new(map: &EnvironmentMap) -> Option<Weights<'_>> {
        let (width, height) = (map.width, map.height);
        if width == 0 || height == 0 || map.pixels.len() != width * height {
            return None;
        }
        let peak = map.pixels.iter().fold(0.0f32, |p, v| p.max(v.max_element()));
        if !(peak > 0.0 && peak.is_finite()) {
            return None;
        }
        let mut sums = Vec::with_capacity((width + 1) * height);
        for (y, row) in map.pixels.chunks_exact(width).enumerate() {
            let sin = (PI * (y as f64 + 0.5) / height as f64).sin();
            let mut sum = 0.0;
            sums.push(sum);
            for pixel in row {
                sum += f64::from(luminance(*pixel / peak)) * sin;
                sums.push(sum);
            }
        }
        Some(Weights { map, sums })
    }

    fn row(&self, y: usize, x: [usize; 2]) -> f64 {
        let row = &self.sums[y * (self.map.width + 1)..];
        row[x[1]] - row[x[0]]
    }

    fn area(&self, x: [usize; 2], y: [usize; 2]) -> f64 {
        (y[0]..y[1]).map(|y| self.row(y, x)).sum()
    }
}

/// A rectangle of pixels, or one pixel that `copies` directions share.
struct Region {
    x: [usize; 2],
    y: [usize; 2],
    weight: f64,
    copies: u32,
    /// Of one of the copies.
    importance: f64,
    /// Order of making: decides between regions that are equally important.
    number: usize,
}

impl Region {
    fn new(weights: &Weights, x: [usize; 2], y: [usize; 2], copies: u32, number: usize) -> Option<Region> {
        let weight = weights.area(x, y);
        let height = weights.map.height as f64;
        let cos = |row: usize| (PI * row as f64 / height).cos();
        let share = f64::from(copies) * weights.map.width as f64;
        let solid_angle = 2.0 * PI * (x[1] - x[0]) as f64 / share * (cos(y[0]) - cos(y[1]));
        (weight > 0.0).then(|| Region {
            x,
            y,
            weight,
            copies,
            importance: weight / f64::from(copies) * solid_angle.powf(0.25),
            number,
        })
    }

    /// Cuts the longer side where the halves weigh most nearly the same. A pixel gets one more direction.
    fn cut(self, weights: &Weights, number: usize) -> [Option<Region>; 2] {
        let Region { x, y, .. } = self;
        let (columns, rows) = (x[1] - x[0], y[1] - y[0]);
        if columns * rows == 1 {
            return [Region::new(weights, x, y, self.copies + 1, number), None];
        }
        let (width, height) = (weights.map.width as f64, weights.map.height as f64);
        let middle = PI * (y[0] + y[1]) as f64 * 0.5 / height;
        let wide = columns as f64 * 2.0 * PI / width * middle.sin() > rows as f64 * PI / height;
        if rows == 1 || (wide && columns > 1) {
            let at = halves(x, self.weight, |at| weights.area([x[0], at], y));
            [[x[0], at], [at, x[1]]].map(|x| Region::new(weights, x, y, 1, number))
        } else {
            let at = halves(y, self.weight, |at| weights.area(x, [y[0], at]));
            [[y[0], at], [at, y[1]]].map(|y| Region::new(weights, x, y, 1, number))
        }
    }

    /// Appends the directions of this region.
    fn draw(
        &self,
        weights: &Weights,
        turn: f32,
        random: &mut impl FnMut(usize) -> [f32; 3],
        out: &mut Vec<Stratum>,
    ) {
        let map = weights.map;
        let (width, height) = (map.width as f64, map.height as f64);
        let mut sum = 0.0;
        let rows: Vec<f64> = (self.y[0]..self.y[1])
            .map(|y| {
                sum += weights.row(y, self.x);
                sum / self.weight
            })
            .collect();
        for _ in 0..self.copies {
            let [rx, ry, _] = random(out.len());
            let (row, inside_y) = pick(&rows, f64::from(ry));
            let y = self.y[0] + row;
            let row_sums = &weights.sums[y * (map.width + 1)..][..=map.width];
            let (first, all) = (row_sums[self.x[0]], weights.row(y, self.x));
            let columns: Vec<f64> = row_sums[self.x[0] + 1..=self.x[1]]
                .iter()
                .map(|s| (s - first) / all)
                .collect();
            let (column, inside_x) = pick(&columns, f64::from(rx));
            let x = self.x[0] + column;
            let u = (x as f64 + 0.5 + tent(inside_x)) / width;
            let mut v = (y as f64 + 0.5 + tent(inside_y)) / height;
            // The half of a tent that reaches over a pole folds back: clamped lookup has the same density.
            if v < 0.0 {
                v = -v;
            } else if v > 1.0 {
                v = 2.0 - v;
            }
            let chance = weights.row(y, [x, x + 1]) / self.weight;
            let solid_angle = 2.0 * PI * PI * (PI * v).sin() / (width * height);
            let pixel = map.pixels[y * map.width + x].as_dvec3();
            out.push(Stratum {
                towards: direction_from_uv([u as f32 - turn, v as f32]),
                flux: pixel * (solid_angle / (chance * f64::from(self.copies))),
            });
        }
    }
}

/// Where in (range.0, range.1), both excluded, `sum_to` is nearest to half of `total`.
fn halves(range: [usize; 2], total: f64, sum_to: impl Fn(usize) -> f64) -> usize {
    let (mut low, mut high) = (range[0] + 1, range[1] - 1);
    while low < high {
        let middle = (low + high) / 2;
        if sum_to(middle) < 0.5 * total {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    let off = |at: usize| (sum_to(at) - 0.5 * total).abs();
    if low > range[0] + 1 && off(low - 1) < off(low) {
        low - 1
    } else {
        low
    }
}

impl PartialEq for Region {
    fn eq(&self, other: &Region) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for Region {}
impl PartialOrd for Region {
    fn partial_cmp(&self, other: &Region) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Region {
    fn cmp(&self, other: &Region) -> Ordering {
        let earlier = || other.number.cmp(&self.number).then(other.x.cmp(&self.x));
        self.importance
            .total_cmp(&other.importance)
            .then_with(earlier)
            .then_with(|| other.y.cmp(&self.y))
    }
}

/// At most `count` directions (at least one unless the map is black) for a map turned by `turn` turns about +Y.
/// `random(i)` are three uniform numbers in [0, 1) for direction i, the third not used here.
pub fn strata(
    map: &EnvironmentMap,
    turn: f32,
    count: usize,
    mut random: impl FnMut(usize) -> [f32; 3],
) -> Vec<Stratum> {
    let Some(weights) = Weights::new(map) else {
        return Vec::new();
    };
    let mut heap = BinaryHeap::new();
    heap.extend(Region::new(&weights, [0, map.width], [0, map.height], 1, 0));
    let mut made = heap.len();
    // Halves without light leave no part behind: the number of cuts is bounded as well.
    let mut number = 0;
    while made < count && number < 4 * count {
        let Some(part) = heap.pop() else { break };
        number += 1;
        made -= part.copies as usize;
        for half in part.cut(&weights, number).into_iter().flatten() {
            made += half.copies as usize;
            heap.push(half);
        }
    }
    let mut parts = heap.into_vec();
    parts.sort_by_key(|part| (part.y, part.x));
    let mut out = Vec::with_capacity(made);
    for part in &parts {
        part.draw(&weights, turn, &mut random, &mut out);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Some sky with a sun of a few pixels, 10⁴ times as bright, and a black half.
    fn map() -> EnvironmentMap {
        let (width, height) = (64, 32);
        let pixel = |x: usize, y: usize| match (x, y) {
            (20..=21, 7..=8) => Vec3::new(1e4, 9e3, 8e3),
            (_, 16..) => Vec3::ZERO,
            _ => Vec3::new(0.3, 0.5, 1.0) * (1.0 + 0.5 * (x as f32 * 0.3).sin()),
        };
        EnvironmentMap {
            width,
            height,
            pixels: (0..width * height).map(|i| pixel(i % width, i / width)).collect(),
        }
    }

    /// Even numbers of the kind that the recurrence by the plastic number gives, moved by `shift`.
    fn numbers(shift: f64) -> impl FnMut(usize) -> [f32; 3] {
        move |i| [0.754_877_67, 0.569_840_29, 0.0].map(|s| ((i as f64 + 0.5) * s + shift).fract() as f32)
    }

    fn irradiance(strata: &[Stratum], normal: Vec3) -> DVec3 {
        strata
            .iter()
            .map(|s| s.flux * f64::from(normal.dot(s.towards).max(0.0)))
            .sum()
    }

    /// Truth: the integral of the bilinear map by a midpoint rule of 16 × 16 places a pixel.
    fn truth(map: &EnvironmentMap, normal: Vec3) -> DVec3 {
        let fine = 16;
        let (w, h) = (map.width * fine, map.height * fine);
        let mut sum = DVec3::ZERO;
        for i in 0..w * h {
            let uv = [(i % w) as f64 + 0.5, (i / w) as f64 + 0.5];
            let uv = [(uv[0] / w as f64) as f32, (uv[1] / h as f64) as f32];
            let sin = (PI * f64::from(uv[1])).sin();
            let cos = f64::from(normal.dot(direction_from_uv(uv)).max(0.0));
            sum += map.at(uv).as_dvec3() * (cos * sin);
        }
        sum * (2.0 * PI * PI / (w * h) as f64)
    }

    #[test]
    fn directions_give_the_irradiance_of_the_map() {
        let map = map();
        let normals = [
            Vec3::Y,
            Vec3::X,
            Vec3::new(-0.6, 0.0, 0.8),
            Vec3::new(0.0, -0.6, 0.8),
        ];
        for normal in normals {
            let exact = truth(&map, normal);
            // The mean over independent sets: each set is unbiased. 0.5 % is some five deviations of 64 sets.
            let mean: DVec3 = (0..64)
                .map(|k| irradiance(&strata(&map, 0.0, 300, numbers(f64::from(k) * 0.618_034)), normal))
                .sum::<DVec3>()
                / 64.0;
            let error = ((mean - exact) / exact).abs().max_element();
            assert!(error < 5e-3, "{normal}: {mean} instead of {exact}");
        }
    }

    #[test]
    fn sun_and_sky_both_get_directions_and_none_is_lost() {
        for count in [1, 2, 7, 300, 3000] {
            let strata = strata(&map(), 0.25, count, numbers(0.1));
            assert_eq!(strata.len(), count);
            assert!(
                strata
                    .iter()
                    .all(|s| s.flux.is_finite() && s.flux.min_element() > 0.0)
            );
        }
        let strata = strata(&map(), 0.0, 300, numbers(0.1));
        let sun = direction_from_uv([21.0 / 64.0, 8.0 / 32.0]);
        let at_sun = strata.iter().filter(|s| s.towards.dot(sun) > 0.97).count();
        assert!((30..270).contains(&at_sun), "{at_sun} of 300");
    }

    #[test]
    fn odd_maps_work() {
        let one = |value: f32| EnvironmentMap {
            width: 1,
            height: 1,
            pixels: vec![Vec3::splat(value)],
        };
        assert!(strata(&one(0.0), 0.0, 100, numbers(0.0)).is_empty());
        for value in [1e-30f32, 1.0, 1e30] {
            let directions = strata(&one(value), 0.0, 100, numbers(0.0));
            let flux: DVec3 = directions.iter().map(|s| s.flux).sum();
            assert_eq!(directions.len(), 100);
            assert!(
                (flux.x / f64::from(value) / (4.0 * PI) - 1.0).abs() < 0.05,
                "{flux}"
            );
        }
    }
}
