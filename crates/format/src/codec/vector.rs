//! Link vectors as three mantissas under one exponent (SPEC 7.6; after G. Ward, "Real pixels", Graphics Gems II,
//! 1991, with signs and 10 bits).
//!
//! The exponent is that of the largest component, whose mantissa is 512 to 1023; the others share its step.
//! Each component is off by at most half a step, so the vector by √3/2 of a step of at most |v|/512:
//! relative error ≤ 1.7e-3 < 2⁻⁹ = 1.95e-3. Independent of neighbours, exactly idempotent, no square root.
//! Vectors whose largest component is below 2⁻¹²⁶ become zero. Half floats take more bytes and a magnitude with
//! an octahedral direction takes as many and decodes slower (docs/notebook/format.md).

/// How many bits mantissas have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mantissa {
    /// 10.
    Long,
    /// 8: relative error ≤ 2⁻⁷.
    Short,
}

impl Mantissa {
    /// 8 bits if `short`, else 10.
    pub fn new(short: bool) -> Mantissa {
        if short { Mantissa::Short } else { Mantissa::Long }
    }

    fn bits(self) -> u32 {
        match self {
            Mantissa::Long => 10,
            Mantissa::Short => 8,
        }
    }

    /// The largest mantissa.
    fn most(self) -> f64 {
        f64::from((1u32 << self.bits()) - 1)
    }

    /// 2^(exponent − 126 − bits) as f64, exactly; exponent 1 to 254.
    fn step(self, exponent: u8) -> f64 {
        f64::from_bits((u64::from(exponent) + 1023 - 126 - u64::from(self.bits())) << 52)
    }
}

/// One encoded vector.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Code {
    /// Biased exponent of the largest component, 1 to 254; 0 for the zero vector.
    pub exponent: u8,
    /// Magnitudes in steps of 2^(exponent − 136), 0 to 1023; short ones in steps of 2^(exponent − 134), 0 to 255.
    pub mantissas: [u16; 3],
    /// Whether each component is negative; never for a mantissa of zero.
    pub negative: [bool; 3],
}

const ZERO: Code = Code {
    exponent: 0,
    mantissas: [0; 3],
    negative: [false; 3],
};

/// The code of a vector; non-finite components read as zero.
pub fn encode(vector: [f32; 3], mantissa: Mantissa) -> Code {
    let vector = vector.map(|v| if v.is_finite() { v } else { 0.0 });
    let largest = vector[0].abs().max(vector[1].abs()).max(vector[2].abs());
    let mut exponent = (largest.to_bits() >> 23) as u8;
    if exponent == 0 {
        return ZERO;
    }
    // The next power of two is taken when the largest mantissa would round up to it.
    if f64::from(largest) / mantissa.step(exponent) >= mantissa.most() + 0.5 && exponent < 254 {
        exponent += 1;
    }
    // Multiplying by the reciprocal of a power of two is exact.
    let steps_per_unit = 1.0 / mantissa.step(exponent);
    let mantissas = vector.map(|v| (f64::from(v.abs()) * steps_per_unit + 0.5).min(mantissa.most()) as u16);
    let mut negative = [false; 3];
    for axis in 0..3 {
        negative[axis] = vector[axis] < 0.0 && mantissas[axis] > 0;
    }
    Code {
        exponent,
        mantissas,
        negative,
    }
}

/// The vector of a code.
pub fn decode(code: Code, mantissa: Mantissa) -> [f32; 3] {
    if code.exponent == 0 {
        return [0.0; 3];
    }
    let step = mantissa.step(code.exponent);
    let mut vector = [0.0; 3];
    for axis in 0..3 {
        // Exact: ten bits of mantissa, and no step below f32's smallest subnormal.
        let magnitude = (f64::from(code.mantissas[axis]) * step) as f32;
        vector[axis] = if code.negative[axis] {
            -magnitude
        } else {
            magnitude
        };
    }
    vector
}

/// The vector that a reader will see: relative error ≤ 2⁻⁹, short ones 2⁻⁷. Quantising once more changes nothing.
pub fn quantised(vector: [f32; 3], mantissa: Mantissa) -> [f32; 3] {
    decode(encode(vector, mantissa), mantissa)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn norm(v: [f32; 3]) -> f64 {
        v.iter().map(|&c| f64::from(c) * f64::from(c)).sum::<f64>().sqrt()
    }

    proptest! {
        #[test]
        fn relative_error_is_bounded(x in -1.0f32..1.0, y in -1.0f32..1.0, z in -1.0f32..1.0, e in -110i32..120) {
            let v = [x, y, z].map(|c| c * 2f32.powi(e));
            prop_assume!(norm(v) > 1e-35);
            for (mantissa, most) in [(Mantissa::Long, 512.0), (Mantissa::Short, 128.0)] {
                let q = quantised(v, mantissa);
                prop_assert!(norm([v[0] - q[0], v[1] - q[1], v[2] - q[2]]) <= norm(v) / most);
                prop_assert_eq!(quantised(q, mantissa).map(f32::to_bits), q.map(f32::to_bits));
            }
        }

        #[test]
        fn any_bits_give_a_finite_vector_that_stays(bits in any::<[u32; 3]>()) {
            for mantissa in [Mantissa::Long, Mantissa::Short] {
                let q = quantised(bits.map(f32::from_bits), mantissa);
                prop_assert!(q.iter().all(|c| c.is_finite()));
                prop_assert_eq!(quantised(q, mantissa).map(f32::to_bits), q.map(f32::to_bits));
            }
        }
    }

    #[test]
    fn powers_of_two_scale_exactly() {
        let v = [0.7, -0.31, 0.002];
        let q = quantised(v, Mantissa::Long);
        assert_eq!(
            quantised(v.map(|c| c * 1024.0), Mantissa::Long),
            q.map(|c| c * 1024.0)
        );
    }

    #[test]
    fn the_largest_floats_do_not_overflow() {
        let q = quantised([f32::MAX, -f32::MAX, 0.0], Mantissa::Long);
        assert!(q[0].is_finite() && q[0] >= f32::MAX * (1.0 - 1.0 / 512.0) && q[1] == -q[0]);
    }
}
