//! The outer shell: reading the file and splitting a `.glb` into its JSON and binary chunks (glTF 2.0,
//! section 4, "GLB File Format Specification").
//!
//! Written by hand, because the gltf crate's splitter subtracts from lengths that it has not checked and
//! names no offsets.

use super::duplicates;
use super::error::ImportError;
use super::mend;
use super::notes::Notes;
use crate::lfs::{LFS_ADVICE, is_lfs_pointer};
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
pub(super) fn read(file: &Path, notes: &mut Notes) -> Result<Container, ImportError> {
    let io = |source| ImportError::Io {
        file: file.into(),
        source,
    };
    // Reading a folder fails late and obscurely on some systems.
    if file.is_dir() {
        return Err(io(std::io::Error::from(std::io::ErrorKind::IsADirectory)));
    }
    let bytes = std::fs::read(file).map_err(io)?;
    let (json_range, bin) = split(&bytes, notes).map_err(|(offset, message)| ImportError::Container {
        file: file.into(),
        offset,
        message,
    })?;
    let text = mend::text(&bytes[json_range], notes);
    let parsed = duplicates::parse(&text).or_else(|e| {
        let Some(quoted) = mend::quoted_non_numbers(&text) else {
            return Err(e);
        };
        let parsed = duplicates::parse(&quoted)?;
        notes.say("the JSON holds NaN or infinite numbers, which JSON doesn't have");
        Ok(parsed)
    });
    let mut json = parsed.map_err(|e| ImportError::Json {
        file: file.into(),
        line: e.line(),
        column: e.column(),
        message: message(&e),
    })?;
    mend::document(&mut json, notes);
    Ok(Container { bytes, json, bin })
}

/// What the parser found, without the place that it repeats at the end.
fn message(error: &serde_json::Error) -> String {
    let text = error.to_string();
    let end = text.rfind(" at line ").unwrap_or(text.len());
    text[..end].to_owned()
}

type Split = (Range<usize>, Option<Range<usize>>);

/// Chunk types, ASCII words, little-endian.
const JSON: u32 = 0x4E4F_534A;
const BIN: u32 = 0x004E_4942;

/// The byte ranges of JSON and binary chunk, or an offset and what is wrong there.
fn split(bytes: &[u8], notes: &mut Notes) -> Result<Split, (usize, String)> {
    if bytes.starts_with(b"glTF") {
        return split_glb(bytes, notes);
    }
    let start = bytes
        .strip_prefix(b"\xef\xbb\xbf")
        .unwrap_or(bytes)
        .trim_ascii_start();
    let is_utf16 = [b"\xff\xfe", b"\xfe\xff"]
        .iter()
        .any(|mark| bytes.starts_with(*mark));
    if start.first() == Some(&b'{') || is_utf16 {
        return Ok((0..bytes.len(), None));
    }
    let what = match bytes {
        _ if is_lfs_pointer(bytes) => return Err((0, format!("this {LFS_ADVICE}"))),
        [] => "the file is empty",
        _ => "this is no glTF file",
    };
    Err((
        0,
        format!("{what}: a .glb starts with \"glTF\", a .gltf with \"{{\"; export the scene as glTF 2.0"),
    ))
}

/// Chunks are to end on multiples of four, with padding that counts; early exporters and other libraries left out
/// the padding, or didn't count it.
fn split_glb(bytes: &[u8], notes: &mut Notes) -> Result<Split, (usize, String)> {
    let peek = |offset: usize| {
        let four = bytes.get(offset..offset.checked_add(4)?)?;
        Some(u32::from_le_bytes(four.try_into().ok()?))
    };
    let word = |offset: usize| {
        peek(offset).ok_or_else(|| {
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
    // Padding of the last chunk that was counted, but not written.
    let lost_padding = length.checked_sub(bytes.len()).is_some_and(|lost| lost <= 3);
    if length < 20 || (length > bytes.len() && !lost_padding) {
        return Err((
            8,
            format!(
                "the header says that the file has {length} bytes, but it has {}; copy or download it again",
                bytes.len()
            ),
        ));
    }
    let mut odd = length > bytes.len();
    let mut end = length.min(bytes.len());
    let mut chunks = Vec::new();
    let mut offset = 12;
    while offset < end {
        let (size, kind) = (word(offset)? as usize, word(offset + 4)?);
        let start = offset + 8;
        let left = bytes.len().saturating_sub(start);
        if size > left + 3 {
            return Err((
                offset,
                format!(
                    "a chunk says that it has {size} bytes, but only {left} are left; copy or download the file again"
                ),
            ));
        }
        let chunk = start..start + size.min(left);
        // Longer than the header's length: that one didn't count padding or the binary chunk.
        odd |= chunk.end > end || size > left;
        end = end.max(chunk.end);
        let padded = chunk.end.next_multiple_of(4);
        let follows = |at: usize| peek(at + 4) == Some(BIN);
        let at_once = padded != chunk.end && !follows(padded) && follows(chunk.end);
        odd |= padded != chunk.end;
        offset = if at_once { chunk.end } else { padded };
        chunks.push((kind, chunk));
    }
    if odd {
        notes.say("the file's chunks are not padded as glTF 2.0 wants it");
    }
    // Unknown chunk types are skipped, as the specification wants it.
    let mut chunks = chunks.into_iter();
    let json = match chunks.next() {
        Some((JSON, range)) => range,
        _ => return Err((12, "the first chunk is not JSON; export the scene again".into())),
    };
    let bin = chunks.next().filter(|chunk| chunk.0 == BIN).map(|chunk| chunk.1);
    Ok((json, bin))
}
