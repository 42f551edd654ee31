//! The bytes of buffers, and accessors decoded from them by the gltf crate.
//!
//! The crate answers out-of-range views with silence and bad types with panics, so it only ever sees a
//! document rebuilt from what `layout` checked.

use super::component::Component;
use super::draco;
use super::error::{Fault, ImportError};
use super::json::Faults;
use super::layout::{Accessor, Buffer, Compressed, Layout, Source, Sparse};
use super::uri;
use gltf::accessor::{Item, Iter};
use rayon::prelude::*;
use serde_json::{Value, json};
use std::borrow::Cow;
use std::path::Path;

/// The bytes of a buffer, or why there are none.
pub(super) type Bytes<'a> = Result<Cow<'a, [u8]>, Fault>;

/// Reads every buffer that is not broken, and after them what compressed streams decode to.
pub(super) fn load_buffers<'a>(layout: &Layout, bin: Option<&'a [u8]>, folder: &Path) -> Vec<Bytes<'a>> {
    let load = |i: usize| {
        let fault = |key: &str, message: String| Fault {
            path: format!("buffers[{i}]{key}"),
            message,
        };
        let Some(buffer) = layout.buffers.peek(i) else {
            return Err(fault("", "is broken; export the scene again".into()));
        };
        let bytes = match &buffer.source {
            Source::Nowhere | Source::Draco(_) => {
                return Err(fault("", "holds no data; export the scene again".into()));
            }
            Source::Chunk => Cow::Borrowed(bin.unwrap_or_default()),
            Source::Uri(uri) => uri::decode_data_uri(uri)
                .unwrap_or_else(|| uri::read_relative(folder, uri, buffer.length))
                .map(Cow::Owned)
                .map_err(|message| fault(".uri", message))?,
        };
        if (bytes.len() as u64) < buffer.length {
            return Err(fault(
                ".byteLength",
                format!(
                    "is {}, but there are only {} bytes; copy or export the scene again",
                    buffer.length,
                    bytes.len()
                ),
            ));
        }
        Ok(bytes)
    };
    let mut buffers: Vec<Bytes> = (0..layout.buffers.len()).map(load).collect();
    let decode = |part: &Compressed| -> Bytes<'a> {
        let bytes = buffers[part.buffer].as_ref().map_err(Fault::clone)?;
        let bytes = &bytes[part.offset as usize..(part.offset + part.length) as usize];
        decoded(part.stream.decode(bytes), &part.path)
    };
    let views: Vec<Bytes> = layout.compressed.par_iter().map(decode).collect();
    buffers.extend(views);
    let mut primitives = Vec::new();
    for i in 0..layout.buffers.len() {
        if let Some(Buffer {
            source: Source::Draco(stream),
            ..
        }) = layout.buffers.peek(i)
        {
            primitives.push((i, stream, view_bytes(layout, &buffers, stream.view)));
        }
    }
    let decode = |(i, stream, bytes): (usize, &draco::Stream, Result<&[u8], Fault>)| {
        (
            i,
            bytes.and_then(|bytes| decoded(stream.decode(bytes), &stream.path)),
        )
    };
    let primitives: Vec<(usize, Bytes)> = primitives.into_par_iter().map(decode).collect();
    for (i, bytes) in primitives {
        buffers[i] = bytes;
    }
    buffers
}

/// What a stream at `path` decoded to.
fn decoded<'a>(stream: Result<Vec<u8>, String>, path: &str) -> Bytes<'a> {
    stream.map(Cow::Owned).map_err(|why| Fault {
        path: path.to_owned(),
        message: format!("its stream {why}; copy the file or compress the scene again"),
    })
}

/// The bytes of a view.
fn view_bytes<'b>(layout: &Layout, buffers: &'b [Bytes], view: usize) -> Result<&'b [u8], Fault> {
    let sink = Faults::default();
    let broken = || Fault {
        path: format!("bufferViews[{view}]"),
        message: "is broken; export the scene again".into(),
    };
    let Some(view) = layout.views.get(view, &sink) else {
        return Err(sink.take().pop().unwrap_or_else(broken));
    };
    let bytes = buffers[view.buffer].as_ref().map_err(Fault::clone)?;
    let range = view.offset as usize..(view.offset + view.length) as usize;
    bytes.get(range).ok_or_else(broken)
}

/// Accessors with their bytes.
pub(super) struct Data<'a> {
    pub layout: &'a Layout,
    buffers: &'a [Bytes<'a>],
    document: gltf::Document,
    faults: &'a Faults,
}

impl<'a> Data<'a> {
    /// Joins a layout and its bytes. What is wrong with those that are asked for goes to `faults`.
    ///
    /// # Errors
    /// [`ImportError::Internal`] if the crate rejects what was checked.
    pub fn new(
        file: &Path,
        layout: &'a Layout,
        buffers: &'a [Bytes<'a>],
        faults: &'a Faults,
    ) -> Result<Self, ImportError> {
        let root = crate_json(layout);
        let root: gltf::json::Root = serde_json::from_value(root).map_err(|e| ImportError::Internal {
            file: file.into(),
            message: format!("the checked document is refused: {e}"),
        })?;
        Ok(Data {
            layout,
            buffers,
            document: gltf::Document::from_json_without_validation(root),
            faults,
        })
    }

    /// Bytes of all buffers together.
    pub fn total_bytes(&self) -> u64 {
        self.buffers
            .iter()
            .flatten()
            .map(|bytes| bytes.len() as u64)
            .sum()
    }

    /// The bytes of a view.
    ///
    /// # Errors
    /// What is wrong with it or its buffer.
    pub fn view_bytes(&self, view: usize) -> Result<&[u8], Fault> {
        view_bytes(self.layout, self.buffers, view)
    }

    /// An accessor whose bytes can be decoded.
    fn readable(&self, accessor: usize) -> Option<&'a Accessor> {
        let info = self.layout.accessors.get(accessor, self.faults)?;
        let sparse = info.sparse.as_ref();
        let views = [info.view, sparse.map(|s| s.indices.0), sparse.map(|s| s.values.0)];
        for view in views.into_iter().flatten() {
            if let Err(fault) = self.view_bytes(view) {
                self.faults.add(fault.path, fault.message);
                return None;
            }
        }
        match sparse {
            Some(sparse) => self.check_sparse(accessor, info, sparse).then_some(info),
            None => Some(info),
        }
    }

    /// Reports sparse indices that are out of range or don't rise: the decoder relies on both.
    fn check_sparse(&self, accessor: usize, info: &Accessor, sparse: &Sparse) -> bool {
        let (view, offset, component) = sparse.indices;
        let stride = self.layout.views.peek(view).and_then(|view| view.stride);
        let (Ok(bytes), size) = (self.view_bytes(view), component.bytes() as usize) else {
            return false;
        };
        let bytes = &bytes[offset as usize..];
        let stride = stride.map_or(size, |s| s as usize);
        let mut previous = None;
        for k in 0..sparse.count as usize {
            let mut word = [0; 4];
            word[..size].copy_from_slice(&bytes[k * stride..k * stride + size]);
            let index = u32::from_le_bytes(word);
            if index as usize >= info.count || previous.is_some_and(|p| p >= index) {
                self.faults.add(
                    format!("accessors[{accessor}].sparse.indices"),
                    format!(
                        "element {k} is {index}: they must rise and stay under the accessor's count, {}",
                        info.count
                    ),
                );
                return false;
            }
            previous = Some(index);
        }
        true
    }

    /// Elements of an accessor of `N` components as floats; normalised integers become 0..1 or −1..1 and
    /// plain integers keep their value. Empty if the accessor has another width.
    pub fn vectors<const N: usize>(&self, accessor: usize) -> Vec<[f32; N]>
    where
        [f32; N]: Item,
        [u8; N]: Item,
        [u16; N]: Item,
        [i8; N]: Item,
        [i16; N]: Item,
        [u32; N]: Item,
    {
        let Some(info) = self.readable(accessor).filter(|a| a.width == N) else {
            return Vec::new();
        };
        if info.is_zeros() {
            return vec![[0.0; N]; info.count];
        }
        let n = info.normalized;
        match info.component {
            Component::F32 => self.collect(accessor, |v: [f32; N]| v),
            Component::U8 => self.collect(accessor, |v: [u8; N]| v.map(|x| unsigned(x.into(), n, 255.0))),
            Component::U16 => self.collect(accessor, |v: [u16; N]| v.map(|x| unsigned(x.into(), n, 65535.0))),
            Component::I8 => self.collect(accessor, |v: [i8; N]| v.map(|x| signed(x.into(), n, 127.0))),
            Component::I16 => self.collect(accessor, |v: [i16; N]| v.map(|x| signed(x.into(), n, 32767.0))),
            Component::U32 => self.collect(accessor, |v: [u32; N]| v.map(|x| x as f32)),
        }
    }

    /// Elements of an accessor of 4 × 4 matrices of floats, column by column; empty for any other.
    pub fn matrices(&self, accessor: usize) -> Vec<[[f32; 4]; 4]> {
        let info = self.readable(accessor);
        match info.filter(|a| a.is_matrix_4() && a.component == Component::F32) {
            Some(info) if info.is_zeros() => vec![[[0.0; 4]; 4]; info.count],
            Some(_) => self.collect(accessor, |m: [[f32; 4]; 4]| m),
            None => Vec::new(),
        }
    }

    /// Elements of a scalar accessor as floats, as [`Data::vectors`].
    pub fn scalars(&self, accessor: usize) -> Vec<f32> {
        let Some(info) = self.readable(accessor).filter(|a| a.width == 1) else {
            return Vec::new();
        };
        if info.is_zeros() {
            return vec![0.0; info.count];
        }
        let n = info.normalized;
        match info.component {
            Component::F32 => self.collect(accessor, |x: f32| x),
            Component::U8 => self.collect(accessor, |x: u8| unsigned(x.into(), n, 255.0)),
            Component::U16 => self.collect(accessor, |x: u16| unsigned(x.into(), n, 65535.0)),
            Component::I8 => self.collect(accessor, |x: i8| signed(x.into(), n, 127.0)),
            Component::I16 => self.collect(accessor, |x: i16| signed(x.into(), n, 32767.0)),
            Component::U32 => self.collect(accessor, |x: u32| x as f32),
        }
    }

    /// Elements of a scalar accessor of unsigned integers; empty for any other.
    pub fn indices(&self, accessor: usize) -> Vec<u32> {
        let Some(info) = self.readable(accessor).filter(|a| a.width == 1) else {
            return Vec::new();
        };
        if info.is_zeros() {
            return vec![0; info.count];
        }
        match info.component {
            Component::U8 => self.collect(accessor, |x: u8| x.into()),
            Component::U16 => self.collect(accessor, |x: u16| x.into()),
            Component::U32 => self.collect(accessor, |x: u32| x),
            _ => Vec::new(),
        }
    }

    fn collect<T: Item, R>(&self, accessor: usize, convert: impl Fn(T) -> R) -> Vec<R> {
        let Some(accessor) = self.document.accessors().nth(accessor) else {
            return Vec::new();
        };
        let bytes = |buffer: gltf::Buffer| self.buffers.get(buffer.index())?.as_deref().ok();
        match Iter::<T>::new(accessor, bytes) {
            Some(iter) => iter.map(convert).collect(),
            None => Vec::new(),
        }
    }
}

fn unsigned(x: f32, normalized: bool, max: f32) -> f32 {
    if normalized { x / max } else { x }
}

fn signed(x: f32, normalized: bool, max: f32) -> f32 {
    if normalized { (x / max).max(-1.0) } else { x }
}

/// The checked layout as the JSON that the gltf crate reads: no URIs, no extensions, nothing unchecked.
fn crate_json(layout: &Layout) -> Value {
    // Broken entries become ones that nobody reads, so that indices keep their meaning.
    let buffer = |i| json!({ "byteLength": layout.buffers.peek(i).map_or(1, |b| b.length) });
    let view = |i| {
        let Some(v) = layout.views.peek(i) else {
            return json!({ "buffer": 0, "byteLength": 1 });
        };
        let mut view = json!({ "buffer": v.buffer, "byteOffset": v.offset, "byteLength": v.length });
        if let Some(stride) = v.stride {
            view["byteStride"] = stride.into();
        }
        view
    };
    let accessor = |i| {
        let Some(a) = layout.accessors.peek(i) else {
            return json!({ "componentType": Component::U8 as u32, "count": 1, "type": "SCALAR" });
        };
        let mut accessor = json!({
            "byteOffset": a.offset, "componentType": a.component as u32, "count": a.count,
            "type": a.kind, "normalized": a.normalized,
        });
        if let Some(view) = a.view {
            accessor["bufferView"] = view.into();
        }
        if let Some(s) = &a.sparse {
            accessor["sparse"] = json!({
                "count": s.count,
                "indices": {
                    "bufferView": s.indices.0, "byteOffset": s.indices.1, "componentType": s.indices.2 as u32,
                },
                "values": { "bufferView": s.values.0, "byteOffset": s.values.1 },
            });
        }
        accessor
    };
    let decoded = |c: &Compressed| json!({ "byteLength": c.stream.decoded_bytes() });
    let buffers: Vec<Value> = (0..layout.buffers.len())
        .map(buffer)
        .chain(layout.compressed.iter().map(decoded))
        .collect();
    let views: Vec<Value> = (0..layout.views.len()).map(view).collect();
    let accessors: Vec<Value> = (0..layout.accessors.len()).map(accessor).collect();
    json!({
        "asset": { "version": "2.0" }, "buffers": buffers, "bufferViews": views, "accessors": accessors,
    })
}
