//! KTX 2.0 textures of plain texels. glTF has only Basis Universal's in this container, but exporters for engines that read any write
//! them, and what they mean is beyond doubt.

use crate::image::Image8;
use ktx2::{Format, SupercompressionScheme};

/// Where a texel's red, green, blue and alpha are among its bytes; what it lacks is 0, and 255 for alpha, as samplers of textures have it.
type Order = [Option<usize>; 4];

/// The order of bytes of the formats that are read, all of 8 bits a channel, and how many bytes a texel has.
fn order(format: Format) -> Option<(Order, usize)> {
    Some(match format {
        Format::R8_UNORM | Format::R8_SRGB => ([Some(0), None, None, None], 1),
        Format::R8G8_UNORM | Format::R8G8_SRGB => ([Some(0), Some(1), None, None], 2),
        Format::R8G8B8_UNORM | Format::R8G8B8_SRGB => ([Some(0), Some(1), Some(2), None], 3),
        Format::B8G8R8_UNORM | Format::B8G8R8_SRGB => ([Some(2), Some(1), Some(0), None], 3),
        Format::R8G8B8A8_UNORM | Format::R8G8B8A8_SRGB => ([Some(0), Some(1), Some(2), Some(3)], 4),
        Format::B8G8R8A8_UNORM | Format::B8G8R8A8_SRGB => ([Some(2), Some(1), Some(0), Some(3)], 4),
        _ => return None,
    })
}

/// The texels of a level, which the caller has found small enough; `stored` are its bytes in the file.
///
/// # Errors
/// What is wrong with it, as the rest of a sentence about the file.
pub(super) fn texels(
    format: Format,
    (width, height): (u32, u32),
    scheme: Option<SupercompressionScheme>,
    stored: &[u8],
) -> Result<Image8, String> {
    let Some((order, bytes)) = order(format) else {
        return Err(format!(
            "holds texels of {format:?}, where KHR_texture_basisu has ETC1S and UASTC"
        ));
    };
    let size = width as usize * height as usize * bytes;
    let level = decompressed(scheme, stored, size)?;
    if level.len() != size {
        return Err(format!(
            "holds {} bytes of {width} × {height} texels, which have {size}",
            level.len()
        ));
    }
    let texel = |texel: &[u8]| {
        let channel = |k: usize| order[k].map_or(if k == 3 { 255 } else { 0 }, |at| texel[at]);
        [0, 1, 2, 3].map(channel)
    };
    Ok(Image8 {
        width: width as usize,
        height: height as usize,
        rgba8: level.chunks_exact(bytes).map(texel).collect(),
    })
}

/// What a level decompresses to, in no more memory than `size` bytes: `zstd` writes to a place of that size. (`ruzstd`, which `basisu` has,
/// makes all of a block before it counts: of 32 kB 2 GB.)
///
/// # Errors
/// What is wrong with it, as the rest of a sentence about the file.
pub(super) fn decompressed(
    scheme: Option<SupercompressionScheme>,
    stored: &[u8],
    size: usize,
) -> Result<Vec<u8>, String> {
    let damaged = |why: String| format!("can't be decompressed ({why})");
    match scheme {
        None => Ok(stored.to_vec()),
        Some(SupercompressionScheme::Zstandard) => {
            zstd::bulk::decompress(stored, size).map_err(|e| damaged(e.to_string()))
        }
        Some(SupercompressionScheme::ZLIB) => {
            miniz_oxide::inflate::decompress_to_vec_zlib_with_limit(stored, size)
                .map_err(|e| damaged(e.to_string()))
        }
        Some(other) => Err(format!(
            "is compressed by {other:?}, which only Basis Universal's are"
        )),
    }
}
