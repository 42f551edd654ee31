//! Environment maps: reading, looking up and importance sampling.
//!
//! A direction d is looked up at u = atan2(d.x, −d.z)/2π mod 1, v = acos(d.y)/π (the middle
//! column looks to +Z, a quarter from the left to +X), bilinearly between pixel centres, around the seam in u
//! and clamped in v.
//!
//! Sampling draws a pixel in proportion to its weight, luminance × sin θ at its centre, through the cumulative
//! sums of rows and of columns within a row (f64, as in Pharr et al., *Physically Based Rendering*, 4th ed.,
//! A.5), and then a place around it from a tent two pixels wide. **Deviation:** textbooks draw uniformly
//! within the pixel, which misses that a bilinear lookup carries a bright pixel's light into its neighbours; the sum
//! of weighted tents is the bilinear interpolation of the weights, so the density is known exactly and is
//! above zero wherever the map is.

use crate::image::environment::decode_equirectangular;
use crate::image::error::read_file;
use crate::image::{FloatImage, ImageError, Limits};
use crate::json::quantity::MAX_FACTOR;
use crate::light::EnvironmentMap;
use glam::Vec3;
use std::f32::consts::{PI, TAU};
use std::path::Path;

/// Reads a Radiance `.hdr` or OpenEXR file (told apart by content, not by name) as an environment map, cubes as well
/// ([`crate::image::read_environment`]).
///
/// # Errors
/// The file cannot be read or decoded, or holds negative, infinite or NaN pixels: the message counts them and
/// names the first. They are not repaired here, because a repaired sun is a wrong sun.
pub fn read_environment(path: &Path) -> Result<EnvironmentMap, ImageError> {
    // Once: it may come through a pipe.
    let bytes = read_file(path, &Limits::default())?;
    decode_environment(&path.display().to_string(), &bytes, &Limits::default())
}

/// As [`read_environment`], from memory; `file` says in errors where the bytes came from.
///
/// # Errors
/// As [`read_environment`].
pub fn decode_environment(file: &str, bytes: &[u8], limits: &Limits) -> Result<EnvironmentMap, ImageError> {
    environment_from_image(file, decode_equirectangular(file, bytes, limits)?)
}

fn environment_from_image(file: &str, image: FloatImage) -> Result<EnvironmentMap, ImageError> {
    let invalid = |detail| {
        Err(ImageError::Invalid {
            file: file.into(),
            detail,
        })
    };
    if image.width == 0 || image.height == 0 {
        return invalid("an environment map must have at least one pixel".into());
    }
    let bad = |p: &[f32; 3]| (p.iter()).any(|v| !v.is_finite() || *v < 0.0 || f64::from(*v) > MAX_FACTOR);
    if let Some(first) = image.pixels.iter().position(bad) {
        let count = image.pixels.iter().filter(|p| bad(p)).count();
        let (x, y, value) = (first % image.width, first / image.width, image.pixels[first]);
        return invalid(format!(
            "{count} of {} pixels are negative, infinite, NaN or beyond {MAX_FACTOR:e}, the first at column {x}, row {y}: {value:?}; \
             radiance is from 0 to {MAX_FACTOR:e}: repair or re-export the map",
            image.pixels.len()
        ));
    }
    Ok(EnvironmentMap {
        width: image.width,
        height: image.height,
        pixels: image.pixels.into_iter().map(Vec3::from_array).collect(),
    })
}

/// Rec. 709 luminance of linear RGB.
pub fn luminance(rgb: Vec3) -> f32 {
    rgb.dot(Vec3::new(0.2126, 0.7152, 0.0722))
}

/// Where a direction is looked up: (u, v) in 0..=1, before any rotation of the map.
pub fn uv_from_direction(d: Vec3) -> [f32; 2] {
    let u = d.x.atan2(-d.z) / TAU;
    // atan2(√(x² + z²), y) is acos(y) without its loss of precision at the poles.
    let v = d.x.hypot(d.z).atan2(d.y) / PI;
    [u - u.floor(), v]
}

/// The unit direction that [`uv_from_direction`] takes to (u, v).
pub fn direction_from_uv(uv: [f32; 2]) -> Vec3 {
    let (sin_phi, cos_phi) = (uv[0] * TAU).sin_cos();
    let (sin_theta, cos_theta) = (uv[1] * PI).sin_cos();
    Vec3::new(sin_phi * sin_theta, cos_theta, -cos_phi * sin_theta)
}

/// Four pixels around a place and their weights.
struct Bilinear {
    index: [usize; 4],
    weight: [f32; 4],
}

/// `u` may lie outside 0..1 and wraps; `v` is clamped to the rows.
fn bilinear(width: usize, height: usize, uv: [f32; 2]) -> Bilinear {
    let u = uv[0] - uv[0].floor();
    let x = u * width as f32 - 0.5;
    let y = (uv[1] * height as f32 - 0.5).clamp(0.0, (height - 1) as f32);
    let (x0, y0) = (x.floor(), y.floor());
    let (fx, fy) = (x - x0, y - y0);
    // x0 is −1..width − 1.
    let left = if x0 < 0.0 {
        width - 1
    } else {
        (x0 as usize).min(width - 1)
    };
    let right = if left + 1 == width { 0 } else { left + 1 };
    let top = (y0 as usize).min(height - 1);
    let bottom = (top + 1).min(height - 1);
    Bilinear {
        index: [
            top * width + left,
            top * width + right,
            bottom * width + left,
            bottom * width + right,
        ],
        weight: [(1.0 - fx) * (1.0 - fy), fx * (1.0 - fy), (1.0 - fx) * fy, fx * fy],
    }
}

impl EnvironmentMap {
    /// Radiance at (u, v), unscaled.
    pub fn at(&self, uv: [f32; 2]) -> Vec3 {
        let place = bilinear(self.width, self.height, uv);
        let mut sum = Vec3::ZERO;
        for k in 0..4 {
            sum += self.pixels[place.index[k]] * place.weight[k];
        }
        sum
    }
}

/// Draws directions from an environment map in proportion to its luminance.
#[derive(Clone, Debug)]
pub struct EnvironmentSampler {
    width: usize,
    height: usize,
    /// Per pixel, luminance × sin θ over the mean of that, so the density over (u, v) at its centre.
    density: Vec<f32>,
    /// Cumulative weight of the rows; the last entry is 1.
    rows: Vec<f64>,
    /// Per row, cumulative weight of its pixels; each row's last entry is 1 (or all are 0: a black row).
    columns: Vec<f64>,
    /// ∫ radiance dω over the sphere, RGB (an approximation: pixel centres).
    flux: Vec3,
}

impl EnvironmentSampler {
    /// Prepares sampling; `None` if the map is black or empty.
    pub fn new(map: &EnvironmentMap) -> Option<EnvironmentSampler> {
        let (width, height) = (map.width, map.height);
        if width == 0 || height == 0 || map.pixels.len() != width * height {
            return None;
        }
        // Relative to the brightest channel, so that weights neither overflow nor vanish.
        let peak = map
            .pixels
            .iter()
            .fold(0.0f32, |peak, p| peak.max(p.max_element()));
        if peak.is_nan() || peak <= 0.0 || peak.is_infinite() {
            return None;
        }
        let mut weights = Vec::with_capacity(width * height);
        let mut rows = Vec::with_capacity(height);
        let mut columns = Vec::with_capacity(width * height);
        let (mut total, mut flux) = (0.0f64, glam::DVec3::ZERO);
        for y in 0..height {
            let sin_theta = (std::f64::consts::PI * (y as f64 + 0.5) / height as f64).sin();
            let mut row = 0.0f64;
            for pixel in &map.pixels[y * width..(y + 1) * width] {
                let relative = pixel.as_dvec3() / f64::from(peak);
                let weight = relative.dot(glam::DVec3::new(0.2126, 0.7152, 0.0722)) * sin_theta;
                flux += relative * sin_theta;
                row += weight;
                weights.push(weight);
                columns.push(row);
            }
            if row > 0.0 {
                columns[y * width..].iter_mut().for_each(|sum| *sum /= row);
            }
            total += row;
            rows.push(total);
        }
        rows.iter_mut().for_each(|sum| *sum /= total);
        let pixels = (width * height) as f64;
        let density = weights.iter().map(|w| (w / total * pixels) as f32).collect();
        // A pixel spans 2π/width · π/height · sin θ.
        let pixel_angle = 2.0 * std::f64::consts::PI.powi(2) / pixels;
        let flux = (flux * pixel_angle * f64::from(peak)).as_vec3();
        Some(EnvironmentSampler {
            width,
            height,
            density,
            rows,
            columns,
            flux,
        })
    }

    /// ∫ radiance dω over the whole sphere, RGB, W/m².
    pub fn flux(&self) -> Vec3 {
        self.flux
    }

    /// A place (u, v) and its density per steradian, from two random numbers in [0, 1).
    pub fn sample(&self, random: [f32; 2]) -> ([f32; 2], f32) {
        let (y, inside_y) = pick(&self.rows, f64::from(random[1]));
        let (x, inside_x) = pick(
            &self.columns[y * self.width..][..self.width],
            f64::from(random[0]),
        );
        let u = (x as f64 + 0.5 + tent(inside_x)) / self.width as f64;
        let mut v = (y as f64 + 0.5 + tent(inside_y)) / self.height as f64;
        // The half of a tent that reaches over a pole folds back: clamped lookup has the same density.
        if v < 0.0 {
            v = -v;
        } else if v > 1.0 {
            v = 2.0 - v;
        }
        let uv = [(u - u.floor()) as f32, v as f32];
        (uv, self.pdf(uv))
    }

    /// Density per steradian with which [`EnvironmentSampler::sample`] draws (u, v).
    pub fn pdf(&self, uv: [f32; 2]) -> f32 {
        let place = bilinear(self.width, self.height, uv);
        let mut density = 0.0;
        for k in 0..4 {
            density += self.density[place.index[k]] * place.weight[k];
        }
        // dω = 2π² sin θ du dv. At the very pole the density is unbounded; 1e-6 keeps it finite on a patch of
        // 1e-12 steradians.
        density / (2.0 * PI * PI * (uv[1] * PI).sin().max(1e-6))
    }
}

/// The first entry of rising sums that exceeds `random`, and how far into the entry it lies, 0..1.
pub(crate) fn pick(sums: &[f64], random: f64) -> (usize, f64) {
    let mut i = sums.partition_point(|&sum| sum <= random);
    if i >= sums.len() {
        // Rounding left the last sum below 1: take the last entry that has any weight.
        i = sums.len() - 1;
        while i > 0 && sums[i] <= sums[i - 1] {
            i -= 1;
        }
    }
    let before = if i == 0 { 0.0 } else { sums[i - 1] };
    let span = sums[i] - before;
    (
        i,
        if span > 0.0 {
            ((random - before) / span).clamp(0.0, 1.0)
        } else {
            0.5
        },
    )
}

/// Offset in −1..1 with density 1 − |offset|, from a number in 0..=1.
pub(crate) fn tent(random: f64) -> f64 {
    if random < 0.5 {
        (2.0 * random).sqrt() - 1.0
    } else {
        1.0 - (2.0 * (1.0 - random)).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::{BEAUTY, ExrHeader, Layers, encode_exr};

    fn map(width: usize, height: usize, pixel: impl Fn(usize, usize) -> Vec3) -> EnvironmentMap {
        let pixels = (0..width * height).map(|i| pixel(i % width, i / width)).collect();
        EnvironmentMap {
            width,
            height,
            pixels,
        }
    }

    /// Truth: the page of the module. The tolerance is f32 rounding of atan2 and sin.
    #[test]
    fn columns_and_rows_look_where_the_module_says() {
        for (d, uv) in [
            (Vec3::Z, [0.5, 0.5]),
            (Vec3::X, [0.25, 0.5]),
            (Vec3::NEG_X, [0.75, 0.5]),
        ] {
            let found = uv_from_direction(d);
            assert!(
                (found[0] - uv[0]).abs() < 1e-6 && (found[1] - uv[1]).abs() < 1e-6,
                "{d} {found:?}"
            );
        }
        assert!(uv_from_direction(Vec3::Y)[1] < 1e-6 && uv_from_direction(Vec3::NEG_Y)[1] > 1.0 - 1e-6);
        for uv in [[0.1, 0.2], [0.6, 0.9], [0.99, 0.5]] {
            let back = uv_from_direction(direction_from_uv(uv));
            assert!((back[0] - uv[0]).abs() < 1e-5 && (back[1] - uv[1]).abs() < 1e-5);
        }
    }

    /// Truth: the cross's middle face looks to +Z, its right one to the map's right, −X, its upper one up.
    #[test]
    fn a_cross_is_a_cube_and_six_faces_in_a_row_are_refused() {
        let side = 8;
        let encoded = |columns: usize, rows: usize, value: &dyn Fn(usize, usize) -> f32| {
            let (width, height) = (columns * side, rows * side);
            let mut layers = Layers::new(width, height);
            let pixel = |i: usize| [value(i % width / side, i / width / side); 3];
            layers.push_rgb(BEAUTY, &(0..width * height).map(pixel).collect::<Vec<_>>());
            encode_exr("t", &layers, &ExrHeader::new(), true).unwrap().0
        };
        let cross = encoded(4, 3, &|column, row| match (column, row) {
            (column, 1) => 1.0 + column as f32,
            (1, row) => 5.0 + row as f32,
            _ => 0.0,
        });
        let map = decode_environment("t", &cross, &Limits::default()).unwrap();
        for (direction, radiance) in [
            (Vec3::X, 1.0),
            (Vec3::Z, 2.0),
            (Vec3::NEG_X, 3.0),
            (Vec3::NEG_Z, 4.0),
            (Vec3::Y, 5.0),
            (Vec3::NEG_Y, 7.0),
        ] {
            assert_eq!(map.at(uv_from_direction(direction)).x, radiance, "{direction}");
        }
        let row = encoded(6, 1, &|column, _| column as f32);
        let refused = decode_environment("t", &row, &Limits::default())
            .unwrap_err()
            .to_string();
        assert!(refused.contains("six faces of a cube"), "{refused}");
    }

    /// Truth: quadrature of the bilinear map itself over a grid far finer than its pixels. An unbiased
    /// estimate of 2^16 stratified samples with nearly proportional density is good to well under 1 %.
    #[test]
    fn sampling_integrates_what_the_lookup_shows() {
        let maps = [
            map(1, 1, |_, _| Vec3::new(1.0, 2.0, 3.0)),
            map(16, 8, |x, y| {
                if (x, y) == (5, 2) {
                    Vec3::splat(1e9)
                } else {
                    Vec3::splat(1.0)
                }
            }),
            map(16, 8, |x, y| {
                if (x, y) == (0, 0) {
                    Vec3::splat(1e-19)
                } else {
                    Vec3::ZERO
                }
            }),
            map(32, 16, |x, y| {
                Vec3::new(x as f32, y as f32, ((x * 7 + y * 3) % 5) as f32)
            }),
        ];
        for map in maps {
            let sampler = EnvironmentSampler::new(&map).unwrap();
            let (n, mut sum) = (256, glam::DVec3::ZERO);
            for i in 0..n * n {
                let random = [
                    ((i % n) as f32 + 0.5) / n as f32,
                    ((i / n) as f32 + 0.5) / n as f32,
                ];
                let (uv, pdf) = sampler.sample(random);
                assert!(pdf > 0.0 && pdf.is_finite());
                sum += map.at(uv).as_dvec3() / f64::from(pdf) / (n * n) as f64;
            }
            let (w, h, mut truth) = (1024, 1024, glam::DVec3::ZERO);
            for i in 0..w * h {
                let uv = [
                    ((i % w) as f32 + 0.5) / w as f32,
                    ((i / w) as f32 + 0.5) / h as f32,
                ];
                let angle = 2.0 * std::f64::consts::PI.powi(2) / (w * h) as f64;
                truth += map.at(uv).as_dvec3() * (f64::from(uv[1]) * std::f64::consts::PI).sin() * angle;
            }
            let error = ((sum - truth) / truth.max(glam::DVec3::splat(1e-300)))
                .abs()
                .max_element();
            assert!(
                error < 0.01,
                "{}x{}: {sum} against {truth}",
                map.width,
                map.height
            );
        }
    }

    /// Truth: a probability density integrates to 1 over the sphere.
    #[test]
    fn density_integrates_to_one() {
        let map = map(16, 8, |x, y| {
            if (x, y) == (15, 4) {
                Vec3::splat(1e4)
            } else {
                Vec3::splat(0.5)
            }
        });
        let sampler = EnvironmentSampler::new(&map).unwrap();
        let (w, h, mut sum) = (512, 512, 0.0f64);
        for i in 0..w * h {
            let uv = [
                ((i % w) as f32 + 0.5) / w as f32,
                ((i / w) as f32 + 0.5) / h as f32,
            ];
            let angle = 2.0 * std::f64::consts::PI.powi(2) / (w * h) as f64;
            sum += f64::from(sampler.pdf(uv)) * (f64::from(uv[1]) * std::f64::consts::PI).sin() * angle;
        }
        assert!((sum - 1.0).abs() < 1e-3, "{sum}");
    }

    #[test]
    fn pixels_that_are_no_radiance_are_refused_with_count_and_place() {
        let mut image = FloatImage::black(4, 2);
        image.pixels[5] = [0.0, -1.0, 0.0];
        image.pixels[6] = [f32::NAN, 0.0, f32::INFINITY];
        let message = environment_from_image("sky.hdr", image).unwrap_err().to_string();
        assert!(
            message.contains("sky.hdr: 2 of 8 pixels") && message.contains("column 1, row 1"),
            "{message}"
        );
    }

    #[test]
    fn black_and_empty_maps_cannot_be_sampled() {
        assert!(EnvironmentSampler::new(&map(4, 2, |_, _| Vec3::ZERO)).is_none());
        assert!(EnvironmentSampler::new(&map(0, 0, |_, _| Vec3::ONE)).is_none());
    }
}
