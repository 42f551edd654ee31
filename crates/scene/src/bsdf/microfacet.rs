//! What the lobes share: horizons, half vectors, GGX, Smith's and Schlick's functions.

use crate::shading::ShadingPoint;
use glam::Vec3;
use std::f32::consts::{PI, TAU};

/// Directions with a smaller cosine count as below the horizon: their light is beyond what f32 resolves, and
/// V, which grows as 1/cosine, would overflow.
pub(super) const MIN_COSINE: f32 = 1e-7;

/// What the distribution and the Fresnel term need of the half vector.
pub(super) struct Half {
    /// Squared sine of its angle with the normal: 1 − cos² would lose all digits for small α.
    pub(super) sin2_h: f32,
    pub(super) cos_oh: f32,
}

impl Half {
    pub(super) fn new(normal: Vec3, wo: Vec3, wi: Vec3) -> Half {
        // Opposite directions are both on the horizon; any half vector will do.
        let half = (wo + wi).try_normalize().unwrap_or(normal);
        Half {
            sin2_h: normal.cross(half).length_squared().min(1.0),
            cos_oh: wo.dot(half).clamp(0.0, 1.0),
        }
    }
}

/// Cosine of a direction with the shading normal, or `None` where it is below a horizon.
pub(super) fn cosine_above(point: &ShadingPoint, direction: Vec3) -> Option<f32> {
    let cos = point.shading_normal.dot(direction);
    (cos > MIN_COSINE && point.geometric_normal.dot(direction) > 0.0).then_some(cos)
}

/// [`cosine_above`] of both directions.
pub(super) fn cosines(point: &ShadingPoint, wo: Vec3, wi: Vec3) -> Option<(f32, f32)> {
    cosine_above(point, wo).zip(cosine_above(point, wi))
}

/// Schlick's term F of the specular part.
pub(super) fn fresnel(point: &ShadingPoint, cos_oh: f32) -> Vec3 {
    point.f0 + (Vec3::splat(point.f90) - point.f0) * (1.0 - cos_oh).max(0.0).powi(5)
}

/// What of the light the specular part takes from the diffuse one, where its own term is `fresnel`.
pub(super) fn veil(point: &ShadingPoint, fresnel: Vec3, cos_oh: f32) -> Vec3 {
    match point.veil {
        Some([v0, v90]) => Vec3::splat(v0 + (v90 - v0) * (1.0 - cos_oh).max(0.0).powi(5)),
        None => fresnel,
    }
}

/// D in 1/sr, from the squared sine of the half vector's angle with the normal.
pub(super) fn ggx_distribution(sin2_h: f32, alpha: f32) -> f32 {
    let alpha2 = alpha * alpha;
    let root = alpha2 * (1.0 - sin2_h) + sin2_h;
    alpha2 / (PI * root * root)
}

/// √(α² + (1 − α²) cos²), the length that Smith's functions share.
pub(super) fn smith_root(cos: f32, alpha: f32) -> f32 {
    let alpha2 = alpha * alpha;
    (alpha2 + (1.0 - alpha2) * cos * cos).sqrt()
}

/// V = G / (4 cos_o cos_i), Smith's height-correlated form.
pub(super) fn visibility(cos_o: f32, cos_i: f32, alpha: f32) -> f32 {
    let with_root = |cos| (cos, smith_root(cos, alpha));
    visibility_by_roots(with_root(cos_o), with_root(cos_i))
}

/// [`visibility`] from each cosine with its [`smith_root`].
pub(super) fn visibility_by_roots((cos_o, root_o): (f32, f32), (cos_i, root_i): (f32, f32)) -> f32 {
    0.5 / (cos_i * root_o + cos_o * root_i)
}

/// G2/G1, both in Smith's height-correlated form: what is left of a visible normal's reflection.
pub(super) fn masking(cos_o: f32, cos_i: f32, alpha: f32) -> f32 {
    let (root_o, root_i) = (smith_root(cos_o, alpha), smith_root(cos_i, alpha));
    cos_i * (cos_o + root_o) / (cos_i * root_o + cos_o * root_i)
}

/// A normal of the microsurface as seen from `wo`, local space (z = shading normal), by Dupuy and Benyoub,
/// "Sampling Visible GGX Normals with Spherical Caps" (2023).
pub(super) fn sample_visible_normal(wo: Vec3, alpha: f32, u: [f32; 2]) -> Vec3 {
    sample_visible_normal_of(wo, [alpha; 2], u)
}

/// The same of a microsurface that is anisotropic along x and y.
pub(super) fn sample_visible_normal_of(wo: Vec3, alpha: [f32; 2], u: [f32; 2]) -> Vec3 {
    // To the configuration where the microsurface is a hemisphere.
    let stretched = Vec3::new(wo.x * alpha[0], wo.y * alpha[1], wo.z).normalize();
    // Directions that the hemisphere reflects into form a spherical cap: sample it evenly.
    let z = (1.0 - u[0]) * (1.0 + stretched.z) - stretched.z;
    let radius = (1.0 - z * z).max(0.0).sqrt();
    let (sin, cos) = (TAU * u[1]).sin_cos();
    let half = Vec3::new(radius * cos, radius * sin, z) + stretched;
    Vec3::new(
        half.x * alpha[0],
        half.y * alpha[1],
        half.z.max(f32::MIN_POSITIVE),
    )
    .normalize()
}
