//! Areas as floats with eight bits of mantissa (SPEC 6.6.4): the bit pattern of a positive f32 is itself a piecewise
//! linear logarithm, so rounding off its lowest 15 bits is a logarithmic quantiser that needs no logarithm.
//!
//! Relative error ≤ 2⁻⁹ for normal numbers; zero is exact. A level stores codes less their smallest: two bytes
//! while its largest area is less than 2²⁵⁶ times its smallest, that is, always.

const DROPPED_BITS: u32 = 15;

/// The code of an area: its bit pattern, rounded to nearest and shortened to the highest bits. Negative and
/// non-finite areas read as 0 and the largest finite one.
pub fn encode(area: f32) -> u32 {
    let area = area.clamp(0.0, decode(MAX_CODE));
    if area > 0.0 {
        (area.to_bits() + (1 << (DROPPED_BITS - 1))) >> DROPPED_BITS
    } else {
        0
    }
}

/// Code of the largest finite value.
pub const MAX_CODE: u32 = (0x7f80_0000 >> DROPPED_BITS) - 1;

/// The area of a code; larger codes than [`MAX_CODE`] read as that.
pub fn decode(code: u32) -> f32 {
    f32::from_bits(code.min(MAX_CODE) << DROPPED_BITS)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn relative_error_is_bounded(area in prop::num::f32::POSITIVE | prop::num::f32::NORMAL) {
            let area = area.abs().min(decode(MAX_CODE));
            let decoded = decode(encode(area));
            prop_assert!((decoded - area).abs() <= area / 512.0, "{area} {decoded}");
            prop_assert_eq!(decode(encode(decoded)), decoded);
        }
    }

    #[test]
    fn odd_values_stay_in_range() {
        assert_eq!([0.0, -1.0, f32::NAN].map(|a| decode(encode(a))), [0.0; 3]);
        assert!(decode(encode(f32::INFINITY)).is_finite());
    }
}
