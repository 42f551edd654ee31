//! The maps that names in sequences stand for: files, patterns of files, and maps that stand in the text itself as data URIs,
//! as an asset has those of its scene.

use crate::data_uri::{decode_data_uri, is_data_uri};
use crate::environment::{decode_environment, read_environment};
use crate::image::Limits;
use crate::light::EnvironmentMaps;
use crate::numbered;
use std::path::Path;
use std::sync::Arc;

/// Most bytes that the maps of one light take in memory.
pub(crate) const MAX_MAP_BYTES: usize = 4 << 30;

/// Largest map in a text, pixels: 8192 × 4096. Texts come from anywhere, and pack a black one into a few bytes.
const MAX_EMBEDDED_PIXELS: u64 = 1 << 25;

/// A name for messages: data URIs are as long as their maps.
pub(crate) fn shown(name: &str) -> &str {
    if is_data_uri(name) {
        "the map in the text"
    } else {
        name
    }
}

/// The map of a data URI; `None` of any other name.
///
/// # Errors
/// What is wrong with it.
pub(crate) fn embedded(name: &str) -> Option<Result<EnvironmentMaps, String>> {
    let bytes = decode_data_uri(name)?;
    let read = |bytes: Vec<u8>| {
        let limits = Limits {
            max_pixels: MAX_EMBEDDED_PIXELS,
            // Channels that nobody asked for count as well.
            max_bytes: 16 * MAX_EMBEDDED_PIXELS,
            ..Limits::default()
        };
        let map = decode_environment(shown(name), &bytes, &limits);
        map.map(|map| Arc::new(map).into())
            .map_err(|error| error.to_string())
    };
    Some(
        bytes
            .map_err(|error| format!("{} {error}", shown(name)))
            .and_then(read),
    )
}

/// The map of a file, or the maps of a pattern of files, one for each frame; `file` is its name in messages.
///
/// # Errors
/// What is wrong with it.
pub(crate) fn read(name: &Path, file: &str, frames: u32) -> Result<EnvironmentMaps, String> {
    // A file that is called so is meant itself.
    if numbered::is_pattern(name) && !name.exists() {
        return read_maps(name, frames).map_err(|error| format!("{file}: {error}"));
    }
    let map = read_environment(name);
    map.map(|map| Arc::new(map).into())
        .map_err(|error| error.to_string())
}

/// The maps of a pattern, as many as there are frames.
fn read_maps(pattern: &Path, frames: u32) -> Result<EnvironmentMaps, String> {
    let (mut maps, mut bytes) = (Vec::new(), 0);
    for file in numbered::files(pattern)?.iter().take(frames as usize) {
        let map = read_environment(file).map_err(|error| error.to_string())?;
        bytes += map.pixels.len() * size_of::<glam::Vec3>();
        if bytes > MAX_MAP_BYTES {
            let name = file.display();
            return Err(format!(
                "with {name} the maps take more than {MAX_MAP_BYTES} bytes of memory; make them smaller, or the sequence shorter"
            ));
        }
        maps.push(Arc::new(map));
    }
    EnvironmentMaps::of_frames(maps).ok_or_else(|| "there is no map".into())
}
