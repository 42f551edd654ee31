//! How fast a bounce series converges: the spectral radius of a non-negative operator by power iteration.
//!
//! Source: Collatz 1942 and Wielandt 1950: for a non-negative operator A and any positive v the largest ratio
//! (A v)_i / v_i bounds the spectral radius from above; power iteration brings it down to it. With v = Aⁿ 1 places where
//! v is zero may be left out: no way of n steps starts there, so that none comes back to where it was.

use crate::sparse::{SparseMatrix, row};

/// Spectral radius of a non-negative operator.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SpectralRadius {
    /// Growth of the sum over the last step of the iteration.
    pub estimate: f64,
    /// No eigenvalue is larger.
    pub upper: f64,
    /// Products with the operator.
    pub iterations: u32,
}

/// Products after which the iteration ends, whatever is left between estimate and bound.
const MOST_ITERATIONS: u32 = 500;

/// Distance of estimate and bound at which the iteration ends: finer than any statement on convergence needs.
const CLOSE: f64 = 1e-5;

/// The spectral radius of v ↦ K (ρ v), `albedo` ρ at least 0.
pub fn spectral_radius(k: &SparseMatrix, albedo: &[f64]) -> SpectralRadius {
    let n = k.rows();
    let mut v = vec![1.0f64; n];
    let mut found = SpectralRadius {
        upper: f64::INFINITY,
        ..SpectralRadius::default()
    };
    if n == 0 {
        return SpectralRadius::default();
    }
    while found.iterations < MOST_ITERATIONS {
        let next: Vec<f64> = (0..n)
            .map(|i| {
                row(k, i)
                    .map(|(j, w)| f64::from(w) * albedo[j as usize] * v[j as usize])
                    .sum()
            })
            .collect();
        found.iterations += 1;
        let ratios = next.iter().zip(&v).filter(|e| *e.1 > 0.0).map(|(a, b)| a / b);
        let ratio = ratios.fold(0.0, f64::max);
        found.upper = found.upper.min(ratio);
        found.estimate = next.iter().sum::<f64>() / v.iter().sum::<f64>();
        let largest = next.iter().copied().fold(0.0, f64::max);
        if largest == 0.0 {
            // No light comes back at all.
            found.upper = 0.0;
            break;
        }
        v = next.iter().map(|a| a / largest).collect();
        if found.upper - found.estimate <= CLOSE {
            break;
        }
    }
    found.estimate = found.estimate.min(found.upper);
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sparse::from_rows;

    /// Two places: A = ((a, b), (c, d)) has the eigenvalues (t ± √(t² − 4 det))/2.
    #[test]
    fn two_places_have_the_radius_of_the_formula() {
        let (a, b, c, d) = (0.2f32, 0.7f32, 0.5f32, 0.3f32);
        let k = from_rows(&[vec![(0, a), (1, b)], vec![(0, c), (1, d)]], 2);
        let rho = [0.9, 0.4];
        let [a, b, c, d] = [a, b, c, d].map(f64::from);
        let (trace, det) = (
            a * rho[0] + d * rho[1],
            a * rho[0] * d * rho[1] - b * rho[1] * c * rho[0],
        );
        let exact = (trace + (trace * trace - 4.0 * det).sqrt()) / 2.0;
        let found = spectral_radius(&k, &rho);
        assert!((found.estimate - exact).abs() < 2e-5, "{found:?} {exact}");
        assert!(
            found.upper >= exact - 1e-12 && found.upper - exact < 2e-5,
            "{found:?} {exact}"
        );
    }

    /// A closed white room loses what its albedo takes, and nothing else; rooms that light never comes back to lose all.
    #[test]
    fn closed_rooms_keep_their_albedo_and_open_ones_keep_nothing() {
        let closed = from_rows(&vec![(0..5).map(|j| (j, 0.2)).collect(); 5], 5);
        let found = spectral_radius(&closed, &[0.75; 5]);
        // Five weights of 0.2 sum to 1 to f32's rounding.
        assert!((found.upper - 0.75).abs() < 1e-6, "{found:?}");
        let one_way = from_rows(&[vec![], vec![(0, 0.5)], vec![(0, 0.5), (1, 0.5)]], 3);
        assert_eq!(spectral_radius(&one_way, &[0.9; 3]).upper, 0.0);
    }
}
