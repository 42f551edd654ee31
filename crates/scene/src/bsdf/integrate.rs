//! Reflected light of many directions at once, laid out for the compiler to take several at a time.

mod lanes;

use super::albedo::{self, DiffuseScale};
use super::eval::{eval, eval_diffuse};
use super::microfacet::{
    Half, MIN_COSINE, cosine_above, fresnel, ggx_distribution, smith_root, visibility_by_roots,
};
use crate::shading::ShadingPoint;
use glam::Vec3;
use lanes::{LANES, Lanes};
use std::f32::consts::{FRAC_1_PI, PI};

/// Light from many directions, structure of arrays, all of one length.
#[derive(Clone, Copy, Debug)]
pub struct Incident<'a> {
    /// Unit directions away from the surface: x, y, z.
    pub direction: [&'a [f32]; 3],
    /// Factor of each, such as its visibility.
    pub weight: &'a [f32],
    /// Flux on a perpendicular surface, RGB, W/m².
    pub flux: [&'a [f32]; 3],
}

/// Radiance towards `wo`: the sum of BRDF × cosine × weight × flux. The same as the sum over [`eval`] but for
/// rounding.
pub fn integrate(point: &ShadingPoint, wo: Vec3, light: &Incident) -> Vec3 {
    if point.lambert {
        return irradiance(point, light) * point.diffuse * FRAC_1_PI;
    }
    let plain = albedo::is_plain(point);
    match Ggx::new(point, wo) {
        Some(ggx) if plain => ggx.integrate(light),
        None if plain => Vec3::ZERO,
        _ => one_by_one(point, wo, light, eval),
    }
}

/// [`integrate`] of the diffuse part alone, with sheen.
pub fn integrate_diffuse(point: &ShadingPoint, wo: Vec3, light: &Incident) -> Vec3 {
    let matt = point.diffuse == Vec3::ZERO && point.layers.is_none();
    if matt || cosine_above(point, wo).is_none() {
        return Vec3::ZERO;
    }
    if point.lambert || !point.gloss.is_ggx() {
        return irradiance(point, light) * point.diffuse * FRAC_1_PI;
    }
    match Ggx::new(point, wo) {
        Some(ggx) if albedo::is_plain(point) => ggx.integrate_diffuse(light),
        _ => one_by_one(point, wo, light, eval_diffuse),
    }
}

/// Σ cosine × weight × flux above both horizons. `direction` may be shorter than 1: a mean of directions gives the mean
/// of their cosines.
pub fn irradiance(point: &ShadingPoint, light: &Incident) -> Vec3 {
    let (shading, geometric) = (point.shading_normal, point.geometric_normal);
    let [sum] = accumulate(light, |direction, weight| {
        let cosine = dot(direction, shading).at_least(0.0);
        [(cosine * weight).where_above(dot(direction, geometric), 0.0)]
    });
    sum
}

#[inline(always)]
fn dot(v: [Lanes; 3], w: Vec3) -> Lanes {
    v[0] * w.x + v[1] * w.y + v[2] * w.z
}

/// Σ factor × flux for each of the `factors`(direction, weight).
#[inline(always)]
fn accumulate<const N: usize>(
    light: &Incident,
    factors: impl Fn([Lanes; 3], Lanes) -> [Lanes; N],
) -> [Vec3; N] {
    let n = light.weight.len();
    let direction = light.direction.map(|column| &column[..n]);
    let flux = light.flux.map(|column| &column[..n]);
    let mut sums = [[Lanes::splat(0.0); 3]; N];
    // One place that calls `factors`, or it would not be compiled into the loop.
    for chunk in 0..n.div_ceil(LANES) {
        let factors = factors(
            direction.map(|column| Lanes::of(column, chunk)),
            Lanes::of(light.weight, chunk),
        );
        for c in 0..3 {
            let flux = Lanes::of(flux[c], chunk);
            for k in 0..N {
                sums[k][c] = sums[k][c] + factors[k] * flux;
            }
        }
    }
    sums.map(|sum| Vec3::from(sum.map(Lanes::sum)))
}

fn one_by_one(
    point: &ShadingPoint,
    wo: Vec3,
    light: &Incident,
    eval: impl Fn(&ShadingPoint, Vec3, Vec3) -> Vec3,
) -> Vec3 {
    let mut sum = Vec3::ZERO;
    for (i, &weight) in light.weight.iter().enumerate() {
        let wi = Vec3::from(light.direction.map(|column| column[i]));
        let cosine = point.shading_normal.dot(wi);
        if weight > 0.0 && cosine > 0.0 {
            let flux = Vec3::from(light.flux.map(|column| column[i]));
            sum += eval(point, wo, wi) * flux * (cosine * weight);
        }
    }
    sum
}

/// A point as one viewer sees it: what many lights one after another share is found once.
pub struct Viewed<'a> {
    point: &'a ShadingPoint,
    wo: Vec3,
    /// Of the metallic-roughness BRDF without extensions.
    ggx: Option<Ggx<'a>>,
}

impl<'a> Viewed<'a> {
    /// Seen from `wo`, a unit vector away from the surface.
    pub fn new(point: &'a ShadingPoint, wo: Vec3) -> Viewed<'a> {
        let plain = !point.lambert && albedo::is_plain(point);
        Viewed {
            point,
            wo,
            ggx: if plain { Ggx::new(point, wo) } else { None },
        }
    }

    /// BRDF × cosine, 1/sr, for light from `wi` (unit, away from the surface): [`eval`]'s but for rounding.
    pub fn reflected(&self, wi: Vec3) -> Vec3 {
        let cosine = self.point.shading_normal.dot(wi).max(0.0);
        match &self.ggx {
            Some(ggx) => ggx.eval(wi) * cosine,
            None => eval(self.point, self.wo, wi) * cosine,
        }
    }
}

/// What of the metallic-roughness BRDF without extensions does not depend on where light comes from.
struct Ggx<'a> {
    point: &'a ShadingPoint,
    wo: Vec3,
    cos_o: f32,
    root_o: f32,
    alpha2: f32,
    /// Diffuse reflectance over π, with s(wo).
    diffuse: Vec3,
    /// s(wi).
    scale: Option<DiffuseScale>,
    /// Cosine above which s(wi) is 1.
    unscaled: f32,
}

impl<'a> Ggx<'a> {
    /// `None` where the viewer is below a horizon.
    fn new(point: &'a ShadingPoint, wo: Vec3) -> Option<Ggx<'a>> {
        let cos_o = cosine_above(point, wo)?;
        let scale = (point.diffuse != Vec3::ZERO).then(|| DiffuseScale::new(point));
        Some(Ggx {
            point,
            wo,
            cos_o,
            root_o: smith_root(cos_o, point.alpha),
            alpha2: point.alpha * point.alpha,
            diffuse: point.diffuse * albedo::diffuse_scale(point, cos_o) * FRAC_1_PI,
            unscaled: scale.as_ref().map_or(0.0, DiffuseScale::unscaled_from),
            scale,
        })
    }

    fn eval(&self, wi: Vec3) -> Vec3 {
        let point = self.point;
        let Some(cos_i) = cosine_above(point, wi) else {
            return Vec3::ZERO;
        };
        let half = Half::new(point.shading_normal, self.wo, wi);
        let fresnel = fresnel(point, half.cos_oh);
        let root_i = smith_root(cos_i, point.alpha);
        let visibility = visibility_by_roots((self.cos_o, self.root_o), (cos_i, root_i));
        let mut f = fresnel * (ggx_distribution(half.sin2_h, point.alpha) * visibility);
        if let Some(scale) = &self.scale {
            let diffuse = (Vec3::ONE - fresnel) * self.diffuse;
            f += if cos_i >= self.unscaled {
                diffuse
            } else {
                diffuse * scale.at(cos_i)
            };
        }
        f
    }

    fn integrate(&self, light: &Incident) -> Vec3 {
        let [straight, grazing, diffuse] = self.lanes(light);
        let f0 = self.point.f0;
        straight * f0 + (grazing + diffuse * self.diffuse) * (Vec3::ONE - f0) - self.overstated(light)
    }

    fn integrate_diffuse(&self, light: &Incident) -> Vec3 {
        let [.., diffuse] = self.lanes(light);
        diffuse * self.diffuse * (Vec3::ONE - self.point.f0) - self.overstated(light)
    }

    /// Sums with s(wi) = 1 everywhere. With the Schlick term k, what is reflected is F D V + (1 − F) c_diff/π for
    /// F = f0 + (1 − f0) k: three sums over the directions are enough, of D V, k D V and 1 − k, and no colour has a part
    /// in them.
    fn lanes(&self, light: &Incident) -> [Vec3; 3] {
        let point = self.point;
        let (shading, geometric, wo) = (point.shading_normal, point.geometric_normal, self.wo);
        let (cos_o, root_o, alpha2) = (self.cos_o, self.root_o, self.alpha2);
        let one = Lanes::splat(1.0);
        accumulate(light, |direction, weight| {
            let cosine = dot(direction, shading);
            // Kept positive below the horizon, so that nothing on the way is NaN.
            let cos_i = cosine.at_least(MIN_COSINE);
            let received = (cos_i * weight)
                .where_above(dot(direction, geometric), 0.0)
                .where_above(cosine, MIN_COSINE);
            // The half vector, before its length. Shorter than a thousandth it is of directions along the surface, which
            // receive next to nothing; the fourth power of less would leave what f32 holds.
            let [x, y, z] = direction;
            let (hx, hy, hz) = (
                x + Lanes::splat(wo.x),
                y + Lanes::splat(wo.y),
                z + Lanes::splat(wo.z),
            );
            let length2 = (hx * hx + hy * hy + hz * hz).at_least(1e-6);
            let (cx, cy, cz) = (
                hz * shading.y - hy * shading.z,
                hx * shading.z - hz * shading.x,
                hy * shading.x - hx * shading.y,
            );
            // Squared sine of its angle with the normal, times length2.
            let sin2 = (cx * cx + cy * cy + cz * cz).min(length2);
            // Half the length is the cosine between wo and the half vector.
            let miss = one - (length2.sqrt() * 0.5).at_most(1.0);
            let schlick = (miss * miss) * (miss * miss) * miss;
            let root = (length2 - sin2) * alpha2 + sin2;
            let root_i = (cos_i * cos_i * (1.0 - alpha2) + Lanes::splat(alpha2)).sqrt();
            // D V × cosine × weight.
            let specular = received * (length2 * length2) * (0.5 * alpha2 / PI)
                / (root * root * (cos_i * root_o + root_i * cos_o));
            [specular, specular * schlick, received * (one - schlick)]
        })
    }

    /// What the diffuse part of directions near the horizon, where s(wi) is below 1, is too large by.
    fn overstated(&self, light: &Incident) -> Vec3 {
        let point = self.point;
        let mut sum = Vec3::ZERO;
        let Some(scale) = &self.scale else { return sum };
        let n = light.weight.len();
        let direction = light.direction.map(|column| &column[..n]);
        for chunk in 0..n.div_ceil(LANES) {
            let lanes = direction.map(|column| Lanes::of(column, chunk));
            let cosines = dot(lanes, point.shading_normal);
            // Most directions are not near the horizon: several are told from the others at a time.
            let received = (cosines * Lanes::of(light.weight, chunk))
                .where_above(dot(lanes, point.geometric_normal), 0.0)
                .where_above(cosines, MIN_COSINE)
                .where_below(cosines, self.unscaled);
            if received.sum() == 0.0 {
                continue;
            }
            for (lane, &received) in received.0.iter().enumerate() {
                if received > 0.0 {
                    let i = chunk * LANES + lane;
                    let wi = Vec3::from(direction.map(|column| column[i]));
                    let cos_oh = (0.5 * (self.wo + wi).length()).min(1.0);
                    let fresnel = point.f0 + (Vec3::ONE - point.f0) * (1.0 - cos_oh).powi(5);
                    let flux = Vec3::from(light.flux.map(|column| column[i]));
                    let lacking = Vec3::ONE - scale.at(cosines.0[lane]);
                    sum += (Vec3::ONE - fresnel) * self.diffuse * lacking * flux * received;
                }
            }
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::SurfaceHit;

    /// Truth: the sum over `eval`, which is tested on its own.
    #[test]
    fn many_directions_at_once_reflect_what_they_do_one_by_one() {
        let mut state = 1u32;
        let mut random = || {
            state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
            (state >> 8) as f32 / (1 << 24) as f32
        };
        let mut unit = || Vec3::new(random() - 0.5, random() - 0.5, random() - 0.5).normalize_or(Vec3::X);
        let directions: Vec<Vec3> = (0..203).map(|_| unit()).collect();
        let column = |axis: usize| directions.iter().map(|d| d[axis]).collect::<Vec<f32>>();
        let direction = [column(0), column(1), column(2)];
        let mut number = 7u32;
        let mut positive = || {
            number = number.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
            (number >> 8) as f32 / (1 << 24) as f32
        };
        let flux: [Vec<f32>; 3] = std::array::from_fn(|_| (0..203).map(|_| positive()).collect());
        let weight: Vec<f32> = (0..203)
            .map(|i| if i % 5 == 0 { 0.0 } else { positive() })
            .collect();
        let light = Incident {
            direction: direction.each_ref().map(Vec::as_slice),
            weight: &weight,
            flux: flux.each_ref().map(Vec::as_slice),
        };
        for case in 0..200 {
            let normal = unit();
            let hit = SurfaceHit {
                t: 1.0,
                position: Vec3::ZERO,
                position_error: Vec3::ZERO,
                geometric_normal: normal,
                normal,
                front: true,
                primitive: 0,
                barycentric: [0.0; 2],
            };
            let white = if case % 3 == 0 { 1.0 } else { 0.6 };
            let point = ShadingPoint {
                lambert: case % 10 == 0,
                f0: Vec3::splat(if case % 2 == 0 { 0.04 } else { 0.7 }),
                alpha: [0.01, 0.05, 0.3, 1.0][case % 4],
                shading_normal: (normal + unit() * 0.3).normalize(),
                ..ShadingPoint::lambert(&hit, Vec3::new(white, 0.5, 0.0))
            };
            let wo = (normal + unit() * 0.9).normalize();
            let viewed = Viewed::new(&point, wo);
            for &wi in &directions {
                let truth = eval(&point, wo, wi) * point.shading_normal.dot(wi).max(0.0);
                let found = viewed.reflected(wi);
                // Some f32 roundings of products.
                let bound = 4e-6 * truth.max_element();
                assert!(
                    (found - truth).abs().max_element() <= bound,
                    "{case}: {found} {truth}"
                );
            }
            let truth = one_by_one(&point, wo, &light, eval);
            let found = integrate(&point, wo, &light);
            // f32 sums of 200 terms; the narrowest lobe magnifies the rounding of the half vector by 1/α².
            let bound = 1e-4 * truth.max_element().max(0.1);
            assert!(
                (found - truth).abs().max_element() < bound,
                "{case}: {found} {truth}"
            );
            // What is left of the widest lobe when it is taken from the whole.
            let rough = ShadingPoint { alpha: 1.0, ..point };
            let black = ShadingPoint {
                diffuse: Vec3::ZERO,
                ..rough
            };
            let left = one_by_one(&rough, wo, &light, eval) - one_by_one(&black, wo, &light, eval);
            let matt = integrate_diffuse(&rough, wo, &light);
            assert!((matt - left).abs().max_element() < bound, "{case}: {matt} {left}");
        }
    }
}
