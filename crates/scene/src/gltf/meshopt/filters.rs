//! Filters that turn decoded elements into what accessors read (KHR_meshopt_compression, appendix B). What the appendix
//! leaves open (lengths of 0, exponents out of range) gives some number; conversions saturate, so nothing fails.

/// Words of 16 bits in little-endian bytes.
fn words(bytes: &[u8]) -> [i16; 4] {
    std::array::from_fn(|i| i16::from_le_bytes([bytes[2 * i], bytes[2 * i + 1]]))
}

fn put_words(bytes: &mut [u8], words: [i16; 4]) {
    for (bytes, word) in bytes.chunks_exact_mut(2).zip(words) {
        bytes.copy_from_slice(&word.to_le_bytes());
    }
}

/// A unit vector from octahedral coordinates, of which the third stands for 1, times `most`.
fn unit_vector(input: [f32; 3], most: f32) -> [f32; 3] {
    let [x, y, one] = input;
    let (x, y) = (x / one, y / one);
    let z = 1.0 - x.abs() - y.abs();
    let t = z.min(0.0);
    let (x, y) = (x - t.copysign(x), y - t.copysign(y));
    let length = (x * x + y * y + z * z).sqrt();
    [x, y, z].map(|x| (x / length * most).round())
}

/// Unit vectors of signed bytes; the fourth stays.
pub(super) fn octahedral_8(bytes: &mut [u8]) {
    for element in bytes.chunks_exact_mut(4) {
        let input = std::array::from_fn(|i| f32::from(element[i] as i8));
        for (byte, x) in element.iter_mut().zip(unit_vector(input, 127.0)) {
            *byte = x as i8 as u8;
        }
    }
}

/// Unit vectors of signed words; the fourth stays.
pub(super) fn octahedral_16(bytes: &mut [u8]) {
    for element in bytes.chunks_exact_mut(8) {
        let [x, y, one, w] = words(element);
        let [x, y, z] = unit_vector([x, y, one].map(f32::from), 32767.0).map(|x| x as i16);
        put_words(element, [x, y, z, w]);
    }
}

/// Unit quaternions of signed words: three components, and which one is left out, in what stands for 1.
pub(super) fn quaternion(bytes: &mut [u8]) {
    for element in bytes.chunks_exact_mut(8) {
        let input = words(element);
        let one = f32::from(input[3] | 3);
        let [x, y, z] = [0, 1, 2].map(|i| f32::from(input[i]) / one * std::f32::consts::FRAC_1_SQRT_2);
        let w = (1.0 - x * x - y * y - z * z).max(0.0).sqrt();
        let largest = (input[3] & 3) as usize;
        let mut output = [0; 4];
        for (i, x) in [w, x, y, z].into_iter().enumerate() {
            output[(largest + i) % 4] = (x * 32767.0).round() as i16;
        }
        put_words(element, output);
    }
}

/// Floats of a signed exponent of 8 bits over a signed mantissa of 24.
pub(super) fn exponential(bytes: &mut [u8]) {
    for element in bytes.chunks_exact_mut(4) {
        let word = i32::from_le_bytes([element[0], element[1], element[2], element[3]]);
        let (exponent, mantissa) = (word >> 24, (word << 8) >> 8);
        // A power of two, exactly: f64 has room for all of them.
        let power = f64::from_bits(((1023 + exponent) as u64) << 52);
        let value = (f64::from(mantissa) * power) as f32;
        element.copy_from_slice(&value.to_le_bytes());
    }
}

/// Red, green, blue and alpha from luma, two differences of colour, and an alpha whose highest bit tells how many bits count.
fn rgba(luma: i32, orange: i32, green: i32, alpha: i32, most: f32) -> [f32; 4] {
    let bits = 32 - alpha.leading_zeros();
    let one = (1 << bits) - 1;
    let scale = most / one as f32;
    let a = alpha & (one >> 1);
    let colors = [
        luma + orange - green,
        luma + green,
        luma - orange - green,
        a << 1 | a & 1,
    ];
    colors.map(|x| (x as f32 * scale).round())
}

/// Colours of four bytes.
pub(super) fn color_8(bytes: &mut [u8]) {
    for element in bytes.chunks_exact_mut(4) {
        let [y, co, cg, a] = [element[0], element[1], element[2], element[3]];
        let color = rgba(y.into(), (co as i8).into(), (cg as i8).into(), a.into(), 255.0);
        element.copy_from_slice(&color.map(|x| x as u8));
    }
}

/// Colours of four words.
pub(super) fn color_16(bytes: &mut [u8]) {
    for element in bytes.chunks_exact_mut(8) {
        let [y, co, cg, a] = words(element);
        let color = rgba(
            (y as u16).into(),
            co.into(),
            cg.into(),
            (a as u16).into(),
            65535.0,
        );
        put_words(element, color.map(|x| x as u16 as i16));
    }
}
