//! A glTF file whose JSON changes and whose other bytes stay.
//!
//! Source: glTF 2.0, section 4 (GLB). The importer mends what exporters get wrong; a copy is written of what is right alone.

use anyhow::{Context, Result, bail};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// The chunk of JSON, and the bytes of a file's head and of a chunk's.
const JSON: &[u8; 4] = b"JSON";
const HEAD: usize = 12;
const CHUNK: usize = 8;

/// A file that was read.
pub struct Source {
    path: PathBuf,
    /// Its JSON.
    pub json: Value,
    /// Of a `.glb` all behind the chunk of JSON.
    rest: Option<Vec<u8>>,
}

fn word(bytes: &[u8], at: usize) -> Option<u32> {
    let four = bytes.get(at..at.checked_add(4)?)?;
    Some(u32::from_le_bytes(four.try_into().ok()?))
}

impl Source {
    /// Reads a `.glb` or `.gltf`.
    ///
    /// # Errors
    /// It cannot be read, or is none; names the file.
    pub fn read(path: &Path) -> Result<Source> {
        let name = path.display();
        let bytes = std::fs::read(path).with_context(|| format!("{name}: cannot be read"))?;
        let (text, rest) = match bytes.starts_with(b"glTF") {
            false => (&bytes[..], None),
            true => {
                let length = word(&bytes, HEAD).map(|n| n as usize);
                let chunk = length.and_then(|n| bytes.get(HEAD + CHUNK..(HEAD + CHUNK).checked_add(n)?));
                match (word(&bytes, 4), bytes.get(HEAD + 4..HEAD + CHUNK), chunk) {
                    (Some(2), Some(kind), Some(text)) if kind == JSON => {
                        (text, Some(bytes[HEAD + CHUNK + text.len()..].to_vec()))
                    }
                    _ => bail!(
                        "{name}: is no whole GLB of version 2: its first chunk must be JSON; export the scene again"
                    ),
                }
            }
        };
        let json: Value = serde_json::from_slice(text).with_context(|| {
            format!("{name}: its JSON cannot be read; a scene description has no lights to set")
        })?;
        if json["asset"]["version"]
            .as_str()
            .is_none_or(|v| !v.starts_with("2."))
        {
            bail!("{name}: is no glTF 2.0: give the .glb or .gltf that the asset was baked of");
        }
        Ok(Source {
            path: path.to_owned(),
            json,
            rest,
        })
    }

    /// Whether a copy can be written there.
    ///
    /// # Errors
    /// It has another ending, or what the scene names beside itself would be elsewhere.
    pub fn check_copy(&self, copy: &Path) -> Result<()> {
        let ending = if self.rest.is_some() { "glb" } else { "gltf" };
        if copy.extension().is_none_or(|e| !e.eq_ignore_ascii_case(ending)) {
            bail!("{}: must end in .{ending}, as the scene does", copy.display());
        }
        let folder = |path: &Path| path.parent().map(Path::to_owned).unwrap_or_default();
        let beside = ["buffers", "images"]
            .iter()
            .flat_map(|list| self.json[*list].as_array());
        let mut uris = beside.flatten().filter_map(|entry| entry["uri"].as_str());
        let same = std::fs::canonicalize(
            self.path
                .parent()
                .filter(|p| !p.as_os_str().is_empty())
                .unwrap_or(Path::new(".")),
        )
        .ok()
        .is_some_and(|own| {
            let other = folder(copy);
            let other = if other.as_os_str().is_empty() {
                PathBuf::from(".")
            } else {
                other
            };
            std::fs::canonicalize(other).is_ok_and(|other| other == own)
        });
        if let Some(uri) = uris.find(|uri| !uri.starts_with("data:")).filter(|_| !same) {
            bail!(
                "{}: the scene names {uri:?} beside itself: write the copy into the scene's folder, {}",
                copy.display(),
                folder(&self.path).display()
            );
        }
        Ok(())
    }

    /// The file with another JSON.
    ///
    /// # Errors
    /// It would be larger than a GLB can be.
    pub fn with_json(&self, json: &Value) -> Result<Vec<u8>> {
        let Some(rest) = &self.rest else {
            return Ok(format!("{json:#}\n").into_bytes());
        };
        let mut text = json.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let all = HEAD + CHUNK + text.len() + rest.len();
        let (Ok(all), Ok(length)) = (u32::try_from(all), u32::try_from(text.len())) else {
            bail!(
                "{}: a GLB has at most 4 GiB; export it as .gltf",
                self.path.display()
            );
        };
        let mut bytes = Vec::with_capacity(all as usize);
        bytes.extend(b"glTF");
        for number in [2, all, length] {
            bytes.extend(number.to_le_bytes());
        }
        bytes.extend(JSON);
        bytes.extend(text);
        bytes.extend(rest);
        Ok(bytes)
    }
}
