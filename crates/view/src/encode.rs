//! Pictures to bytes.

use crate::tone::Tone;
use image::ExtendedColorType;
use image::codecs::jpeg::JpegEncoder;
use relight_play::scene::image::preview::display_encoded;
use relight_play::scene::image::{FloatImage, Image8, ImageError, Layers, encode_png};

/// Quality of pictures that are replaced at once: artefacts are below what one sees of a moving picture.
const QUALITY: u8 = 85;

/// An encoded picture.
pub struct Encoded {
    /// Its media type.
    pub format: &'static str,
    /// The file.
    pub bytes: Vec<u8>,
}

/// How values become what a screen shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// Stops: 2^exposure times the radiance.
    pub exposure: f32,
    /// What of it a screen shows.
    pub tone: Tone,
}

/// A picture for a screen.
pub struct Shown {
    /// Its pixels.
    pub picture: Image8,
    /// Values at the ends of the scale of false colours, where it has one.
    pub scale: Option<[f32; 2]>,
}

/// A layer of a frame as it is shown: radiance tone-mapped (by default as `relight play --png` writes it), reflectance as it is,
/// normals as colours, distances from near (white) to far, counts in false colours; `difference`: radiance that may be below
/// zero, around a middle grey. `None`: there is no such layer.
pub fn shown(layers: &Layers, name: &str, difference: bool, look: Look) -> Option<Shown> {
    let gain = look.exposure.exp2();
    let mut scale = None;
    let picture = match name {
        "albedo" => display_encoded(&layers.rgb(name)?),
        "normal" => display_encoded(&mapped(layers.rgb(name)?, |p| p.map(|v| 0.5 * v + 0.5))),
        "depth" => display_encoded(&depths(layers)?),
        "cut_size" | "nodes" => {
            let values = scalars(layers, name)?;
            let most = most_but_few(&values).max(1.0);
            scale = Some([0.0, most]);
            let mut image = FloatImage::black(layers.width, layers.height);
            for (pixel, value) in image.pixels.iter_mut().zip(&values) {
                *pixel = false_colour(value / most);
            }
            display_encoded(&image)
        }
        _ if difference => display_encoded(&mapped(layers.rgb(name)?, |p| {
            p.map(|v| 0.2 + 0.2 * (v * gain).clamp(-1e15, 1e15) / (0.2 + (v * gain).abs().min(1e15)))
        })),
        _ => display_encoded(&mapped(layers.rgb(name)?, |p| {
            look.tone.mapped(p.map(|v| v * gain))
        })),
    };
    Some(Shown { picture, scale })
}

fn mapped(mut image: FloatImage, map: impl Fn([f32; 3]) -> [f32; 3]) -> FloatImage {
    for pixel in &mut image.pixels {
        *pixel = map(*pixel);
    }
    image
}

/// Dark blue for 0 over green to light yellow for 1, rising in lightness, so that it reads in grey, too; linear Rec. 709.
pub fn false_colour(share: f32) -> [f32; 3] {
    /// sRGB at even steps.
    const STEPS: [[f32; 3]; 6] = [
        [0.05, 0.03, 0.20],
        [0.20, 0.16, 0.50],
        [0.13, 0.40, 0.56],
        [0.14, 0.62, 0.50],
        [0.55, 0.80, 0.30],
        [0.99, 0.91, 0.35],
    ];
    let at = share.clamp(0.0, 1.0) * (STEPS.len() - 1) as f32;
    let first = (at as usize).min(STEPS.len() - 2);
    let part = at - first as f32;
    [0, 1, 2].map(|i| {
        let v = STEPS[first][i] * (1.0 - part) + STEPS[first + 1][i] * part;
        relight_play::scene::image::preview::linear_from_srgb(v)
    })
}

fn scalars(layers: &Layers, name: &str) -> Option<Vec<f32>> {
    let layer = layers.layer(name)?;
    let pixels = layers.width * layers.height;
    let at = |i: usize| layer.data.get(i * layer.channels).copied();
    Some((0..pixels).map(|i| at(i).unwrap_or(f32::INFINITY)).collect())
}

/// The value that one in two hundred lies above: few don't make all others dark.
fn most_but_few(values: &[f32]) -> f32 {
    let mut sorted: Vec<f32> = values.iter().copied().filter(|v| v.is_finite()).collect();
    sorted.sort_unstable_by(f32::total_cmp);
    let at = sorted.len().saturating_sub(1 + sorted.len() / 200);
    sorted.get(at).copied().unwrap_or(0.0)
}

fn depths(layers: &Layers) -> Option<FloatImage> {
    let depths = scalars(layers, "depth")?;
    let finite = |d: &f32| d.is_finite() && *d > 0.0;
    let all = || depths.iter().copied().filter(finite);
    let (near, far) = (all().fold(f32::MAX, f32::min), all().fold(0.0, f32::max));
    let mut image = FloatImage::black(layers.width, layers.height);
    for (d, pixel) in depths.iter().zip(&mut image.pixels) {
        if finite(d) {
            *pixel = [1.0 - 0.95 * (d - near) / (far - near).max(f32::MIN_POSITIVE); 3];
        }
    }
    Some(image)
}

/// A picture as a file: small where it is replaced at once, else without loss.
///
/// # Errors
/// It has no pixels.
pub fn encoded(picture: &Image8, lossless: bool) -> Result<Encoded, ImageError> {
    if lossless {
        return Ok(Encoded {
            format: "image/png",
            bytes: encode_png("the picture", picture)?,
        });
    }
    let rgb: Vec<u8> = picture.rgba8.iter().flat_map(|p| [p[0], p[1], p[2]]).collect();
    let mut bytes = Vec::new();
    // Sides are bounded by the wish: they fit.
    JpegEncoder::new_with_quality(&mut bytes, QUALITY)
        .encode(
            &rgb,
            picture.width as u32,
            picture.height as u32,
            ExtendedColorType::Rgb8,
        )
        .map_err(|error| ImageError::Invalid {
            file: "the picture".into(),
            detail: error.to_string(),
        })?;
    Ok(Encoded {
        format: "image/jpeg",
        bytes,
    })
}
