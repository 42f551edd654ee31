//! Real spherical harmonics of degrees 0 to 3: functions of direction.
//!
//! Source: Lehtinen et al. 2008, section 2.1 (tensor product bases) names them; the polynomials are those of
//! Sloan 2008, "Stupid spherical harmonics tricks", appendix A2, and the cosine factors of [`irradiance_factors`] those
//! of Ramamoorthi and Hanrahan 2001, equation 8.
//!
//! Convention: orthonormal over the sphere, without the Condon-Shortley sign, so that every function of degree
//! 1 is a positive multiple of an axis. Function (l, m) is entry l(l + 1) + m; m < 0 are the sines.

use glam::Vec3;
use std::f32::consts::PI;

/// Highest degree.
pub const MAX_DEGREE: usize = 3;
/// Functions of degrees 0 to [`MAX_DEGREE`].
pub const COUNT: usize = count(MAX_DEGREE);

/// Coefficients of a directional function in world space, or the functions' values at one direction.
pub type Coefficients = [f32; COUNT];

/// Number of functions up to `degree`: (degree + 1)².
pub const fn count(degree: usize) -> usize {
    (degree + 1) * (degree + 1)
}

/// All functions at a unit direction.
#[inline]
pub fn evaluate(direction: Vec3) -> Coefficients {
    let Vec3 { x, y, z } = direction;
    let (xx, yy, zz) = (x * x, y * y, z * z);
    // Square roots of rationals over π, which make the functions orthonormal: √(1/4π), √(3/4π), √(15/4π),
    // √(5/16π), √(15/16π), √(35/32π), √(105/4π), √(21/32π), √(7/16π), √(105/16π).
    [
        0.282_094_79,
        0.488_602_51 * y,
        0.488_602_51 * z,
        0.488_602_51 * x,
        1.092_548_4 * x * y,
        1.092_548_4 * y * z,
        0.315_391_57 * (3.0 * zz - 1.0),
        1.092_548_4 * x * z,
        0.546_274_2 * (xx - yy),
        0.590_043_6 * y * (3.0 * xx - yy),
        2.890_611_4 * x * y * z,
        0.457_045_8 * y * (5.0 * zz - 1.0),
        0.373_176_33 * z * (5.0 * zz - 3.0),
        0.457_045_8 * x * (5.0 * zz - 1.0),
        1.445_305_7 * z * (xx - yy),
        0.590_043_6 * x * (xx - 3.0 * yy),
    ]
}

/// Σ aᵢ bᵢ: the integral over the sphere of the product of two functions; with [`evaluate`] of a direction the value there.
#[inline]
pub fn dot(a: &Coefficients, b: &Coefficients) -> f32 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// What coefficients of incident radiance are multiplied with to give the irradiance of a surface with unit normal
/// `normal`, ∫ L max(0, n·ω) dω: the clamped cosine's own coefficients, so that it is exact for radiance of these degrees.
#[inline]
pub fn irradiance_factors(normal: Vec3) -> Coefficients {
    // The clamped cosine's coefficients per degree; its degree 3 vanishes.
    const COSINE: [f32; MAX_DEGREE + 1] = [PI, 2.0 * PI / 3.0, PI / 4.0, 0.0];
    let mut y = evaluate(normal);
    for (l, factor) in COSINE.iter().enumerate() {
        y[l * l..count(l)].iter_mut().for_each(|y| *y *= factor);
    }
    y
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;
    use crate::test_random::direction;

    /// (direction, solid angle) of a product rule, Gauss's with four nodes along z and eight even angles: exact
    /// for polynomials of degree 7.
    fn quadrature() -> Vec<(Vec3, f32)> {
        let inner = (3.0f64 / 7.0 - 2.0 / 7.0 * 1.2f64.sqrt()).sqrt();
        let outer = (3.0f64 / 7.0 + 2.0 / 7.0 * 1.2f64.sqrt()).sqrt();
        let (heavy, light) = ((18.0 + 30f64.sqrt()) / 36.0, (18.0 - 30f64.sqrt()) / 36.0);
        let mut rule = Vec::new();
        for (z, w) in [(inner, heavy), (-inner, heavy), (outer, light), (-outer, light)] {
            for k in 0..8 {
                let (sin, cos) = (std::f64::consts::TAU * (f64::from(k) + 0.3) / 8.0).sin_cos();
                let r = (1.0 - z * z).sqrt();
                let direction = glam::DVec3::new(r * cos, r * sin, z).as_vec3();
                rule.push((direction, (w * std::f64::consts::TAU / 8.0) as f32));
            }
        }
        rule
    }

    /// ∫ f Y dω.
    fn projected(f: impl Fn(Vec3) -> f32) -> Coefficients {
        let mut sums = [0.0; COUNT];
        for (direction, weight) in quadrature() {
            let value = f(direction) * weight;
            sums.iter_mut()
                .zip(evaluate(direction))
                .for_each(|(sum, y)| *sum += value * y);
        }
        sums
    }

    /// Sixteen values of a few units of rounding of numbers below 3.
    const ROUNDING: f32 = 4e-6;

    #[test]
    fn functions_are_orthonormal() {
        for i in 0..COUNT {
            for (j, c) in projected(|d| evaluate(d)[i]).into_iter().enumerate() {
                let exact = if i == j { 1.0 } else { 0.0 };
                assert!((c - exact).abs() < ROUNDING, "{i} with {j}: {c}");
            }
        }
    }

    #[test]
    fn a_degree_sums_to_legendres_polynomial_of_the_angle() {
        // Addition theorem: Σ_m Y_lm(a) Y_lm(b) = (2l + 1)/4π · P_l(a·b), P_l written out.
        let mut s = Stream::new(41, 0, 0);
        for _ in 0..1000 {
            let (a, b) = (direction(&mut s), direction(&mut s));
            let (ya, yb) = (evaluate(a), evaluate(b));
            let t = a.dot(b);
            let legendre = [1.0, t, 1.5 * t * t - 0.5, 2.5 * t * t * t - 1.5 * t];
            for l in 0..=MAX_DEGREE {
                let sum: f32 = (l * l..count(l)).map(|i| ya[i] * yb[i]).sum();
                let exact = (2 * l + 1) as f32 / (4.0 * PI) * legendre[l];
                assert!((sum - exact).abs() < ROUNDING, "degree {l}: {sum}, not {exact}");
            }
        }
    }

    #[test]
    fn irradiance_is_the_cosine_integral() {
        // Radiance 1 + z + z²: on a surface that faces +z ∫ L cosθ dω = 2π(1/2 + 1/3 + 1/4) = 13π/6, on one that
        // faces −z 2π(1/2 − 1/3 + 1/4) = 5π/6, by hand.
        let c = projected(|d| 1.0 + d.z + d.z * d.z);
        for (normal, exact) in [(Vec3::Z, 13.0 * PI / 6.0), (Vec3::NEG_Z, 5.0 * PI / 6.0)] {
            assert!((dot(&c, &irradiance_factors(normal)) - exact).abs() < 10.0 * ROUNDING);
        }
    }
}
