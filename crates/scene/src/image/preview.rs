//! What a float image looks like on a screen: exposure, tone mapping, transfer function, contact sheets.
//!
//! Sources: the Khronos PBR Neutral tone mapper as its specification defines it (below 0.8 − 0.04 colours pass but
//! for the subtraction of Fresnel's 4 %; above, the peak is compressed hyperbolically and colours fade to white);
//! IEC 61966-2-1 for the sRGB transfer function.

use super::error::ImageError;
use super::layers::FloatImage;
use super::ldr::Image8;
use crate::environment::luminance;

/// Reflectance of a dielectric at normal incidence, which the tone mapper takes off dark and light colours alike.
const FRESNEL: f32 = 0.04;
/// Above this peak, after [`FRESNEL`] is off, colours are compressed.
const START_COMPRESSION: f32 = 0.8 - FRESNEL;
/// How fast compressed colours fade to white.
const DESATURATION: f32 = 0.15;

/// Khronos PBR Neutral: linear Rec. 709 of any brightness to linear Rec. 709 in [0, 1]. Negative values count as 0,
/// NaN becomes 0, infinity white.
pub fn pbr_neutral(color: [f32; 3]) -> [f32; 3] {
    // Far above what a screen tells from white; keeps infinity out of the arithmetic.
    let color = color.map(|v| if v > 0.0 { v.min(1e30) } else { 0.0 });
    let least = color.into_iter().fold(f32::MAX, f32::min);
    // Meets the constant offset at 2 · FRESNEL with equal slope.
    let offset = if least < 2.0 * FRESNEL {
        least - least * least / (4.0 * FRESNEL)
    } else {
        FRESNEL
    };
    let color = color.map(|v| v - offset);
    let peak = color.into_iter().fold(0.0, f32::max);
    if peak < START_COMPRESSION {
        return color;
    }
    let room = 1.0 - START_COMPRESSION;
    let new_peak = 1.0 - room * room / (peak + room - START_COMPRESSION);
    let fade = 1.0 - 1.0 / (DESATURATION * (peak - new_peak) + 1.0);
    color.map(|v| {
        let compressed = v * (new_peak / peak);
        compressed + fade * (new_peak - compressed)
    })
}

/// The sRGB code value in [0, 1] of a linear value; clamps to [0, 1] (IEC 61966-2-1).
pub fn srgb_from_linear(v: f32) -> f32 {
    let v = v.clamp(0.0, 1.0);
    if v <= 0.0031308 {
        12.92 * v
    } else {
        1.055 * v.powf(1.0 / 2.4) - 0.055
    }
}

/// The linear value of an sRGB code value in [0, 1] (IEC 61966-2-1).
pub fn linear_from_srgb(v: f32) -> f32 {
    if v <= 0.04045 {
        v / 12.92
    } else {
        ((v + 0.055) / 1.055).powf(2.4)
    }
}

/// A preview: 2^`exposure_ev` times the image, [`pbr_neutral`], sRGB.
pub fn tone_mapped(image: &FloatImage, exposure_ev: f32) -> Image8 {
    let gain = exposure_ev.exp2();
    encoded(image, |p| pbr_neutral(p.map(|v| v * gain)))
}

/// Luminance that the middle of an image is shown with: the grey of a photographer's card.
const MIDDLE_GREY: f64 = 0.18;
/// Share of the image's mean below which light counts as that much: darkness tells little of how bright an image is.
const DARK: f64 = 1e-3;

/// The `exposure_ev` of [`tone_mapped`] with which an image's middle is a middle grey; `None` for an image without light. The
/// middle is the geometric mean of what shines at all, so that a few lamps or a window don't decide.
///
/// Source: Reinhard, Stark, Shirley and Ferwerda 2002, *Photographic Tone Reproduction for Digital Images*, equations 1 and 2.
pub fn auto_exposure(image: &FloatImage) -> Option<f32> {
    let luminances = (image.pixels.iter())
        .map(|&p| f64::from(luminance(p.into())))
        .filter(|&l| l > 0.0 && l.is_finite());
    let (sum, count) = luminances
        .clone()
        .fold((0.0, 0.0), |(sum, count), l| (sum + l, count + 1.0));
    let mean = sum / count;
    let logs: f64 = luminances.map(|l| l.max(DARK * mean).ln()).sum();
    (count > 0.0).then(|| (MIDDLE_GREY / (logs / count).exp()).log2() as f32)
}

/// The image as it is, clamped to [0, 1] and sRGB encoded: for error maps and other pictures made for screens.
pub fn display_encoded(image: &FloatImage) -> Image8 {
    encoded(image, |p| p)
}

fn encoded(image: &FloatImage, map: impl Fn([f32; 3]) -> [f32; 3]) -> Image8 {
    let rgba8 = image
        .pixels
        .iter()
        .map(|&p| {
            // `as` rounds towards zero and takes NaN to 0.
            let [r, g, b] = map(p).map(|v| (srgb_from_linear(v) * 255.0 + 0.5) as u8);
            [r, g, b, 255]
        })
        .collect();
    Image8 {
        width: image.width,
        height: image.height,
        rgba8,
    }
}

/// Images of one size side by side, `columns` in a row, filled row by row; black where none is left.
///
/// # Errors
/// [`ImageError::Invalid`] if there is no image or column, or the sizes differ.
pub fn contact_sheet(images: &[FloatImage], columns: usize) -> Result<FloatImage, ImageError> {
    let fail = |detail: String| Err(ImageError::invalid("contact sheet", detail));
    let Some(first) = images.first() else {
        return fail("there is no image".into());
    };
    if columns == 0 {
        return fail("it needs at least one column".into());
    }
    let (w, h) = (first.width, first.height);
    if let Some(i) = images
        .iter()
        .position(|i| (i.width, i.height, i.pixels.len()) != (w, h, w * h))
    {
        return fail(format!(
            "image {i} has {} × {} pixels, not {w} × {h}",
            images[i].width, images[i].height
        ));
    }
    let columns = columns.min(images.len());
    let mut sheet = FloatImage::black(w * columns, h * images.len().div_ceil(columns));
    for (i, image) in images.iter().enumerate() {
        let (left, top) = (i % columns * w, i / columns * h);
        for (y, row) in image.pixels.chunks_exact(w.max(1)).enumerate() {
            let at = (top + y) * sheet.width + left;
            sheet.pixels[at..at + w].copy_from_slice(row);
        }
    }
    Ok(sheet)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Truth: by hand. Of two halves of 0.02 and 0.08 the geometric mean is 0.04.
    #[test]
    fn an_exposure_makes_the_middle_of_an_image_grey_whatever_its_unit_and_lamps() {
        let image = |pixels: Vec<f32>| FloatImage {
            width: pixels.len(),
            height: 1,
            pixels: pixels.into_iter().map(|v| [v; 3]).collect(),
        };
        let halves: Vec<f32> = (0..100).map(|i| if i % 2 == 0 { 0.02 } else { 0.08 }).collect();
        let expected = (0.18f32 / 0.04).log2();
        let found = |pixels: &[f32]| auto_exposure(&image(pixels.to_vec())).unwrap();
        assert!((found(&halves) - expected).abs() < 1e-4);
        for unit in [1e-20, 1e-3, 1e20] {
            let scaled: Vec<f32> = halves.iter().map(|v| v * unit).collect();
            assert!((found(&scaled) + unit.log2() - expected).abs() < 1e-3, "{unit}");
        }
        // A lamp of one pixel, a thousand times as bright: a hundredth of ten stops. A black background: nothing.
        let with_lamp = [halves.as_slice(), &[40.0], &[0.0; 50]].concat();
        assert!((found(&with_lamp) - expected).abs() < 0.1);
        assert_eq!(auto_exposure(&image(vec![0.0, f32::NAN])), None);
    }

    /// Truth: the specification's arithmetic by hand. 0.5 grey: 0.5 − 0.04. 1.04 grey: peak 1, new peak
    /// 1 − 0.24²/(1 + 0.24 − 0.76) = 0.88. 0.04 grey: 0.04 − (0.04 − 6.25 · 0.04²) = 0.01.
    #[test]
    fn tone_mapping_keeps_middle_greys_and_compresses_highlights() {
        for (input, expected) in [(0.5, 0.46), (1.04, 0.88), (0.04, 0.01), (0.0, 0.0), (-3.0, 0.0)] {
            for v in pbr_neutral([input; 3]) {
                assert!((v - expected).abs() < 1e-6, "{input}: {v}");
            }
        }
        // Pure red of 2: no offset; new peak 1 − 0.0576/1.48; g = 1 − 1/(0.15 · (2 − peak) + 1).
        let peak = 1.0 - 0.0576 / 1.48;
        let green = peak * (1.0 - 1.0 / (0.15 * (2.0 - peak) + 1.0));
        let mapped = pbr_neutral([2.0, 0.0, 0.0]);
        assert!(
            (mapped[0] - peak).abs() < 1e-6 && (mapped[1] - green).abs() < 1e-6,
            "{mapped:?}"
        );
    }

    #[test]
    fn no_light_however_bright_leaves_the_screen_and_brighter_is_never_darker() {
        let mut last = 0.0;
        for ev in -40..=127 {
            let v = pbr_neutral([(ev as f32).exp2(); 3])[0];
            assert!((last..=1.0).contains(&v), "2^{ev}: {v}");
            last = v;
        }
        assert_eq!(pbr_neutral([f32::INFINITY; 3]), [1.0; 3]);
        assert_eq!(pbr_neutral([f32::NAN; 3]), [0.0; 3]);
    }

    /// Truth: IEC 61966-2-1: code value 188 is the first at or above half of white, 118 is 18 % grey's neighbour.
    #[test]
    fn srgb_codes_are_those_of_the_standard_and_invert() {
        assert_eq!((srgb_from_linear(0.5) * 255.0).round(), 188.0);
        assert_eq!((srgb_from_linear(0.18) * 255.0).round(), 118.0);
        for code in 0..=255 {
            let v = code as f32 / 255.0;
            // Two powf of relative error 1e-7 each.
            assert!((srgb_from_linear(linear_from_srgb(v)) - v).abs() < 1e-6);
        }
    }

    #[test]
    fn one_stop_more_exposure_is_twice_the_light() {
        let image = FloatImage {
            width: 2,
            height: 1,
            pixels: vec![[0.1, 0.2, 0.3], [3.0, 0.0, 0.01]],
        };
        let twice = FloatImage {
            pixels: image.pixels.iter().map(|p| p.map(|v| 2.0 * v)).collect(),
            ..image.clone()
        };
        assert_eq!(tone_mapped(&image, 1.0), tone_mapped(&twice, 0.0));
    }

    #[test]
    fn a_contact_sheet_shows_every_image_in_its_place() {
        let flat = |v: f32| FloatImage {
            width: 2,
            height: 3,
            pixels: vec![[v; 3]; 6],
        };
        let sheet = contact_sheet(&[flat(1.0), flat(2.0), flat(3.0)], 2).unwrap();
        assert_eq!((sheet.width, sheet.height), (4, 6));
        let at = |x: usize, y: usize| sheet.pixels[y * 4 + x][0];
        assert_eq!(
            [
                at(0, 0),
                at(1, 2),
                at(2, 0),
                at(3, 2),
                at(0, 3),
                at(1, 5),
                at(2, 3),
                at(3, 5)
            ],
            [1.0, 1.0, 2.0, 2.0, 3.0, 3.0, 0.0, 0.0]
        );
        assert!(contact_sheet(&[], 2).is_err());
        assert!(contact_sheet(&[flat(1.0)], 0).is_err());
        let message = contact_sheet(&[flat(1.0), FloatImage::black(1, 1)], 2)
            .unwrap_err()
            .to_string();
        assert!(message.contains("image 1 has 1 × 1"), "{message}");
    }
}
