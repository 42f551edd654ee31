//! False-colour error maps.
//!
//! The colours are a fit of our own, of degree 6, to matplotlib's viridis (CC0; Smith and van der Walt 2015), whose
//! lightness rises evenly: more error is always lighter, in print and for colour-blind eyes too. The fit is within
//! 0.017 of it in sRGB.

use super::error::ImageError;
use super::layers::FloatImage;
use super::metrics::relative_errors;
use super::preview::linear_from_srgb;

/// Coefficients of t⁰ … t⁶ of the sRGB code values, least squares over viridis's 256 colours.
const VIRIDIS: [[f32; 7]; 3] = [
    [0.2745, 0.1077, -0.3272, -4.5999, 6.2037, 4.7518, -5.4321],
    [0.0058, 1.3965, 0.2148, -5.7582, 14.154, -13.7494, 4.6416],
    [0.3327, 1.3868, 0.0920, -19.2918, 56.6563, -65.321, 26.2721],
];
/// Decades of relative error that [`error_map`] spreads over its colours, up to 1: 0.1 % to 100 %.
const DECADES: f64 = 3.0;

/// Colour of `t` in [0, 1] (clamped; NaN counts as 1), linear Rec. 709: dark violet, blue, green, yellow.
pub fn heat(t: f32) -> [f32; 3] {
    let t = if t.is_nan() { 1.0 } else { t.clamp(0.0, 1.0) };
    VIRIDIS.map(|c| linear_from_srgb(c.iter().rev().fold(0.0, |sum, a| sum * t + a).clamp(0.0, 1.0)))
}

/// Where and how much `test` differs from `reference`: each pixel's relative error ([`relative_errors`]) through
/// [`heat`], logarithmic from 0.001 or less (dark violet) to 1 or more (yellow). The result is meant for
/// [`super::preview::display_encoded`], without tone mapping.
///
/// # Errors
/// As [`relative_errors`].
pub fn error_map(test: &FloatImage, reference: &FloatImage) -> Result<FloatImage, ImageError> {
    let pixels = relative_errors(test, reference)?
        .into_iter()
        .map(|e| heat((1.0 + e.log10() / DECADES) as f32))
        .collect();
    Ok(FloatImage {
        width: test.width,
        height: test.height,
        pixels,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Truth: CIE 1976 lightness of the linear colour has to rise all the way, as in viridis (15 to 91).
    #[test]
    fn more_error_is_lighter() {
        let lightness = |t: f32| {
            let [r, g, b] = heat(t).map(f64::from);
            116.0 * (0.2126 * r + 0.7152 * g + 0.0722 * b).cbrt() - 16.0
        };
        let mut last = lightness(0.0);
        assert!((last - 15.0).abs() < 2.0, "{last}");
        for i in 1..=200 {
            let l = lightness(i as f32 / 200.0);
            assert!(l > last, "at {i}/200: {l} after {last}");
            last = l;
        }
        assert!((last - 91.0).abs() < 2.0, "{last}");
    }

    /// Truth: over a flat reference of 1 the relative error of a pixel is |difference| / √1.01.
    #[test]
    fn errors_of_equal_size_have_equal_colours_and_none_is_dark() {
        let reference = FloatImage {
            width: 4,
            height: 1,
            pixels: vec![[1.0; 3]; 4],
        };
        let e = 0.1 * 1.01_f32.sqrt();
        let pixels = vec![[1.0; 3], [1.0 + e; 3], [1.0 - e; 3], [900.0; 3]];
        let map = error_map(
            &FloatImage {
                pixels,
                ..reference.clone()
            },
            &reference,
        )
        .unwrap();
        assert_eq!(map.pixels[0], heat(0.0));
        assert_eq!(map.pixels[3], heat(1.0));
        for k in 0..3 {
            // A tenth is two of three decades up; colours change by less than 4 per unit of t.
            assert!((map.pixels[1][k] - heat(2.0 / 3.0)[k]).abs() < 1e-4);
            assert!((map.pixels[2][k] - heat(2.0 / 3.0)[k]).abs() < 1e-4);
        }
    }
}
