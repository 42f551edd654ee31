//! Writing OpenEXR: one part, scan lines, ZIP, half or float.
//!
//! The `exr` crate writes header, chunks and offsets. Two things it can't do:
//!
//! - **Compress fast.** `UncompressedBlock::compress_to_chunk` deflates at level 4 with no way to choose, which makes a
//!   frame take three times as long for 8 % fewer bytes (`docs/notebook/images.md`). So blocks are compressed here; the steps of ZIP
//!   (bytes split into even and odd ones, differences, zlib) are those of OpenEXR's technical introduction.
//! - **Say that names are long.** `MetaData::validate` looks at attributes' names only when it sets the flag that files
//!   with names beyond 31 bytes need, not at channels' names. The flag is set here.
//!
//! Equal frames give equal bytes: `exr_header` says how attributes keep their order.

use super::atomic::write_atomically;
use super::error::ImageError;
use super::exr_header::{ExrHeader, file_header, with_attributes};
use super::layers::{ALPHA, BEAUTY, DEPTH, Layer, Layers, RAY_DEPTH};
use exr::block::chunk::{Chunk, CompressedBlock, CompressedScanLineBlock};
use exr::block::writer::ChunksWriter;
use exr::meta::attribute::SampleType;
use half::slice::HalfFloatSliceExt;
use rayon::prelude::*;
use std::io::Cursor;
use std::path::Path;

/// zlib level of the blocks.
const DEFLATE_LEVEL: u8 = 1;
/// Scan lines in a block of ZIP.
const LINES_PER_BLOCK: usize = 16;
/// Longest name without the flag of long names; with it 255.
const SHORT_NAME: usize = 31;
/// From here on a number rounds to infinity in half precision (65504 is the largest finite one).
const HALF_OVERFLOW: f32 = 65520.0;
/// A layer whose largest value is below half's smallest normal number (2⁻¹⁴) would lose its precision, or itself.
const HALF_NORMAL: f32 = 6.103_515_6e-5;

/// What a written file holds that its caller did not ask for.
#[derive(Clone, Debug, PartialEq)]
pub enum ExrWarning {
    /// The layer has values that half precision cannot hold, so it was written in 32 bits.
    BeyondHalf {
        /// The layer.
        layer: String,
        /// Its largest finite magnitude.
        largest: f32,
    },
    /// The layer has NaN or infinite values: NaN were written as 0, infinities as the largest finite number.
    NotFinite {
        /// The layer.
        layer: String,
        /// How many NaN values.
        nan: usize,
        /// How many infinite values.
        infinite: usize,
    },
}

impl std::fmt::Display for ExrWarning {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::BeyondHalf { layer, largest } => write!(
                f,
                "layer {layer}: its largest value {largest:e} is beyond half precision, so it is written in 32 bits"
            ),
            Self::NotFinite { layer, nan, infinite } => write!(
                f,
                "layer {layer}: {nan} NaN values written as 0, {infinite} infinite ones as the largest number"
            ),
        }
    }
}

/// The names of a layer's channels: `R G B` for [`BEAUTY`], else `name.R` and so on; `X Y Z` for `normal`, `Z` for [`DEPTH`], nothing but
/// their names for [`ALPHA`] and [`RAY_DEPTH`], `Y` (OpenEXR's luminance) for any other single channel; `r g b a` for four, in which
/// Cryptomatte keeps what is no colour.
pub fn channel_names(layer: &Layer) -> Vec<String> {
    let suffixes: &[&str] = match (layer.channels, layer.name.as_str()) {
        (1, ALPHA | RAY_DEPTH) => return vec![layer.name.clone()],
        (4, _) => &["r", "g", "b", "a"],
        (1, DEPTH) => &["Z"],
        (1, _) => &["Y"],
        (_, "normal") => &["X", "Y", "Z"],
        _ => &["R", "G", "B"],
    };
    let name = |s: &&str| {
        if layer.name == BEAUTY {
            s.to_string()
        } else {
            format!("{}.{s}", layer.name)
        }
    };
    suffixes.iter().map(name).collect()
}

/// Whether a layer has 32 bits whatever else has: half precision tells distances apart by 1 in 2000, and identifiers not at all.
fn always_float(layer: &Layer) -> bool {
    layer.channels == 4 || [DEPTH, RAY_DEPTH].contains(&layer.name.as_str())
}

/// Writes the layers as `path`, atomically ([`write_atomically`]): half precision, or 32 bits if `float`.
///
/// # Errors
/// As [`encode_exr`], and [`ImageError::Io`].
pub fn write_exr(
    path: &Path,
    layers: &Layers,
    header: &ExrHeader,
    float: bool,
) -> Result<Vec<ExrWarning>, ImageError> {
    let (bytes, warnings) = encode_exr(&path.display().to_string(), layers, header, float)?;
    write_atomically(path, &bytes)?;
    Ok(warnings)
}

/// One channel of the file: where its values lie in its layer.
struct Channel<'a> {
    layer: &'a Layer,
    component: usize,
    kind: SampleType,
    /// Whether it has values that are not finite, and what stands in for infinity.
    repair: bool,
    largest: f32,
}

/// The bytes of the file that [`write_exr`] writes; they depend on the arguments only. `file` names it in errors.
///
/// # Errors
/// [`ImageError::Invalid`] if there is no layer, a size is 0 or does not fit, or a name is empty, too long or taken.
pub fn encode_exr(
    file: &str,
    layers: &Layers,
    header: &ExrHeader,
    float: bool,
) -> Result<(Vec<u8>, Vec<ExrWarning>), ImageError> {
    let mut warnings = Vec::new();
    let mut channels = checked_channels(file, layers, float, &mut warnings)?;
    channels.sort_by(|a, b| a.0.cmp(&b.0));
    if let Some(pair) = channels.windows(2).find(|pair| pair[0].0 == pair[1].0) {
        return Err(ImageError::invalid(
            file,
            format!("channel {} would be written twice", pair[0].0),
        ));
    }

    let kinds = channels.iter().map(|(name, c)| (name.clone(), c.kind));
    let exr_header = file_header(layers.width, layers.height, kinds, header);
    let chunk_count = exr_header.chunk_count;
    let chunks: Vec<Chunk> = (0..chunk_count)
        .into_par_iter()
        .map(|i| {
            let first = i * LINES_PER_BLOCK;
            let rows = first..(first + LINES_PER_BLOCK).min(layers.height);
            let block = CompressedScanLineBlock {
                y_coordinate: first as i32,
                compressed_pixels_le: compressed_block(raw_block(layers.width, rows, &channels)),
            };
            Chunk {
                layer_index: 0,
                compressed_block: CompressedBlock::ScanLine(block),
            }
        })
        .collect();

    let mut bytes = Cursor::new(Vec::new());
    exr::block::write(
        &mut bytes,
        [exr_header].into_iter().collect(),
        true,
        |_, writer| (chunks.into_iter().enumerate()).try_for_each(|(i, chunk)| writer.write_chunk(i, chunk)),
    )
    .map_err(|e| ImageError::invalid(file, format!("cannot be an OpenEXR file: {e}")))?;
    let mut bytes = with_attributes(&bytes.into_inner(), chunk_count, header)
        .ok_or_else(|| ImageError::invalid(file, "its attributes do not fit into an OpenEXR file"))?;
    if channels.iter().any(|(name, _)| name.len() > SHORT_NAME) {
        // Bit 10 of the version field, which follows the 4 bytes of the magic number.
        bytes[5] |= 1 << 2;
    }
    Ok((bytes, warnings))
}

/// Checks the layers and decides each one's precision.
fn checked_channels<'a>(
    file: &str,
    layers: &'a Layers,
    float: bool,
    warnings: &mut Vec<ExrWarning>,
) -> Result<Vec<(String, Channel<'a>)>, ImageError> {
    let Layers {
        width,
        height,
        layers,
    } = layers;
    // Block sizes are 32-bit numbers: 16 lines of `width` pixels of all channels have to fit.
    let values: usize = layers.iter().map(|l| l.channels).sum();
    let fits = width
        .checked_mul(values * 4 * LINES_PER_BLOCK)
        .is_some_and(|b| b < i32::MAX as usize);
    if *width == 0 || *height == 0 || *height > i32::MAX as usize || !fits || values == 0 {
        let detail =
            format!("{width} × {height} pixels with {values} channels is no size for an OpenEXR file");
        return Err(ImageError::invalid(file, detail));
    }
    let mut channels = Vec::new();
    for layer in layers {
        let Layer {
            name,
            channels: count,
            data,
        } = layer;
        // OpenEXR's names are at most 255 bytes and end in a zero byte; 2 bytes are for ".R".
        if name.is_empty() || name.len() > 253 || name.contains('\0') {
            return Err(ImageError::invalid(
                file,
                format!("{name:?} is no name for a layer"),
            ));
        }
        if !matches!(count, 1 | 3 | 4) || data.len() != width * height * count {
            let detail = format!(
                "layer {name} has {} values in {count} channels for {width} × {height} pixels",
                data.len()
            );
            return Err(ImageError::invalid(file, detail));
        }
        let Extent {
            nan,
            infinite,
            largest,
        } = extent(data);
        let repair = nan + infinite > 0;
        if repair {
            warnings.push(ExrWarning::NotFinite {
                layer: name.clone(),
                nan,
                infinite,
            });
        }
        let float = float || always_float(layer);
        let beyond = largest >= HALF_OVERFLOW || (largest > 0.0 && largest < HALF_NORMAL);
        if beyond && !float {
            warnings.push(ExrWarning::BeyondHalf {
                layer: name.clone(),
                largest,
            });
        }
        let (kind, largest) = if float || beyond {
            (SampleType::F32, f32::MAX)
        } else {
            (SampleType::F16, 65504.0)
        };
        for (component, channel) in channel_names(layer).into_iter().enumerate() {
            channels.push((
                channel,
                Channel {
                    layer,
                    component,
                    kind,
                    repair,
                    largest,
                },
            ));
        }
    }
    Ok(channels)
}

/// What the values of a layer reach.
struct Extent {
    nan: usize,
    infinite: usize,
    /// Largest finite magnitude.
    largest: f32,
}

/// Magnitudes of floats are ordered as their bits are, and comparing integers is what compilers vectorise.
fn extent(data: &[f32]) -> Extent {
    const INFINITE: u32 = f32::INFINITY.to_bits();
    let parts: Vec<[u32; 3]> = data
        .par_chunks(1 << 15)
        .map(|chunk| {
            chunk.iter().fold([0; 3], |[nan, infinite, largest], v| {
                let bits = v.abs().to_bits();
                let finite = if bits < INFINITE { bits } else { 0 };
                [
                    nan + u32::from(bits > INFINITE),
                    infinite + u32::from(bits == INFINITE),
                    largest.max(finite),
                ]
            })
        })
        .collect();
    let sum = |k: usize| parts.iter().map(|p| p[k] as usize).sum();
    let largest = parts.iter().map(|p| p[2]).max().unwrap_or(0);
    Extent {
        nan: sum(0),
        infinite: sum(1),
        largest: f32::from_bits(largest),
    }
}

/// The pixels of some rows as the file wants them: per row, per channel, the values of all columns.
fn raw_block(width: usize, rows: std::ops::Range<usize>, channels: &[(String, Channel)]) -> Vec<u8> {
    let bytes_per_pixel: usize = channels.iter().map(|(_, c)| c.kind.bytes_per_sample()).sum();
    let mut raw = Vec::with_capacity(width * rows.len() * bytes_per_pixel);
    let mut values = vec![0.0_f32; width];
    let mut halves = vec![half::f16::ZERO; width];
    for y in rows {
        for (_, channel) in channels {
            let stride = channel.layer.channels;
            let row = &channel.layer.data[y * width * stride..(y + 1) * width * stride];
            let of_channel = row[channel.component..].iter().step_by(stride);
            values.iter_mut().zip(of_channel).for_each(|(to, v)| *to = *v);
            if channel.repair {
                for v in values.iter_mut().filter(|v| !v.is_finite()) {
                    *v = if v.is_nan() {
                        0.0
                    } else {
                        channel.largest.copysign(*v)
                    };
                }
            }
            match channel.kind {
                SampleType::F16 => {
                    halves.convert_from_f32_slice(&values);
                    let bits: &mut [u16] = halves.reinterpret_cast_mut();
                    // The file is little-endian; so is nearly every machine, where this does nothing.
                    bits.iter_mut().for_each(|b| *b = b.to_le());
                    raw.extend_from_slice(bytemuck::cast_slice(bits));
                }
                _ => {
                    values
                        .iter_mut()
                        .for_each(|v| *v = f32::from_bits(v.to_bits().to_le()));
                    raw.extend_from_slice(bytemuck::cast_slice(&values));
                }
            }
        }
    }
    raw
}

/// A block's ZIP bytes, or the block itself where those would not be fewer: readers tell by the length.
fn compressed_block(raw: Vec<u8>) -> Vec<u8> {
    let mut split = vec![0; raw.len()];
    let (even, odd) = split.split_at_mut(raw.len().div_ceil(2));
    for (pair, (e, o)) in raw.as_chunks::<2>().0.iter().zip(even.iter_mut().zip(odd)) {
        (*e, *o) = (pair[0], pair[1]);
    }
    // Values have 2 or 4 bytes, so a block has no odd byte left.
    let mut previous = split[0];
    for byte in &mut split[1..] {
        let current = *byte;
        *byte = current.wrapping_sub(previous).wrapping_add(128);
        previous = current;
    }
    let packed = miniz_oxide::deflate::compress_to_vec_zlib(&split, DEFLATE_LEVEL);
    if packed.len() < raw.len() { packed } else { raw }
}
