//! Small glTF files, written by hand in test code.
#![allow(dead_code)]

use relight_scene::gltf::{ImportError, ImportOptions, LightUnits, import};
use relight_scene::scene::Scene;
use serde_json::{Value, json};

/// The eight bytes that say PNG; the importer looks no further.
pub const PNG: &[u8] = b"\x89PNG\r\n\x1a\n and no more";

/// A glTF document with one buffer.
#[derive(Clone)]
pub struct Doc {
    pub json: Value,
    pub bin: Vec<u8>,
}

impl Doc {
    /// One node with one triangle, (0,0,0) (1,0,0) (0,1,0), in accessor 0.
    pub fn triangle() -> Doc {
        let mut doc = Doc {
            json: json!({
                "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [0] }], "nodes": [{ "mesh": 0 }],
                "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 } }] }],
                "buffers": [{ "byteLength": 0 }], "bufferViews": [], "accessors": [],
            }),
            bin: Vec::new(),
        };
        doc.floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0], "VEC3");
        doc
    }

    /// Appends bytes as a view; returns its index.
    pub fn view(&mut self, bytes: &[u8]) -> usize {
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        let view = json!({ "buffer": 0, "byteOffset": self.bin.len(), "byteLength": bytes.len() });
        self.bin.extend_from_slice(bytes);
        self.json["buffers"][0]["byteLength"] = self.bin.len().into();
        self.push("/bufferViews", view)
    }

    /// Appends an accessor of floats; returns its index.
    pub fn floats(&mut self, values: &[f32], kind: &str) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|x| x.to_le_bytes()).collect();
        let width = match kind {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            _ => 4,
        };
        self.accessor(&bytes, 5126, values.len() / width, kind)
    }

    /// Appends an accessor of anything; returns its index.
    pub fn accessor(&mut self, bytes: &[u8], component: u32, count: usize, kind: &str) -> usize {
        let view = self.view(bytes);
        self.push(
            "/accessors",
            json!({ "bufferView": view, "componentType": component, "count": count, "type": kind }),
        )
    }

    /// Appends to the array at a JSON pointer; returns the index.
    pub fn push(&mut self, pointer: &str, value: Value) -> usize {
        let array = self
            .json
            .pointer_mut(pointer)
            .and_then(Value::as_array_mut)
            .expect("array");
        array.push(value);
        array.len() - 1
    }

    /// Sets what a JSON pointer names: an existing place, or a new member of an existing object.
    pub fn set(&mut self, pointer: &str, value: Value) -> &mut Self {
        let (parent, key) = pointer.rsplit_once('/').expect("pointer");
        let parent = self
            .json
            .pointer_mut(parent)
            .unwrap_or_else(|| panic!("no {pointer}"));
        match parent.as_array_mut() {
            Some(array) => array[key.parse::<usize>().expect("index")] = value,
            None => parent[key] = value,
        }
        self
    }

    /// As a `.glb`.
    pub fn glb(&self) -> Vec<u8> {
        glb(&serde_json::to_vec(&self.json).expect("json"), &self.bin)
    }

    /// Imports it as a `.glb`.
    pub fn import(&self) -> Result<Scene, ImportError> {
        import_bytes("scene.glb", &self.glb())
    }

    /// Imports it; any error fails the test.
    pub fn scene(&self) -> Scene {
        self.import().unwrap_or_else(|e| panic!("{e}"))
    }

    /// Imports it with other light units.
    pub fn scene_with(&self, light_units: LightUnits) -> Scene {
        let folder = tempfile::tempdir().expect("folder");
        let file = folder.path().join("scene.glb");
        std::fs::write(&file, self.glb()).expect("write");
        let options = ImportOptions {
            light_units,
            variant: None,
        };
        import(&file, &options).unwrap_or_else(|e| panic!("{e}"))
    }
}

/// Joins chunks to a `.glb`.
pub fn glb(json: &[u8], bin: &[u8]) -> Vec<u8> {
    let pad = |bytes: &[u8], with: u8| {
        let mut padded = bytes.to_vec();
        padded.resize(bytes.len().next_multiple_of(4), with);
        padded
    };
    let (json, bin) = (pad(json, b' '), pad(bin, 0));
    let mut bytes = b"glTF\x02\0\0\0".to_vec();
    bytes.extend((28 + json.len() as u32 + bin.len() as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", json), (b"BIN\0", bin)] {
        bytes.extend((chunk.len() as u32).to_le_bytes());
        bytes.extend(kind);
        bytes.extend(chunk);
    }
    bytes
}

/// Imports bytes from a file of that name in a folder of its own.
pub fn import_bytes(name: &str, bytes: &[u8]) -> Result<Scene, ImportError> {
    let folder = tempfile::tempdir().expect("folder");
    let file = folder.path().join(name);
    std::fs::write(&file, bytes).expect("write");
    import(&file, &ImportOptions::default())
}
