//! Reading OpenEXR, also files of other programs: half, float or uint; scan lines or tiles (the largest level);
//! one part or many. Not read: deep data, subsampled channels.
//!
//! The `exr` crate decodes. It allocates what a header asks for, so the headers are read first and held against
//! [`Limits`] and against the file's length. It decodes on one thread here: a panic in one of its worker threads
//! would end the process, one in ours is caught and becomes an error.

use super::error::{ImageError, Limits, read_file};
use super::exr_space::{Placement, rec_709_from};
use super::layers::{BEAUTY, Layer, Layers};
use exr::block::reader::Reader;
use exr::image::{AnyChannels, FlatSamples, Layer as Part};
use exr::meta::attribute::{Compression, EnvironmentMap as Projection, IntegerBounds};
use exr::meta::header::Header;
use exr::prelude::{ReadChannels, ReadLayers};
use glam::{DMat3, DVec3};
use std::io::Cursor;
use std::path::Path;

/// Reads all channels of a file, grouped into layers.
///
/// Channels with a common prefix and the endings `R G B` or `X Y Z` become one layer of three, named by the prefix
/// ([`super::BEAUTY`] without one); the only channel of a prefix, or its `Z`, becomes a layer named by it; every other channel
/// becomes a layer with its full name. In a file of many parts the part's name comes before the prefix, unless it is there
/// already. Values come as the file has them, NaN and infinity included, but colours (`R G B`) in Rec. 709 where the file
/// has other chromaticities. The image is the display window; where it has no data it is 0.
///
/// # Errors
/// [`ImageError`] of every kind; it names the file.
pub fn read_exr(path: &Path, limits: &Limits) -> Result<Layers, ImageError> {
    decode_exr(&path.display().to_string(), &read_file(path, limits)?, limits)
}

/// As [`read_exr`], from memory; `file` says in errors where the bytes came from.
///
/// # Errors
/// As [`read_exr`].
pub fn decode_exr(file: &str, bytes: &[u8], limits: &Limits) -> Result<Layers, ImageError> {
    decode_exr_and_cube(file, bytes, limits).map(|(layers, _)| layers)
}

/// As [`decode_exr`], and whether the file says that it holds the faces of a cube (attribute `envmap`).
pub(super) fn decode_exr_and_cube(
    file: &str,
    bytes: &[u8],
    limits: &Limits,
) -> Result<(Layers, bool), ImageError> {
    // Last net: no known input gets here, but the decoder holds asserts.
    std::panic::catch_unwind(|| decode(file, bytes, limits)).unwrap_or_else(|_| {
        Err(ImageError::invalid(
            file,
            "the OpenEXR decoder failed on it: the file is damaged; write it again",
        ))
    })
}

fn decode(file: &str, bytes: &[u8], limits: &Limits) -> Result<(Layers, bool), ImageError> {
    let error = |e: exr::error::Error| match e {
        exr::error::Error::NotSupported(what) => ImageError::unsupported(
            file,
            format!("OpenEXR feature not supported: {what}; convert the file"),
        ),
        other => ImageError::invalid(file, format!("no whole OpenEXR file: {other}; write it again")),
    };
    let reader = Reader::read_from_buffered(Cursor::new(bytes), false).map_err(error)?;
    check_headers(file, bytes.len(), reader.headers(), limits)?;
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .non_parallel()
        .from_chunks(reader)
        .map_err(error)?;
    let window = image.attributes.display_window;
    let to_709 = rec_709_from(file, image.attributes.chromaticities)?;
    let is_cube =
        (image.layer_data.iter()).any(|part| part.attributes.environment_map == Some(Projection::Cube));
    let layers = grouped(file, image.layer_data.to_vec(), window, to_709)?;
    Ok((layers, is_cube))
}

/// How many bytes one byte of a compressed block can become at most, an upper bound.
fn largest_expansion(compression: Compression) -> u64 {
    match compression {
        Compression::Uncompressed => 1,
        // Runs of up to 128 bytes in two.
        Compression::RLE => 64,
        // deflate reaches 1032; PXR24 drops one byte of four on top; B44A holds 32 bytes in 3.
        Compression::ZIP1 | Compression::ZIP16 | Compression::B44 | Compression::B44A => 1032,
        Compression::PXR24 => 1376,
        // PIZ and DWA stack run lengths on entropy coding; nothing exact is published.
        _ => 1 << 16,
    }
}

/// Bytes that a display window may take whatever the file's length, and beyond that per byte of the file: no more than pixels
/// of one colour pack to.
const FREE_WINDOW: u64 = 64 << 20;
const LARGEST_WINDOW: u64 = 1032;

/// Refuses what would cost more memory than the limits allow, or than a file of that length can hold.
fn check_headers(
    file: &str,
    file_bytes: usize,
    headers: &[Header],
    limits: &Limits,
) -> Result<(), ImageError> {
    if headers.is_empty() {
        return Err(ImageError::invalid(file, "the file has no part"));
    }
    let (mut seen, mut bytes) = (false, 0u64);
    for header in headers {
        if header.deep {
            return Err(ImageError::unsupported(file, "deep data; flatten the image"));
        }
        if header
            .channels
            .list
            .iter()
            .any(|c| c.sampling != exr::math::Vec2(1, 1))
        {
            return Err(ImageError::unsupported(
                file,
                "subsampled channels; write it as plain RGB",
            ));
        }
        let (w, h) = (header.layer_size.0 as u64, header.layer_size.1 as u64);
        // Each value is decoded as it is in the file, and then kept as f32 over the display window.
        let window = header.shared_attributes.display_window;
        limits.check(file, w, h, header.channels.bytes_per_pixel as u64)?;
        let channels = header.channels.list.len() as u64;
        let (window_w, window_h) = (window.size.0 as u64, window.size.1 as u64);
        limits.check(file, window_w, window_h, 4 * channels)?;
        let placed = window_w * window_h * 4 * channels;
        if placed > FREE_WINDOW.max((file_bytes as u64).saturating_mul(LARGEST_WINDOW)) {
            let detail = format!(
                "its display window of {window_w} × {window_h} pixels is far larger than its data, {w} × {h}; crop it"
            );
            return Err(ImageError::invalid(file, detail));
        }
        let position = header.own_attributes.layer_position;
        seen |= Placement::new(header.layer_size, position, window).is_seen();
        let raw = w
            .saturating_mul(h)
            .saturating_mul(header.channels.bytes_per_pixel as u64);
        let possible = (file_bytes as u64).saturating_mul(largest_expansion(header.compression));
        // Each block takes an entry in the offset table.
        if raw > possible || header.chunk_count > file_bytes / 8 {
            let detail =
                format!("{w} × {h} pixels cannot be in {file_bytes} bytes: the file is damaged or cut off");
            return Err(ImageError::invalid(file, detail));
        }
        bytes = bytes.saturating_add(raw).saturating_add(placed);
    }
    if bytes > limits.max_bytes {
        return Err(ImageError::LimitExceeded {
            file: file.into(),
            what: "the decoded size in bytes",
            found: bytes,
            limit: limits.max_bytes,
        });
    }
    if !seen {
        let what =
            "no pixel lies in the display window; write the image with a display window around its data";
        return Err(ImageError::invalid(file, what));
    }
    Ok(())
}

/// Channels of one prefix of one part.
struct Group {
    prefix: String,
    placement: Placement,
    /// Ending and values.
    channels: Vec<(String, FlatSamples)>,
}

fn grouped(
    file: &str,
    parts: Vec<Part<AnyChannels<FlatSamples>>>,
    window: IntegerBounds,
    to_709: Option<DMat3>,
) -> Result<Layers, ImageError> {
    let (width, height) = (window.size.0, window.size.1);
    let many = parts.len() > 1;
    let mut groups: Vec<Group> = Vec::new();
    for (i, part) in parts.into_iter().enumerate() {
        let part_name = part.attributes.layer_name.as_ref().map(|n| text(n.as_slice()));
        let part_name = if many {
            part_name.unwrap_or_else(|| format!("part{i}"))
        } else {
            String::new()
        };
        let first = groups.len();
        let placement = Placement::new(part.size, part.attributes.layer_position, window);
        for channel in part.channel_data.list {
            let name = text(channel.name.as_slice());
            let (prefix, ending) = name.rsplit_once('.').unwrap_or(("", &name));
            let is_named = prefix
                .strip_prefix(part_name.as_str())
                .is_some_and(|rest| rest.is_empty() || rest.starts_with('.') || part_name.is_empty());
            let prefix = [if is_named { "" } else { &part_name }, prefix]
                .iter()
                .filter(|s| !s.is_empty())
                .copied()
                .collect::<Vec<_>>();
            let prefix = prefix.join(".");
            let at = groups[first..]
                .iter()
                .position(|g| g.prefix == prefix)
                .unwrap_or_else(|| {
                    groups.push(Group {
                        prefix,
                        placement,
                        channels: Vec::new(),
                    });
                    groups.len() - 1 - first
                });
            groups[first + at]
                .channels
                .push((ending.to_string(), channel.sample_data));
        }
    }
    // The beauty first, as relight itself orders layers; the rest as in the file.
    groups.sort_by_key(|g| !g.prefix.is_empty());

    let mut layers = Layers::new(width, height);
    for mut group in groups {
        for endings in [["R", "G", "B"], ["X", "Y", "Z"]] {
            let find = |e: &str| {
                group
                    .channels
                    .iter()
                    .position(|(ending, _)| ending.eq_ignore_ascii_case(e))
            };
            let [Some(a), Some(b), Some(c)] = endings.map(find) else {
                continue;
            };
            let mut data = vec![0.0; 3 * group.placement.size.0 * group.placement.size.1];
            for (component, at) in [a, b, c].into_iter().enumerate() {
                let values = group.channels[at].1.values_as_f32();
                data[component..]
                    .iter_mut()
                    .step_by(3)
                    .zip(values)
                    .for_each(|(to, v)| *to = v);
            }
            if let Some(matrix) = to_709.filter(|_| endings[0] == "R") {
                for color in data.as_chunks_mut::<3>().0 {
                    *color = (matrix * DVec3::from_array(color.map(f64::from)))
                        .as_vec3()
                        .to_array();
                }
            }
            let data = group.placement.placed(data, 3);
            group
                .channels
                .retain(|(e, _)| !endings.iter().any(|known| e.eq_ignore_ascii_case(known)));
            let name = if group.prefix.is_empty() {
                BEAUTY
            } else {
                &group.prefix
            };
            layers.layers.push(Layer {
                name: unused(&layers, name),
                channels: 3,
                data,
            });
            break;
        }
        // A distance goes by its prefix also beside others, as `depth.Z` beside `depth.ray`.
        let unnamed = !group.prefix.is_empty() && layers.layer(&group.prefix).is_none();
        let alone = unnamed && group.channels.len() == 1;
        for (ending, samples) in group.channels {
            let name = match group.prefix.as_str() {
                "" => ending,
                prefix if alone || (unnamed && ending == "Z") => prefix.to_string(),
                prefix => format!("{prefix}.{ending}"),
            };
            let data = group.placement.placed(samples.values_as_f32().collect(), 1);
            layers.layers.push(Layer {
                name: unused(&layers, &name),
                channels: 1,
                data,
            });
        }
    }
    let whole = |l: &Layer| l.data.len() == width * height * l.channels;
    if layers.layers.is_empty() || !layers.layers.iter().all(whole) {
        return Err(ImageError::invalid(
            file,
            "the file holds no channel, or one without all its pixels",
        ));
    }
    Ok(layers)
}

/// `name`, or with a number behind it if a layer has that name already.
fn unused(layers: &Layers, name: &str) -> String {
    let mut candidate = name.to_string();
    let mut number = 2;
    while layers.layer(&candidate).is_some() {
        candidate = format!("{name}#{number}");
        number += 1;
    }
    candidate
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}
