//! Buffers, buffer views and accessors (glTF 2.0, section 3.6) as the JSON has them: checked against each other before
//! anything is read, so that accessors lie in their views and views in their buffers.
//!
//! A compressed view (`meshopt`) lies in a buffer of its own, which is what its stream decodes to.

use super::component::Component;
use super::draco;
use super::json::At;
use super::list::List;
use super::meshopt::{self, Stream};
use super::notes::Notes;
use std::collections::HashMap;

/// Bytes read for one scene, all buffers and images together: far above any scene that fits in memory with
/// its acceleration structure, low enough to stop a small file that names a big one many times.
pub(super) const MAX_BYTES: u64 = 4 << 30;

/// Bytes that compressed views may decode to for each byte of the buffers, and for a small file. Streams of equal
/// elements shrink to a thousandth, but a scene has others beside them.
const DECODED_PER_BYTE: u64 = 256;
const FREE_DECODED: u64 = 64 << 20;

/// Where a buffer's bytes are.
pub(super) enum Source {
    /// The binary chunk of a `.glb`.
    Chunk,
    Uri(String),
    /// Nowhere: it stands for what compressed views decode to.
    Nowhere,
    /// What a compressed primitive decodes to.
    Draco(draco::Stream),
}

/// A buffer, before its bytes are read.
pub(super) struct Buffer {
    pub source: Source,
    /// Bytes that it must have.
    pub length: u64,
}

/// A part of a buffer that a stream decodes from.
pub(super) struct Compressed {
    /// Place of the extension in the JSON.
    pub path: String,
    pub buffer: usize,
    pub offset: u64,
    pub length: u64,
    pub stream: Stream,
}

/// A checked part of a buffer.
pub(super) struct View {
    /// Of the file's buffers or, counted on after them, of the compressed streams.
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
    /// `type` as the file has it.
    pub kind: String,
}

impl Accessor {
    /// Whether its elements are matrices of 4 × 4.
    pub fn is_matrix_4(&self) -> bool {
        self.kind == "MAT4"
    }

    /// Whether all elements, if any, are 0 without a byte that says so.
    pub fn is_zeros(&self) -> bool {
        self.count == 0 || (self.view.is_none() && self.sparse.is_none())
    }
}

/// Elements that replace those of the view.
pub(super) struct Sparse {
    pub count: u64,
    /// View, offset and type.
    pub indices: (usize, u64, Component),
    /// View and offset.
    pub values: (usize, u64),
}

/// What the JSON says about data.
pub(super) struct Layout {
    pub buffers: List<Buffer>,
    /// Streams that views are decoded from.
    pub compressed: Vec<Compressed>,
    pub views: List<View>,
    pub accessors: List<Accessor>,
}

impl Layout {
    /// Reads and checks buffers, views and accessors. `streams` says which buffers are compressed primitives, by place
    /// ([`draco::unfold`]).
    pub fn parse(
        root: &At,
        has_bin: bool,
        mut streams: HashMap<String, draco::Stream>,
        notes: &mut Notes,
    ) -> Layout {
        let (mut total, mut decoded) = (0u64, 0u64);
        let buffers = List::parse(root, "buffers", |at| {
            if let Some(stream) = streams.remove(&at.path) {
                let length = stream.length;
                decoded = decoded.saturating_add(length);
                let source = Source::Draco(stream);
                return Some(Buffer { source, length });
            }
            // Only the first one may mean the binary chunk.
            let buffer = parse_buffer(at, has_bin && at.path == "buffers[0]")?;
            if !matches!(buffer.source, Source::Nowhere) {
                total = total.saturating_add(buffer.length);
            }
            Some(buffer)
        });
        let mut compressed = Vec::new();
        let views = List::parse(root, "bufferViews", |at| {
            match meshopt::NAMES.iter().find_map(|name| at.extension(name)) {
                Some(extension) => {
                    let view = parse_compressed(&extension, at, &buffers, notes)?;
                    compressed.push(view.1);
                    let buffer = buffers.len() + compressed.len() - 1;
                    Some(View { buffer, ..view.0 })
                }
                None => parse_view(at, &buffers, notes),
            }
        });
        for part in &compressed {
            decoded = decoded.saturating_add(part.stream.decoded_bytes().unwrap_or(u64::MAX));
        }
        let most = total
            .saturating_mul(DECODED_PER_BYTE)
            .clamp(FREE_DECODED, MAX_BYTES);
        if total > MAX_BYTES {
            root.fault_at(
                "buffers",
                format!("declare {total} bytes together; at most {MAX_BYTES} are read: split the scene"),
            );
        } else if decoded > most {
            root.fault_at(
                "buffers",
                format!(
                    "decompress to {decoded} bytes from {total}; at most {most} are read: split the scene, \
                     or export it without compression"
                ),
            );
        }
        let accessors = List::parse(root, "accessors", |at| parse_accessor(at, &views, notes));
        Layout {
            buffers,
            compressed,
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
    let source = match at.text("uri") {
        Some(uri) => Source::Uri(uri.to_owned()),
        None if at.get("uri").is_some() => return None,
        None if is_bin => Source::Chunk,
        None => Source::Nowhere,
    };
    if length > MAX_BYTES {
        at.fault_at(
            "byteLength",
            format!("is {length}; at most {MAX_BYTES} bytes are read: split the scene"),
        );
        return None;
    }
    Some(Buffer { source, length })
}

/// A stride that means something, else elements have no gaps.
fn parse_stride(at: &At, notes: &mut Notes) -> Option<u64> {
    // 0 is what older exporters write for elements without gaps. Any other stride means one thing, too.
    let stride = at.uint("byteStride");
    if stride.is_some_and(|stride| !(4..=252).contains(&stride)) {
        notes.count("buffer views with a byteStride that is not 4 to 252", 1);
    }
    stride.filter(|&stride| stride != 0)
}

/// Buffer, offset and length of a part of a buffer that has bytes.
fn parse_part(at: &At, buffers: &List<Buffer>) -> Option<(usize, u64, u64)> {
    let buffer = at.required_index("buffer", buffers.len(), "buffers")?;
    let length = at.required_uint("byteLength")?;
    let offset = at.uint("byteOffset").unwrap_or(0);
    let Buffer {
        source,
        length: available,
    } = buffers.get(buffer, at.faults())?;
    if matches!(source, Source::Nowhere) {
        at.faults().add(
            format!("buffers[{buffer}]"),
            "has no uri, and there is no binary chunk that it could mean; export the scene again",
        );
        return None;
    }
    if offset.checked_add(length).is_none_or(|end| end > *available) {
        at.fault(format!(
            "covers {length} bytes from {offset}, but buffers[{buffer}] has {available}; export the scene again"
        ));
        return None;
    }
    Some((buffer, offset, length))
}

fn parse_view(at: &At, buffers: &List<Buffer>, notes: &mut Notes) -> Option<View> {
    let stride = parse_stride(at, notes);
    let (buffer, offset, length) = parse_part(at, buffers)?;
    Some(View {
        buffer,
        offset,
        length,
        stride,
    })
}

/// A view whose bytes are compressed, and its stream. Where the view says that the bytes are without compression nobody
/// looks: the place may be empty.
fn parse_compressed(
    extension: &At,
    at: &At,
    buffers: &List<Buffer>,
    notes: &mut Notes,
) -> Option<(View, Compressed)> {
    let stride = parse_stride(at, notes);
    let stream = Stream::parse(extension);
    let part = parse_part(extension, buffers);
    let declared = at.required_uint("byteLength")?;
    let (stream, (buffer, offset, length)) = (stream?, part?);
    if stream.decoded_bytes() != Some(declared) {
        at.fault_at(
            "byteLength",
            format!("is {declared}, but its stream has count times byteStride; compress the scene again"),
        );
        return None;
    }
    if stream.fewest_bytes() > length {
        extension.fault_at(
            "count",
            format!("is more than a stream of {length} bytes can hold; compress the scene again"),
        );
        return None;
    }
    let view = View {
        buffer: 0,
        offset: 0,
        length: declared,
        stride,
    };
    let path = extension.path.clone();
    Some((
        view,
        Compressed {
            path,
            buffer,
            offset,
            length,
            stream,
        },
    ))
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
