//! Reading OpenEXR, also files of other programs: half, float or uint; scan lines or tiles (the largest level);
//! one part or many. Not read: deep data, subsampled channels, parts of different sizes.
//!
//! The `exr` crate decodes. It allocates what a header asks for, so the headers are read first and held against
//! [`Limits`] and against the file's length. It decodes on one thread here: a panic in one of its worker threads
//! would end the process, one in ours is caught and becomes an error.

use super::error::{ImageError, Limits, read_file};
use super::layers::{BEAUTY, Layer, Layers};
use exr::block::reader::Reader;
use exr::image::{AnyChannels, FlatSamples, Layer as Part};
use exr::meta::attribute::Compression;
use exr::meta::header::Header;
use exr::prelude::{ReadChannels, ReadLayers};
use std::io::Cursor;
use std::path::Path;

/// Reads all channels of a file, grouped into layers.
///
/// Channels with a common prefix and the endings `R G B` or `X Y Z` become one layer of three, named by the prefix
/// ([`super::BEAUTY`] without one); the only channel of a prefix becomes a layer named by it; every other channel
/// becomes a layer with its full name. In a file of many parts the part's name comes before the prefix. Values come
/// as the file has them, NaN and infinity included. The image is the data window.
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
    // Last net: no known input gets here, but the decoder holds asserts.
    std::panic::catch_unwind(|| decode(file, bytes, limits)).unwrap_or_else(|_| {
        Err(ImageError::invalid(
            file,
            "the OpenEXR decoder failed on it: the file is damaged; write it again",
        ))
    })
}

fn decode(file: &str, bytes: &[u8], limits: &Limits) -> Result<Layers, ImageError> {
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
    grouped(file, image.layer_data.to_vec())
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

/// Refuses what would cost more memory than the limits allow, or than a file of that length can hold.
fn check_headers(
    file: &str,
    file_bytes: usize,
    headers: &[Header],
    limits: &Limits,
) -> Result<(), ImageError> {
    let first = headers
        .first()
        .ok_or_else(|| ImageError::invalid(file, "the file has no part"))?;
    let mut bytes_per_pixel = 0;
    for header in headers {
        if header.deep {
            return Err(ImageError::unsupported(file, "deep data; flatten the image"));
        }
        if header.layer_size != first.layer_size {
            return Err(ImageError::unsupported(
                file,
                "its parts differ in size; write them to one file each",
            ));
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
        // Each value is decoded as it is in the file and then kept as f32.
        let part = header.channels.bytes_per_pixel as u64 + 4 * header.channels.list.len() as u64;
        bytes_per_pixel += part;
        limits.check(file, w, h, bytes_per_pixel)?;
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
    }
    Ok(())
}

/// Channels of one prefix of one part.
struct Group {
    prefix: String,
    /// Ending and values.
    channels: Vec<(String, FlatSamples)>,
}

fn grouped(file: &str, parts: Vec<Part<AnyChannels<FlatSamples>>>) -> Result<Layers, ImageError> {
    let (width, height) = parts.first().map_or((0, 0), |p| (p.size.0, p.size.1));
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
        for channel in part.channel_data.list {
            let name = text(channel.name.as_slice());
            let (prefix, ending) = name.rsplit_once('.').unwrap_or(("", &name));
            let prefix = [part_name.as_str(), prefix]
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
            let mut data = vec![0.0; 3 * width * height];
            for (component, at) in [a, b, c].into_iter().enumerate() {
                let values = group.channels[at].1.values_as_f32();
                data[component..]
                    .iter_mut()
                    .step_by(3)
                    .zip(values)
                    .for_each(|(to, v)| *to = v);
            }
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
        let alone =
            group.channels.len() == 1 && !group.prefix.is_empty() && layers.layer(&group.prefix).is_none();
        for (ending, samples) in group.channels {
            let name = match group.prefix.as_str() {
                "" => ending,
                prefix if alone => prefix.to_string(),
                prefix => format!("{prefix}.{ending}"),
            };
            let data: Vec<f32> = samples.values_as_f32().collect();
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
