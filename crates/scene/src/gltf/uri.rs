//! URIs in glTF files: data URIs (RFC 2397, read by `crate::data_uri`) and relative paths (RFC 3986), nothing else.
//!
//! A scene may come from anybody, so a relative path must stay inside the folder of the file that names it,
//! whatever percent-encoding or symbolic links it uses.

pub(super) use crate::data_uri::decode_data_uri;
use crate::data_uri::percent_decode;
use crate::lfs::{LFS_ADVICE, is_lfs_pointer};
use std::path::{Path, PathBuf};

/// The path inside the file's folder that a relative URI means.
///
/// # Errors
/// A scheme, an absolute path, a way out of the folder, or characters that no file name may hold.
pub(super) fn relative_path(uri: &str) -> Result<PathBuf, String> {
    if let Some((head, _)) = uri.split_once(':') {
        let is_scheme = head.starts_with(|c: char| c.is_ascii_alphabetic())
            && head
                .chars()
                .all(|c| c.is_ascii_alphanumeric() || matches!(c, '+' | '.' | '-'));
        if is_scheme {
            return Err(format!(
                "starts with the scheme \"{head}:\"; only data: URIs and relative paths are read: \
                 put the file beside the scene and name it without a scheme"
            ));
        }
    }
    // Decoded first: Godot writes %2F between folders, and nothing in a name could be a slash.
    let path = String::from_utf8(percent_decode(uri)?)
        .map_err(|_| "is not UTF-8 after percent-decoding; rename the file".to_owned())?;
    if path.starts_with('/') {
        return Err("is an absolute path; put the file beside the scene and name it relative to it".into());
    }
    let mut parts: Vec<&str> = Vec::new();
    for part in path.split('/') {
        match part {
            "" | "." => {}
            ".." => {
                if parts.pop().is_none() {
                    return Err("leads out of the scene's folder; put the file inside it".into());
                }
            }
            name if name.contains(['\\', '\0']) => {
                return Err("has a backslash or zero inside a name; rename the file".into());
            }
            _ => parts.push(part),
        }
    }
    if parts.is_empty() {
        return Err("names no file".into());
    }
    Ok(parts.iter().collect())
}

/// Reads at most `limit` bytes of the file that a relative URI names.
///
/// # Errors
/// As [`relative_path`]; a file that is missing, not a plain file, or outside `folder` through a link.
pub(super) fn read_relative(folder: &Path, uri: &str, limit: u64) -> Result<Vec<u8>, String> {
    use std::io::Read;
    let relative = relative_path(uri)?;
    let missing = |e: std::io::Error| {
        format!(
            "names {}, which cannot be read: {e}; put it beside the scene",
            relative.display()
        )
    };
    let full = folder.join(&relative).canonicalize().map_err(missing)?;
    let inside = folder.canonicalize().map_err(missing)?;
    if !full.starts_with(&inside) {
        return Err("is a link out of the scene's folder; put a copy of the file inside".into());
    }
    let file = std::fs::File::open(&full).map_err(missing)?;
    let metadata = file.metadata().map_err(missing)?;
    if !metadata.is_file() {
        return Err(format!("names {}, which is not a plain file", relative.display()));
    }
    let mut bytes = Vec::with_capacity(metadata.len().min(limit) as usize);
    // Enough to know a pointer, which is shorter than what it stands for.
    file.take(limit.max(64))
        .read_to_end(&mut bytes)
        .map_err(missing)?;
    if is_lfs_pointer(&bytes) {
        return Err(format!("names {}, which {LFS_ADVICE}", relative.display()));
    }
    bytes.truncate(usize::try_from(limit).unwrap_or(usize::MAX));
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn relative_uris_stay_inside() {
        for (uri, path) in [
            ("a.bin", "a.bin"),
            ("./maps/a%20b.png", "maps/a b.png"),
            ("maps/../a.bin", "a.bin"),
            ("100%25.png", "100%.png"),
            ("gr%C3%BCn.png", "grün.png"),
            ("%252e%252e/x", "%2e%2e/x"),
            ("maps%2Fa.png", "maps/a.png"),
            ("a%2F..%2Fb", "b"),
        ] {
            assert_eq!(relative_path(uri).as_deref(), Ok(Path::new(path)), "{uri}");
        }
        for uri in [
            "",
            ".",
            "..",
            "../a",
            "a/../../b",
            "%2e%2e/a",
            "/etc/passwd",
            "file:///etc/passwd",
            "http://a/b",
            "C:/a",
            "%2Fetc/passwd",
            "a%2F..%2F..%2Fb",
            "a\\b",
            "%5c%5chost",
            "a%00",
            "100%.png",
            "%f",
            "%zz",
            "%ff.png",
        ] {
            assert!(relative_path(uri).is_err(), "{uri}");
        }
    }
}
