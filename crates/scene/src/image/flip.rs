//! FLIP: how different two images look to somebody who flips between them.
//!
//! Sources: Andersson et al., "FLIP: A Difference Evaluator for Alternating Images" (HPG 2020): contrast sensitivity
//! filters in YCxCz (section 4.1), Hunt-adjusted CIELAB and the HyAB distance, redistributed (4.1.2), edge and point
//! features (4.2), their union (4.3); Andersson et al., "Visualizing Errors in Rendered High Dynamic Range Images"
//! (EG 2021): the exposure range and the largest error over it. Constants are the papers' and, where those leave
//! them open (the ACES curve, the exposure's t, 67 pixels per degree), those of NVIDIA's published tool.
//!
//! Deviations: Gaussians are applied one axis at a time, the blue-yellow filter as two of them; the sRGB round trip
//! between tone mapping and the opponent space is left out, being the identity. Agreement with the tool:
//! `docs/notebook/images.md`.

use super::error::ImageError;
use super::layers::{FloatImage, check_pair};
use rayon::prelude::*;
use std::f64::consts::PI;

/// A FLIP error map and its mean.
#[derive(Clone, Debug, PartialEq)]
pub struct Flip {
    /// Per pixel, 0 (looks equal) to 1, row after row.
    pub errors: Vec<f32>,
    /// Mean of `errors`.
    pub mean: f64,
    /// Shortest and longest exposure in EV and their number; `(0, 0, 1)` for [`flip_ldr`].
    pub exposures: (f64, f64, usize),
}

/// A 4K screen of 0.7 m, 0.7 m away: pixels per degree of visual angle.
const PIXELS_PER_DEGREE: f64 = 0.7 * 3840.0 / 0.7 * PI / 180.0;
/// Contrast sensitivity as sums of Gaussians a·√(π/b)·exp(−π²x²/b), x in degrees (HPG 2020, table 1).
const ACHROMATIC: [[f64; 2]; 1] = [[1.0, 0.0047]];
const RED_GREEN: [[f64; 2]; 1] = [[1.0, 0.0053]];
const BLUE_YELLOW: [[f64; 2]; 2] = [[34.1, 0.04], [13.5, 0.025]];
/// The widest of the Gaussians above; all filters reach as far.
const WIDEST: f64 = 0.04;
/// Exponent of the colour difference, and of the feature difference.
const Q_COLOR: f32 = 0.7;
const Q_FEATURE: f32 = 0.5;
/// Differences up to P_C of the largest one fill the range up to P_T.
const P_C: f32 = 0.4;
const P_T: f32 = 0.95;
/// Peak-to-trough width, in degrees, of the eye's edge detectors.
const FEATURE_WIDTH: f64 = 0.082;
/// The tone mapped level of the brightest, and of the median, luminance at the ends of the exposure range.
const EXPOSURE_T: f64 = 0.85;
/// Narkowicz's fit of ACES, (k₀x² + k₁x) / (k₃x² + k₄x + k₅), its pre-exposure of 0.6 folded in.
const ACES: [f64; 5] = [0.36 * 2.51, 0.6 * 0.03, 0.36 * 2.43, 0.6 * 0.59, 0.14];
/// Linear sRGB to CIE XYZ, and the white point it implies; rational entries as the tool has them.
const XYZ_FROM_RGB: [[f64; 3]; 3] = [
    [
        10135552.0 / 24577794.0,
        8788810.0 / 24577794.0,
        4435075.0 / 24577794.0,
    ],
    [
        2613072.0 / 12288897.0,
        8788810.0 / 12288897.0,
        887015.0 / 12288897.0,
    ],
    [
        1425312.0 / 73733382.0,
        8788810.0 / 73733382.0,
        70074185.0 / 73733382.0,
    ],
];

/// Images as three planes.
type Planes = [Vec<f32>; 3];

/// HDR-FLIP of two linear images of any brightness (negative values count as 0).
///
/// # Errors
/// [`ImageError::Invalid`] if the sizes differ, an image is empty, or a value is NaN or infinite.
pub fn flip_hdr(test: &FloatImage, reference: &FloatImage) -> Result<Flip, ImageError> {
    check_pair(test, reference)?;
    let (start, stop, count) = exposure_range(reference);
    let mut errors = vec![0.0_f32; test.pixels.len()];
    for i in 0..count {
        let exposure = start + (stop - start) * i as f64 / (count - 1).max(1) as f64;
        let map = |image: &FloatImage| FloatImage {
            pixels: image
                .pixels
                .iter()
                .map(|p| p.map(|v| aces(v, exposure)))
                .collect(),
            ..*image
        };
        for (e, at) in errors.iter_mut().zip(ldr_errors(&map(test), &map(reference))) {
            *e = e.max(at);
        }
    }
    Ok(with_mean(errors, (start, stop, count)))
}

/// LDR-FLIP of two linear images, clamped to [0, 1].
///
/// # Errors
/// As [`flip_hdr`].
pub fn flip_ldr(test: &FloatImage, reference: &FloatImage) -> Result<Flip, ImageError> {
    check_pair(test, reference)?;
    let clamped = |image: &FloatImage| FloatImage {
        pixels: image
            .pixels
            .iter()
            .map(|p| p.map(|v| v.clamp(0.0, 1.0)))
            .collect(),
        ..*image
    };
    Ok(with_mean(
        ldr_errors(&clamped(test), &clamped(reference)),
        (0.0, 0.0, 1),
    ))
}

fn with_mean(errors: Vec<f32>, exposures: (f64, f64, usize)) -> Flip {
    let mean = errors.iter().map(|&e| f64::from(e)).sum::<f64>() / errors.len() as f64;
    Flip {
        errors,
        mean,
        exposures,
    }
}

/// Exposures from where the brightest luminance to where the median one is mapped to [`EXPOSURE_T`] (EG 2021).
fn exposure_range(reference: &FloatImage) -> (f64, f64, usize) {
    let [k0, k1, k3, k4, k5] = ACES;
    // The positive root of (k₀ − t k₃)x² + (k₁ − t k₄)x − t k₅ = 0.
    let t = EXPOSURE_T;
    let (b, c) = ((k1 - k4 * t) / (k0 - k3 * t), -k5 * t / (k0 - k3 * t));
    let x = -0.5 * b + ((0.5 * b).powi(2) - c).sqrt();
    let mut luminances: Vec<f64> = reference
        .pixels
        .iter()
        .map(|p| p.map(|v| f64::from(v.max(0.0))))
        .map(|[r, g, b]| 0.2126 * r + 0.7152 * g + 0.0722 * b)
        .collect();
    luminances.sort_by(f64::total_cmp);
    // Of an even number the upper one, as in the tool.
    let median = luminances[luminances.len() / 2];
    let brightest = luminances[luminances.len() - 1];
    if brightest <= 0.0 {
        return (0.0, 0.0, 1);
    }
    // More than half of the image black: the tool's range is then infinite. 2⁻²⁰ of the brightest looks black too.
    let (start, stop) = (
        (x / brightest).log2(),
        (x / median.max(brightest / 1_048_576.0)).log2(),
    );
    (start, stop, ((stop - start).ceil() as usize).max(2))
}

/// Narkowicz's ACES curve of a linear value under an exposure.
fn aces(v: f32, exposure: f64) -> f32 {
    let [k0, k1, k3, k4, k5] = ACES;
    let x = f64::from(v.max(0.0)) * exposure.exp2();
    (((k0 * x + k1) * x) / ((k3 * x + k4) * x + k5)).clamp(0.0, 1.0) as f32
}

/// FLIP per pixel of linear images in [0, 1] (HPG 2020, section 4).
fn ldr_errors(test: &FloatImage, reference: &FloatImage) -> Vec<f32> {
    let (width, filters, features) = (test.width, Filters::new(), Features::new());
    let appearance = |image: &FloatImage| {
        let opponent = opponent_planes(image);
        let lab = filters.hunt_lab(&opponent, width);
        let luma: Vec<f32> = opponent[0].iter().map(|y| (y + 16.0) / 116.0).collect();
        (lab, features.detect(&luma, width))
    };
    let ((test_lab, test_features), (reference_lab, reference_features)) =
        rayon::join(|| appearance(test), || appearance(reference));
    let largest = hyab(hunt(lab([0.0, 1.0, 0.0])), hunt(lab([0.0, 0.0, 1.0]))).powf(Q_COLOR);
    let knee = P_C * largest;
    (0..test.pixels.len())
        .into_par_iter()
        .map(|i| {
            let difference = hyab(test_lab[i], reference_lab[i]).powf(Q_COLOR);
            let color = if difference < knee {
                P_T / knee * difference
            } else {
                P_T + (difference - knee) / (largest - knee) * (1.0 - P_T)
            };
            let [edge, point] = [0, 1].map(|k| (test_features[i][k] - reference_features[i][k]).abs());
            let feature = (edge.max(point) / 2.0_f32.sqrt()).powf(Q_FEATURE);
            color.powf(1.0 - feature).clamp(0.0, 1.0)
        })
        .collect()
}

fn xyz_relative_to_white(rgb: [f32; 3]) -> [f32; 3] {
    XYZ_FROM_RGB.map(|row| {
        let white: f64 = row.iter().sum();
        ((0..3).map(|k| row[k] * f64::from(rgb[k])).sum::<f64>() / white) as f32
    })
}

/// Linear RGB as Y, Cx, Cz: CIELAB's axes without its cube root.
fn opponent_planes(image: &FloatImage) -> Planes {
    let mut planes: Planes = std::array::from_fn(|_| Vec::with_capacity(image.pixels.len()));
    for &p in &image.pixels {
        let [x, y, z] = xyz_relative_to_white(p);
        for (plane, v) in planes
            .iter_mut()
            .zip([116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)])
        {
            plane.push(v);
        }
    }
    planes
}

/// CIELAB of linear RGB.
fn lab(rgb: [f32; 3]) -> [f32; 3] {
    const DELTA: f32 = 6.0 / 29.0;
    let [x, y, z] = xyz_relative_to_white(rgb).map(|v| {
        if v > DELTA * DELTA * DELTA {
            v.cbrt()
        } else {
            v / (3.0 * DELTA * DELTA) + 4.0 / 29.0
        }
    });
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// The Hunt effect: colours look more vivid where it is lighter.
fn hunt([l, a, b]: [f32; 3]) -> [f32; 3] {
    [l, 0.01 * l * a, 0.01 * l * b]
}

/// HyAB: city-block distance in lightness, Euclidean in chroma.
fn hyab(p: [f32; 3], q: [f32; 3]) -> f32 {
    (p[0] - q[0]).abs() + ((p[1] - q[1]).powi(2) + (p[2] - q[2]).powi(2)).sqrt()
}

/// The contrast sensitivity filters: per channel one or two kernels of one axis, and their weights, which sum to 1.
struct Filters {
    channels: [Vec<(f32, Vec<f32>)>; 3],
}

impl Filters {
    fn new() -> Self {
        let radius = (3.0 * (WIDEST / (2.0 * PI * PI)).sqrt() * PIXELS_PER_DEGREE).ceil() as i32;
        let channel = |gaussians: &[[f64; 2]]| {
            let kernels: Vec<(f64, Vec<f64>)> = gaussians
                .iter()
                .map(|&[a, b]| {
                    let tap = |x: i32| (-PI * PI * (f64::from(x) / PIXELS_PER_DEGREE).powi(2) / b).exp();
                    let taps: Vec<f64> = (-radius..=radius).map(tap).collect();
                    let sum: f64 = taps.iter().sum();
                    (
                        a * (PI / b).sqrt() * sum * sum,
                        taps.iter().map(|t| t / sum).collect(),
                    )
                })
                .collect();
            let total: f64 = kernels.iter().map(|k| k.0).sum();
            kernels
                .into_iter()
                .map(|(weight, taps)| ((weight / total) as f32, taps.iter().map(|&t| t as f32).collect()))
                .collect()
        };
        Self {
            channels: [channel(&ACHROMATIC), channel(&RED_GREEN), channel(&BLUE_YELLOW)],
        }
    }

    /// Filters the opponent planes and takes the result, clamped to the RGB cube, to Hunt-adjusted CIELAB.
    fn hunt_lab(&self, opponent: &Planes, width: usize) -> Vec<[f32; 3]> {
        let filtered: Vec<Vec<f32>> = opponent
            .iter()
            .zip(&self.channels)
            .map(|(plane, kernels)| {
                let mut sum = vec![0.0; plane.len()];
                for (weight, taps) in kernels {
                    let once = filter_columns(&filter_rows(plane, width, taps), width, taps);
                    sum.iter_mut().zip(once).for_each(|(s, v)| *s += weight * v);
                }
                sum
            })
            .collect();
        let inverse = glam::DMat3::from_cols_array_2d(&XYZ_FROM_RGB)
            .transpose()
            .inverse();
        let white = XYZ_FROM_RGB.map(|row| row.iter().sum::<f64>());
        (0..opponent[0].len())
            .into_par_iter()
            .map(|i| {
                let y = (f64::from(filtered[0][i]) + 16.0) / 116.0;
                let (x, z) = (
                    y + f64::from(filtered[1][i]) / 500.0,
                    y - f64::from(filtered[2][i]) / 200.0,
                );
                let rgb = inverse * glam::DVec3::new(x * white[0], y * white[1], z * white[2]);
                hunt(lab(rgb.to_array().map(|v| v.clamp(0.0, 1.0) as f32)))
            })
            .collect()
    }
}

/// Kernels of the edge and the point detector: a derivative of a Gaussian along one axis, the Gaussian across it.
struct Features {
    smooth: Vec<f32>,
    first: Vec<f32>,
    second: Vec<f32>,
}

impl Features {
    fn new() -> Self {
        let sd = 0.5 * FEATURE_WIDTH * PIXELS_PER_DEGREE;
        let radius = (3.0 * sd).ceil() as i32;
        let gauss = |x: i32| (-f64::from(x * x) / (2.0 * sd * sd)).exp();
        let kernel = |f: &dyn Fn(i32) -> f64| (-radius..=radius).map(f).collect::<Vec<f64>>();
        // Positive weights sum to 1, negative ones to -1.
        let balanced = |taps: Vec<f64>| {
            let positive: f64 = taps.iter().filter(|t| **t > 0.0).sum();
            let negative: f64 = -taps.iter().filter(|t| **t < 0.0).sum::<f64>();
            taps.iter()
                .map(|t| {
                    (t / if *t > 0.0 {
                        positive
                    } else {
                        negative.max(f64::MIN_POSITIVE)
                    }) as f32
                })
                .collect()
        };
        Self {
            smooth: balanced(kernel(&gauss)),
            first: balanced(kernel(&|x| -f64::from(x) * gauss(x))),
            second: balanced(kernel(&|x| (f64::from(x * x) / (sd * sd) - 1.0) * gauss(x))),
        }
    }

    /// Per pixel the strength of an edge and of a point.
    fn detect(&self, luma: &[f32], width: usize) -> Vec<[f32; 2]> {
        let smooth_rows = filter_rows(luma, width, &self.smooth);
        let strength = |kernel: &[f32]| {
            let along_x = filter_columns(&filter_rows(luma, width, kernel), width, &self.smooth);
            let along_y = filter_columns(&smooth_rows, width, kernel);
            along_x
                .into_iter()
                .zip(along_y)
                .map(|(x, y)| x.hypot(y))
                .collect::<Vec<f32>>()
        };
        strength(&self.first)
            .into_iter()
            .zip(strength(&self.second))
            .map(|(e, p)| [e, p])
            .collect()
    }
}

/// Correlates each row with an odd kernel; the border pixels go on outside.
fn filter_rows(plane: &[f32], width: usize, taps: &[f32]) -> Vec<f32> {
    let radius = taps.len() / 2;
    let mut out = vec![0.0; plane.len()];
    out.par_chunks_mut(width)
        .zip(plane.par_chunks(width))
        .for_each(|(out, row)| {
            let mut padded = vec![row[0]; radius];
            padded.extend_from_slice(row);
            padded.resize(width + 2 * radius, row[width - 1]);
            for (k, tap) in taps.iter().enumerate() {
                out.iter_mut().zip(&padded[k..]).for_each(|(o, v)| *o += tap * v);
            }
        });
    out
}

/// As [`filter_rows`], for columns.
fn filter_columns(plane: &[f32], width: usize, taps: &[f32]) -> Vec<f32> {
    let (radius, height) = (taps.len() / 2, plane.len() / width);
    let mut out = vec![0.0; plane.len()];
    out.par_chunks_mut(width).enumerate().for_each(|(y, out)| {
        for (k, tap) in taps.iter().enumerate() {
            let from = (y + k).saturating_sub(radius).min(height - 1) * width;
            out.iter_mut()
                .zip(&plane[from..from + width])
                .for_each(|(o, v)| *o += tap * v);
        }
    });
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The image that the tool was given too: ramps, and the same with a rectangle at half its brightness.
    fn ramps(scale: f32) -> (FloatImage, FloatImage) {
        let (w, h) = (48, 32);
        let mut reference = FloatImage::black(w, h);
        for (i, p) in reference.pixels.iter_mut().enumerate() {
            let (x, y) = ((i % w) as f32, (i / w) as f32);
            *p = [x / w as f32, y / h as f32, (x + y) / (w + h) as f32].map(|v| v * scale);
        }
        let mut test = reference.clone();
        for y in 8..16 {
            for p in &mut test.pixels[y * w + 8..y * w + 24] {
                *p = p.map(|v| v * 0.5);
            }
        }
        (test, reference)
    }

    /// Truth: PyPI's flip-evaluator 1.7 (NVIDIA's own) on the same arrays. It rounds to f32 at every step, in
    /// another order than we do: 1e-4 of the mean, 1e-5 EV.
    #[test]
    fn flip_agrees_with_nvidias_tool_on_ramps() {
        let (test, reference) = ramps(1.0);
        let ldr = flip_ldr(&test, &reference).unwrap().mean;
        assert!((ldr / 0.062_874_771_654_6 - 1.0).abs() < 1e-4, "{ldr}");
        let (test, reference) = ramps(50.0);
        let hdr = flip_hdr(&test, &reference).unwrap();
        assert!(
            (hdr.mean / 0.058_818_995_952_6 - 1.0).abs() < 1e-3,
            "{}",
            hdr.mean
        );
        assert!(
            (hdr.exposures.0 - -4.518_719_673).abs() < 1e-5,
            "{:?}",
            hdr.exposures
        );
        assert!(
            (hdr.exposures.1 - -3.519_381_762).abs() < 1e-5,
            "{:?}",
            hdr.exposures
        );
        assert_eq!(hdr.exposures.2, 2);
    }

    /// Truth: by definition, black against white is the largest difference in lightness, and equal images have none.
    #[test]
    fn black_against_white_is_nearly_all_and_equal_is_nothing() {
        let flat = |v: f32| FloatImage {
            width: 30,
            height: 30,
            pixels: vec![[v; 3]; 900],
        };
        assert!(flip_ldr(&flat(0.0), &flat(1.0)).unwrap().mean > 0.9);
        assert_eq!(flip_ldr(&flat(0.4), &flat(0.4)).unwrap().mean, 0.0);
    }

    /// Truth: HDR-FLIP chooses its exposures from the reference, so a power of two of the light changes nothing.
    #[test]
    fn hdr_flip_does_not_depend_on_the_brightness_of_the_scene() {
        let at = |scale: f32| {
            let (test, reference) = ramps(scale);
            flip_hdr(&test, &reference).unwrap().mean
        };
        let one = at(1.0);
        for scale in [2.0_f32.powi(-60), 2.0_f32.powi(60)] {
            // Exposures are rounded logarithms.
            assert!((at(scale) - one).abs() < 1e-6, "{} {one}", at(scale));
        }
    }

    #[test]
    fn images_of_one_pixel_and_mostly_black_ones_have_a_finite_error() {
        let one = |v: f32| FloatImage {
            width: 1,
            height: 1,
            pixels: vec![[v; 3]],
        };
        assert!((0.0..=1.0).contains(&flip_hdr(&one(0.0), &one(1e20)).unwrap().mean));
        assert!((0.0..=1.0).contains(&flip_hdr(&one(1.0), &one(0.0)).unwrap().mean));
        let mut speck = FloatImage::black(9, 9);
        speck.pixels[40] = [1e9; 3];
        assert!((0.0..=1.0).contains(&flip_hdr(&FloatImage::black(9, 9), &speck).unwrap().mean));
    }
}
