//! KHR_texture_basisu: KTX 2.0 textures of ETC1S or UASTC, read by the `ktx2` crate and transcoded by `basisu`. Those of plain texels are
//! read, too ([`super::ktx`]).
//!
//! The level of full size becomes a PNG, so that players need no transcoder. Whether colours are sRGB says the place in
//! the material where the texture is used, as for other images; the file's own word for it is not needed.

use super::guard::guarded;
use super::ktx::{decompressed, texels};
use super::notes::Notes;
use crate::image::{Image8, Limits, encode_png};
use basisu::{DecodeFlags, SourceFormat, TargetFormat, Transcoder};
use ktx2::{Header, LevelIndex, SupercompressionScheme};

/// How a KTX 2.0 file starts.
pub(super) const MAGIC: &[u8] = b"\xabKTX 20\xbb\r\n\x1a\n";

/// Bytes of a block of 4 × 4 texels in UASTC.
const BLOCK_BYTES: u64 = 16;

/// The texture as a PNG. `name` says in errors which it is.
///
/// # Errors
/// What is wrong with the file and what to do, as the rest of a sentence about it.
pub(super) fn png(name: &str, bytes: &[u8], notes: &mut Notes) -> Result<Vec<u8>, String> {
    let read = guarded(|| decode(name, bytes)).map_err(|why| format!("{why}; write the texture again"))?;
    let (image, is_plain) = read;
    notes.count(
        "KTX2 textures that are not Basis Universal's, which glTF has not, read as they are",
        is_plain.into(),
    );
    encode_png(name, &image).map_err(|e| e.to_string())
}

/// The picture, and whether the file has its texels as they are.
fn decode(name: &str, bytes: &[u8]) -> Result<(Image8, bool), String> {
    // Of the container only what says how much there is: the whole reader adds up bytes of the format's description
    // that may overflow, and the transcoder checks all that it reads.
    let (Some(head), Some(level)) = (
        bytes.first_chunk::<{ Header::LENGTH }>(),
        bytes[bytes.len().min(Header::LENGTH)..].first_chunk::<{ LevelIndex::LENGTH }>(),
    ) else {
        return Err("is no whole KTX 2.0 file (it ends in its header)".into());
    };
    let header = Header::from_bytes(head).map_err(|e| format!("is no whole KTX 2.0 file ({e})"))?;
    let level = LevelIndex::from_bytes(level);
    let (width, height) = (header.pixel_width, header.pixel_height);
    if width == 0 || height == 0 || header.pixel_depth > 0 || header.layer_count > 1 || header.face_count != 1
    {
        return Err("is not one two-dimensional picture".into());
    }
    // As much again for the PNG.
    Limits::default()
        .check(name, width.into(), height.into(), 8)
        .map_err(|e| e.to_string())?;
    let scheme = header.supercompression_scheme;
    let place = usize::try_from(level.byte_offset)
        .ok()
        .zip(usize::try_from(level.byte_length).ok());
    let stored = place.and_then(|(start, length)| bytes.get(start..start.checked_add(length)?));
    let stored = stored.ok_or("says that texels lie beyond its end")?;
    if let Some(format) = header.format {
        let image = texels(format, (width, height), scheme, stored)?;
        return Ok((image, true));
    }
    let size = u64::from(width.div_ceil(4)) * u64::from(height.div_ceil(4)) * BLOCK_BYTES;
    let declared = match scheme {
        None => level.byte_length,
        // ETC1S declares nothing.
        Some(SupercompressionScheme::BasisLZ) => size,
        Some(_) => level.uncompressed_byte_length,
    };
    // The transcoder reserves what the file declares.
    if declared != size {
        return Err(format!(
            "declares {declared} bytes for {width} × {height} texels, which have {size}"
        ));
    }
    let unpacked;
    let bytes = if scheme == Some(SupercompressionScheme::Zstandard) {
        let level = decompressed(scheme, stored, size as usize)?;
        let found = level.len();
        if found as u64 != size {
            return Err(format!(
                "holds {found} bytes of {width} × {height} texels, which have {size}"
            ));
        }
        unpacked = unpack(bytes, &level);
        &unpacked
    } else {
        bytes
    };
    let transcoder = Transcoder::new(bytes).map_err(|e| format!("can't be transcoded ({e:?})"))?;
    match transcoder.source_format() {
        SourceFormat::Etc1s | SourceFormat::UastcLdr => {}
        other => {
            return Err(format!(
                "holds {other:?}, where KHR_texture_basisu has ETC1S and UASTC"
            ));
        }
    }
    let transcoded = transcoder
        .transcode(0, TargetFormat::Rgba32, DecodeFlags::NONE)
        .map_err(|e| format!("can't be transcoded ({e:?})"))?;
    let image = Image8 {
        width: width as usize,
        height: height as usize,
        rgba8: transcoded.as_chunks().0.to_vec(),
    };
    Ok((image, false))
}

/// The file with `level` as its only one, not compressed.
fn unpack(bytes: &[u8], level: &[u8]) -> Vec<u8> {
    let mut file = bytes.to_vec();
    file.resize(file.len().next_multiple_of(BLOCK_BYTES as usize), 0);
    let (start, length) = (file.len() as u64, level.len() as u64);
    file.extend(level);
    // The header's number of levels and scheme of compression, and the first entry of the levels' index.
    let mut put = |at: usize, number: &[u8]| file[at..at + number.len()].copy_from_slice(number);
    put(40, &1u32.to_le_bytes());
    put(44, &0u32.to_le_bytes());
    for (i, number) in [start, length, length].into_iter().enumerate() {
        put(Header::LENGTH + 8 * i, &number.to_le_bytes());
    }
    file
}
