//! Reflection: Lambert, the metallic-roughness BRDF of glTF 2.0 appendix B, and, for edited materials, modified
//! [`phong`] and [`ward`].
//!
//! Metallic-roughness: with h half way between the directions wo and wi, both away from the surface, n the shading normal and α
//! roughness squared:
//!
//! * F = f0 + (1 − f0)(1 − wo·h)⁵ (Schlick), f0 between 0.04 and the base colour by metallic,
//! * D the GGX distribution, V = G / (4 (n·wo)(n·wi)) with Smith's height-correlated masking and shadowing,
//! * f = (1 − F) c_diff / π + F D V.
//!
//! Reflection is two-sided: the point's normals are on the viewer's side already. A direction below the
//! geometric surface or below the shading normal's horizon reflects nothing.
//!
//! Deviation: as printed, the sum exceeds one for bright, smooth dielectrics seen at grazing angles (1.4 for
//! white at 82°, since the half vector's Fresnel term takes almost nothing from the diffuse part there), and
//! light would grow from bounce to bounce. The diffuse part is therefore multiplied by s(n·wo) s(n·wi), with s
//! the largest factor up to 1 that leaves the total at one: s(μ) = min(1, (1 − E(μ)) / D(μ)), where E and D are
//! the directional albedos of the two parts (tables of [`albedo`]). It is 1 wherever the printed sum conserves
//! energy, and symmetric, so that reciprocity holds.
//!
//! Sampling: one lobe, chosen by its albedo; the specular one by visible normals (Heitz 2018, in the form of
//! Dupuy and Benyoub 2023), the diffuse one by cosine. The density is that of the mixture.

pub mod albedo;
pub mod bounds;
mod frame;
mod integrate;
mod lobe;
mod mixture;
#[cfg(test)]
mod model_tests;
mod phong;
#[cfg(test)]
mod tests;
mod ward;

use crate::shading::ShadingPoint;
use glam::Vec3;
use std::f32::consts::{FRAC_1_PI, PI, TAU};

pub use albedo::hemispherical_albedo;
pub use integrate::{Incident, Viewed, integrate, integrate_diffuse, irradiance};
pub use lobe::{Lobe, at_least_as_wide, lobe, spread_by_normals, width_facing};
pub use phong::{MAX_EXPONENT, exponent_of_alpha};

/// Directions with a smaller cosine count as below the horizon: their light is beyond what f32 resolves, and
/// V, which grows as 1/cosine, would overflow.
const MIN_COSINE: f32 = 1e-7;

/// A sampled direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BsdfSample {
    /// Unit vector away from the surface.
    pub wi: Vec3,
    /// BRDF × cosine / density.
    pub weight: Vec3,
    /// Density per solid angle, 1/sr.
    pub pdf: f32,
}

/// BRDF in 1/sr, without the cosine, for light from `wi` seen from `wo` (unit vectors away from the surface).
/// Zero where either is below the geometric or the shading horizon; finite everywhere.
pub fn eval(point: &ShadingPoint, wo: Vec3, wi: Vec3) -> Vec3 {
    let Some((cos_o, cos_i)) = cosines(point, wo, wi) else {
        return Vec3::ZERO;
    };
    if point.lambert {
        return point.diffuse * FRAC_1_PI;
    }
    if let Some(lobe) = mixture::Lobe::of(point) {
        return lobe.eval(point, wo, wi);
    }
    let half = Half::new(point.shading_normal, wo, wi);
    reflect(point, cos_o, cos_i, &half)
}

/// Share of the light from a direction at cosine `cos` with the shading normal that the diffuse part reflects, RGB in
/// 0..=1: what a virtual point light passes on.
pub fn diffuse_reflectance(point: &ShadingPoint, cos: f32) -> Vec3 {
    if point.lambert || mixture::Lobe::of(point).is_some() {
        return point.diffuse;
    }
    albedo::diffuse_limit(point, cos)
}

/// Share of even light that the specular part reflects towards `wo`, RGB in 0..=1: for GGX within 3e-3, for Phong and Ward
/// roughly. Zero where there is none, or `wo` is below a horizon.
pub fn lobe_albedo(point: &ShadingPoint, wo: Vec3) -> Vec3 {
    match (cosine_above(point, wo), mixture::Lobe::of(point)) {
        (None, _) => Vec3::ZERO,
        _ if point.lambert => Vec3::ZERO,
        (Some(cos), Some(lobe)) => lobe.rough_albedo(point, cos),
        (Some(cos), None) => albedo::specular(point.f0, point.alpha, cos),
    }
}

/// Samples a direction of the specular part alone for light seen from `wo`, and its value × cosine / density; `u` as in
/// [`sample`]. `None` for matt surfaces and where either direction is below a horizon.
pub fn sample_lobe(point: &ShadingPoint, wo: Vec3, u: [f32; 2]) -> Option<(Vec3, Vec3)> {
    if point.lambert || cosine_above(point, wo).is_none() {
        return None;
    }
    if let Some(lobe) = mixture::Lobe::of(point) {
        let (wi, weight) = lobe.sample_specular(point, wo, u);
        cosines(point, wo, wi)?;
        return weight.is_finite().then_some((wi, weight));
    }
    let (wi, half) = visible_reflection(point, wo, u);
    let (cos_o, cos_i) = cosines(point, wo, wi)?;
    Some((
        wi,
        fresnel(point.f0, half.cos_oh) * masking(cos_o, cos_i, point.alpha),
    ))
}

/// Density with which [`sample`] returns `wi`, per solid angle (1/sr).
pub fn pdf(point: &ShadingPoint, wo: Vec3, wi: Vec3) -> f32 {
    let Some((cos_o, cos_i)) = cosines(point, wo, wi) else {
        return 0.0;
    };
    if let Some(lobe) = mixture::Lobe::of(point) {
        return lobe.pdf(point, wo, wi, (cos_o, cos_i));
    }
    let half = Half::new(point.shading_normal, wo, wi);
    density(point, cos_o, cos_i, &half, specular_probability(point, cos_o))
}

/// Samples a direction for light seen from `wo`; `u` are three uniform numbers in [0, 1). `None` where the
/// surface reflects nothing or the sampled direction is below a horizon: such a sample contributes nothing.
pub fn sample(point: &ShadingPoint, wo: Vec3, u: [f32; 3]) -> Option<BsdfSample> {
    let n = point.shading_normal;
    let cos_o = cosine_above(point, wo)?;
    if point.diffuse == Vec3::ZERO && point.f0 == Vec3::ZERO {
        return None;
    }
    if let Some(lobe) = mixture::Lobe::of(point) {
        let wi = lobe.direction(point, wo, u);
        let cosines = cosines(point, wo, wi)?;
        let pdf = lobe.pdf(point, wo, wi, cosines);
        let weight = lobe.eval(point, wo, wi) * (cosines.1 / pdf);
        return (pdf > 0.0 && pdf.is_finite() && weight.is_finite()).then_some(BsdfSample {
            wi,
            weight,
            pdf,
        });
    }
    let p_specular = specular_probability(point, cos_o);
    let (wi, half) = if u[2] < p_specular {
        visible_reflection(point, wo, [u[0], u[1]])
    } else {
        let (tangent, bitangent) = n.any_orthonormal_pair();
        let radius = u[0].sqrt();
        let (sin, cos) = (TAU * u[1]).sin_cos();
        let local = Vec3::new(radius * cos, radius * sin, (1.0 - u[0]).sqrt());
        let wi = (tangent * local.x + bitangent * local.y + n * local.z).normalize();
        (wi, Half::new(n, wo, wi))
    };
    let (cos_o, cos_i) = cosines(point, wo, wi)?;
    let pdf = density(point, cos_o, cos_i, &half, p_specular);
    let f = if point.lambert {
        point.diffuse * FRAC_1_PI
    } else {
        reflect(point, cos_o, cos_i, &half)
    };
    let weight = f * (cos_i / pdf);
    (pdf > 0.0 && weight.is_finite()).then_some(BsdfSample { wi, weight, pdf })
}

/// Reflects `wo` in a visible normal of the GGX microsurface.
fn visible_reflection(point: &ShadingPoint, wo: Vec3, u: [f32; 2]) -> (Vec3, Half) {
    let n = point.shading_normal;
    let (tangent, bitangent) = n.any_orthonormal_pair();
    let local_o = Vec3::new(tangent.dot(wo), bitangent.dot(wo), n.dot(wo));
    let local_h = sample_visible_normal(local_o, point.alpha, u);
    let cos_oh = local_o.dot(local_h);
    let local = local_h * (2.0 * cos_oh) - local_o;
    let wi = (tangent * local.x + bitangent * local.y + n * local.z).normalize();
    // The sampled half vector itself, not the one recomputed from rounded directions.
    let sin2_h = local_h.x * local_h.x + local_h.y * local_h.y;
    (wi, Half { sin2_h, cos_oh })
}

/// What the distribution and the Fresnel term need of the half vector.
struct Half {
    /// Squared sine of its angle with the normal: 1 − cos² would lose all digits for small α.
    sin2_h: f32,
    cos_oh: f32,
}

impl Half {
    fn new(normal: Vec3, wo: Vec3, wi: Vec3) -> Half {
        // Opposite directions are both on the horizon; any half vector will do.
        let half = (wo + wi).try_normalize().unwrap_or(normal);
        Half {
            sin2_h: normal.cross(half).length_squared().min(1.0),
            cos_oh: wo.dot(half).clamp(0.0, 1.0),
        }
    }
}

/// Cosine of a direction with the shading normal, or `None` where it is below a horizon.
fn cosine_above(point: &ShadingPoint, direction: Vec3) -> Option<f32> {
    let cos = point.shading_normal.dot(direction);
    (cos > MIN_COSINE && point.geometric_normal.dot(direction) > 0.0).then_some(cos)
}

/// [`cosine_above`] of both directions.
fn cosines(point: &ShadingPoint, wo: Vec3, wi: Vec3) -> Option<(f32, f32)> {
    cosine_above(point, wo).zip(cosine_above(point, wi))
}

/// Schlick's term F.
fn fresnel(f0: Vec3, cos_oh: f32) -> Vec3 {
    f0 + (Vec3::ONE - f0) * (1.0 - cos_oh).max(0.0).powi(5)
}

fn reflect(point: &ShadingPoint, cos_o: f32, cos_i: f32, half: &Half) -> Vec3 {
    let fresnel = fresnel(point.f0, half.cos_oh);
    let specular = ggx_distribution(half.sin2_h, point.alpha) * visibility(cos_o, cos_i, point.alpha);
    let mut f = fresnel * specular;
    if point.diffuse != Vec3::ZERO {
        let conserve = albedo::diffuse_scale(point, cos_o) * albedo::diffuse_scale(point, cos_i);
        f += (Vec3::ONE - fresnel) * point.diffuse * conserve * FRAC_1_PI;
    }
    f
}

fn density(point: &ShadingPoint, cos_o: f32, cos_i: f32, half: &Half, p_specular: f32) -> f32 {
    let diffuse = (1.0 - p_specular) * cos_i * FRAC_1_PI;
    if p_specular == 0.0 {
        return diffuse;
    }
    // D G1(wo) / (4 cos_o), with G1 = 2 cos_o / (cos_o + √(α² + (1 − α²) cos_o²)).
    let specular =
        ggx_distribution(half.sin2_h, point.alpha) * 0.5 / (cos_o + smith_root(cos_o, point.alpha));
    diffuse + p_specular * specular
}

/// Probability of the specular lobe: its share of the directional albedo.
fn specular_probability(point: &ShadingPoint, cos_o: f32) -> f32 {
    if point.lambert {
        return 0.0;
    }
    if point.diffuse == Vec3::ZERO {
        return 1.0;
    }
    let specular = albedo::specular(point.f0, point.alpha, cos_o).element_sum();
    let diffuse = (albedo::diffuse_limit(point, cos_o)).element_sum();
    // Both lobes keep a chance, so that no rounding of the tables makes a weight explode.
    (specular / (specular + diffuse)).clamp(0.02, 0.98)
}

/// D in 1/sr, from the squared sine of the half vector's angle with the normal.
fn ggx_distribution(sin2_h: f32, alpha: f32) -> f32 {
    let alpha2 = alpha * alpha;
    let root = alpha2 * (1.0 - sin2_h) + sin2_h;
    alpha2 / (PI * root * root)
}

/// √(α² + (1 − α²) cos²), the length that Smith's functions share.
fn smith_root(cos: f32, alpha: f32) -> f32 {
    let alpha2 = alpha * alpha;
    (alpha2 + (1.0 - alpha2) * cos * cos).sqrt()
}

/// V = G / (4 cos_o cos_i), Smith's height-correlated form.
fn visibility(cos_o: f32, cos_i: f32, alpha: f32) -> f32 {
    let with_root = |cos| (cos, smith_root(cos, alpha));
    visibility_by_roots(with_root(cos_o), with_root(cos_i))
}

/// [`visibility`] from each cosine with its [`smith_root`].
fn visibility_by_roots((cos_o, root_o): (f32, f32), (cos_i, root_i): (f32, f32)) -> f32 {
    0.5 / (cos_i * root_o + cos_o * root_i)
}

/// G2/G1, both in Smith's height-correlated form: what is left of a visible normal's reflection.
fn masking(cos_o: f32, cos_i: f32, alpha: f32) -> f32 {
    let (root_o, root_i) = (smith_root(cos_o, alpha), smith_root(cos_i, alpha));
    cos_i * (cos_o + root_o) / (cos_i * root_o + cos_o * root_i)
}

/// A normal of the microsurface as seen from `wo`, local space (z = shading normal), by Dupuy and Benyoub,
/// "Sampling Visible GGX Normals with Spherical Caps" (2023).
fn sample_visible_normal(wo: Vec3, alpha: f32, u: [f32; 2]) -> Vec3 {
    // To the configuration where the microsurface is a hemisphere.
    let stretched = Vec3::new(wo.x * alpha, wo.y * alpha, wo.z).normalize();
    // Directions that the hemisphere reflects into form a spherical cap: sample it evenly.
    let z = (1.0 - u[0]) * (1.0 + stretched.z) - stretched.z;
    let radius = (1.0 - z * z).max(0.0).sqrt();
    let (sin, cos) = (TAU * u[1]).sin_cos();
    let half = Vec3::new(radius * cos, radius * sin, z) + stretched;
    Vec3::new(half.x * alpha, half.y * alpha, half.z.max(f32::MIN_POSITIVE)).normalize()
}
