//! The BRDF in single directions: its value, its density and its samples.

use super::anisotropic::Anisotropic;
use super::layers::{Over, base_point, coat_point};
use super::microfacet::{
    Half, cosine_above, cosines, fresnel, ggx_distribution, masking, sample_visible_normal, smith_root, veil,
    visibility,
};
use super::{albedo, mixture, sheen};
use crate::shading::{Layers, ShadingPoint};
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
    if let Some(layers) = &point.layers {
        return layered(point, layers, wo, wi, eval) + coated(point, layers, wo, wi, cos_i);
    }
    let half = Half::new(point.shading_normal, wo, wi);
    match Anisotropic::of(point) {
        None => reflect(point, cos_o, cos_i, &half),
        Some(lobe) => {
            let pair = lobe.pair(wo, wi);
            fresnel(point, pair.cos_oh) * pair.value + diffuse(point, cos_o, cos_i, pair.cos_oh)
        }
    }
}

/// [`eval`] of the diffuse part alone, and of sheen.
pub fn eval_diffuse(point: &ShadingPoint, wo: Vec3, wi: Vec3) -> Vec3 {
    let Some((cos_o, cos_i)) = cosines(point, wo, wi) else {
        return Vec3::ZERO;
    };
    if point.lambert || !point.gloss.is_ggx() {
        return point.diffuse * FRAC_1_PI;
    }
    if let Some(layers) = &point.layers {
        return layered(point, layers, wo, wi, eval_diffuse);
    }
    let half = Half::new(point.shading_normal, wo, wi);
    diffuse(point, cos_o, cos_i, half.cos_oh)
}

/// Sheen, and what `base` is of what lies under it and under the clearcoat.
fn layered(
    point: &ShadingPoint,
    layers: &Layers,
    wo: Vec3,
    wi: Vec3,
    base: fn(&ShadingPoint, Vec3, Vec3) -> Vec3,
) -> Vec3 {
    let over = Over::new(point, layers, wo);
    let mut f = base(&base_point(point), wo, wi) * over.base;
    if over.sheen != Vec3::ZERO
        && let Some(cosines) = cosines(point, wo, wi)
    {
        let half = Half::new(point.shading_normal, wo, wi);
        f += over.sheen * sheen::value(layers.sheen_alpha, cosines, &half);
    }
    f
}

/// The clearcoat's part, whose cosine is the one with its own normal: `cos_i` is that with the surface's, which callers multiply by.
fn coated(point: &ShadingPoint, layers: &Layers, wo: Vec3, wi: Vec3, cos_i: f32) -> Vec3 {
    let over = Over::new(point, layers, wo);
    if over.coat <= 0.0 {
        return Vec3::ZERO;
    }
    let coat = coat_point(point, layers);
    eval(&coat, wo, wi) * (over.coat * coat.shading_normal.dot(wi) / cos_i)
}

/// Share of the light from a direction at cosine `cos` with the shading normal that the diffuse part reflects, RGB in
/// 0..=1: what a virtual point light passes on. With what sheen reflects.
pub fn diffuse_reflectance(point: &ShadingPoint, cos: f32) -> Vec3 {
    if point.lambert || mixture::Lobe::of(point).is_some() {
        return point.diffuse;
    }
    let own = albedo::diffuse_limit(point, cos);
    match &point.layers {
        Some(layers) => {
            let over = Over::at(layers, cos, cos);
            own * over.base + over.sheen * over.sheen_albedo
        }
        None => own,
    }
}

/// Share of even light that the specular part, with clearcoat, reflects towards `wo`, RGB in 0..=1: for GGX within 3e-3, for
/// Phong, Ward and anisotropic GGX roughly. Zero where there is none, or `wo` is below a horizon.
pub fn lobe_albedo(point: &ShadingPoint, wo: Vec3) -> Vec3 {
    match (cosine_above(point, wo), mixture::Lobe::of(point)) {
        (None, _) => Vec3::ZERO,
        _ if point.lambert => Vec3::ZERO,
        (Some(cos), Some(lobe)) => lobe.rough_albedo(point, cos),
        (Some(cos), None) => {
            let own = albedo::specular(point, cos);
            match &point.layers {
                Some(layers) => {
                    let over = Over::new(point, layers, wo);
                    own * over.base + over.coat * coat_albedo(layers, wo)
                }
                None => own,
            }
        }
    }
}

/// Directional albedo of the clearcoat's lobe.
fn coat_albedo(layers: &Layers, wo: Vec3) -> f32 {
    albedo::white(layers.coat_alpha, layers.coat_normal.dot(wo))
}

/// Samples a direction of the specular part alone, with clearcoat, for light seen from `wo`, and its value × cosine / density; `u` as in
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
    if let Some(layers) = &point.layers {
        let over = Over::new(point, layers, wo);
        let base = base_point(point);
        let coat_share = over.coat * coat_albedo(layers, wo);
        let whole = coat_share + over.base * lobe_albedo(&base, wo).max_element();
        let chance = coat_share / whole.max(f32::MIN_POSITIVE);
        let (lobe, factor, first) = if u[0] < chance {
            (coat_point(point, layers), over.coat / chance, u[0] / chance)
        } else {
            let rest = 1.0 - chance;
            (base, over.base / rest, ((u[0] - chance) / rest).min(BELOW_ONE))
        };
        let (wi, weight) = sample_lobe(&lobe, wo, [first, u[1]])?;
        cosines(point, wo, wi)?;
        return Some((wi, weight * factor));
    }
    if let Some(lobe) = Anisotropic::of(point) {
        let (wi, pair) = lobe.sample(wo, u);
        let (_, cos_i) = cosines(point, wo, wi)?;
        let weight = fresnel(point, pair.cos_oh) * (pair.value * cos_i / pair.density);
        return weight.is_finite().then_some((wi, weight));
    }
    let (wi, half) = visible_reflection(point, wo, u);
    let (cos_o, cos_i) = cosines(point, wo, wi)?;
    Some((
        wi,
        fresnel(point, half.cos_oh) * masking(cos_o, cos_i, point.alpha),
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
    if let Some(layers) = &point.layers {
        let [coat, sheen, base] = chances(point, layers, wo);
        return coat * pdf(&coat_point(point, layers), wo, wi)
            + sheen * cos_i * FRAC_1_PI
            + base * pdf(&base_point(point), wo, wi);
    }
    if let Some(lobe) = Anisotropic::of(point) {
        let specular = specular_probability(point, cos_o);
        return (1.0 - specular) * cos_i * FRAC_1_PI + specular * lobe.pair(wo, wi).density;
    }
    let half = Half::new(point.shading_normal, wo, wi);
    density(point, cos_o, cos_i, &half, specular_probability(point, cos_o))
}

/// Samples a direction for light seen from `wo`; `u` are three uniform numbers in [0, 1). `None` where the
/// surface reflects nothing or the sampled direction is below a horizon: such a sample contributes nothing.
pub fn sample(point: &ShadingPoint, wo: Vec3, u: [f32; 3]) -> Option<BsdfSample> {
    let n = point.shading_normal;
    let cos_o = cosine_above(point, wo)?;
    if let Some(layers) = &point.layers {
        let wi = layered_direction(point, layers, wo, u)?;
        return weighed(point, wo, wi);
    }
    // Metallic-roughness reflects at grazing angles even where f0 is zero.
    let grazing = !point.lambert && point.gloss.is_ggx() && point.f90 > 0.0;
    if point.diffuse == Vec3::ZERO && point.f0 == Vec3::ZERO && !grazing {
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
    if let Some(lobe) = Anisotropic::of(point) {
        let wi = if u[2] < specular_probability(point, cos_o) {
            lobe.sample(wo, [u[0], u[1]]).0
        } else {
            cosine_direction(n, [u[0], u[1]])
        };
        return weighed(point, wo, wi);
    }
    let p_specular = specular_probability(point, cos_o);
    let (wi, half) = if u[2] < p_specular {
        visible_reflection(point, wo, [u[0], u[1]])
    } else {
        let wi = cosine_direction(n, [u[0], u[1]]);
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

/// A direction about a normal with density cosine/π.
fn cosine_direction(normal: Vec3, u: [f32; 2]) -> Vec3 {
    let (tangent, bitangent) = normal.any_orthonormal_pair();
    let radius = u[0].sqrt();
    let (sin, cos) = (TAU * u[1]).sin_cos();
    let local = Vec3::new(radius * cos, radius * sin, (1.0 - u[0]).sqrt());
    (tangent * local.x + bitangent * local.y + normal * local.z).normalize()
}

/// A sample of this direction, by [`eval`] and [`pdf`].
fn weighed(point: &ShadingPoint, wo: Vec3, wi: Vec3) -> Option<BsdfSample> {
    let (_, cos_i) = cosines(point, wo, wi)?;
    let pdf = pdf(point, wo, wi);
    let weight = eval(point, wo, wi) * (cos_i / pdf);
    (pdf > 0.0 && pdf.is_finite() && weight.is_finite()).then_some(BsdfSample { wi, weight, pdf })
}

/// A direction of one of the layers, which may be below a horizon.
fn layered_direction(point: &ShadingPoint, layers: &Layers, wo: Vec3, u: [f32; 3]) -> Option<Vec3> {
    let [coat, sheen, base] = chances(point, layers, wo);
    if u[2] < coat {
        return sample(&coat_point(point, layers), wo, [u[0], u[1], 0.0]).map(|sample| sample.wi);
    }
    if u[2] < coat + sheen {
        return Some(cosine_direction(point.shading_normal, [u[0], u[1]]));
    }
    let rest = ((u[2] - coat - sheen) / base).min(BELOW_ONE);
    sample(&base_point(point), wo, [u[0], u[1], rest]).map(|sample| sample.wi)
}

/// The largest number below 1.
const BELOW_ONE: f32 = 1.0 - f32::EPSILON / 2.0;

/// Chances with which clearcoat, sheen and what lies under them are sampled: their shares of the directional albedo, roughly.
fn chances(point: &ShadingPoint, layers: &Layers, wo: Vec3) -> [f32; 3] {
    let over = Over::new(point, layers, wo);
    let cos_o = point.shading_normal.dot(wo);
    let base = base_point(point);
    let under = albedo::specular(&base, cos_o) + albedo::diffuse_limit(&base, cos_o);
    let coat = over.coat * coat_albedo(layers, wo);
    let sheen = over.sheen.max_element() * over.sheen_albedo;
    let base = over.base * under.max_element();
    let total = coat + sheen + base;
    // What is there keeps a chance, so that no rounding of the tables makes a weight explode.
    let least = |share: f32, there: bool| if there { (share / total).max(0.02) } else { 0.0 };
    let all = if total > 0.0 && (coat > 0.0 || sheen > 0.0) {
        [
            least(coat, over.coat > 0.0),
            least(sheen, over.sheen != Vec3::ZERO),
            least(base, point.diffuse != Vec3::ZERO || point.f90 > 0.0),
        ]
    } else {
        [0.0, 0.0, 1.0]
    };
    let sum: f32 = all.iter().sum();
    all.map(|chance| chance / sum)
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
    let specular = ggx_distribution(half.sin2_h, point.alpha) * visibility(cos_o, cos_i, point.alpha);
    fresnel(point, half.cos_oh) * specular + diffuse(point, cos_o, cos_i, half.cos_oh)
}

/// The diffuse part of metallic-roughness.
fn diffuse(point: &ShadingPoint, cos_o: f32, cos_i: f32, cos_oh: f32) -> Vec3 {
    if point.diffuse == Vec3::ZERO {
        return Vec3::ZERO;
    }
    let lost = veil(point, fresnel(point, cos_oh), cos_oh);
    let conserve = albedo::diffuse_scales(point, cos_o, cos_i);
    (Vec3::ONE - lost) * point.diffuse * conserve * FRAC_1_PI
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
    let specular = albedo::specular(point, cos_o).element_sum();
    let diffuse = (albedo::diffuse_limit(point, cos_o)).element_sum();
    // Both lobes keep a chance, so that no rounding of the tables makes a weight explode.
    (specular / (specular + diffuse)).clamp(0.02, 0.98)
}
