//! KTX 2.0 files of one texture of half floats, of two or three dimensions.
//!
//! Source: the KTX file format specification, version 2.0, sections 3 and 4; Khronos Data Format 1.3, section 5, for the descriptor.

use half::f16;

const IDENTIFIER: [u8; 12] = *b"\xabKTX 20\xbb\r\n\x1a\n";
/// VK_FORMAT_R16G16B16A16_SFLOAT.
const FORMAT: u32 = 97;
/// Bytes before the descriptor: identifier, header, index, and the index of one level.
const HEAD: u32 = 80 + 24;
/// Bytes of the descriptor: its length, the head of a basic block, and four samples.
const DESCRIPTOR: u32 = 4 + 24 + 4 * 16;

/// A texture of `size` (across, down, deep; 0 deep is one of two dimensions), its texels row by row and slice by slice, linear Rec. 709 and opaque.
pub fn texture(size: [u32; 3], texels: &[[f32; 3]]) -> Vec<u8> {
    // Texels of 8 bytes begin at multiples of 8.
    let data = (HEAD + DESCRIPTOR).next_multiple_of(8);
    let length = 8 * texels.len() as u64;
    let mut bytes = Vec::with_capacity(data as usize + length as usize);
    bytes.extend(IDENTIFIER);
    let [width, height, depth] = size;
    // Format, size of a number, size of the texture, no array, one face, one level, no supercompression; where the descriptor is; no
    // keys and values.
    for word in [
        FORMAT, 2, width, height, depth, 0, 1, 1, 0, HEAD, DESCRIPTOR, 0, 0,
    ] {
        bytes.extend(word.to_le_bytes());
    }
    // No data of supercompression; then the level.
    for word in [0, 0, u64::from(data), length, length] {
        bytes.extend(word.to_le_bytes());
    }
    // Length; vendor and type; version and length of the block; RGB with Rec. 709's primaries, linear; blocks of one texel; 8 bytes.
    for word in [DESCRIPTOR, 0, 2 | ((DESCRIPTOR - 4) << 16), 0x0001_0101, 0, 8, 0] {
        bytes.extend(word.to_le_bytes());
    }
    for (number, channel) in [0u32, 1, 2, 15].into_iter().enumerate() {
        // Bit offset, 16 bits less 1, signed floats of the channel; no position; from −1 to 1.
        let sample = (16 * number as u32) | (15 << 16) | ((channel | 0xc0) << 24);
        for word in [sample, 0, (-1.0f32).to_bits(), 1.0f32.to_bits()] {
            bytes.extend(word.to_le_bytes());
        }
    }
    bytes.resize(data as usize, 0);
    for &[r, g, b] in texels {
        for value in [r, g, b, 1.0] {
            bytes.extend(f16::from_f32(value.clamp(-65504.0, 65504.0)).to_le_bytes());
        }
    }
    bytes
}
