//! Light that is constant over intervals of a row of pixels, summed over many lights: the prefix sums of pixelcuts.
//!
//! Source: Khungurn et al., *Pixelcuts*, section 3 ("Scattering contribution"): a light's contribution is constant over
//! the interval of each node of its cut, so only the differences where intervals begin are entered, and one prefix sum
//! per coefficient recovers the sum over all lights. O(n + intervals) instead of O(n · lights).
//!
//! **Deviation:** the row is cut into blocks that fit into a cache, and what reaches into a block from before is entered
//! at its first pixel. That costs one entry per light and block, makes blocks independent of each other (so they run on
//! all cores, with the same sums on any number of them), and keeps what cancels in a difference near by. Sums are f64:
//! successive differences of lights of 1e20 leave residues at the size of their rounding beside lights of 1.

use crate::sh;
use glam::Vec3;
use rayon::prelude::*;

/// A light's contribution from pixel `start` on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Run {
    /// Place in the row.
    pub start: u32,
    /// Light from `direction` as incident radiance at one direction: irradiance of a surface that faces it, RGB, W/m².
    /// Zero where it is hidden.
    pub light: Vec3,
    /// Unit, towards the light.
    pub direction: Vec3,
    /// Share of `light` that is irradiance, apart from the harmonics.
    pub cosine: f32,
    /// Whether the harmonics are wanted.
    pub harmonics: bool,
}

/// Numbers per pixel: irradiance RGB, then each harmonic's RGB.
pub const fn stride(degree: usize) -> usize {
    3 + 3 * sh::count(degree)
}

/// The largest [`stride`].
const MOST: usize = stride(sh::MAX_DEGREE);

/// Pixels of a block: 51 f64 for each are 0.4 MB, which fits into a second-level cache.
const BLOCK: usize = 1024;

/// Adds lights to a row. `lights` have runs with rising starts, the first at 0; `row` holds [`stride`] numbers for each
/// pixel: irradiance and coefficients of incident radiance in spherical harmonics up to `degree`.
pub fn scatter(lights: &[Vec<Run>], degree: usize, row: &mut [f32]) {
    let stride = stride(degree);
    row.par_chunks_mut(BLOCK * stride)
        .enumerate()
        .for_each(|(block, row)| add_block(lights, degree, block * BLOCK, row));
}

fn add_block(lights: &[Vec<Run>], degree: usize, first: usize, row: &mut [f32]) {
    let stride = stride(degree);
    let mut differences = vec![0.0f64; row.len()];
    let end = first + row.len() / stride;
    for runs in lights {
        let before = runs.partition_point(|run| run.start as usize <= first).max(1) - 1;
        let mut last = [0.0f64; MOST];
        for run in &runs[before..] {
            if run.start as usize >= end {
                break;
            }
            let value = values(run, degree);
            let at = (run.start as usize).max(first) - first;
            let entry = &mut differences[at * stride..][..stride];
            for ((entry, value), last) in entry.iter_mut().zip(&value).zip(&last) {
                *entry += value - last;
            }
            last = value;
        }
    }
    let mut sums = [0.0f64; MOST];
    for (row, differences) in row.chunks_exact_mut(stride).zip(differences.chunks_exact(stride)) {
        for ((out, difference), sum) in row.iter_mut().zip(differences).zip(&mut sums) {
            *sum += difference;
            *out += *sum as f32;
        }
    }
}

/// What a run adds to each of its pixels.
fn values(run: &Run, degree: usize) -> [f64; MOST] {
    let mut values = [0.0; MOST];
    let light = run.light.as_dvec3().to_array();
    for channel in 0..3 {
        values[channel] = light[channel] * f64::from(run.cosine);
    }
    if run.harmonics {
        let y = sh::evaluate(run.direction);
        for (i, y) in y.iter().enumerate().take(sh::count(degree)) {
            for channel in 0..3 {
                values[3 + 3 * i + channel] = light[channel] * f64::from(*y);
            }
        }
    }
    values
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;
    use crate::test_random::direction;

    fn lights(n: usize, strength: impl Fn(usize) -> f32) -> Vec<Vec<Run>> {
        (0..40)
            .map(|light| {
                let mut s = Stream::new(3, 0, light as u64);
                let mut runs = Vec::new();
                let mut start = 0;
                while start < n as u32 {
                    let visible = s.uniform() < 0.7;
                    runs.push(Run {
                        start,
                        light: Vec3::new(s.uniform(), s.uniform(), s.uniform())
                            * strength(light)
                            * f32::from(u8::from(visible)),
                        direction: direction(&mut s),
                        cosine: s.uniform(),
                        harmonics: s.uniform() < 0.5,
                    });
                    start += 1 + (s.uniform().powi(8) * 2000.0) as u32;
                }
                runs
            })
            .collect()
    }

    /// Every light at every pixel by itself.
    fn direct(lights: &[Vec<Run>], degree: usize, n: usize) -> Vec<f64> {
        let stride = stride(degree);
        let mut row = vec![0.0; n * stride];
        for runs in lights {
            for (pixel, row) in row.chunks_exact_mut(stride).enumerate() {
                let run = runs.iter().rev().find(|run| run.start as usize <= pixel).unwrap();
                for (out, value) in row.iter_mut().zip(values(run, degree)) {
                    *out += value;
                }
            }
        }
        row
    }

    #[test]
    fn prefix_sums_are_the_sums_over_lights() {
        for (n, degree) in [(1, 3), (1023, 0), (3000, 1), (5000, 2), (5000, 3)] {
            let lights = lights(n, |_| 1.0);
            let mut row = vec![0.0; n * stride(degree)];
            scatter(&lights, degree, &mut row);
            for (found, exact) in row.iter().zip(direct(&lights, degree, n)) {
                assert!((f64::from(*found) - exact).abs() < 1e-5, "{found}, not {exact}");
            }
        }
    }

    #[test]
    fn faint_lights_survive_beside_strong_ones() {
        // Pixels that the strong light does not reach keep the faint ones to the rounding of 1e9 in f64.
        let n = 4000;
        let mut lights = lights(n, |light| if light == 7 { 1e9 } else { 1.0 });
        for run in &mut lights[7] {
            if run.start >= 2000 {
                run.light = Vec3::ZERO;
            }
        }
        let degree = 3;
        let mut row = vec![0.0; n * stride(degree)];
        scatter(&lights, degree, &mut row);
        let exact = direct(&lights, degree, n);
        let dark = 3000 * stride(degree);
        for (found, exact) in row[dark..].iter().zip(&exact[dark..]) {
            assert!((f64::from(*found) - exact).abs() < 1e-5, "{found}, not {exact}");
        }
    }

    #[test]
    fn any_number_of_threads_gives_the_same_sums() {
        let (n, degree) = (9000, 3);
        let lights = lights(n, |light| 10f32.powi(light as i32 % 9));
        let on = |threads| {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .unwrap();
            let mut row = vec![0.0; n * stride(degree)];
            pool.install(|| scatter(&lights, degree, &mut row));
            row
        };
        assert_eq!(on(1), on(3));
    }
}
