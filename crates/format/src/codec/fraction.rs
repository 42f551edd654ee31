//! Bounce weights as 16-bit fractions of their row's largest, rescaled on reading so that the row sums to what
//! the file says (SPEC 6.8). Non-negative by construction; a row loses no energy however coarse its fractions.
//!
//! Before rescaling a weight is off by at most max/131070; rescaling multiplies by 1 + δ with
//! |δ| ≤ n·max/131070/sum for n links. The sum of the decoded weights equals `row_sum` to f32 rounding of the
//! weights themselves (relative 2⁻²⁴ each).

const STEPS: f64 = 65535.0;

/// Fractions of the row's largest weight, 0 to 65535. Negative and non-finite weights read as zero.
pub fn encode(weights: &[f32]) -> impl Iterator<Item = u32> + '_ {
    let usable = |w: f32| if w.is_finite() { w.max(0.0) } else { 0.0 };
    let largest = f64::from(weights.iter().fold(0.0, |m: f32, &w| m.max(usable(w))));
    weights.iter().map(move |&w| {
        if largest > 0.0 {
            (f64::from(usable(w)) / largest * STEPS).round() as u32
        } else {
            0
        }
    })
}

/// Appends the weights of one row: fraction × row_sum / Σ fractions; zeros when all fractions are zero.
pub fn decode(fractions: &[u32], row_sum: f32, weights: &mut Vec<f32>) {
    let total: u64 = fractions.iter().map(|&q| u64::from(q)).sum();
    let scale = if total > 0 {
        f64::from(row_sum) / total as f64
    } else {
        0.0
    };
    weights.extend(fractions.iter().map(|&q| (f64::from(q) * scale) as f32));
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn rows_keep_their_sum_and_weights_stay_near(weights in prop::collection::vec(0.0f32..1.0, 1..200)) {
            let total: f64 = weights.iter().map(|&w| f64::from(w)).sum();
            let row_sum = (total * 0.001) as f32;
            let small: Vec<f32> = weights.iter().map(|w| w * 0.001).collect();
            let fractions: Vec<u32> = encode(&small).collect();
            let mut decoded = Vec::new();
            decode(&fractions, row_sum, &mut decoded);
            let sum: f64 = decoded.iter().map(|&w| f64::from(w)).sum();
            // Each weight is rounded to f32 once: relative 2⁻²⁴, and so is their sum.
            prop_assert!((sum - f64::from(row_sum)).abs() <= f64::from(row_sum) * 6e-8);
            let largest = f64::from(small.iter().copied().fold(0.0, f32::max));
            let step = largest / 131_070.0;
            let rescaling = small.len() as f64 * step / f64::from(row_sum).max(1e-30) + 2e-7;
            for (a, b) in small.iter().zip(&decoded) {
                let bound = step + (f64::from(*a) + step) * rescaling;
                prop_assert!(*b >= 0.0 && f64::from((a - b).abs()) <= bound * 1.001 + 1e-12);
            }
            prop_assert_eq!(encode(&decoded).collect::<Vec<_>>(), fractions);
        }
    }

    #[test]
    fn a_row_of_zeros_stays_so() {
        let mut weights = Vec::new();
        decode(&encode(&[0.0, 0.0]).collect::<Vec<_>>(), 0.0, &mut weights);
        assert_eq!(weights, [0.0, 0.0]);
    }
}
