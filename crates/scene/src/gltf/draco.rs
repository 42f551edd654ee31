//! KHR_draco_mesh_compression, decoded by the `draco-core` crate.
//!
//! A stream holds all attributes of a primitive and its triangles, where the rest of the importer wants accessors. So the
//! document is rewritten before anything else is read: each stream becomes a buffer, after those of the file, that holds
//! what it decodes to, and the primitive gets accessors of that buffer. Their types and counts are what the file's own
//! accessors declare; a stream that decodes to anything else is refused.

use super::component::Component;
use super::guard::guarded;
use draco_core::{DecodeLimits, DecoderBuffer, Mesh, MeshDecoder};
use serde_json::{Map, Value, json};
use std::collections::HashMap;

/// Name of the extension.
pub(super) const NAME: &str = "KHR_draco_mesh_compression";

/// Bytes of attributes that a vertex may have: sixteen of four floats. The stream may have more of them than the
/// primitive names.
const MOST_VERTEX_BYTES: u64 = 256;

/// A compressed primitive, before its bytes are decoded.
pub(super) struct Stream {
    /// Place of the extension in the JSON.
    pub path: String,
    /// The buffer view that holds it.
    pub view: usize,
    vertices: u64,
    indices: u64,
    /// Bytes that it decodes to.
    pub length: u64,
    parts: Vec<Part>,
}

/// What an accessor reads.
struct Part {
    /// The stream's number of an attribute; `None` for the indices.
    attribute: Option<u32>,
    component: Component,
    width: usize,
    offset: u64,
}

fn index(value: Option<&Value>) -> Option<usize> {
    value?.as_u64().and_then(|index| usize::try_from(index).ok())
}

/// Gives every compressed primitive accessors of what its stream decodes to, and returns the streams by the places of their
/// buffers in the document. Primitives whose extension makes no sense stay as they are, and so do those whose positions and
/// indices are there without compression.
pub(super) fn unfold(root: &mut Value) -> HashMap<String, Stream> {
    let mut streams = HashMap::new();
    let Some(Value::Array(mut meshes)) = root.get_mut("meshes").map(Value::take) else {
        return streams;
    };
    // Primitives that agree in all that matters share accessors, so that they are one mesh.
    let mut known: HashMap<String, Value> = HashMap::new();
    for (i, mesh) in meshes.iter_mut().enumerate() {
        let primitives = mesh.get_mut("primitives").and_then(Value::as_array_mut);
        for (j, primitive) in primitives.into_iter().flatten().enumerate() {
            let Some(extension) = primitive.pointer(&format!("/extensions/{NAME}")) else {
                continue;
            };
            let parts = [
                Some(extension),
                primitive.get("attributes"),
                primitive.get("indices"),
            ];
            let key = json!(parts).to_string();
            if !known.contains_key(&key) {
                let path = format!("meshes[{i}].primitives[{j}].extensions.{NAME}");
                let Some((accessors, buffer, stream)) = unfold_one(root, primitive, path) else {
                    continue;
                };
                streams.insert(buffer, stream);
                known.insert(key.clone(), accessors);
            }
            for part in ["attributes", "indices"] {
                primitive[part] = known[&key][part].clone();
            }
        }
    }
    root["meshes"] = Value::Array(meshes);
    streams
}

/// The accessors of a primitive as its members `attributes` and `indices`, the place of their buffer, and its stream.
fn unfold_one(root: &mut Value, primitive: &Value, path: String) -> Option<(Value, String, Stream)> {
    if primitive
        .get("mode")
        .is_some_and(|mode| mode.as_f64() != Some(4.0))
    {
        return None;
    }
    let extension = primitive.get("extensions")?.get(NAME)?;
    let view = index(extension.get("bufferView"))?;
    let attributes = primitive.get("attributes")?.as_object()?;
    let accessor = |value: Option<&Value>| root.get("accessors")?.get(index(value)?);
    let (positions, corners) = (
        accessor(attributes.get("POSITION"))?,
        accessor(primitive.get("indices"))?,
    );
    if positions.get("bufferView").is_some() && corners.get("bufferView").is_some() {
        return None;
    }
    let count = |accessor: &Value| accessor.get("count").and_then(Value::as_u64);
    let mut stream = Stream {
        path,
        view,
        vertices: count(positions)?,
        indices: count(corners)?,
        length: 0,
        parts: Vec::new(),
    };
    // The new accessors, with where they stand in the primitive; `None` for the indices.
    let mut made: Vec<(Option<&String>, Value)> = Vec::new();
    let mut add = |name, attribute, source: &Value| {
        let component = Component::of(source.get("componentType")?.as_u64()?)?;
        let width = match source.get("type")?.as_str()? {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            _ => return None,
        };
        let bytes = count(source)?.checked_mul(component.bytes() * width as u64)?;
        let (offset, view) = (stream.length, made.len());
        stream.length = offset.checked_add(bytes)?.checked_next_multiple_of(4)?;
        stream.parts.push(Part {
            attribute,
            component,
            width,
            offset,
        });
        let mut accessor = Map::from_iter([
            ("bufferView".to_owned(), view.into()),
            ("byteOffset".to_owned(), offset.into()),
        ]);
        for key in ["componentType", "count", "type", "normalized", "sparse"] {
            accessor.extend(source.get(key).map(|value| (key.to_owned(), value.clone())));
        }
        made.push((name, Value::Object(accessor)));
        Some(())
    };
    for (name, number) in extension.get("attributes")?.as_object()? {
        let Some(source) = accessor(attributes.get(name)) else {
            continue;
        };
        let number = u32::try_from(number.as_u64()?).ok()?;
        // Vertices of another number are not this stream's, and told where the primitive is read.
        if count(source) == count(positions) {
            add(Some(name), Some(number), source)?;
        }
    }
    add(None, None, corners)?;
    let mut unfolded = json!({ "attributes": attributes });
    let buffers = list(root, "buffers")?;
    buffers.push(json!({ "byteLength": stream.length }));
    let buffer = buffers.len() - 1;
    let views = list(root, "bufferViews")?;
    views.push(json!({ "buffer": buffer, "byteLength": stream.length }));
    let view = views.len() - 1;
    let accessors = list(root, "accessors")?;
    for (name, mut accessor) in made {
        accessor["bufferView"] = view.into();
        accessors.push(accessor);
        let number = Value::from(accessors.len() - 1);
        match name {
            Some(name) => unfolded["attributes"][name] = number,
            None => unfolded["indices"] = number,
        }
    }
    Some((unfolded, format!("buffers[{buffer}]"), stream))
}

/// A list of the document, made if it isn't there.
fn list<'a>(root: &'a mut Value, key: &str) -> Option<&'a mut Vec<Value>> {
    let members = root.as_object_mut()?;
    members
        .entry(key)
        .or_insert_with(|| Value::Array(Vec::new()))
        .as_array_mut()
}

impl Stream {
    /// What `bytes` decode to, laid out as the accessors read it.
    ///
    /// # Errors
    /// What is wrong with the stream, as the rest of a sentence about it.
    pub fn decode(&self, bytes: &[u8]) -> Result<Vec<u8>, String> {
        guarded(|| self.decode_mesh(bytes))
    }

    fn decode_mesh(&self, bytes: &[u8]) -> Result<Vec<u8>, String> {
        let limits = DecodeLimits::default()
            .with_max_points(self.vertices)
            .with_max_faces(self.indices / 3)
            .with_max_decoded_bytes(self.vertices.saturating_mul(MOST_VERTEX_BYTES));
        let mut mesh = Mesh::new();
        MeshDecoder::new()
            .decode(&mut DecoderBuffer::new(bytes).with_limits(limits), &mut mesh)
            .map_err(|e| format!("is damaged ({e})"))?;
        let (vertices, corners) = (mesh.num_points(), 3 * mesh.num_faces());
        if vertices as u64 != self.vertices || corners as u64 != self.indices {
            return Err(format!(
                "has {vertices} vertices and {corners} indices, where the accessors declare {} and {}",
                self.vertices, self.indices
            ));
        }
        let mut out = vec![0; self.length as usize];
        for part in &self.parts {
            let out = &mut out[part.offset as usize..];
            match part.attribute {
                Some(number) => {
                    let attribute = mesh
                        .attribute_by_unique_id(number)
                        .ok_or_else(|| format!("has no attribute {number}"))?;
                    put(out, part.component, &attribute.read_f32s(vertices, part.width));
                }
                None => put_indices(out, part.component, &mesh)?,
            }
        }
        Ok(out)
    }
}

/// Writes numbers as a component type. Integers of 8 and 16 bits are exact in floats, and no attribute has longer ones.
fn put(out: &mut [u8], component: Component, values: &[f32]) {
    fn each<const N: usize>(out: &mut [u8], values: &[f32], bytes: impl Fn(f32) -> [u8; N]) {
        for (out, value) in out.as_chunks_mut().0.iter_mut().zip(values) {
            *out = bytes(*value);
        }
    }
    match component {
        Component::I8 => each(out, values, |x| (x as i8).to_le_bytes()),
        Component::U8 => each(out, values, |x| (x as u8).to_le_bytes()),
        Component::I16 => each(out, values, |x| (x as i16).to_le_bytes()),
        Component::U16 => each(out, values, |x| (x as u16).to_le_bytes()),
        Component::U32 => each(out, values, |x| (x as u32).to_le_bytes()),
        Component::F32 => each(out, values, f32::to_le_bytes),
    }
}

fn put_indices(out: &mut [u8], component: Component, mesh: &Mesh) -> Result<(), String> {
    let size = component.bytes() as usize;
    let corners = mesh.faces().iter().flatten();
    for (out, corner) in out.chunks_exact_mut(size).zip(corners) {
        let bytes = corner.0.to_le_bytes();
        if bytes[size..].iter().any(|&byte| byte != 0) {
            return Err(format!("holds index {}, more than {size} bytes can", corner.0));
        }
        out.copy_from_slice(&bytes[..size]);
    }
    Ok(())
}
