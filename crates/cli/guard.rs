//! What a command may write over: never a file that it reads, and no file of another kind than it writes, unless --force says so.

use crate::kinds::Kind;
use crate::text;
use anyhow::{Result, bail};
use relight_scene::json::token::string_length;
use relight_scene::numbered;
use std::cell::OnceCell;
use std::path::{Path, PathBuf};

/// What a command reads, and whether it may replace files of other kinds.
pub struct Guard {
    /// Files that options name.
    named: Vec<PathBuf>,
    /// Those, and what they name: found when something is there that could be replaced.
    inputs: OnceCell<Vec<PathBuf>>,
    force: bool,
}

impl Guard {
    /// Of a command that reads nothing yet. `force`: files of other kinds may be replaced.
    pub fn new(force: bool) -> Guard {
        Guard {
            named: Vec::new(),
            inputs: OnceCell::new(),
            force,
        }
    }

    /// With files that are read: scenes, sequences and edits with what they name.
    pub fn reads<'a>(mut self, files: impl IntoIterator<Item = &'a Path>) -> Guard {
        self.named.extend(files.into_iter().map(Path::to_owned));
        self
    }

    /// Whether a file of this kind may be written there.
    ///
    /// # Errors
    /// It would replace an input, whatever link leads there, or something else.
    pub fn check(&self, output: &Path, kind: Kind) -> Result<()> {
        // What isn't there cannot be lost. Folders, devices and pipes are refused by who prepares outputs.
        if !output.is_file() {
            return Ok(());
        }
        let name = output.display();
        let inputs = self.inputs.get_or_init(|| {
            let named_in = self.named.iter().flat_map(|file| files_named_in(file));
            self.named.iter().cloned().chain(named_in).collect()
        });
        if let Some(input) = inputs.iter().find(|input| same_file(input, output)) {
            let read = match *input == output {
                true => String::new(),
                false => format!(" (as {})", input.display()),
            };
            bail!(
                "{name}: is read by this command{read} and would be replaced; give another name to what is written"
            );
        }
        let found = Kind::of(output);
        if self.force || found == kind || found == Kind::Empty {
            return Ok(());
        }
        bail!(
            "{name}: is {}, not {}, and would be replaced; give another name, or --force to replace it",
            found.name(),
            kind.name()
        )
    }
}

/// Whether two paths lead to one file, by whatever links.
fn same_file(a: &Path, b: &Path) -> bool {
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt;
        let place = |path: &Path| path.metadata().ok().map(|m| (m.dev(), m.ino()));
        place(a).is_some_and(|a| place(b) == Some(a))
    }
    #[cfg(not(unix))]
    {
        a.canonicalize()
            .is_ok_and(|a| b.canonicalize().is_ok_and(|b| a == b))
    }
}

/// Files that a scene, a sequence or a description names: under the keys `uri` and `file`, relative to its folder.
fn files_named_in(file: &Path) -> Vec<PathBuf> {
    if !matches!(Kind::of(file), Kind::Scene | Kind::Description | Kind::Sequence) {
        return Vec::new();
    }
    let bytes = std::fs::read(file).unwrap_or_default();
    let json = chunk_of_glb(&bytes).unwrap_or(&bytes);
    let folder = file.parent().unwrap_or(Path::new(""));
    let names = named(&text::of(json));
    let files = names.iter().map(|name| folder.join(name));
    // A pattern of environment maps is all of its files.
    files
        .flat_map(|file| match numbered::is_pattern(&file) {
            true => numbered::files(&file).unwrap_or_default(),
            false => vec![file],
        })
        .collect()
}

/// The JSON of a binary glTF: the first chunk, after a header of 12 bytes and its own length and type.
fn chunk_of_glb(bytes: &[u8]) -> Option<&[u8]> {
    let bytes = bytes.strip_prefix(b"glTF")?;
    let length = u32::from_le_bytes(bytes.get(8..12)?.try_into().ok()?) as usize;
    bytes.get(16..16usize.checked_add(length)?)
}

/// What stands after the keys that name files, as it is and decoded. Looks at strings alone, so that it finds names in texts that
/// readers mend first: with numbers that JSON doesn't have, or a key given twice.
fn named(json: &str) -> Vec<String> {
    let mut names = Vec::new();
    let (mut rest, mut key) = (json, String::new());
    while let Some(start) = rest.find('"') {
        let (before, string) = rest.split_at(start);
        let (string, after) = string.split_at(string_length(string));
        let is_value = before.trim() == ":" && ["uri", "file"].contains(&key.as_str());
        key = match string.starts_with("\"data:") {
            true => String::new(),
            false => serde_json::from_str(string).unwrap_or_default(),
        };
        if is_value && !key.is_empty() {
            names.push(decoded(&key));
            names.push(std::mem::take(&mut key));
        }
        rest = after;
    }
    names
}

/// With %20 and the like as what they stand for.
fn decoded(uri: &str) -> String {
    let mut bytes = Vec::new();
    let mut rest = uri.as_bytes();
    while let [first, tail @ ..] = rest {
        let digits = tail.get(..2).filter(|_| *first == b'%');
        let code = digits.and_then(|d| u8::from_str_radix(std::str::from_utf8(d).ok()?, 16).ok());
        bytes.push(code.unwrap_or(*first));
        rest = if code.is_some() { &tail[2..] } else { tail };
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scene_names_its_buffers_and_a_sequence_its_maps() {
        let folder = tempfile::tempdir().unwrap();
        let (scene, lights) = (folder.path().join("s.gltf"), folder.path().join("l.json"));
        let text = r#"{"asset": {"version": "2.0"}, "buffers": [{"uri": "a%20b.bin"}, {"uri": "data:,"}]}"#;
        std::fs::write(&scene, text).unwrap();
        assert!(files_named_in(&scene).contains(&folder.path().join("a b.bin")));
        let text = r#"{"relight_sequence": 1, "lights": [{"type": "environment", "file": "sky.hdr"}]}"#;
        std::fs::write(&lights, text).unwrap();
        assert!(files_named_in(&lights).contains(&folder.path().join("sky.hdr")));
        let pattern = r#"{"relight_sequence": 1, "lights": [{"type": "environment", "file": "sky_##.hdr"}]}"#;
        std::fs::write(&lights, pattern).unwrap();
        let second = folder.path().join("sky_02.hdr");
        std::fs::write(&second, "").unwrap();
        assert!(files_named_in(&lights).contains(&second));
    }

    #[test]
    fn names_are_found_in_what_is_no_json_yet() {
        let text = r#"{"min": [NaN], "images": [{"uri" : "a\u0041.png", "uri": "b.png"}, {"name": "uri"}], "uri": {"x": "no"},
            "file": ["no"], "extras": "uri", "a": "no \" \"file\": \"no\"", "file":"sky.hdr"#;
        assert_eq!(named(text), ["aA.png", "aA.png", "b.png", "b.png"]);
        assert_eq!(named(r#"{"file": "c d.hdr"}"#), ["c d.hdr", "c d.hdr"]);
        let utf16: Vec<u8> = "\u{feff}{\"file\": \"ü.hdr\"}"
            .encode_utf16()
            .flat_map(u16::to_le_bytes)
            .collect();
        assert_eq!(named(&text::of(&utf16)), ["ü.hdr", "ü.hdr"]);
    }

    #[test]
    fn the_json_of_a_binary_scene_is_found() {
        let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/cornell.glb");
        let bytes = std::fs::read(data).unwrap();
        let json: serde_json::Value = serde_json::from_slice(chunk_of_glb(&bytes).unwrap()).unwrap();
        assert_eq!(json["asset"]["version"], "2.0");
        for cut in [0, 4, 11, 19, 30] {
            let _ = chunk_of_glb(&bytes[..cut]);
        }
    }
}
