//! How far an image is from its reference: the measures that every comparison in relight quotes.
//!
//! relMSE is the mean over pixels of
//! (mean over RGB of the squared difference) / ((mean over RGB of the reference)² + 0.01 · (mean of the reference
//! image)²), the worst 0.1 % of the pixels left out, so that a single bright speck does not decide. Sums are f64 in
//! pixel order.

use super::error::ImageError;
use super::flip::flip_hdr;
use super::layers::{FloatImage, check_pair};

/// Part of the squared mean of the reference that keeps dark pixels from dominating relMSE.
pub const RELMSE_EPSILON: f64 = 0.01;
/// Part of the pixels, the worst ones, that relMSE leaves out (rounded down to whole pixels).
pub const RELMSE_TRIMMED: f64 = 0.001;

/// All measures of one pair of images.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    /// [`rmse`], in the images' unit.
    pub rmse: f64,
    /// [`relmse`].
    pub relmse: f64,
    /// [`psnr`] in dB; infinite for equal images.
    pub psnr_db: f64,
    /// Relative error of the mean of red, green and blue ([`bias`]).
    pub bias_rgb: [f64; 3],
    /// Relative error of the mean over all channels ([`bias`]).
    pub bias: f64,
    /// 99th percentile of [`relative_errors`].
    pub relative_error_p99: f64,
    /// Mean of HDR-FLIP, 0 (equal) to 1.
    pub flip: f64,
}

/// All measures of `test` against `reference`.
///
/// # Errors
/// [`ImageError::Invalid`] if the sizes differ, an image is empty, or a value is NaN or infinite.
pub fn compare(test: &FloatImage, reference: &FloatImage) -> Result<Comparison, ImageError> {
    let (bias_rgb, all) = bias(test, reference)?;
    let mut errors = relative_errors(test, reference)?;
    Ok(Comparison {
        rmse: rmse(test, reference)?,
        relmse: relmse(test, reference)?,
        psnr_db: psnr(test, reference)?,
        bias_rgb,
        bias: all,
        relative_error_p99: percentile(&mut errors, 0.99),
        flip: flip_hdr(test, reference)?.mean,
    })
}

/// Mean over RGB of a pixel.
pub(super) fn grey(p: &[f32; 3]) -> f64 {
    (f64::from(p[0]) + f64::from(p[1]) + f64::from(p[2])) / 3.0
}

/// Mean over RGB of the squared difference of two pixels.
fn squared_difference(a: &[f32; 3], b: &[f32; 3]) -> f64 {
    (0..3)
        .map(|k| (f64::from(a[k]) - f64::from(b[k])).powi(2))
        .sum::<f64>()
        / 3.0
}

/// Root of the mean squared difference over all pixels and channels, in the images' unit.
///
/// # Errors
/// As [`compare`].
pub fn rmse(test: &FloatImage, reference: &FloatImage) -> Result<f64, ImageError> {
    check_pair(test, reference)?;
    let sum: f64 = test
        .pixels
        .iter()
        .zip(&reference.pixels)
        .map(|(a, b)| squared_difference(a, b))
        .sum();
    Ok((sum / test.pixels.len() as f64).sqrt())
}

/// Per pixel, the summand of relMSE, before trimming; 0 / 0 (both images black) counts as 0.
fn relative_squares(test: &FloatImage, reference: &FloatImage) -> Result<Vec<f64>, ImageError> {
    check_pair(test, reference)?;
    let mean = reference.pixels.iter().map(grey).sum::<f64>() / reference.pixels.len() as f64;
    let floor = RELMSE_EPSILON * mean * mean;
    let relative = |(a, b): (&[f32; 3], &[f32; 3])| {
        let difference = squared_difference(a, b);
        if difference == 0.0 {
            0.0
        } else {
            difference / (grey(b).powi(2) + floor)
        }
    };
    Ok(test.pixels.iter().zip(&reference.pixels).map(relative).collect())
}

/// Relative mean squared error; the module's header has the formula.
///
/// # Errors
/// As [`compare`].
pub fn relmse(test: &FloatImage, reference: &FloatImage) -> Result<f64, ImageError> {
    let mut squares = relative_squares(test, reference)?;
    squares.sort_by(f64::total_cmp);
    squares.truncate(squares.len() - (squares.len() as f64 * RELMSE_TRIMMED) as usize);
    Ok(squares.iter().sum::<f64>() / squares.len() as f64)
}

/// Per pixel, the root of relMSE's summand: a relative error that stays finite in the dark.
///
/// # Errors
/// As [`compare`].
pub fn relative_errors(test: &FloatImage, reference: &FloatImage) -> Result<Vec<f64>, ImageError> {
    Ok(relative_squares(test, reference)?
        .into_iter()
        .map(f64::sqrt)
        .collect())
}

/// The smallest value that at least a `part` (0 to 1) of the values do not exceed (nearest rank). Sorts `values`,
/// of which there has to be at least one.
pub fn percentile(values: &mut [f64], part: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let rank = (part * values.len() as f64).ceil() as usize;
    values[rank.clamp(1, values.len()) - 1]
}

/// Peak signal-to-noise ratio in dB, 20 log₁₀(peak / RMSE), the peak being the reference's largest value (float
/// images have no other). Infinite for equal images.
///
/// # Errors
/// As [`compare`].
pub fn psnr(test: &FloatImage, reference: &FloatImage) -> Result<f64, ImageError> {
    let error = rmse(test, reference)?;
    let peak = reference
        .pixels
        .as_flattened()
        .iter()
        .copied()
        .fold(0.0_f32, f32::max);
    Ok(if error == 0.0 {
        f64::INFINITY
    } else {
        20.0 * (f64::from(peak) / error).log10()
    })
}

/// Relative error of the image's mean: (mean of test − mean of reference) / mean of reference, per channel and over
/// all channels. 0 where both means are 0.
///
/// # Errors
/// As [`compare`].
pub fn bias(test: &FloatImage, reference: &FloatImage) -> Result<([f64; 3], f64), ImageError> {
    check_pair(test, reference)?;
    let sums = |image: &FloatImage| {
        image.pixels.iter().fold([0.0; 3], |sum: [f64; 3], p| {
            std::array::from_fn(|k| sum[k] + f64::from(p[k]))
        })
    };
    let relative = |t: f64, r: f64| if t == r { 0.0 } else { (t - r) / r };
    let (t, r) = (sums(test), sums(reference));
    let per_channel = std::array::from_fn(|k| relative(t[k], r[k]));
    Ok((per_channel, relative(t.iter().sum(), r.iter().sum())))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flat(value: [f32; 3], count: usize) -> FloatImage {
        FloatImage {
            width: count,
            height: 1,
            pixels: vec![value; count],
        }
    }

    /// f32 inputs such as 1.1 are off by up to 6e-8 of their value; their differences by ten times that.
    fn assert_near(found: f64, expected: f64) {
        assert!(
            (found - expected).abs() <= 2e-6 * expected.abs().max(1e-3),
            "{found}, not {expected}"
        );
    }

    /// Truth: by hand. Everything 10 % too bright: relMSE = 0.01 · L² / (1.01 · L²), whatever the brightness L.
    #[test]
    fn an_image_ten_percent_too_bright_has_analytic_errors_at_every_brightness() {
        for brightness in [1e-15_f32, 1.0, 1e15] {
            let reference = flat([brightness; 3], 10);
            let test = flat([1.1 * brightness; 3], 10);
            assert_near(relmse(&test, &reference).unwrap(), 0.01 / 1.01);
            assert_near(rmse(&test, &reference).unwrap() / f64::from(brightness), 0.1);
            assert_near(psnr(&test, &reference).unwrap(), 20.0);
            let (channels, all) = bias(&test, &reference).unwrap();
            assert_near(all, 0.1);
            channels.iter().for_each(|b| assert_near(*b, 0.1));
        }
    }

    /// Truth: by hand. One channel off by 3: mean squared difference 3, reference grey 2, ε = 0.01 · 2².
    #[test]
    fn errors_are_averaged_over_channels_before_they_are_divided() {
        let (test, reference) = (flat([4.0, 2.0, 3.0], 4), flat([1.0, 2.0, 3.0], 4));
        assert_near(relmse(&test, &reference).unwrap(), 3.0 / (4.0 + 0.04));
        assert_near(rmse(&test, &reference).unwrap(), 3.0_f64.sqrt());
        let (channels, all) = bias(&test, &reference).unwrap();
        assert_eq!((channels, all), ([3.0, 0.0, 0.0], 0.5));
    }

    /// Truth: of 2000 pixels the two worst are left out, so two fireflies do not show and a third does.
    #[test]
    fn the_worst_pixel_in_a_thousand_is_left_out_of_relmse_only() {
        let reference = flat([1.0; 3], 2000);
        let mut test = reference.clone();
        test.pixels[7] = [1e6; 3];
        test.pixels[1999] = [1e6; 3];
        assert_eq!(relmse(&test, &reference).unwrap(), 0.0);
        assert!(rmse(&test, &reference).unwrap() > 1e4);
        test.pixels[100] = [2.0; 3];
        assert_near(relmse(&test, &reference).unwrap(), 1.0 / 1.01 / 1998.0);
    }

    #[test]
    fn the_percentile_is_the_nearest_rank() {
        let mut values: Vec<f64> = (1..=200).rev().map(f64::from).collect();
        assert_eq!(percentile(&mut values, 0.99), 198.0);
        assert_eq!(percentile(&mut values, 0.0), 1.0);
        assert_eq!(percentile(&mut values, 1.0), 200.0);
    }

    #[test]
    fn equal_images_have_no_error_even_black_ones() {
        for image in [flat([0.0; 3], 3), flat([0.3, 2.0, 1e9], 3)] {
            let c = compare(&image, &image).unwrap();
            assert_eq!(
                (c.rmse, c.relmse, c.bias, c.relative_error_p99, c.flip),
                (0.0, 0.0, 0.0, 0.0, 0.0)
            );
            assert_eq!(c.psnr_db, f64::INFINITY);
        }
    }

    #[test]
    fn what_cannot_be_compared_is_refused_with_a_reason() {
        let one = flat([1.0; 3], 2);
        let message = |a: &FloatImage, b: &FloatImage| compare(a, b).unwrap_err().to_string();
        assert!(message(&one, &flat([1.0; 3], 3)).contains("2 × 1 pixels, but the reference has 3 × 1"));
        assert!(message(&flat([f32::NAN, 1.0, 1.0], 2), &one).contains("test image: 2 values are NaN"));
        assert!(message(&one, &flat([f32::INFINITY; 3], 2)).contains("reference image: 6 values"));
        assert!(message(&flat([1.0; 3], 0), &flat([1.0; 3], 0)).contains("0 × 1"));
    }
}
