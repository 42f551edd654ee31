//! Images of 8 bits: PNG, JPEG and WebP textures in, PNG previews out. The `image` crate codes and decodes.

use super::atomic::write_atomically;
use super::error::{ImageError, Limits};
use ::image::{ExtendedColorType, ImageDecoder, ImageEncoder, ImageFormat};
use std::io::Cursor;
use std::path::Path;

/// An image of 8 bits a channel, encoded as its file has it (colours are sRGB, data such as normals linear).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image8 {
    /// Columns.
    pub width: usize,
    /// Rows; row 0 is the top.
    pub height: usize,
    /// `width · height` pixels, row after row: red, green, blue, alpha (not premultiplied; 255 where there is none).
    pub rgba8: Vec<[u8; 4]>,
}

/// Decodes a PNG, JPEG or WebP file (of a moving one the first picture), told by its first bytes. Grey becomes RGB, 16 bits become 8, palettes their colours.
/// `name` says in errors which image it is.
///
/// # Errors
/// [`ImageError::Unsupported`] for other formats, [`ImageError::LimitExceeded`], [`ImageError::Invalid`].
pub fn decode_ldr(name: &str, bytes: &[u8], limits: &Limits) -> Result<Image8, ImageError> {
    // Last net: damaged frames of moving WebP images get here, no known PNG or JPEG.
    std::panic::catch_unwind(|| decode(name, bytes, limits)).unwrap_or_else(|_| {
        Err(ImageError::invalid(
            name,
            "the image decoder failed on it: the image is damaged; write it again",
        ))
    })
}

fn decode(name: &str, bytes: &[u8], limits: &Limits) -> Result<Image8, ImageError> {
    let format = match ::image::guess_format(bytes) {
        Ok(format @ (ImageFormat::Png | ImageFormat::Jpeg | ImageFormat::WebP)) => format,
        _ => {
            return Err(ImageError::unsupported(
                name,
                "neither PNG, JPEG nor WebP; convert the image to one of them",
            ));
        }
    };
    let error = |e| ImageError::invalid(name, format!("no whole {format:?} image: {e}; write it again"));
    let mut reader = ::image::ImageReader::with_format(Cursor::new(bytes), format);
    let mut decoder_limits = ::image::Limits::default();
    decoder_limits.max_alloc = Some(limits.max_bytes);
    reader.limits(decoder_limits);
    let decoder = reader.into_decoder().map_err(error)?;
    let (width, height) = decoder.dimensions();
    // Decoded as the file has it, then as four bytes.
    let bytes_per_pixel = 4 + u64::from(decoder.color_type().bytes_per_pixel());
    limits.check(name, width.into(), height.into(), bytes_per_pixel)?;
    let rgba = ::image::DynamicImage::from_decoder(decoder)
        .map_err(error)?
        .into_rgba8();
    Ok(Image8 {
        width: width as usize,
        height: height as usize,
        rgba8: rgba.as_raw().as_chunks::<4>().0.to_vec(),
    })
}

/// The bytes of a PNG file: RGB if every pixel is opaque, else RGBA. `file` names it in errors.
///
/// # Errors
/// [`ImageError::Invalid`] if the pixels do not fill the size, or the size is 0 or above 2³¹.
pub fn encode_png(file: &str, image: &Image8) -> Result<Vec<u8>, ImageError> {
    let Image8 { width, height, rgba8 } = image;
    let invalid =
        |why: String| ImageError::invalid(file, format!("cannot write {width} × {height} pixels: {why}"));
    if width.checked_mul(*height) != Some(rgba8.len()) || rgba8.is_empty() {
        return Err(invalid(format!("there are {}", rgba8.len())));
    }
    let size = |n: &usize| u32::try_from(*n).map_err(|_| invalid("too many for PNG".into()));
    let (w, h) = (size(width)?, size(height)?);
    let mut bytes = Vec::new();
    let encoder = ::image::codecs::png::PngEncoder::new(&mut bytes);
    let result = if rgba8.iter().all(|p| p[3] == 255) {
        let rgb: Vec<u8> = rgba8.iter().flat_map(|p| [p[0], p[1], p[2]]).collect();
        encoder.write_image(&rgb, w, h, ExtendedColorType::Rgb8)
    } else {
        encoder.write_image(rgba8.as_flattened(), w, h, ExtendedColorType::Rgba8)
    };
    result.map_err(|e| invalid(e.to_string()))?;
    Ok(bytes)
}

/// Writes a PNG file, atomically ([`write_atomically`]).
///
/// # Errors
/// As [`encode_png`], and [`ImageError::Io`].
pub fn write_png(path: &Path, image: &Image8) -> Result<(), ImageError> {
    write_atomically(path, &encode_png(&path.display().to_string(), image)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(alpha: u8) -> Image8 {
        let rgba8 = (0..35_u8).map(|i| [i, 255 - i, 7 * i, alpha]).collect();
        Image8 {
            width: 7,
            height: 5,
            rgba8,
        }
    }

    /// Truth: PNG is lossless.
    #[test]
    fn png_comes_back_bit_by_bit_with_and_without_alpha() {
        for alpha in [255, 77] {
            let bytes = encode_png("t", &image(alpha)).unwrap();
            assert_eq!(decode_ldr("t", &bytes, &Limits::default()).unwrap(), image(alpha));
        }
    }

    /// Truth: a flat grey block is what JPEG keeps exactly, up to rounding by one.
    #[test]
    fn jpeg_keeps_a_flat_grey() {
        let mut bytes = Vec::new();
        ::image::codecs::jpeg::JpegEncoder::new_with_quality(&mut bytes, 95)
            .write_image(&[100; 16 * 16], 16, 16, ExtendedColorType::L8)
            .unwrap();
        let image = decode_ldr("t", &bytes, &Limits::default()).unwrap();
        assert_eq!((image.width, image.height), (16, 16));
        for p in image.rgba8 {
            assert!(
                p[..3].iter().all(|v| v.abs_diff(100) <= 1) && p[3] == 255,
                "{p:?}"
            );
        }
    }

    /// Truth: WebP's lossless coding, written by `image`'s encoder, and the size that its header claims.
    #[test]
    fn webp_comes_back_bit_by_bit_within_the_limits() {
        for alpha in [255, 77] {
            let image = image(alpha);
            let mut bytes = Vec::new();
            ::image::codecs::webp::WebPEncoder::new_lossless(&mut bytes)
                .write_image(image.rgba8.as_flattened(), 7, 5, ExtendedColorType::Rgba8)
                .unwrap();
            assert_eq!(decode_ldr("t", &bytes, &Limits::default()).unwrap(), image);
            let small = Limits {
                max_pixels: 34,
                ..Limits::default()
            };
            assert!(matches!(
                decode_ldr("t", &bytes, &small),
                Err(ImageError::LimitExceeded { .. })
            ));
            // The decoder forgives a missing end, as browsers do; it never makes another image of it.
            for end in 0..bytes.len() {
                let cut = decode_ldr("t", &bytes[..end], &Limits::default());
                assert!(cut.is_err() || (end > 20 && cut.is_ok_and(|cut| cut.rgba8.len() == 35)));
            }
        }
    }

    /// Moving images whose frame is smaller than its alpha, or empty, at which the decoder panics (fuzz target `texture`).
    #[test]
    fn webp_at_which_its_decoder_panics_is_an_error() {
        for bytes in [
            &include_bytes!("../../../../fuzz/corpus/texture/webp_alpha_short")[..],
            include_bytes!("../../../../fuzz/corpus/texture/webp_no_width"),
            include_bytes!("../../../../fuzz/corpus/texture/webp_no_chroma"),
        ] {
            let message = decode_ldr("texture 3", bytes, &Limits::default())
                .unwrap_err()
                .to_string();
            let what = "texture 3: the image decoder failed on it: the image is damaged";
            assert!(message.contains(what), "{message}");
        }
    }

    /// Truth: PNG's 16-bit values are the 8-bit ones times 257.
    #[test]
    fn sixteen_bits_become_eight() {
        let samples: Vec<u8> = (0..12_u16).flat_map(|i| (i * 20 * 257).to_ne_bytes()).collect();
        let mut bytes = Vec::new();
        ::image::codecs::png::PngEncoder::new(&mut bytes)
            .write_image(&samples, 4, 1, ExtendedColorType::Rgb16)
            .unwrap();
        let image = decode_ldr("t", &bytes, &Limits::default()).unwrap();
        assert_eq!(image.rgba8[1], [60, 80, 100, 255]);
    }

    #[test]
    fn other_formats_and_images_over_the_limits_are_refused_by_name() {
        let limits = Limits::default();
        let message = decode_ldr("texture 3", b"DDS ....", &limits)
            .unwrap_err()
            .to_string();
        assert!(
            message.contains("texture 3: neither PNG, JPEG nor WebP"),
            "{message}"
        );
        let bytes = encode_png("t", &image(255)).unwrap();
        let small = Limits {
            max_pixels: 34,
            ..limits
        };
        assert!(matches!(
            decode_ldr("t", &bytes, &small),
            Err(ImageError::LimitExceeded { .. })
        ));
        assert!(
            encode_png(
                "t",
                &Image8 {
                    height: 6,
                    ..image(255)
                }
            )
            .is_err()
        );
    }

    /// A header of 60,000 × 60,000 pixels with a right checksum (CRC-32, PNG specification annex D), and no pixels.
    #[test]
    fn a_small_file_that_claims_a_huge_image_is_refused_by_its_header() {
        let mut bytes = encode_png("t", &image(255)).unwrap();
        // Behind the signature (8), the chunk's length (4) and its name (4): width and height.
        bytes[16..20].copy_from_slice(&60_000_u32.to_be_bytes());
        bytes[20..24].copy_from_slice(&60_000_u32.to_be_bytes());
        let mut crc = u32::MAX;
        for byte in &bytes[12..29] {
            crc ^= u32::from(*byte);
            for _ in 0..8 {
                crc = if crc & 1 == 1 {
                    (crc >> 1) ^ 0xedb8_8320
                } else {
                    crc >> 1
                };
            }
        }
        bytes[29..33].copy_from_slice(&(!crc).to_be_bytes());
        let error = decode_ldr("t", &bytes, &Limits::default()).unwrap_err();
        assert!(
            matches!(
                error,
                ImageError::LimitExceeded {
                    found: 3_600_000_000,
                    ..
                }
            ),
            "{error}"
        );
    }
}
