//! What the tests share: the program, scenes, and a small asset that is baked once.

use assert_cmd::Command;
use relight_scene::image::{FloatImage, Layers};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Child;
use std::sync::OnceLock;
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// The program, quiet where nobody listens.
pub fn relight() -> Command {
    Command::new(env!("CARGO_BIN_EXE_relight"))
}

/// Sends a signal, such as `-TERM`, to a child.
pub fn send(signal: &str, child: &Child) {
    let mut kill = Command::new("kill");
    kill.args([signal, &child.id().to_string()]).assert().success();
}

/// Longest that a program may take to stop, seconds.
pub const STOPS_WITHIN: f64 = 2.0;

/// A child that was told to stop, from when that was.
pub struct Stopping {
    start: Instant,
    /// Processor time of all that runs, and of the child.
    busy: f64,
    own: f64,
}

impl Stopping {
    /// From now on.
    pub fn now(child: &Child) -> Stopping {
        Stopping {
            start: Instant::now(),
            busy: processors().unwrap_or_default(),
            own: process(child).map(|(_, own)| own).unwrap_or_default(),
        }
    }

    /// Seconds until the child has ended, which nobody has waited for: those on the clock, less what others had of the machine
    /// meanwhile, in seconds of all its cores (where the system tells that). So a machine that does nothing else is judged by the
    /// clock, and one that runs other tests by what was left for the child.
    pub fn seconds(&self, child: &Child) -> f64 {
        let own = loop {
            match process(child) {
                Some(('Z', own)) => break Some(own),
                Some(_) => std::thread::sleep(Duration::from_millis(5)),
                None => break None,
            }
        };
        let clock = self.start.elapsed().as_secs_f64();
        let cores = std::thread::available_parallelism().map_or(1.0, |n| n.get() as f64);
        let others = (own.zip(processors())).map_or(0.0, |(own, busy)| (busy - self.busy) - (own - self.own));
        clock - others.max(0.0) / cores
    }
}

/// Ticks of the processor times that Linux tells.
const TICKS: f64 = 100.0;

/// State and processor time of a child that nobody has waited for, seconds; `None` where `/proc` doesn't tell.
fn process(child: &Child) -> Option<(char, f64)> {
    let text = std::fs::read_to_string(format!("/proc/{}/stat", child.id())).ok()?;
    // The name, in parentheses, may hold anything.
    let fields: Vec<&str> = text[text.rfind(')')? + 1..].split_whitespace().collect();
    let time = |at: usize| fields.get(at)?.parse::<f64>().ok();
    Some((fields.first()?.chars().next()?, (time(11)? + time(12)?) / TICKS))
}

/// Seconds that all cores together were not idle; `None` where `/proc` doesn't tell.
fn processors() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/stat").ok()?;
    let times: Vec<f64> = (text.lines().next()?.split_whitespace().skip(1))
        .filter_map(|time| time.parse().ok())
        .collect();
    // User, nice, system, idle, waiting for disks, interrupts of two kinds, stolen.
    let idle = times.get(3)? + times.get(4)?;
    Some((times.iter().take(8).sum::<f64>() - idle) / TICKS)
}

/// A file of `data/`.
pub fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("data").join(name)
}

/// Options that make a bake of the Cornell box (0.55 m) take a fraction of a second.
pub const TINY: [&str; 6] = ["--levels", "2", "--sender-levels", "1", "--coarse-radius", "0.1"];

/// One point light.
pub const TINY_LIGHT: &str = r#"{ "relight_sequence": 1, "lights": [
    { "name": "lamp", "type": "point", "position": [0.2, 0.4, 0.1], "intensity": [0.3, 0.2, 0.1] } ] }"#;

/// A folder that the test owns.
pub fn folder() -> TempDir {
    tempfile::tempdir().unwrap()
}

/// The Cornell box, baked once for all tests.
pub fn cornell() -> &'static Path {
    static ASSET: OnceLock<(TempDir, PathBuf)> = OnceLock::new();
    &ASSET
        .get_or_init(|| {
            let folder = folder();
            let asset = folder.path().join("cornell.relight");
            relight()
                .arg("bake")
                .arg(data("cornell.glb"))
                .arg("-o")
                .arg(&asset)
                .args(TINY)
                .assert()
                .success();
            (folder, asset)
        })
        .1
}

/// Bakes; the JSON that it prints.
pub fn bake_json(scene: &Path, asset: &Path, more: &[&str]) -> Value {
    let output = relight()
        .arg("bake")
        .arg(scene)
        .arg("-o")
        .arg(asset)
        .args(more)
        .arg("--json")
        .assert()
        .success()
        .get_output()
        .clone();
    json(&output.stdout)
}

/// What `inspect --json` prints of an asset.
pub fn inspect_json(asset: &Path) -> Value {
    let mut inspect = relight();
    let run = inspect.arg("inspect").arg(asset).arg("--json").assert().success();
    json(&run.get_output().stdout)
}

/// The Cornell box's asset with its links changed, in a folder.
pub fn with_broken_links(folder: &Path, damage: impl FnOnce(&mut [u8])) -> PathBuf {
    let mut bytes = std::fs::read(cornell()).unwrap();
    let summary = relight_format::summarise(&bytes).unwrap();
    let links = summary.sections.iter().find(|s| s.name == "links_transfer");
    let (start, length) = links
        .map(|s| (s.offset as usize, s.stored_bytes as usize))
        .unwrap();
    damage(&mut bytes[start..start + length]);
    let broken = folder.join("broken.relight");
    std::fs::write(&broken, bytes).unwrap();
    broken
}

/// Writes a sequence of one environment map of the same folder; returns its path.
pub fn sky(folder: &Path, map: &str) -> PathBuf {
    let light = format!(r#"{{ "name": "sky", "type": "environment", "file": "{map}" }}"#);
    let text = format!(r#"{{ "relight_sequence": 1, "lights": [ {light} ] }}"#);
    sequence(folder, &format!("{map}.json"), &text)
}

/// Whether no pixel of a layer is lit.
pub fn is_dark(layers: &Layers, layer: &str) -> bool {
    let layer = layers.rgb(layer).unwrap();
    layer.pixels.iter().all(|p| *p == [0.0; 3])
}

/// Sum of the channels, mean over the pixels.
pub fn mean(image: &FloatImage) -> f64 {
    let sum: f64 = image.pixels.iter().flatten().map(|&v| f64::from(v)).sum();
    sum / image.pixels.len() as f64
}

/// The one JSON object on stdout.
pub fn json(stdout: &[u8]) -> Value {
    let value: Value = serde_json::from_slice(stdout).expect("stdout is exactly one JSON value");
    assert!(value.is_object());
    assert_eq!(value["schema"], 1);
    value
}

/// Runs a command that must fail with `code`, and returns what it said: one paragraph that begins with the
/// program's name.
pub fn complaint(command: &mut Command, code: i32) -> String {
    let output = command.assert().code(code).get_output().clone();
    let text = String::from_utf8(output.stderr).unwrap();
    let message = text
        .split("relight: error: ")
        .nth(1)
        .unwrap_or_else(|| panic!("no error in {text:?}"))
        .trim();
    assert!(!message.contains("\n\n"), "more than one paragraph: {message}");
    assert!(!message.contains("panicked"), "{message}");
    assert!(output.stdout.is_empty());
    message.to_owned()
}

/// Names in a folder, sorted.
pub fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = std::fs::read_dir(folder)
        .unwrap()
        .map(|e| e.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

/// Writes a glTF of unindexed triangles with a camera at (0, 0, 3) that looks along −Z; returns its path.
pub fn gltf(folder: &Path, vertices: &[[f32; 3]]) -> PathBuf {
    let bytes: Vec<u8> = vertices
        .as_flattened()
        .iter()
        .flat_map(|v| v.to_le_bytes())
        .collect();
    std::fs::write(folder.join("scene.bin"), &bytes).unwrap();
    let finite = |pick: fn(f32, f32) -> f32, start: f32| -> Vec<f32> {
        (0..3)
            .map(|axis| {
                vertices
                    .iter()
                    .map(|v| v[axis])
                    .filter(|v| v.is_finite())
                    .fold(start, pick)
            })
            .collect()
    };
    let document = serde_json::json!({
        "asset": { "version": "2.0" },
        "scene": 0,
        "scenes": [{ "nodes": [0, 1] }],
        "nodes": [{ "mesh": 0 }, { "name": "Front", "camera": 0, "translation": [0, 0, 3] }],
        "cameras": [{ "type": "perspective", "perspective": { "yfov": 0.8, "znear": 0.1 } }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 } }] }],
        "buffers": [{ "uri": "scene.bin", "byteLength": bytes.len() }],
        "bufferViews": [{ "buffer": 0, "byteLength": bytes.len() }],
        "accessors": [{
            "bufferView": 0, "componentType": 5126, "type": "VEC3", "count": vertices.len(),
            "min": finite(f32::min, f32::MAX), "max": finite(f32::max, f32::MIN),
        }],
    });
    let path = folder.join("scene.gltf");
    std::fs::write(&path, document.to_string()).unwrap();
    path
}

/// A square of 2 m around the origin that faces +Z.
pub const SQUARE: [[f32; 3]; 6] = [
    [-1.0, -1.0, 0.0],
    [1.0, -1.0, 0.0],
    [1.0, 1.0, 0.0],
    [-1.0, -1.0, 0.0],
    [1.0, 1.0, 0.0],
    [-1.0, 1.0, 0.0],
];

/// Writes a lighting sequence; returns its path.
pub fn sequence(folder: &Path, name: &str, text: &str) -> PathBuf {
    let path = folder.join(name);
    std::fs::write(&path, text).unwrap();
    path
}

/// A copy of a .glb scene with its JSON changed.
pub fn edited(scene: &Path, copy: &Path, edit: impl FnOnce(&mut Value)) {
    let bytes = std::fs::read(scene).unwrap();
    let length = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    let end = 20 + length(12);
    let mut json: Value = serde_json::from_slice(&bytes[20..end]).unwrap();
    edit(&mut json);
    let mut text = json.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut out = bytes[..8].to_vec();
    let total = (20 + text.len() + bytes.len() - end) as u32;
    out.extend(total.to_le_bytes());
    out.extend((text.len() as u32).to_le_bytes());
    out.extend(b"JSON");
    out.extend(text);
    out.extend(&bytes[end..]);
    std::fs::write(copy, out).unwrap();
}

/// A level white square of 10 m under a camera that sees nothing else, baked.
pub fn yard(folder: &Path) -> PathBuf {
    let corners: [[f32; 3]; 6] = [
        [-5.0, 0.0, 5.0],
        [5.0, 0.0, 5.0],
        [5.0, 0.0, -5.0],
        [-5.0, 0.0, 5.0],
        [5.0, 0.0, -5.0],
        [-5.0, 0.0, -5.0],
    ];
    let bytes: Vec<u8> = corners
        .as_flattened()
        .iter()
        .flat_map(|x| x.to_le_bytes())
        .collect();
    std::fs::write(folder.join("yard.bin"), &bytes).unwrap();
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let document = serde_json::json!({
        "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [0, 1] }],
        "nodes": [{ "mesh": 0 }, { "camera": 0, "translation": [0, 2, 0], "rotation": [-half, 0, 0, half] }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "material": 0 }] }],
        "materials": [{ "pbrMetallicRoughness": { "baseColorFactor": [1, 1, 1, 1], "metallicFactor": 0 } }],
        "cameras": [{ "type": "perspective", "perspective": { "yfov": 0.8, "aspectRatio": 1, "znear": 0.1 } }],
        "buffers": [{ "uri": "yard.bin", "byteLength": bytes.len() }],
        "bufferViews": [{ "buffer": 0, "byteLength": bytes.len() }],
        "accessors": [{ "bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 6 }],
    });
    let scene = folder.join("yard.gltf");
    std::fs::write(&scene, document.to_string()).unwrap();
    let asset = folder.join("yard.relight");
    let mut bake = relight();
    bake.arg("bake").arg(&scene).arg("-o").arg(&asset);
    bake.args(["--preset", "draft", "--lambert"]).assert().success();
    asset
}
