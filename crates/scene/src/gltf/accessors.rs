//! Buffers, buffer views and accessors (glTF 2.0, section 3.6): checked against each other and against the
//! real bytes first, then decoded by the gltf crate.
//!
//! The crate answers out-of-range views with silence and bad types with panics, so it only ever sees a
//! document rebuilt from what was checked here.

use super::error::{Fault, ImportError};
use super::extensions::advice;
use super::json::{At, Faults};
use super::list::List;
use super::notes::Notes;
use super::uri;
use gltf::accessor::{Item, Iter};
use serde_json::{Value, json};
use std::borrow::Cow;
use std::path::Path;

/// Bytes read for one scene, all buffers and images together: far above any scene that fits in memory with
/// its acceleration structure, low enough to stop a small file that names a big one many times.
pub(super) const MAX_BYTES: u64 = 4 << 30;

/// A buffer, before its bytes are read.
pub(super) struct Buffer {
    /// `None`: the binary chunk of a `.glb`.
    pub uri: Option<String>,
    /// Bytes that it must have.
    pub length: u64,
}

/// A checked part of a buffer.
pub(super) struct View {
    pub buffer: usize,
    pub offset: u64,
    pub length: u64,
    pub stride: Option<u64>,
}

/// A checked accessor: its bytes lie in its view, its view in its buffer.
pub(super) struct Accessor {
    pub view: Option<usize>,
    pub offset: u64,
    pub component: Component,
    /// Components per element; 0 stands for a matrix, as skins alone have.
    pub width: usize,
    pub count: usize,
    pub normalized: bool,
    pub sparse: Option<Sparse>,
    kind: String,
}

impl Accessor {
    /// Whether its elements are matrices of 4 × 4.
    pub fn is_matrix_4(&self) -> bool {
        self.kind == "MAT4"
    }

    /// Whether all elements, if any, are 0 without a byte that says so.
    fn is_zeros(&self) -> bool {
        self.count == 0 || (self.view.is_none() && self.sparse.is_none())
    }
}

/// Elements that replace those of the view.
pub(super) struct Sparse {
    count: u64,
    indices: (usize, u64, Component),
    values: (usize, u64),
}

/// Component types, with the numbers glTF inherits from OpenGL.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Component {
    I8 = 5120,
    U8 = 5121,
    I16 = 5122,
    U16 = 5123,
    U32 = 5125,
    F32 = 5126,
}

impl Component {
    fn parse(at: &At) -> Option<Component> {
        let code = at.required_uint("componentType")?;
        use Component::*;
        let found = [I8, U8, I16, U16, U32, F32]
            .into_iter()
            .find(|c| *c as u64 == code);
        if found.is_none() {
            at.fault_at(
                "componentType",
                format!("is {code}; glTF knows 5120, 5121, 5122, 5123, 5125 and 5126"),
            );
        }
        found
    }

    fn bytes(self) -> u64 {
        match self {
            Component::I8 | Component::U8 => 1,
            Component::I16 | Component::U16 => 2,
            Component::U32 | Component::F32 => 4,
        }
    }
}

/// What the JSON says about data.
pub(super) struct Layout {
    pub buffers: List<Buffer>,
    pub views: List<View>,
    pub accessors: List<Accessor>,
}

impl Layout {
    /// Reads and checks buffers, views and accessors.
    pub fn parse(root: &At, has_bin: bool, notes: &mut Notes) -> Layout {
        let mut total = 0u64;
        let buffers = List::parse(root, "buffers", |at| {
            // Only the first one may mean the binary chunk.
            let buffer = parse_buffer(at, has_bin && at.path == "buffers[0]")?;
            total = total.saturating_add(buffer.length);
            Some(buffer)
        });
        if total > MAX_BYTES {
            root.fault_at(
                "buffers",
                format!("declare {total} bytes together; at most {MAX_BYTES} are read: split the scene"),
            );
        }
        let views = List::parse(root, "bufferViews", |at| parse_view(at, &buffers, notes));
        let accessors = List::parse(root, "accessors", |at| parse_accessor(at, &views, notes));
        Layout {
            buffers,
            views,
            accessors,
        }
    }
}

impl Layout {
    /// Notes what is wrong with what nobody used.
    pub fn note_unused(&self, notes: &mut Notes) {
        self.accessors.note_unused(notes);
        self.views.note_unused(notes);
        self.buffers.note_unused(notes);
    }
}

fn parse_buffer(at: &At, is_bin: bool) -> Option<Buffer> {
    let length = at.required_uint("byteLength")?;
    let uri = at.text("uri").map(str::to_owned);
    if uri.is_none() && !is_bin {
        let compressed = ["EXT_meshopt_compression", "KHR_meshopt_compression"]
            .into_iter()
            .find(|name| at.extension(name).is_some());
        at.fault(match compressed {
            Some(name) => format!("holds no data, because {name} compressed it: {}", advice(name)),
            None => {
                "has no uri, and there is no binary chunk that it could mean; export the scene again".into()
            }
        });
        return None;
    }
    if length > MAX_BYTES {
        at.fault_at(
            "byteLength",
            format!("is {length}; at most {MAX_BYTES} bytes are read: split the scene"),
        );
        return None;
    }
    Some(Buffer { uri, length })
}

fn parse_view(at: &At, buffers: &List<Buffer>, notes: &mut Notes) -> Option<View> {
    let buffer = at.required_index("buffer", buffers.len(), "buffers")?;
    let length = at.required_uint("byteLength")?;
    let offset = at.uint("byteOffset").unwrap_or(0);
    // 0 is what older exporters write for elements without gaps. Any other stride means one thing, too.
    let stride = at.uint("byteStride");
    if stride.is_some_and(|stride| !(4..=252).contains(&stride)) {
        notes.count("buffer views with a byteStride that is not 4 to 252", 1);
    }
    let stride = stride.filter(|&stride| stride != 0);
    let available = buffers.get(buffer, at.faults())?.length;
    if offset.checked_add(length).is_none_or(|end| end > available) {
        at.fault(format!(
            "covers {length} bytes from {offset}, but buffers[{buffer}] has {available}; export the scene again"
        ));
        return None;
    }
    Some(View {
        buffer,
        offset,
        length,
        stride,
    })
}

/// Reports a fault unless `count` elements of `size` bytes from `offset` lie in the view.
fn check_range(at: &At, views: &List<View>, view: usize, offset: u64, count: u64, size: u64) -> Option<()> {
    let v = views.get(view, at.faults())?;
    let stride = v.stride.unwrap_or(size);
    if stride < size {
        at.fault(format!(
            "has elements of {size} bytes, more than the stride of bufferViews[{view}], {stride}"
        ));
        return None;
    }
    let end = (count - 1)
        .checked_mul(stride)
        .and_then(|bytes| bytes.checked_add(size)?.checked_add(offset));
    if end.is_none_or(|end| end > v.length) {
        at.fault(format!(
            "needs {count} elements of {size} bytes, {stride} apart, from byte {offset}, but bufferViews[{view}] \
             has {} bytes; export the scene again",
            v.length
        ));
        return None;
    }
    Some(())
}

fn parse_accessor(at: &At, views: &List<View>, notes: &mut Notes) -> Option<Accessor> {
    let component = Component::parse(at);
    let count = at.required_uint("count");
    let kind = at.text("type");
    let (width, columns) = match kind {
        Some("SCALAR") => (1, 1),
        Some("VEC2") => (2, 1),
        Some("VEC3") => (3, 1),
        Some("VEC4") => (4, 1),
        Some("MAT2") => (2, 2),
        Some("MAT3") => (3, 3),
        Some("MAT4") => (4, 4),
        Some(other) => {
            at.fault_at(
                "type",
                format!("is \"{other}\"; glTF knows SCALAR, VEC2 to VEC4 and MAT2 to MAT4"),
            );
            return None;
        }
        None => {
            if at.get("type").is_none() {
                at.fault_at("type", "is missing");
            }
            return None;
        }
    };
    let (component, count) = (component?, count?);
    // Columns of matrices start at multiples of four bytes.
    let column = width as u64 * component.bytes();
    let size = match columns {
        1 => column,
        _ => column.next_multiple_of(4) * columns,
    };
    let offset = at.uint("byteOffset").unwrap_or(0);
    // An empty accessor reads nothing, wherever it says that it would.
    let is_empty = count == 0;
    notes.count("accessors of 0 elements", u64::from(is_empty));
    let view = match at.get("bufferView") {
        Some(_) if is_empty => None,
        Some(_) => Some(at.index("bufferView", views.len(), "bufferViews")?),
        None => None,
    };
    if let Some(view) = view {
        check_range(at, views, view, offset, count, size)?;
    }
    let sparse = match at.object("sparse") {
        _ if is_empty => None,
        Some(sparse) => Some(parse_sparse(&sparse, views, count, size)?),
        None if at.get("sparse").is_some() => return None,
        None => None,
    };
    Some(Accessor {
        view,
        offset,
        component,
        width: if columns == 1 { width } else { 0 },
        count: usize::try_from(count).ok()?,
        normalized: at.flag("normalized"),
        sparse,
        kind: kind?.to_owned(),
    })
}

fn parse_sparse(at: &At, views: &List<View>, accessor_count: u64, size: u64) -> Option<Sparse> {
    let count = at.required_uint("count")?;
    if count == 0 || count > accessor_count {
        at.fault_at(
            "count",
            format!("is {count}; it must be 1 to the accessor's count, {accessor_count}"),
        );
        return None;
    }
    let part = |key: &str| {
        let part = at.object(key);
        if part.is_none() {
            at.fault_at(key, "is missing");
        }
        part
    };
    let (indices, values) = (part("indices"), part("values"));
    let (indices, values) = (indices?, values?);
    let component = Component::parse(&indices)?;
    if !matches!(component, Component::U8 | Component::U16 | Component::U32) {
        indices.fault_at("componentType", "must be 5121, 5123 or 5125 (unsigned integers)");
        return None;
    }
    let place = |at: &At, size| {
        let view = at.required_index("bufferView", views.len(), "bufferViews")?;
        let offset = at.uint("byteOffset").unwrap_or(0);
        check_range(at, views, view, offset, count, size)?;
        Some((view, offset))
    };
    let (i, v) = (place(&indices, component.bytes()), place(&values, size));
    let (i, v) = (i?, v?);
    Some(Sparse {
        count,
        indices: (i.0, i.1, component),
        values: v,
    })
}

/// The bytes of a buffer, or why there are none.
pub(super) type Bytes<'a> = Result<Cow<'a, [u8]>, Fault>;

/// Reads every buffer that is not broken.
pub(super) fn load_buffers<'a>(layout: &Layout, bin: Option<&'a [u8]>, folder: &Path) -> Vec<Bytes<'a>> {
    let load = |i: usize| {
        let fault = |key: &str, message: String| Fault {
            path: format!("buffers[{i}]{key}"),
            message,
        };
        let Some(buffer) = layout.buffers.peek(i) else {
            return Err(fault("", "is broken; export the scene again".into()));
        };
        let bytes = match &buffer.uri {
            None => Cow::Borrowed(bin.unwrap_or_default()),
            Some(uri) => uri::decode_data_uri(uri)
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
    (0..layout.buffers.len()).map(load).collect()
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
        let sink = Faults::default();
        let broken = || Fault {
            path: format!("bufferViews[{view}]"),
            message: "is broken; export the scene again".into(),
        };
        let Some(view) = self.layout.views.get(view, &sink) else {
            return Err(sink.take().pop().unwrap_or_else(broken));
        };
        let bytes = self.buffers[view.buffer].as_ref().map_err(Fault::clone)?;
        let range = view.offset as usize..(view.offset + view.length) as usize;
        bytes.get(range).ok_or_else(broken)
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
    let buffers: Vec<Value> = (0..layout.buffers.len()).map(buffer).collect();
    let views: Vec<Value> = (0..layout.views.len()).map(view).collect();
    let accessors: Vec<Value> = (0..layout.accessors.len()).map(accessor).collect();
    json!({
        "asset": { "version": "2.0" }, "buffers": buffers, "bufferViews": views, "accessors": accessors,
    })
}
