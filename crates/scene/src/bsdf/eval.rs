//! The BRDF in single directions: its value, its density and its samples.

use super::microfacet::{
    Half, cosine_above, cosines, fresnel, ggx_distribution, masking, sample_visible_normal, smith_root,
    visibility,
};
use super::{albedo, mixture};
use crate::shading::ShadingPoint;
use glam::Vec3;
use std::f32::consts::{FRAC_1_PI, TAU};

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
