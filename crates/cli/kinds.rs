//! What a file is, by how it begins: so that one of the wrong kind is named, with the command that takes it, and none is
//! replaced by something else.

use crate::text;
use anyhow::{Result, bail};
use relight_format::layout;
use serde::de::IgnoredAny;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Kinds of files that commands read or write.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Without a byte.
    Empty,
    Asset,
    Scene,
    Description,
    Sequence,
    Materials,
    Plan,
    Log,
    Json,
    Exr,
    Hdr,
    Png,
    Jpeg,
    Npy,
    Ply,
    Market,
    Ktx2,
    /// Which an export writes beside its files.
    ExportPage,
    RadianceMatrix,
    Html,
    Svg,
    Gif,
    WebP,
    Mp4,
    Man,
    Script,
    /// Of lines with commas in them.
    Table,
    Text,
    /// Anything else.
    Unknown,
}

/// Bytes that tell kinds apart which are no JSON.
const HEAD: u64 = 4096;
/// JSON up to this size is parsed for the names of its fields.
const MOST_JSON: u64 = 64 << 20;

const MAGIC: [(&[u8], Kind); 14] = [
    (&layout::MAGIC, Kind::Asset),
    (b"glTF", Kind::Scene),
    (&[0x76, 0x2f, 0x31, 0x01], Kind::Exr),
    (b"\x89PNG", Kind::Png),
    (&[0xff, 0xd8, 0xff], Kind::Jpeg),
    (b"\x93NUMPY", Kind::Npy),
    (b"ply\n", Kind::Ply),
    (b"%%MatrixMarket", Kind::Market),
    (b"\xabKTX 20\xbb", Kind::Ktx2),
    (b"relight export: ", Kind::ExportPage),
    (b"#?RGBE", Kind::Hdr),
    (b"#!", Kind::Script),
    (b"GIF8", Kind::Gif),
    // As pages for man begin that programs write.
    (b".ie \\n(.g .ds Aq", Kind::Man),
];

impl Kind {
    /// With its article.
    pub fn name(self) -> &'static str {
        match self {
            Kind::Empty => "an empty file",
            Kind::Asset => "an asset",
            Kind::Scene => "a glTF scene",
            Kind::Description => "a scene description",
            Kind::Sequence => "a lighting sequence",
            Kind::Materials => "a file of material edits",
            Kind::Plan => "the plan of a bake",
            Kind::Log => "the log of a bake",
            Kind::Json => "a JSON file",
            Kind::Exr => "an OpenEXR image",
            Kind::Hdr => "an HDR image",
            Kind::Png => "a PNG image",
            Kind::Jpeg => "a JPEG image",
            Kind::Npy => "a numpy array",
            Kind::Ply => "a PLY file",
            Kind::Market => "a Matrix Market file",
            Kind::Ktx2 => "a KTX2 texture",
            Kind::ExportPage => "the page of an export",
            Kind::RadianceMatrix => "a Radiance matrix",
            Kind::Html => "a web page",
            Kind::Svg => "an SVG picture",
            Kind::Gif => "a GIF picture",
            Kind::WebP => "a WebP picture",
            Kind::Mp4 => "an MP4 movie",
            Kind::Man => "a page for man",
            Kind::Script => "a script",
            Kind::Table => "a table",
            Kind::Text => "a text",
            Kind::Unknown => "a file of an unknown kind",
        }
    }

    /// What a file is; [`Kind::Unknown`] of what cannot be read, and of pipes, from which nothing is taken.
    pub fn of(path: &Path) -> Kind {
        let Ok(metadata) = path.metadata() else {
            return Kind::Unknown;
        };
        if !metadata.is_file() {
            return Kind::Unknown;
        }
        if metadata.len() == 0 {
            return Kind::Empty;
        }
        let read = |most: u64| -> Option<Vec<u8>> {
            let mut bytes = Vec::new();
            File::open(path).ok()?.take(most).read_to_end(&mut bytes).ok()?;
            Some(bytes)
        };
        let Some(head) = read(HEAD) else {
            return Kind::Unknown;
        };
        if let Some((_, kind)) = MAGIC.iter().find(|(magic, _)| head.starts_with(magic)) {
            return *kind;
        }
        match (head.get(..4), head.get(4..8), head.get(8..12)) {
            (Some(b"RIFF"), _, Some(b"WEBP")) => return Kind::WebP,
            (_, Some(b"ftyp"), _) => return Kind::Mp4,
            _ => {}
        }
        if head.starts_with(b"#?RADIANCE") {
            let header = String::from_utf8_lossy(&head);
            return if header.contains("NROWS=") {
                Kind::RadianceMatrix
            } else {
                Kind::Hdr
            };
        }
        let text = text::of(&head);
        let start = text.trim_start().to_ascii_lowercase();
        if start.starts_with('{') {
            return of_json(&text::of(&read(MOST_JSON).unwrap_or_default()));
        }
        if ["<!doctype html", "<html"]
            .iter()
            .any(|tag| start.starts_with(tag))
        {
            return Kind::Html;
        }
        if start.starts_with("<svg") || (start.starts_with("<?xml") && start.contains("<svg")) {
            return Kind::Svg;
        }
        let is_text = match std::str::from_utf8(&head) {
            Ok(_) => !head.contains(&0),
            // A letter may be cut in two at the end of the head; UTF-16 has a mark.
            Err(error) => (error.error_len().is_none() || is_utf16(&head)) && !text.contains('\0'),
        };
        match (is_text, start.lines().next().unwrap_or_default().contains(',')) {
            (false, _) => Kind::Unknown,
            (true, true) => Kind::Table,
            (true, false) => Kind::Text,
        }
    }
}

fn is_utf16(bytes: &[u8]) -> bool {
    bytes.starts_with(b"\xff\xfe") || bytes.starts_with(b"\xfe\xff")
}

/// By the names of the fields of the object.
fn of_json(text: &str) -> Kind {
    let fields: Option<BTreeMap<String, IgnoredAny>> = serde_json::from_str(text).ok();
    let has = |name: &str| match &fields {
        Some(fields) => fields.contains_key(name),
        // Broken, or with numbers that JSON doesn't have.
        None => text.contains(&format!("\"{name}\"")),
    };
    match () {
        () if has("relight_sequence") => Kind::Sequence,
        () if has("relight_materials") => Kind::Materials,
        () if has("relight_scene") => Kind::Description,
        () if has("relight_plan") => Kind::Plan,
        () if has("peak_memory_bytes") && has("seconds") && !has("command") => Kind::Log,
        // What commands print of an asset has the field, too.
        () if has("asset") && !has("schema") => Kind::Scene,
        () => Kind::Json,
    }
}

/// What an input is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wanted {
    /// An asset to play, inspect, check, export or report on.
    Asset,
    /// A scene to bake.
    Scene,
    /// `--lights`.
    Lights,
    /// `--materials`.
    Materials,
    /// An image to compare.
    Image,
}

/// Refuses a file that is something else than what is wanted, with the command or the option that takes it. What is not known is
/// left to who reads it.
///
/// # Errors
/// It is of another kind, a folder, or a pipe where a stream is not enough.
pub fn check(path: &Path, wanted: Wanted) -> Result<()> {
    let name = path.display();
    if path.is_dir() {
        let advice = match (wanted, path.join("plan.json").is_file()) {
            (Wanted::Asset, true) => {
                format!("the folder of a plan: relight bake --merge {name} writes its asset")
            }
            _ => format!("a folder; give {}", wanted.name()),
        };
        bail!("{name}: is {advice}");
    }
    if path == Path::new("-") && !path.exists() {
        let advice = match wanted {
            Wanted::Asset | Wanted::Scene => "write what comes through a pipe to a file and give that",
            Wanted::Lights | Wanted::Materials | Wanted::Image => {
                "give /dev/stdin for what comes through a pipe"
            }
        };
        bail!("-: there is no such file; {advice}");
    }
    match wanted {
        Wanted::Asset => check_file(path, "an asset is read here and there, not from front to back")?,
        Wanted::Scene => check_file(path, "a scene is read twice, and what it names lies beside it")?,
        Wanted::Lights | Wanted::Materials | Wanted::Image => {}
    }
    let found = Kind::of(path);
    let Some(advice) = wanted.advice(found, &name.to_string()) else {
        return Ok(());
    };
    bail!("{name}: is {}, not {}; {advice}", found.name(), wanted.name())
}

/// Refuses pipes and devices where a stream is not enough.
///
/// # Errors
/// It is one; `why` says what it is needed for.
pub fn check_file(path: &Path, why: &str) -> Result<()> {
    if path.metadata().is_ok_and(|m| !m.is_file() && !m.is_dir()) {
        bail!(
            "{}: is a pipe or a device, but {why}: write it to a file and give that",
            path.display()
        );
    }
    Ok(())
}

impl Wanted {
    fn name(self) -> &'static str {
        match self {
            Wanted::Asset => "an asset",
            Wanted::Scene => "a scene (.glb, .gltf or .scene.json)",
            Wanted::Lights => "a lighting sequence",
            Wanted::Materials => "a file of material edits",
            Wanted::Image => "an OpenEXR image",
        }
    }

    /// What to do with a file of another kind; `None` for the right kind and for what only its reader can judge.
    fn advice(self, found: Kind, file: &str) -> Option<String> {
        use Wanted::{Asset, Image, Lights, Materials, Scene};
        let play = "relight play ASSET.relight";
        Some(match (self, found) {
            (Asset, Kind::Asset)
            | (Scene, Kind::Scene | Kind::Description)
            | (Lights, Kind::Sequence)
            | (Materials, Kind::Materials)
            | (Image, Kind::Exr)
            | (_, Kind::Unknown | Kind::Empty | Kind::Text | Kind::Table) => return None,
            // Who reads them says which field is missing.
            (Lights | Materials | Scene, Kind::Json) => return None,
            (Asset, Kind::Scene | Kind::Description) => {
                format!("bake it first: relight bake {file} -o {}", asset_of(file))
            }
            (_, Kind::Scene | Kind::Description) => {
                format!(
                    "bake it and play the asset: relight bake {file} -o {}",
                    asset_of(file)
                )
            }
            (Scene, Kind::Asset) => format!("it is baked already: relight play {file} -o frame_####.exr"),
            (_, Kind::Asset) => format!("it goes first: relight play {file} -o frame_####.exr"),
            (_, Kind::Sequence) => format!("it goes with --lights: {play} --lights {file} -o frame_####.exr"),
            (_, Kind::Materials) => {
                format!("it goes with --materials: {play} --materials {file} -o frame_####.exr")
            }
            (Asset, Kind::Exr) => format!("compare images with: relight compare {file} REFERENCE.exr"),
            (Lights, Kind::Hdr | Kind::Exr) => format!(
                "name it in a sequence: {{\"relight_sequence\": 1, \"lights\": [{{\"name\": \"sky\", \"type\": \"environment\", \
                 \"file\": {file:?}}}]}}"
            ),
            (Image, Kind::Png | Kind::Jpeg) => {
                "it holds what a screen shows, not light: give the .exr beside it".into()
            }
            (Asset, Kind::Log) => format!(
                "give the asset beside it, {}",
                file.strip_suffix(".log.json").unwrap_or("ASSET.relight")
            ),
            (_, Kind::Plan) => "give its folder: relight bake --merge DIR writes the asset".into(),
            _ => format!("give {}", self.name()),
        })
    }
}

/// What the asset of a scene would be called.
fn asset_of(scene: &str) -> String {
    let stem = [".scene.json", ".gltf", ".glb"]
        .iter()
        .find_map(|end| scene.strip_suffix(end));
    format!("{}.relight", stem.unwrap_or(scene))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Truth: what the files of `data/` are.
    #[test]
    fn files_are_known_by_how_they_begin() {
        let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("data");
        for (name, kind) in [
            ("cornell.glb", Kind::Scene),
            ("isosurface.scene.json", Kind::Description),
            ("cornell.lights.json", Kind::Sequence),
            ("table_materials.json", Kind::Materials),
            ("sky.hdr", Kind::Hdr),
            ("README.md", Kind::Text),
            ("nothing", Kind::Unknown),
        ] {
            assert_eq!(Kind::of(&data.join(name)), kind, "{name}");
        }
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("f");
        for (bytes, kind) in [
            (&b""[..], Kind::Empty),
            (
                b"\xef\xbb\xbf {\"lights\": [], \"relight_sequence\": 1}",
                Kind::Sequence,
            ),
            (b"{\"relight_sequence\": 1, ", Kind::Sequence),
            (
                b"\xfe\xff\0{\0\"\0r\0e\0l\0i\0g\0h\0t\0_\0s\0e\0q\0u\0e\0n\0c\0e\0\"\0:\0\x31\0}",
                Kind::Sequence,
            ),
            (b"\xff\xfea\0,\0b\0", Kind::Table),
            (b"K\xfcche", Kind::Unknown),
            (b"{\"asset\": {\"version\": \"2.0\"}}", Kind::Scene),
            (b"{}", Kind::Json),
            (b"a,b\n1,2\n", Kind::Table),
            (b"\0\x01\x02", Kind::Unknown),
            (b"#?RADIANCE\nNROWS=2\nNCOLS=2\n", Kind::RadianceMatrix),
        ] {
            std::fs::write(&file, bytes).unwrap();
            assert_eq!(Kind::of(&file), kind, "{}", String::from_utf8_lossy(bytes));
        }
    }
}
