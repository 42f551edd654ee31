//! Modes 1 and 2: lists of triangles and sequences of indices (KHR_meshopt_compression, appendix A).
//!
//! Triangles lean on edges and vertices of those just before, which two queues of 16 entries keep; a sequence leans on
//! either of two indices.

/// What the queues hold before anything was put in; no index of glTF is as large.
const NOTHING: u32 = u32::MAX;

/// The table at the end of a stream of triangles.
const TABLE_BYTES: usize = 16;

/// Bytes at the end of a sequence, which mean nothing.
const SEQUENCE_TAIL: usize = 4;

/// Bytes that a stream of so many indices has at least: header, a byte a triangle, table.
pub(super) fn fewest_triangle_bytes(count: u64) -> u64 {
    (count / 3).saturating_add(1 + TABLE_BYTES as u64)
}

/// Bytes that a sequence of so many indices has at least: header, a byte an index, tail.
pub(super) fn fewest_sequence_bytes(count: u64) -> u64 {
    count.saturating_add(1 + SEQUENCE_TAIL as u64)
}

/// Indices as little-endian integers of 2 or 4 bytes.
///
/// # Errors
/// An index that two bytes cannot hold.
pub(super) fn pack(indices: &[u32], stride: usize) -> Result<Vec<u8>, String> {
    if stride == 4 {
        return Ok(indices.iter().flat_map(|index| index.to_le_bytes()).collect());
    }
    let mut bytes = Vec::with_capacity(2 * indices.len());
    for index in indices {
        let short =
            u16::try_from(*index).map_err(|_| format!("holds index {index}, more than two bytes can"))?;
        bytes.extend(short.to_le_bytes());
    }
    Ok(bytes)
}

/// The last sixteen of something, newest first.
struct Queue<T> {
    entries: [T; 16],
    next: usize,
}

impl<T: Copy> Queue<T> {
    fn push(&mut self, entry: T) {
        self.entries[self.next] = entry;
        self.next = (self.next + 1) % 16;
    }

    fn back(&self, by: u8) -> T {
        self.entries[(self.next + 15 - usize::from(by)) % 16]
    }
}

/// State of a decoder of triangles.
struct Triangles<'a> {
    /// Bytes for what no code says.
    data: &'a [u8],
    /// The lowest index that no triangle had.
    next: u32,
    /// The index that was spelled out last.
    last: u32,
    edges: Queue<[u32; 2]>,
    vertices: Queue<u32>,
}

impl Triangles<'_> {
    fn fresh(&mut self) -> u32 {
        self.next = self.next.wrapping_add(1);
        self.next.wrapping_sub(1)
    }

    fn spelled(&mut self) -> Result<u32, String> {
        let v = varint(&mut self.data)?;
        let delta = if v & 1 == 1 { !(v >> 1) } else { v >> 1 };
        self.last = self.last.wrapping_add(delta);
        Ok(self.last)
    }

    /// A corner by its half byte: 0 is a fresh vertex, 15 one that is spelled out, others are in the queue.
    fn corner(&mut self, code: u8) -> Result<u32, String> {
        match code {
            0 => Ok(self.fresh()),
            15 => self.spelled(),
            _ => Ok(self.vertices.back(code - 1)),
        }
    }

    /// A triangle on a known edge.
    fn on_edge(&mut self, edge: u8, code: u8) -> Result<[u32; 3], String> {
        let [a, b] = self.edges.back(edge);
        let c = match code {
            0 | 15 => self.corner(code)?,
            13 | 14 => {
                self.last = match code {
                    13 => self.last.wrapping_sub(1),
                    _ => self.last.wrapping_add(1),
                };
                self.last
            }
            _ => self.vertices.back(code),
        };
        self.edges.push([c, b]);
        self.edges.push([a, c]);
        if matches!(code, 0 | 13..) {
            self.vertices.push(c);
        }
        Ok([a, b, c])
    }

    /// A triangle by its corners' half bytes.
    fn free(&mut self, first: u8, codes: u8) -> Result<[u32; 3], String> {
        let (second, third) = (codes >> 4, codes & 15);
        let a = self.corner(first)?;
        let b = self.corner(second)?;
        let c = self.corner(third)?;
        for edge in [[b, a], [c, b], [a, c]] {
            self.edges.push(edge);
        }
        self.vertices.push(a);
        for (code, vertex) in [(second, b), (third, c)] {
            if matches!(code, 0 | 15) {
                self.vertices.push(vertex);
            }
        }
        Ok([a, b, c])
    }
}

/// Indices of a stream of triangles; `count` is a multiple of 3.
///
/// # Errors
/// A stream that is no such one, too short or too long, or leans on what was never there.
pub(super) fn decode_triangles(bytes: &[u8], count: usize) -> Result<Vec<u32>, String> {
    expect_header(bytes, 0xe1, "triangles")?;
    let body = bytes[1..].split_at_checked(count / 3);
    let Some((codes, (data, table))) = body.and_then(|(codes, rest)| {
        Some((
            codes,
            rest.split_at_checked(rest.len().checked_sub(TABLE_BYTES)?)?,
        ))
    }) else {
        return Err(format!("is too short for {} triangles", count / 3));
    };
    let mut state = Triangles {
        data,
        next: 0,
        last: 0,
        edges: Queue {
            entries: [[NOTHING; 2]; 16],
            next: 0,
        },
        vertices: Queue {
            entries: [NOTHING; 16],
            next: 0,
        },
    };
    let mut indices = Vec::with_capacity(count);
    for (i, code) in codes.iter().enumerate() {
        let triangle = match (code >> 4, code & 15) {
            (15, low @ 14..) => {
                let (&corners, rest) = state.data.split_first().ok_or("ends too early")?;
                state.data = rest;
                if corners == 0 {
                    state.next = 0;
                }
                state.free(if low == 14 { 0 } else { 15 }, corners)?
            }
            (15, low) => {
                let corners = table[usize::from(low)];
                if corners >> 4 == 15 || corners & 15 == 15 {
                    return Err(format!(
                        "has a table with {corners:#04x}, which nothing says how to read"
                    ));
                }
                state.free(0, corners)?
            }
            (edge, low) => state.on_edge(edge, low)?,
        };
        if triangle.contains(&NOTHING) {
            return Err(format!("has triangle {i} lean on one that was never there"));
        }
        indices.extend(triangle);
    }
    match state.data.len() {
        0 => Ok(indices),
        more => Err(format!("has {more} bytes too many for {} triangles", count / 3)),
    }
}

/// The indices of a sequence.
///
/// # Errors
/// A stream that is no such one, too short or too long.
pub(super) fn decode_sequence(bytes: &[u8], count: usize) -> Result<Vec<u32>, String> {
    expect_header(bytes, 0xd1, "indices")?;
    let end = bytes.len().checked_sub(SEQUENCE_TAIL);
    let Some(mut data) = end.and_then(|end| bytes.get(1..end)) else {
        return Err(format!("is too short for {count} indices"));
    };
    let mut last = [0u32; 2];
    let mut indices = Vec::with_capacity(count);
    for _ in 0..count {
        let v = varint(&mut data)?;
        let delta = if v & 2 == 2 { !(v >> 2) } else { v >> 2 };
        let last = &mut last[(v & 1) as usize];
        *last = last.wrapping_add(delta);
        indices.push(*last);
    }
    match data.len() {
        0 => Ok(indices),
        more => Err(format!("has {more} bytes too many for {count} indices")),
    }
}

fn expect_header(bytes: &[u8], header: u8, what: &str) -> Result<(), String> {
    match bytes.first() {
        Some(&found) if found == header => Ok(()),
        Some(found) => Err(format!(
            "starts with {found:#04x}, where {what} have {header:#04x}"
        )),
        None => Err("is empty".into()),
    }
}

/// An integer of seven bits a byte, lowest first, of at most five bytes.
fn varint(data: &mut &[u8]) -> Result<u32, String> {
    let mut value = 0;
    for shift in (0..35).step_by(7) {
        let (&byte, rest) = data.split_first().ok_or("ends too early")?;
        *data = rest;
        value |= u32::from(byte & 127) << shift;
        if byte < 128 {
            return Ok(value);
        }
    }
    Err("holds an integer of more than five bytes".into())
}
