//! Streams that meshoptimizer 1.3 (its JavaScript build) wrote of the numbers which the tests make again.

use super::*;
use base64::Engine;

/// 300 elements of [`four_bytes`], version 0: two blocks.
const VERSION_0: &str = "\
    oP////8ASkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpK\
    SkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpK\
    SkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpK\
    SkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKVVVVVQAAgACAAIAAgACAAIAAgACAAIAAgACAAIAAgACAAIAAgACA\
    AIAAgACAAIAAgACAAIAAgACAAIAAgACAAIAAgAAAAAAAEREREQPAAABxcgPAAABxcgPAAABxcgPAAABxcgPAAABxcgPAAABxcgPA\
    AABxcgPAAABxcj9KSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSkpKSgAAAAAVgACAAIAAgACAAIAAABED\
    wAAAcXIDwAAAcXIAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAFAQ==";
/// 40 elements of [`twelve_bytes`], version 1, level 3: all control modes and all channel modes.
const VERSION_1: &str = "\
    of1xmQCAQAEDIBABBwgAAQB3mYu5j5mL+ZeJu4mfiXuJl7mLmY/5i5m3iZuJf4mbibeZi/mPmYsAgYOGgYKPgoGGg56BgoeBgo+C\
    gYaDnoGCh4KBjoOBhoOegYKHgoGOACVuO+YtWucqfSbrXiXqP2ol3msm/Spn2i1mO+4lWu86ZS7bZi36JyoCYwRRJjBFEmMEUSYw\
    RRJjBFEmMAAAAAABAIACALa2tra2tra2tra2tra2tra2tra2tra2tra2tra2tra2tra2tra2tgAYAHFyGABxchgAcXIVFVVVVVVV\
    VVVVVQAAKgTE9MT0xPTEHDwc9MT0xPTE9MR8HDwc9MT0xAAAAAD8HAAAAAAAAAAAAAAA//8ACQABAACAv1IAEg==";
/// The same at level 0.
const LEVEL_0: &str = "\
    oVVVWg8Aj4+Pj4+Pj4+Pj4+Pj4+Pj4+Pj4+Pj4+Pj4+Pj4+Pj/8Aj4+Pj4+Pj48PABYYGBYYGBgWGBgWGBgYFhgYFhgYGBYYGBYY\
    GBgWGBj/ABgWGBgWGBgYDwBXV1dXV1dXV1dXV1dXV1dXV1dXV1dXV1dXV1dXV1dX/wBXV1dXV1dXVxUVXVXVAwNdVdVdAwMDV1UA\
    AAMqAmMEUSYwRRJjBFEmMEUSYwRRJjAAAAAAAACAAgAAAAAPALa2tra2tra2tra2tra2tra2tra2tra2tra2tra2trb/ALa2tra2\
    tra2ABgAcXIYAHFyGABxcioERERERERERERERERERERERERERAAAAAAPAP//////////////////////////////////////////\
    AP//////////AAAAAAAAAAAAAAD//wAJAAEAAIC/AAAA";
/// 54 triangles of [`triangles`].
const TRIANGLES: &str = "\
    4f4eEA4QDhAOEA7+HhkOGA4XDhYO/x4WDhYOFg4WDv8eFg4WDhYOFg7/HhYOFg4WDhYO//7+/w8MnwJfCQxfCQxfCQz/ggHBAdrF\
    CPPVxQgA8gYDAHaHVmd4qYZliWiYAWkAAA==";
/// The indices of [`SEQUENCE_OF`].
const SEQUENCE: &str = "0QCRAwQFBAUUC+D/D/8CAcSLAQsAAAAA";
const SEQUENCE_OF: [u32; 13] = [0, 100, 1, 101, 2, 102, 7, 99, 65535, 3, 3, 70000, 0];
/// Of 8 bits.
const OCTAHEDRAL_8: &str = "oe8A/pHg9wD+/cbmAAQDAAQAAAAAAAAAAAAAAAAAAAAAAAAAAAB/fwA=";
/// Of 12 bits in 16.
const OCTAHEDRAL_16: &str = "of+6AAHcKaQADgcREAABAnwwAA4NDBEABAMABAAAAAAAAAAAAAAAAAAAAAAAAP8H/38AAQ==";
/// Of 12 bits in 16.
const QUATERNION: &str = "of+/ALGyQgAKCQIAsuCaAAsYGwCxskEACgkDAAUEAQAAAAAAAAAAAAAAAAAAAAAAAAAA/wcAAA==";
/// Mantissas of 15 bits, one exponent for two.
const EXPONENTIAL: &str = "of/vAAB0SAA/oAkAAQIAAAAaagAQDwAAPwAAAAAaagAAAAAAAAAAAAAAAAAAAAAA8wAgAPMAAA==";
/// Of 8 bits.
const COLOR_8: &str = "of8AZuUB5wBqmADFAGQaAAwAfX/+vQAAAAAAAAAAAAAAAAAAAAAAAABAf8H/AA==";
/// Of 10 bits in 16.
const COLOR_16: &str =
    "of/3AGVmAVwAAAEGAQBhZADiAAUEAAMAZ2YAMgAEAAIAAgAB/QAAAQIBAAAAAAAAAAAAAAAAAAAAAf8BAf//AwAA";

const OCT8: [i32; 20] = [
    0, 0, 127, 127, 0, 0, -127, -127, 76, 0, 102, 127, -46, 61, -102, 127, 73, -73, 74, -127,
];
const OCT16: [i32; 20] = [
    0, 0, 32767, 32767, 0, 0, -32767, -32767, 19653, 0, 26219, 32767, -11785, 15723, -26222, 32767, 18909,
    -18909, 18937, -32767,
];
const QUAT: [i32; 16] = [
    0, 0, 0, 32767, 16399, 16378, -16378, 16378, 19661, 0, 26213, 0, -3271, 22943, 3271, -22932,
];
const COL8: [i32; 20] = [
    254, 1, 0, 255, 52, 102, 204, 128, 0, 0, 0, 0, 255, 255, 255, 255, 34, 145, 232, 64,
];
const COL16: [i32; 20] = [
    65471, 64, 0, 65535, 13197, 26265, 52402, 32800, 0, 0, 0, 0, 65535, 65535, 65535, 65535, 8520, 37284,
    59641, 16400,
];

fn bytes(stream: &str) -> Vec<u8> {
    base64::engine::general_purpose::STANDARD.decode(stream).unwrap()
}

fn stream(mode: Mode, filter: Filter, count: u64, stride: u64) -> Stream {
    Stream {
        mode,
        filter,
        count,
        stride,
    }
}

fn attributes(filter: Filter, count: u64, stride: u64, text: &str) -> Vec<u8> {
    let stream = stream(Mode::Attributes, filter, count, stride);
    assert!(stream.fewest_bytes() <= bytes(text).len() as u64);
    stream.decode(&bytes(text)).unwrap()
}

/// A ramp that wraps, a slow one, a constant, and one that is rarely another.
fn four_bytes() -> Vec<u8> {
    let element = |i: usize| {
        [
            (i * 37 % 256) as u8,
            (i >> 3) as u8,
            5,
            if i % 32 == 3 { 200 } else { 1 },
        ]
    };
    (0..300).flat_map(element).collect()
}

/// Two ramps of words, four bytes of different kinds, and a float that changes its sign.
fn twelve_bytes() -> Vec<u8> {
    let element = |i: usize| {
        let mut element = [0; 12];
        element[..2].copy_from_slice(&((i * 3000 % 65536) as u16).to_le_bytes());
        element[2..4].copy_from_slice(&((65535 - i * 300) as u16).to_le_bytes());
        let rare = if i % 16 == 3 { 200 } else { 1 };
        element[4..8].copy_from_slice(&[
            (i * i % 7) as u8,
            if i < 15 { 9 } else { 10 },
            (i * 91 % 256) as u8,
            rare,
        ]);
        let sign = if i % 2 == 1 { 1.0 } else { -1.0 };
        element[8..].copy_from_slice(&(sign * (1.0 + i as f32 / 64.0)).to_le_bytes());
        element
    };
    (0..40).flat_map(element).collect()
}

/// A grid of 5 × 5 quads, then triangles far from each other; the decoder may turn a triangle's first corner.
fn triangles() -> Vec<[u32; 3]> {
    let quad = |i: u32| {
        let v = i / 5 * 6 + i % 5;
        [[v, v + 1, v + 6], [v + 1, v + 7, v + 6]]
    };
    let grid = (0..25).flat_map(quad);
    grid.chain([[100, 3, 70000], [5, 100, 7], [0, 1, 2], [8, 6, 1]])
        .collect()
}

fn turned(t: [u32; 3]) -> [u32; 3] {
    let least = (0..3).min_by_key(|&i| t[i]).unwrap();
    [0, 1, 2].map(|i| t[(least + i) % 3])
}

#[test]
fn attributes_of_both_versions_come_back_bit_by_bit() {
    assert_eq!(attributes(Filter::None, 300, 4, VERSION_0), four_bytes());
    assert_eq!(attributes(Filter::None, 40, 12, VERSION_1), twelve_bytes());
    assert_eq!(attributes(Filter::None, 40, 12, LEVEL_0), twelve_bytes());
}

#[test]
fn triangles_and_indices_come_back() {
    let decoded = stream(Mode::Triangles, Filter::None, 162, 4)
        .decode(&bytes(TRIANGLES))
        .unwrap();
    let corners: Vec<u32> = decoded
        .as_chunks()
        .0
        .iter()
        .map(|b| u32::from_le_bytes(*b))
        .collect();
    let found: Vec<[u32; 3]> = corners.as_chunks().0.iter().map(|t| turned(*t)).collect();
    assert_eq!(found, triangles().into_iter().map(turned).collect::<Vec<_>>());
    let decoded = stream(Mode::Indices, Filter::None, 13, 4)
        .decode(&bytes(SEQUENCE))
        .unwrap();
    assert_eq!(decoded, SEQUENCE_OF.map(u32::to_le_bytes).concat());
    let error = stream(Mode::Indices, Filter::None, 13, 2)
        .decode(&bytes(SEQUENCE))
        .unwrap_err();
    assert!(error.contains("holds index 70000"), "{error}");
}

/// Truth: meshoptimizer's decoder. The specification leaves it open by one unit.
#[test]
fn filters_give_what_meshoptimizer_gives() {
    let near = |found: &[i32], expected: &[i32]| {
        assert_eq!(found.len(), expected.len());
        for (f, e) in found.iter().zip(expected) {
            assert!(f.abs_diff(*e) <= 1, "{found:?}\n{expected:?}");
        }
    };
    let signed = |b: &u8| i32::from(*b as i8);
    let word = |b: &[u8]| i16::from_le_bytes([b[0], b[1]]);
    let words = |b: Vec<u8>| b.chunks(2).map(|b| word(b).into()).collect::<Vec<i32>>();
    let found: Vec<i32> = attributes(Filter::Octahedral, 5, 4, OCTAHEDRAL_8)
        .iter()
        .map(signed)
        .collect();
    near(&found, &OCT8);
    near(
        &words(attributes(Filter::Octahedral, 5, 8, OCTAHEDRAL_16)),
        &OCT16,
    );
    near(&words(attributes(Filter::Quaternion, 4, 8, QUATERNION)), &QUAT);
    let found: Vec<i32> = attributes(Filter::Color, 5, 4, COLOR_8)
        .into_iter()
        .map(i32::from)
        .collect();
    near(&found, &COL8);
    let found: Vec<i32> = words(attributes(Filter::Color, 5, 8, COLOR_16))
        .into_iter()
        .map(|w| w & 0xffff)
        .collect();
    near(&found, &COL16);
    let decoded = attributes(Filter::Exponential, 4, 8, EXPONENTIAL);
    let floats: Vec<f32> = decoded
        .as_chunks()
        .0
        .iter()
        .map(|b| f32::from_le_bytes(*b))
        .collect();
    // The sources were 0, 1, −1, 0.001, 12345.678, −3e−7, 1e20, −0.1.
    assert_eq!(
        floats,
        [
            0.0,
            1.0,
            -1.0,
            0.0009765625,
            12346.0,
            0.0,
            99997926126134500000.0,
            0.0
        ]
    );
}

#[test]
fn damaged_streams_are_refused_or_give_as_many_elements() {
    let cases = [
        (stream(Mode::Attributes, Filter::None, 300, 4), VERSION_0),
        (stream(Mode::Attributes, Filter::Exponential, 40, 12), VERSION_1),
        (stream(Mode::Attributes, Filter::Octahedral, 5, 8), OCTAHEDRAL_16),
        (stream(Mode::Attributes, Filter::Quaternion, 4, 8), QUATERNION),
        (stream(Mode::Attributes, Filter::Color, 5, 4), COLOR_8),
        (stream(Mode::Attributes, Filter::Color, 5, 8), COLOR_16),
        (stream(Mode::Triangles, Filter::None, 162, 4), TRIANGLES),
        (stream(Mode::Indices, Filter::None, 13, 2), SEQUENCE),
    ];
    for (stream, text) in cases {
        let whole = bytes(text);
        for end in 0..whole.len() {
            assert!(stream.decode(&whole[..end]).is_err(), "{stream:?} of {end} bytes");
        }
        let more = [&whole[..1], &[0], &whole[1..]].concat();
        let longer = Stream {
            count: stream.count + 3,
            ..stream
        };
        for at in 0..whole.len() {
            for bit in 0..8 {
                let mut damaged = whole.clone();
                damaged[at] ^= 1 << bit;
                for bytes in [&damaged, &more] {
                    for stream in [stream, longer] {
                        if let Ok(decoded) = stream.decode(bytes) {
                            assert_eq!(decoded.len() as u64, stream.count * stream.stride);
                        }
                    }
                }
            }
        }
    }
}
