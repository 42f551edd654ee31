//! Mode 0: attributes. Elements are split into their bytes, each byte's differences from the element before are coded in
//! groups of 16, in blocks of at most 8 KiB (KHR_meshopt_compression, appendix A).

/// Elements whose differences share a header of two bits.
const GROUP: usize = 16;

/// Bytes of elements in a block, and its elements, at most.
const BLOCK_BYTES: usize = 8192;
const BLOCK_ELEMENTS: usize = 256;

fn block_elements(stride: usize) -> usize {
    (BLOCK_BYTES / stride / GROUP * GROUP).min(BLOCK_ELEMENTS)
}

/// Bytes before the end at which blocks stop: the first element and, in version 1, the channels' modes, after padding.
fn tail_bytes(version: u8, stride: usize) -> (usize, usize) {
    match version {
        0 => (stride, stride.max(32)),
        _ => (stride + stride / 4, (stride + stride / 4).max(24)),
    }
}

/// Bytes that a stream has at least: header, a byte of control per channel and block in version 1, tail.
pub(super) fn fewest_bytes(count: u64, stride: u64) -> u64 {
    let blocks = count.div_ceil(block_elements(stride as usize) as u64);
    let (_, tail) = tail_bytes(1, stride as usize);
    (stride / 4)
        .saturating_mul(blocks)
        .saturating_add(1 + tail as u64)
}

/// The elements of a stream, `count · stride` bytes; a stride is a multiple of 4 up to 256.
///
/// # Errors
/// A stream that is no such one, or too short or too long.
pub(super) fn decode(bytes: &[u8], count: usize, stride: usize) -> Result<Vec<u8>, String> {
    let version = match bytes.first() {
        Some(0xa0) => 0,
        Some(0xa1) => 1,
        Some(other) => {
            return Err(format!(
                "starts with {other:#04x}, where attributes have 0xa0 or 0xa1"
            ));
        }
        None => return Err("is empty".into()),
    };
    let (tail, padded) = tail_bytes(version, stride);
    let Some(blocks) = bytes.len().checked_sub(padded).and_then(|end| bytes.get(1..end)) else {
        return Err("is too short for its last block".into());
    };
    let tail = &bytes[bytes.len() - tail..];
    let mut previous = [0; 256];
    previous[..stride].copy_from_slice(&tail[..stride]);
    let channels = &tail[stride..];
    let mut left = Reader(blocks);
    let mut out = vec![0; count * stride];
    let mut deltas = [[0; BLOCK_ELEMENTS]; 4];
    for block in out.chunks_mut(block_elements(stride) * stride) {
        let elements = block.len() / stride;
        let control = left.take(if version == 0 { 0 } else { stride / 4 })?;
        for channel in 0..stride / 4 {
            for (k, deltas) in deltas.iter_mut().enumerate() {
                let lengths = match control.get(channel).map(|control| control >> (2 * k) & 3) {
                    None => Some([0, 2, 4, 8]),
                    Some(0) => Some([0, 1, 2, 4]),
                    Some(1) => Some([1, 2, 4, 8]),
                    Some(2) => {
                        deltas[..elements].fill(0);
                        None
                    }
                    Some(_) => {
                        deltas[..elements].copy_from_slice(left.take(elements)?);
                        None
                    }
                };
                if let Some(lengths) = lengths {
                    groups(
                        &mut left,
                        lengths,
                        &mut deltas[..elements.next_multiple_of(GROUP)],
                    )?;
                }
            }
            let mode = channels.get(channel).copied().unwrap_or(0);
            let previous = &mut previous[4 * channel..4 * channel + 4];
            undo_deltas(mode, &deltas, previous, &mut block[4 * channel..], stride)?;
        }
    }
    match left.0.len() {
        0 => Ok(out),
        more => Err(format!("has {more} bytes too many for {count} elements")),
    }
}

/// Bytes that are still to be read.
struct Reader<'a>(&'a [u8]);

impl<'a> Reader<'a> {
    fn take(&mut self, count: usize) -> Result<&'a [u8], String> {
        let (taken, rest) = self.0.split_at_checked(count).ok_or("ends too early")?;
        self.0 = rest;
        Ok(taken)
    }
}

/// A data block: headers of two bits a group, which choose among four bit lengths, then the groups.
fn groups(left: &mut Reader, lengths: [u32; 4], deltas: &mut [u8]) -> Result<(), String> {
    let headers = left.take((deltas.len() / GROUP).div_ceil(4))?;
    for (i, group) in deltas.chunks_exact_mut(GROUP).enumerate() {
        match lengths[usize::from(headers[i / 4] >> (2 * (i % 4)) & 3)] {
            0 => group.fill(0),
            8 => group.copy_from_slice(left.take(GROUP)?),
            bits => sentinels(left, bits, group)?,
        }
    }
    Ok(())
}

/// Sixteen differences of 1, 2 or 4 bits; all bits set stands for a whole byte behind them.
fn sentinels(left: &mut Reader, bits: u32, group: &mut [u8]) -> Result<(), String> {
    let packed = left.take(2 * bits as usize)?;
    let (per_byte, sentinel) = (8 / bits, (1u8 << bits) - 1);
    for (i, delta) in group.iter_mut().enumerate() {
        let (byte, place) = (packed[i / per_byte as usize], i as u32 % per_byte);
        // Single bits stand from the lowest up, others from the highest down.
        let shift = if bits == 1 { place } else { 8 - bits * (place + 1) };
        let value = byte >> shift & sentinel;
        *delta = if value == sentinel {
            left.take(1)?[0]
        } else {
            value
        };
    }
    Ok(())
}

/// Adds up a channel's differences by its mode: bytes, words of 16 bits, or words of 32 bits that are exclusive-ored.
/// `out` starts at the channel's first byte.
fn undo_deltas(
    mode: u8,
    deltas: &[[u8; BLOCK_ELEMENTS]; 4],
    previous: &mut [u8],
    out: &mut [u8],
    stride: usize,
) -> Result<(), String> {
    let sums = |now: [u8; 4], d: [u8; 4]| -> [u8; 4] {
        let one = |d: u8| if d & 1 == 1 { !(d >> 1) } else { d >> 1 };
        std::array::from_fn(|i| now[i].wrapping_add(one(d[i])))
    };
    let sums_of_words = |now: [u8; 4], d: [u8; 4]| {
        let word = |low: u8, high: u8| u16::from_le_bytes([low, high]);
        let one = |d: u16| if d & 1 == 1 { !(d >> 1) } else { d >> 1 };
        let low = word(now[0], now[1]).wrapping_add(one(word(d[0], d[1])));
        let high = word(now[2], now[3]).wrapping_add(one(word(d[2], d[3])));
        (u32::from(high) << 16 | u32::from(low)).to_le_bytes()
    };
    match (mode & 15, mode >> 4) {
        (0, 0) => undo(deltas, previous, out, stride, sums),
        (1, 0) => undo(deltas, previous, out, stride, sums_of_words),
        (2, turn) => undo(deltas, previous, out, stride, |now, d| {
            (u32::from_le_bytes(d).rotate_right(turn.into()) ^ u32::from_le_bytes(now)).to_le_bytes()
        }),
        _ => {
            return Err(format!(
                "has a channel of mode {mode:#04x}, which nothing says how to read"
            ));
        }
    }
    Ok(())
}

fn undo(
    deltas: &[[u8; BLOCK_ELEMENTS]; 4],
    previous: &mut [u8],
    out: &mut [u8],
    stride: usize,
    step: impl Fn([u8; 4], [u8; 4]) -> [u8; 4],
) {
    let mut now = [previous[0], previous[1], previous[2], previous[3]];
    for (i, element) in out.chunks_mut(stride).enumerate() {
        now = step(now, [deltas[0][i], deltas[1][i], deltas[2][i], deltas[3][i]]);
        element[..4].copy_from_slice(&now);
    }
    previous.copy_from_slice(&now);
}
