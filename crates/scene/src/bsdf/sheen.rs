//! The lobe of KHR_materials_sheen: the "Charlie" distribution with its own shadowing.
//!
//! Source: Estevez and Kulla 2017, "Production friendly microfacet sheen BRDF", equations 2 and 3 and the fit of table 1, as the
//! extension's appendix prints them: D = (2 + 1/α) sin^{1/α} θ_h / 2π, V = 1 / ((1 + Λ(θo) + Λ(θi)) 4 cosθo cosθi), F = 1.

use super::microfacet::Half;
use glam::Vec3;
use std::f32::consts::TAU;
use std::sync::LazyLock;

/// Smallest α, of perceptual roughness 0.07: below, the lobe is a rim that no picture resolves, and tables don't either.
pub const MIN_SHEEN_ALPHA: f32 = 0.0049;

/// Nodes of the table over μ^½ and over perceptual roughness.
const COSINES: usize = 64;
const ROUGHNESSES: usize = 32;
/// Directions per node; a Fibonacci number, with the one before it.
const QUADRATURE: usize = 987;
const BEFORE: usize = 610;

/// The lobe's value in 1/sr, both directions above the horizon; `cosines` are those with the shading normal.
pub(super) fn value(alpha: f32, (cos_o, cos_i): (f32, f32), half: &Half) -> f32 {
    distribution(alpha, half.sin2_h) * received(alpha, cos_o, cos_i) / cos_i
}

/// Most that the lobe × cosine can be seen at cosine `cos_o`, whatever the light's direction.
pub(super) fn most(alpha: f32, cos_o: f32) -> f32 {
    // Light's own shadowing is at least that of light from above.
    distribution(alpha, 1.0) / ((1.0 + shadowing(alpha, cos_o)) * 4.0 * cos_o)
}

fn distribution(alpha: f32, sin2_h: f32) -> f32 {
    let inverse = alpha.recip();
    (2.0 + inverse) * sin2_h.powf(0.5 * inverse) / TAU
}

/// V × cosθi.
fn received(alpha: f32, cos_o: f32, cos_i: f32) -> f32 {
    let shadowed = 1.0 + shadowing(alpha, cos_o) + shadowing(alpha, cos_i);
    (shadowed * 4.0 * cos_o).recip()
}

/// Λ of a direction at this cosine with the normal.
fn shadowing(alpha: f32, cos: f32) -> f32 {
    let weight = (1.0 - alpha) * (1.0 - alpha);
    let mix = |rough: f32, smooth: f32| rough + (smooth - rough) * weight;
    let [a, b, c, d, e] = [
        mix(21.5473, 25.3245),
        mix(3.82987, 3.32435),
        mix(0.19823, 0.16801),
        mix(-1.97760, -1.27393),
        mix(-4.32054, -4.85967),
    ];
    let l = |x: f32| a / (1.0 + b * x.powf(c)) + d * x + e;
    let cos = cos.clamp(0.0, 1.0);
    if cos < 0.5 {
        l(cos).exp()
    } else {
        (2.0 * l(0.5) - l(1.0 - cos)).exp()
    }
}

static TABLE: LazyLock<Vec<f32>> = LazyLock::new(|| {
    (0..ROUGHNESSES * COSINES)
        .map(|at| {
            let root = (at % COSINES) as f32 / (COSINES - 1) as f32;
            integrate(node_alpha(at / COSINES), (root * root).max(1e-5))
        })
        .collect()
});

fn node_alpha(at: usize) -> f32 {
    let lowest = MIN_SHEEN_ALPHA.sqrt();
    (lowest + (1.0 - lowest) * at as f32 / (ROUGHNESSES - 1) as f32).powi(2)
}

/// Directional albedo by directions that are even over the hemisphere, for which lobe × cosine is bounded.
fn integrate(alpha: f32, cos_o: f32) -> f32 {
    let wo = Vec3::new((1.0 - cos_o * cos_o).max(0.0).sqrt(), 0.0, cos_o);
    let mut sum = 0.0f64;
    for k in 0..QUADRATURE {
        let cos = (k as f32 + 0.5) / QUADRATURE as f32;
        let turn = (k * BEFORE % QUADRATURE) as f32 / QUADRATURE as f32;
        // Squared, since the lobe is brightest near the horizon; the factor below is the density's.
        let cos_i = cos * cos;
        let (sin, cosine) = (TAU * turn).sin_cos();
        let radius = (1.0 - cos_i * cos_i).max(0.0).sqrt();
        let wi = Vec3::new(radius * cosine, radius * sin, cos_i);
        let half = Half::new(Vec3::Z, wo, wi);
        sum += f64::from(distribution(alpha, half.sin2_h) * received(alpha, cos_o, cos_i) * 2.0 * cos);
    }
    (sum * f64::from(TAU) / QUADRATURE as f64) as f32
}

/// Directional albedo of the lobe seen at cosine `cos`, within 1e-2; up to 3 for the least roughness at grazing views.
pub(super) fn albedo(alpha: f32, cos: f32) -> f32 {
    let place = |x: f32, nodes: usize| {
        let x = x.clamp(0.0, 1.0) * (nodes - 1) as f32;
        let at = (x as usize).min(nodes - 2);
        (at, x - at as f32)
    };
    let lowest = MIN_SHEEN_ALPHA.sqrt();
    let (row, fr) = place((alpha.sqrt() - lowest) / (1.0 - lowest), ROUGHNESSES);
    let (column, fc) = place(cos.clamp(0.0, 1.0).sqrt(), COSINES);
    let at = |row: usize| {
        let row = &TABLE[row * COSINES..(row + 1) * COSINES];
        row[column] * (1.0 - fc) + row[column + 1] * fc
    };
    at(row) * (1.0 - fr) + at(row + 1) * fr
}
