//! Environment maps from Radiance `.hdr` and OpenEXR files.
//!
//! Source: the Radiance file format ("RADIANCE Reference Manual", picture files): shared-exponent pixels, run
//! lengths; EXPOSURE and COLORCORR are divided out, as it asks. The `image` crate decodes the pixels. Not read: XYZE
//! pixels, and other orientations than rows from the top, columns from the left (`-Y … +X …`).

use super::cube::{Faces, cross, unfolded};
use super::error::{ImageError, Limits, read_file};
use super::exr_read::decode_exr_and_cube;
use super::layers::{BEAUTY, FloatImage};
use ::image::ImageDecoder;
use ::image::codecs::hdr::HdrDecoder;
use std::path::Path;

/// Radiance as an environment light wants it.
#[derive(Clone, Debug, PartialEq)]
pub struct EnvironmentMap {
    /// Linear RGB radiance, finite and not negative; equirectangular, row 0 is the zenith.
    pub image: FloatImage,
    /// How many values of the file were NaN (now 0), infinite (now the largest finite value of the map) or negative
    /// (now 0). A sun that overflowed half precision shows here.
    pub repaired: usize,
}

/// Reads an environment map, `.hdr` or `.exr` by its content: equirectangular, or a cube's faces as a cross or, in OpenEXR
/// files that say so (attribute `envmap`), one below the other. Of an OpenEXR file the beauty is taken (plain `R G B`,
/// or what other programs call it), or its only layer.
///
/// # Errors
/// [`ImageError`] of every kind; it names the file.
pub fn read_environment(path: &Path, limits: &Limits) -> Result<EnvironmentMap, ImageError> {
    let file = path.display().to_string();
    decode_environment(&file, &read_file(path, limits)?, limits)
}

/// As [`read_environment`], from memory; `file` says in errors where the bytes came from.
///
/// # Errors
/// As [`read_environment`].
pub fn decode_environment(file: &str, bytes: &[u8], limits: &Limits) -> Result<EnvironmentMap, ImageError> {
    decode_equirectangular(file, bytes, limits).map(repaired)
}

/// The image of [`decode_environment`], with what is negative, infinite or NaN in it.
///
/// # Errors
/// As [`read_environment`].
pub(crate) fn decode_equirectangular(
    file: &str,
    bytes: &[u8],
    limits: &Limits,
) -> Result<FloatImage, ImageError> {
    let mut is_cube = false;
    let image = if bytes.starts_with(&[0x76, 0x2f, 0x31, 0x01]) {
        let layers;
        (layers, is_cube) = decode_exr_and_cube(file, bytes, limits)?;
        let name = match layers.layers.as_slice() {
            [only] => only.name.as_str(),
            _ => layers.find(BEAUTY).map_or(BEAUTY, |layer| &layer.name),
        };
        layers.rgb(name).ok_or_else(|| {
            let detail = format!(
                "an environment map needs channels R, G, B; found the layers {}",
                layers.names()
            );
            ImageError::invalid(file, detail)
        })?
    } else {
        decode_hdr(file, bytes, limits)?
    };
    let faces = match is_cube {
        true => Some(Faces::Column),
        false => cross(file, &image)?,
    };
    match faces {
        Some(faces) => unfolded(file, &image, faces, limits),
        None => Ok(image),
    }
}

/// Reads a Radiance `.hdr` file.
///
/// # Errors
/// [`ImageError`] of every kind; it names the file.
pub fn read_hdr(path: &Path, limits: &Limits) -> Result<FloatImage, ImageError> {
    decode_hdr(&path.display().to_string(), &read_file(path, limits)?, limits)
}

/// As [`read_hdr`], from memory; `file` says in errors where the bytes came from.
///
/// # Errors
/// As [`read_hdr`].
pub fn decode_hdr(file: &str, bytes: &[u8], limits: &Limits) -> Result<FloatImage, ImageError> {
    // Last net: no known input gets here, but decoders hold asserts.
    std::panic::catch_unwind(|| decode(file, bytes, limits)).unwrap_or_else(|_| {
        Err(ImageError::invalid(
            file,
            "the Radiance decoder failed on it: the file is damaged; write it again",
        ))
    })
}

fn decode(file: &str, bytes: &[u8], limits: &Limits) -> Result<FloatImage, ImageError> {
    let first_line = bytes.iter().take(128).position(|&b| b == b'\n').unwrap_or(0);
    if !bytes.starts_with(b"#?") || first_line == 0 {
        return Err(ImageError::invalid(
            file,
            "neither a Radiance (.hdr) nor an OpenEXR file; convert it to one",
        ));
    }
    // Programs write their own name behind `#?`; the decoder insists on one.
    let renamed = std::io::Read::chain(&b"#?RADIANCE"[..], &bytes[first_line..]);
    let error = |e| ImageError::invalid(file, format!("no whole Radiance file: {e}; write it again"));
    let decoder = HdrDecoder::new(renamed).map_err(error)?;
    let meta = decoder.metadata();
    // A pixel is decoded to three floats; a row of bytes beside it is small.
    limits.check(file, meta.width.into(), meta.height.into(), 12)?;
    // A row begins with a pixel or a mark of four bytes, however well the rest of it is packed.
    if meta.width == 0 || meta.height == 0 || meta.height as usize > bytes.len() / 4 {
        let detail = format!(
            "{} × {} pixels cannot be in {} bytes: the file is damaged",
            meta.width,
            meta.height,
            bytes.len()
        );
        return Err(ImageError::invalid(file, detail));
    }
    let mut image = FloatImage::black(meta.width as usize, meta.height as usize);
    decoder
        .read_image(bytemuck::cast_slice_mut(&mut image.pixels))
        .map_err(error)?;
    let exposure = meta.exposure.unwrap_or(1.0);
    let correction = meta.color_correction.unwrap_or((1.0, 1.0, 1.0));
    let divisor = [
        exposure * correction.0,
        exposure * correction.1,
        exposure * correction.2,
    ];
    if divisor.iter().any(|d| !d.is_normal() || *d < 0.0) {
        let detail = format!("EXPOSURE and COLORCORR multiply to {divisor:?}; they have to be positive");
        return Err(ImageError::invalid(file, detail));
    }
    if divisor != [1.0; 3] {
        for pixel in &mut image.pixels {
            *pixel = std::array::from_fn(|k| pixel[k] / divisor[k]);
        }
    }
    Ok(image)
}

fn repaired(mut image: FloatImage) -> EnvironmentMap {
    let values = image.pixels.as_flattened_mut();
    let largest = values
        .iter()
        .copied()
        .filter(|v| v.is_finite())
        .fold(0.0, f32::max);
    let mut repaired = 0;
    for v in values {
        // NaN fails every comparison, so it goes with the negative ones; minus zero may stay.
        let good = if v.is_infinite() && *v > 0.0 {
            largest
        } else if *v >= 0.0 {
            continue;
        } else {
            0.0
        };
        *v = good;
        repaired += 1;
    }
    EnvironmentMap { image, repaired }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::{ExrHeader, Layers, encode_exr};

    /// Two rows of nine pixels; the first row in the newer run lengths, the second plain.
    fn small_hdr(header: &str) -> Vec<u8> {
        let mut bytes = format!("#?RGBE\n{header}FORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 9\n").into_bytes();
        bytes.extend_from_slice(&[2, 2, 0, 9]);
        for value in [128, 64, 0, 129] {
            bytes.extend_from_slice(&[128 + 9, value]);
        }
        for _ in 0..9 {
            bytes.extend_from_slice(&[255, 0, 128, 136]);
        }
        bytes
    }

    /// Truth: a shared-exponent pixel is mantissa · 2^(exponent − 136) (Ward, Graphics Gems II).
    #[test]
    fn shared_exponents_become_the_radiance_they_stand_for() {
        let image = decode_hdr("t", &small_hdr(""), &Limits::default()).unwrap();
        assert_eq!((image.width, image.height), (9, 2));
        assert_eq!(image.pixels[..9], [[1.0, 0.5, 0.0]; 9]);
        assert_eq!(image.pixels[9..], [[255.0, 0.0, 128.0]; 9]);
    }

    /// Truth: the Radiance manual: the product of all EXPOSURE lines has been multiplied into the pixels.
    #[test]
    fn exposure_lines_are_divided_out() {
        let bytes = small_hdr("EXPOSURE=2\nEXPOSURE=4\nCOLORCORR=1 0.5 1\n");
        let image = decode_hdr("t", &bytes, &Limits::default()).unwrap();
        assert_eq!(image.pixels[0], [0.125, 0.125, 0.0]);
        let message = decode_hdr("t", &small_hdr("EXPOSURE=0\n"), &Limits::default())
            .unwrap_err()
            .to_string();
        assert!(message.contains("EXPOSURE"), "{message}");
    }

    #[test]
    fn what_is_no_map_or_too_large_is_refused() {
        let limits = Limits::default();
        let message = decode_environment("sky.hdr", b"\x89PNG...", &limits)
            .unwrap_err()
            .to_string();
        assert!(message.contains("sky.hdr: neither"), "{message}");
        let huge = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 60000 +X 60000\n";
        assert!(matches!(
            decode_hdr("t", huge, &limits),
            Err(ImageError::LimitExceeded { .. })
        ));
        let tall = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 60000 +X 600\n";
        assert!(matches!(
            decode_hdr("t", tall, &limits),
            Err(ImageError::Invalid { .. })
        ));
        let bytes = small_hdr("");
        for length in 0..bytes.len() {
            assert!(decode_hdr("t", &bytes[..length], &limits).is_err());
        }
    }

    #[test]
    fn an_openexr_map_is_read_and_its_impossible_values_are_repaired_and_counted() {
        let mut layers = Layers::new(2, 1);
        layers.push_rgb(BEAUTY, &[[1.0, 2.0, -3.0], [4.0, 0.0, 5.0]]);
        layers.push_scalar("depth", &[1.0, 2.0]);
        let (bytes, _) = encode_exr("t", &layers, &ExrHeader::new(), false).unwrap();
        let map = decode_environment("t", &bytes, &Limits::default()).unwrap();
        assert_eq!(map.image.pixels, [[1.0, 2.0, 0.0], [4.0, 0.0, 5.0]]);
        assert_eq!(map.repaired, 1);

        let bad = FloatImage {
            width: 1,
            height: 1,
            pixels: vec![[f32::NAN, f32::INFINITY, 7.0]],
        };
        let map = repaired(bad);
        assert_eq!((map.image.pixels[0], map.repaired), ([0.0, 7.0, 7.0], 2));
    }
}
