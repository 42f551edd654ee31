//! Albedo as 12 bits along a smoothstep: ρ = t²(3 − 2t), t = code/4095 (SPEC 6.6.3).
//!
//! Interreflection grows with 1/(1 − ρ), so what counts near 1 is the error relative to 1 − ρ, and near 0 the
//! error relative to ρ; 8 bits miss 0.99 by 1.8e-3, which is 15 % of the light in a furnace. The smoothstep spends its
//! codes at both ends: |error| ≤ 1.5/(2·4095) < 1.9e-4 everywhere (its steepest slope is 1.5), below 1/510;
//! about 4.3e-5 at 0.01 and 0.99 (0.4 % of 1 − ρ) and 1.4e-5 at 0.999 (1.4 %). 0 and 1 are exact.

use std::sync::LazyLock;

/// Number of codes.
pub const CODES: usize = 4096;

static VALUES: LazyLock<Vec<f32>> = LazyLock::new(|| {
    (0..CODES)
        .map(|code| {
            let t = code as f64 / (CODES - 1) as f64;
            (t * t * (3.0 - 2.0 * t)) as f32
        })
        .collect()
});

/// The code whose value is nearest (the lower of two). Values outside 0 to 1 are clamped, NaN becomes 0.
pub fn encode(albedo: f32) -> u32 {
    let above = VALUES.partition_point(|&value| value < albedo).min(CODES - 1);
    if above > 0 && albedo - VALUES[above - 1] <= VALUES[above] - albedo {
        above as u32 - 1
    } else {
        above as u32
    }
}

/// The value of a code; codes of 4096 and more read as 4095.
pub fn decode(code: u32) -> f32 {
    VALUES[(code as usize).min(CODES - 1)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn codes_survive_and_the_ends_are_exact() {
        for code in 0..CODES as u32 {
            assert_eq!(encode(decode(code)), code);
        }
        assert_eq!([decode(0), decode(4095)], [0.0, 1.0]);
        assert_eq!([encode(-1.0), encode(2.0), encode(f32::NAN)], [0, 4095, 0]);
    }

    proptest! {
        #[test]
        fn error_is_bounded_everywhere_and_shrinks_towards_the_ends(albedo in 0.0f32..=1.0) {
            let error = f64::from((decode(encode(albedo)) - albedo).abs());
            prop_assert!(error <= 1.9e-4);
            // Slope 6t(1 − t) = 6√(distance/3) at most, half a step of it, and the curvature's half step squared.
            let end = f64::from(albedo.min(1.0 - albedo));
            let half = 0.5 / 4095.0;
            prop_assert!(error <= 6.0 * (end / 2.0).sqrt() * half + 3.0 * half * half + 6e-8);
        }
    }
}
