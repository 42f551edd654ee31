//! The lobe of modified Phong, normalised: (n + 2)/2π · cosⁿ of the angle with the mirror direction.
//!
//! Source: Lafortune and Willems 1994. It is symmetric in both directions; its directional albedo is 1 at normal
//! incidence and falls to about n·wo for large exponents, so that a specular factor and a diffuse albedo that
//! sum to at most 1 conserve energy.

use glam::Vec3;
use std::f32::consts::{FRAC_1_PI, PI, TAU};

/// Largest exponent: its lobe is a tenth of a degree wide, and f32 still resolves it (the sine of the angle with
/// the mirror direction is known to some 1e-7, a ten-thousandth of that).
pub const MAX_EXPONENT: f32 = 1e6;

/// The exponent whose lobe is as wide as GGX's or Ward's of this α at normal incidence: with θ ≈ 2θ_h,
/// cosⁿθ ≈ exp(−nθ²/2) equals exp(−θ_h²/α²) where n = 1/(2α²). Less ½, so that α = 1 is n = 0.
pub fn exponent_of_alpha(alpha: f32) -> f32 {
    let n = 0.5 / (alpha * alpha) - 0.5;
    if n.is_nan() {
        0.0
    } else {
        n.clamp(0.0, MAX_EXPONENT)
    }
}

/// The lobe's value in 1/sr and the density with which [`sample`] draws `wi`, per solid angle.
pub(super) fn value_and_density(exponent: f32, normal: Vec3, wo: Vec3, wi: Vec3) -> (f32, f32) {
    let mirror = mirrored(normal, wo);
    if mirror.dot(wi) <= 0.0 {
        return (0.0, 0.0);
    }
    // cosⁿ from the sine: the cosine loses all digits near the lobe's middle.
    let sin2 = mirror.cross(wi).length_squared().min(1.0);
    let power = if exponent == 0.0 {
        1.0
    } else {
        (0.5 * exponent * (-sin2).ln_1p()).exp()
    };
    let scale = power * (0.5 * FRAC_1_PI);
    (scale * (exponent + 2.0), scale * (exponent + 1.0))
}

/// A direction with density ∝ cosⁿ around the mirror direction.
pub(super) fn sample(exponent: f32, normal: Vec3, wo: Vec3, u: [f32; 2]) -> Vec3 {
    let mirror = mirrored(normal, wo).normalize();
    let (x, y) = mirror.any_orthonormal_pair();
    // cos² = (1 − u)^(2 / (n + 1)), written so that its complement keeps its digits.
    let sin2 = -(2.0 / (exponent + 1.0) * (-u[0]).ln_1p()).exp_m1();
    let (sin, cos) = (TAU * u[1]).sin_cos();
    let radius = sin2.clamp(0.0, 1.0).sqrt();
    (x * (radius * cos) + y * (radius * sin) + mirror * (1.0 - sin2).max(0.0).sqrt()).normalize()
}

/// Rough directional albedo at cosine `cos`: exact at normal incidence and for a mirror. It only decides how
/// often the lobe is drawn.
pub(super) fn rough_albedo(exponent: f32, cos: f32) -> f32 {
    (2.0 + exponent * cos) / (exponent + 2.0)
}

/// Share of cosine-weighted light that the lobe reflects in all: 2/3 + 2 W / (3π (n + 2)), where W = ∫₀^{π/2}
/// cosⁿ. (The double integral over both hemispheres depends on the angle γ between direction and mirror
/// direction alone once their common rotation is averaged, with weight (sin γ + (π − γ) cos γ) / 6π.)
///
/// W is taken as √(π / (2n + 1 + 0.273 / (n + 1))), right to 1e-3 of itself: an error below 2e-4.
pub(super) fn hemispherical_albedo(exponent: f32) -> f32 {
    let wallis = (PI / (2.0 * exponent + 1.0 + 0.273 / (exponent + 1.0))).sqrt();
    2.0 / 3.0 + 2.0 * wallis / (3.0 * PI * (exponent + 2.0))
}

pub(super) fn mirrored(normal: Vec3, wo: Vec3) -> Vec3 {
    normal * (2.0 * normal.dot(wo)) - wo
}
