//! Pictures to bytes.

use image::ExtendedColorType;
use image::codecs::jpeg::JpegEncoder;
use relight_play::scene::image::preview::{display_encoded, tone_mapped};
use relight_play::scene::image::{FloatImage, ImageError, Layers, encode_png};

/// Quality of pictures that are replaced at once: artefacts are below what one sees of a moving picture.
const QUALITY: u8 = 85;

/// An encoded picture.
pub struct Encoded {
    /// Its media type.
    pub format: &'static str,
    /// The file.
    pub bytes: Vec<u8>,
}

/// A layer of a frame as it is shown: radiance as `relight play --png` writes it, reflectance as it is, normals as colours,
/// distances from near (white) to far. `None`: there is no such layer.
pub fn shown(layers: &Layers, name: &str, exposure: f32) -> Option<relight_play::scene::image::Image8> {
    let picture = match name {
        "albedo" => display_encoded(&layers.rgb(name)?),
        "normal" => {
            let mut image = layers.rgb(name)?;
            for pixel in &mut image.pixels {
                *pixel = pixel.map(|v| 0.5 * v + 0.5);
            }
            display_encoded(&image)
        }
        "depth" => display_encoded(&depths(layers)?),
        _ => tone_mapped(&layers.rgb(name)?, exposure),
    };
    Some(picture)
}

fn depths(layers: &Layers) -> Option<FloatImage> {
    let layer = layers.layer("depth")?;
    let at = |i: usize| {
        layer
            .data
            .get(i * layer.channels)
            .copied()
            .unwrap_or(f32::INFINITY)
    };
    let finite = |d: &f32| d.is_finite() && *d > 0.0;
    let all = || (0..layers.width * layers.height).map(at).filter(finite);
    let (near, far) = (all().fold(f32::MAX, f32::min), all().fold(0.0, f32::max));
    let mut image = FloatImage::black(layers.width, layers.height);
    for (i, pixel) in image.pixels.iter_mut().enumerate() {
        let d = at(i);
        if finite(&d) {
            *pixel = [1.0 - 0.95 * (d - near) / (far - near).max(f32::MIN_POSITIVE); 3];
        }
    }
    Some(image)
}

/// A picture as a file: small where it is replaced at once, else without loss.
///
/// # Errors
/// It has no pixels.
pub fn encoded(picture: &relight_play::scene::image::Image8, lossless: bool) -> Result<Encoded, ImageError> {
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
