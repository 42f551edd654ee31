//! The outer shell: reading the file and splitting a `.glb` into its JSON and binary chunks (glTF 2.0,
//! section 4, "GLB File Format Specification").
//!
//! Written by hand, because the gltf crate's splitter subtracts from lengths that it has not checked and
//! names no offsets.

use super::error::ImportError;
use serde_json::Value;
use std::ops::Range;
use std::path::Path;

/// A file split into its parts.
pub(super) struct Container {
    /// The whole file.
    pub bytes: Vec<u8>,
    /// The parsed JSON.
    pub json: Value,
    /// Where in `bytes` the binary chunk is; `None` for a `.gltf` or a `.glb` without one.
    pub bin: Option<Range<usize>>,
}

/// Reads a file and parses its JSON.
///
/// # Errors
/// [`ImportError::Io`], [`ImportError::Container`], [`ImportError::Json`].
pub(super) fn read(file: &Path) -> Result<Container, ImportError> {
    let io = |source| ImportError::Io {
        file: file.into(),
        source,
    };
    // Reading a folder fails late and obscurely on some systems.
    if file.is_dir() {
        return Err(io(std::io::Error::from(std::io::ErrorKind::IsADirectory)));
    }
    let bytes = std::fs::read(file).map_err(io)?;
    let (json_range, bin) = split(&bytes).map_err(|(offset, message)| ImportError::Container {
        file: file.into(),
        offset,
        message,
    })?;
    let mut text = &bytes[json_range];
    // A byte order mark is forbidden, but some editors add one.
    if let Some(rest) = text.strip_prefix(b"\xef\xbb\xbf") {
        text = rest;
    }
    let json = serde_json::from_slice(text).map_err(|e| ImportError::Json {
        file: file.into(),
        line: e.line(),
        column: e.column(),
        message: e.to_string(),
    })?;
    Ok(Container { bytes, json, bin })
}

type Split = (Range<usize>, Option<Range<usize>>);

/// The byte ranges of JSON and binary chunk, or an offset and what is wrong there.
fn split(bytes: &[u8]) -> Result<Split, (usize, String)> {
    if !bytes.starts_with(b"glTF") {
        let start = bytes
            .strip_prefix(b"\xef\xbb\xbf")
            .unwrap_or(bytes)
            .trim_ascii_start();
        if start.first() != Some(&b'{') {
            let what = if bytes.is_empty() {
                "the file is empty"
            } else {
                "this is no glTF file"
            };
            return Err((
                0,
                format!(
                    "{what}: a .glb starts with \"glTF\", a .gltf with \"{{\"; export the scene as glTF 2.0"
                ),
            ));
        }
        return Ok((0..bytes.len(), None));
    }
    let word = |offset: usize| {
        let four = bytes
            .get(offset..offset + 4)
            .and_then(|b| <[u8; 4]>::try_from(b).ok());
        four.map(u32::from_le_bytes).ok_or_else(|| {
            (
                bytes.len(),
                "the file ends inside a header; copy or download it again".to_owned(),
            )
        })
    };
    let version = word(4)?;
    if version != 2 {
        return Err((
            4,
            format!("this is glTF version {version}; export the scene as glTF 2.0"),
        ));
    }
    let length = word(8)? as usize;
    if length < 20 || length > bytes.len() {
        return Err((
            8,
            format!(
                "the header says that the file has {length} bytes, but it has {}; copy or download it again",
                bytes.len()
            ),
        ));
    }
    let mut chunks = Vec::new();
    let mut offset = 12;
    while offset < length {
        let (size, kind) = (word(offset)? as usize, word(offset + 4)?);
        let start = offset + 8;
        if size > length.saturating_sub(start) {
            return Err((
                offset,
                format!(
                    "a chunk says that it has {size} bytes, but only {} are left; copy or download the file again",
                    length.saturating_sub(start)
                ),
            ));
        }
        chunks.push((kind, start..start + size));
        // Chunks end on multiples of four; writers that forget it still have the next chunk there.
        offset = (start + size).next_multiple_of(4);
    }
    // Chunk types are ASCII words, little-endian: "JSON" and "BIN\0". Unknown ones are skipped, as the
    // specification wants it.
    let mut chunks = chunks.into_iter();
    let json = match chunks.next() {
        Some((0x4E4F_534A, range)) => range,
        _ => return Err((12, "the first chunk is not JSON; export the scene again".into())),
    };
    let bin = chunks
        .next()
        .filter(|chunk| chunk.0 == 0x004E_4942)
        .map(|chunk| chunk.1);
    Ok((json, bin))
}
