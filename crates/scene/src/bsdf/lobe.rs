//! Where a point's specular light comes from: the lobe's mean direction and width, for integrators that sample
//! light in clusters.

use super::layers::leading;
use super::microfacet::{
    cosine_above, fresnel, ggx_distribution, masking, sample_visible_normal, visibility,
};
use super::phong;
use crate::shading::{Gloss, MIN_ALPHA, ShadingPoint};
use glam::Vec3;
use std::f32::consts::FRAC_PI_2;
use std::sync::LazyLock;

/// Extent of a specular lobe.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lobe {
    /// Unit vector away from the surface; light from around there is reflected most.
    pub direction: Vec3,
    /// Angular radius around `direction`, radians in 0..=π/2, from which at least 90 % of the reflected specular
    /// light comes under even illumination (tested by sampling).
    pub width: f32,
}

/// Angular radius, radians, of the widest lobe that shows solid glass as a mirror does, by rays that bend: α = 0.02. Wider ones blur what
/// bending changes.
const SHARP: f32 = 0.1;

/// Whether a point has a lobe so narrow that its rays bend in solid glass ([`crate::traced::TracedScene::look`]).
pub fn is_sharp(point: &ShadingPoint) -> bool {
    !point.lambert && width_facing(point) <= SHARP
}

/// The same point with a lobe whose half vectors spread by at least `slope` (the α of GGX and Ward): light that is known
/// at separate directions only would fall beside narrower ones.
pub fn at_least_as_wide(point: &ShadingPoint, slope: f32) -> ShadingPoint {
    let mut wide = with_slopes(point, |alpha| alpha.max(slope));
    if let Some(layers) = &mut wide.layers {
        layers.coat_alpha = layers.coat_alpha.max(slope);
    }
    wide
}

/// The same point, standing for places whose unit shading normals have a mean of this length: what the normals spread
/// by widens the lobe. For small angles the length is 1 − σ² with σ² the variance of slopes along each axis, and α²
/// grows by 2σ² (Olano and Baker 2010, for the Gaussian lobe; GGX of like width).
pub fn spread_by_normals(point: &ShadingPoint, length: f32) -> ShadingPoint {
    let variance = (1.0 - length.clamp(0.0, 1.0)).min(0.5);
    if variance <= 0.0 {
        return *point;
    }
    with_slopes(point, |alpha| (alpha * alpha + 2.0 * variance).sqrt().min(1.0))
}

/// Cosine with the normal of a view as grazing as matters: surfaces that are seen at it fill little of what sees them.
const GRAZING: f32 = 0.25;

/// About the most that the specular part sends anywhere of light at cosine `cos_i` with the shading normal, BRDF in 1/sr: the larger of what it sends to the mirror
/// direction, and to a grazing one on that side, where Fresnel's term is larger. Of GGX without layers; of others as if all light were mirrored by a lobe
/// of α.
pub fn strongest(point: &ShadingPoint, cos_i: f32) -> f32 {
    if point.lambert {
        return 0.0;
    }
    if point.layers.is_some() || !matches!(point.gloss, Gloss::Ggx) {
        return 0.25 * ggx_distribution(0.0, point.alpha);
    }
    let cos_i = cos_i.clamp(MIN_ALPHA, 1.0);
    let sin_i = (1.0 - cos_i * cos_i).sqrt();
    let to = |cos_o: f32| {
        let sin_o = (1.0 - cos_o * cos_o).sqrt();
        // |ωi + ωo|² in their common plane, on both sides of the normal.
        let sum2 = 2.0 + 2.0 * (cos_o * cos_i - sin_o * sin_i);
        let sin2_h = (sin_o - sin_i).powi(2) / sum2.max(f32::MIN_POSITIVE);
        let lobe = ggx_distribution(sin2_h, point.alpha) * visibility(cos_o, cos_i, point.alpha);
        lobe * fresnel(point, 0.5 * sum2.max(0.0).sqrt()).max_element()
    };
    to(cos_i).max(to(GRAZING))
}

fn with_slopes(point: &ShadingPoint, change: impl Fn(f32) -> f32) -> ShadingPoint {
    let gloss = match point.gloss {
        Gloss::Ggx => Gloss::Ggx,
        Gloss::GgxAnisotropic { alpha, tangent } => Gloss::GgxAnisotropic {
            alpha: alpha.map(&change),
            tangent,
        },
        Gloss::Ward { alpha, tangent } => Gloss::Ward {
            alpha: alpha.map(&change),
            tangent,
        },
        Gloss::Phong { exponent } => Gloss::Phong {
            // n = 1/(2α²) − 1/2 backwards.
            exponent: phong::exponent_of_alpha(change((2.0 * exponent + 1.0).recip().sqrt())),
        },
    };
    ShadingPoint {
        alpha: change(point.alpha),
        gloss,
        ..*point
    }
}

/// The specular lobe seen from `wo` (unit, away from the surface), of clearcoat and what lies under it the brighter one; `None` where there is none: matt surfaces,
/// and views from below a horizon.
pub fn lobe(point: &ShadingPoint, wo: Vec3) -> Option<Lobe> {
    let point = &leading(point);
    let normal = point.shading_normal;
    let cos = cosine_above(point, wo)?;
    if point.lambert || point.f0 == Vec3::ZERO {
        return None;
    }
    let mirror = phong::mirrored(normal, wo);
    let rough = match point.gloss {
        Gloss::Ggx => return ggx(point.alpha, cos.min(1.0), normal, mirror),
        Gloss::GgxAnisotropic { alpha, .. } => {
            return ggx(alpha[0].max(alpha[1]), cos.min(1.0), normal, mirror);
        }
        Gloss::Ward { alpha, .. } => alpha[0].max(alpha[1]),
        Gloss::Phong { exponent } => (2.0 * exponent + 1.0).recip().sqrt(),
    };
    // A rough lobe is cut off by the horizon, and what is left leans towards the normal (after Lagarde and de
    // Rousiers 2014, section 4.9.3).
    let smooth = (1.0 - rough) * ((1.0 - rough).max(0.0).sqrt() + rough);
    let direction = normal.lerp(mirror, smooth.clamp(0.0, 1.0)).try_normalize()?;
    Some(Lobe {
        direction,
        width: width_facing(point),
    })
}

/// [`Lobe::width`] of the specular lobe of [`lobe`] seen from above.
pub fn width_facing(point: &ShadingPoint) -> f32 {
    let point = &leading(point);
    let width = match point.gloss {
        Gloss::Ggx => nominal_width(point.alpha),
        Gloss::GgxAnisotropic { alpha, .. } => nominal_width(alpha[0].max(alpha[1])),
        // Gaussian slopes: 90 % within tan θ = √(ln 10) α = 1.52 α of the rougher direction.
        Gloss::Ward { alpha, .. } => 2.0 * (1.52 * alpha[0].max(alpha[1])).atan(),
        // cosⁿ⁺¹ = 0.08: 92 %, since the direction of the lobe is a little off the middle.
        Gloss::Phong { exponent } => 0.08f32.powf(1.0 / (exponent + 1.0)).acos(),
    };
    width.min(FRAC_PI_2)
}

/// GGX spreads and leans far towards the normal at grazing views: both from a table.
fn ggx(alpha: f32, cos: f32, normal: Vec3, mirror: Vec3) -> Option<Lobe> {
    let place = |x: f32| {
        let x = x.clamp(0.0, 1.0) * (NODES - 1) as f32;
        let at = (x as usize).min(NODES - 2);
        (at, x - at as f32)
    };
    let lowest = MIN_ALPHA.sqrt().sqrt();
    let (row, fr) = place((alpha.sqrt().sqrt() - lowest) / (1.0 - lowest));
    let (column, fc) = place(cos.sqrt().sqrt());
    let [width, lean] = [0, 1].map(|k| {
        let at =
            |row: usize| GGX[row * NODES + column][k] * (1.0 - fc) + GGX[row * NODES + column + 1][k] * fc;
        at(row) * (1.0 - fr) + at(row + 1) * fr
    });
    let width = width * nominal_width(alpha);
    // From the mirror direction towards the normal, by an angle that is not beyond it.
    let across = (normal - mirror * cos).try_normalize().unwrap_or(Vec3::ZERO);
    let (sin, cos) = (lean * width).clamp(0.0, cos.acos()).sin_cos();
    Some(Lobe {
        direction: (mirror * cos + across * sin).try_normalize()?,
        width: width.min(FRAC_PI_2),
    })
}

/// Nodes of the table over α^¼ and cosine^¼, as of the albedos.
const NODES: usize = 32;
/// Half vectors per node, on the lattice of [`super::albedo`].
const QUADRATURE: usize = 610;
/// Share of a white metal's energy within the tabulated width: above the 0.9 that is promised, since Fresnel's
/// factor weighs a rough dielectric's lobe towards the horizon (0.88 of it lay within 0.93 of the metal's).
const SHARE: f64 = 0.955;

/// Width over [`nominal_width`], and the angle from mirror to mean direction over the width.
static GGX: LazyLock<Vec<[f32; 2]>> = LazyLock::new(|| {
    (0..NODES * NODES)
        .map(|at| {
            let lowest = MIN_ALPHA.sqrt().sqrt();
            let [row, column] = [at / NODES, at % NODES].map(|i| i as f32 / (NODES - 1) as f32);
            let alpha = (lowest + (1.0 - lowest) * row).powi(4);
            extent(alpha, column.powi(4).max(1e-6))
        })
        .collect()
});

/// 90 % of GGX's half vectors lie within tan θ = 3α.
fn nominal_width(alpha: f32) -> f32 {
    2.0 * (3.0 * alpha).atan()
}

fn extent(alpha: f32, cos_o: f32) -> [f32; 2] {
    let wo = Vec3::new((1.0 - cos_o * cos_o).max(0.0).sqrt(), 0.0, cos_o);
    let mut samples: Vec<(Vec3, f64)> = Vec::with_capacity(QUADRATURE);
    let mut mean = Vec3::ZERO;
    for k in 0..QUADRATURE {
        // 377 is the Fibonacci number before 610.
        let turn = (k * 377 % QUADRATURE) as f32 / QUADRATURE as f32;
        let h = sample_visible_normal(wo, alpha, [(k as f32 + 0.5) / QUADRATURE as f32, turn]);
        let wi = h * (2.0 * wo.dot(h)) - wo;
        if wi.z > 0.0 {
            let weight = masking(cos_o, wi.z, alpha);
            mean += wi * weight;
            samples.push((wi, f64::from(weight)));
        }
    }
    let mirror = Vec3::new(-wo.x, 0.0, wo.z);
    // The lobe is symmetric about the plane of incidence.
    let mean = Vec3::new(mean.x, 0.0, mean.z).try_normalize().unwrap_or(mirror);
    let mut angles: Vec<(f32, f64)> = samples.iter().map(|(wi, w)| (angle(*wi, mean), *w)).collect();
    angles.sort_by(|a, b| a.0.total_cmp(&b.0));
    let total: f64 = angles.iter().map(|a| a.1).sum();
    let mut sum = 0.0;
    let width = (angles.iter())
        .find(|a| {
            sum += a.1;
            sum >= SHARE * total
        })
        .map_or(FRAC_PI_2, |a| a.0);
    let lean = if mean.z > mirror.z {
        angle(mean, mirror)
    } else {
        0.0
    };
    [width / nominal_width(alpha), lean / width.max(f32::MIN_POSITIVE)]
}

/// Angle between unit vectors from their chord: cosines of small angles have lost their digits.
fn angle(a: Vec3, b: Vec3) -> f32 {
    2.0 * (0.5 * (a - b).length()).min(1.0).asin()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bsdf::eval;
    use crate::surface::SurfaceHit;

    /// Truth: the mean of the BRDF over normals that spread by a known amount, at the lobe's peak.
    #[test]
    fn spread_normals_widen_a_lobe_as_the_mean_over_them_does() {
        let hit = SurfaceHit {
            t: 1.0,
            position: Vec3::ZERO,
            position_error: Vec3::ZERO,
            geometric_normal: Vec3::Z,
            normal: Vec3::Z,
            front: true,
            primitive: 0,
            barycentric: [0.0; 2],
        };
        let metal = ShadingPoint {
            lambert: false,
            f0: Vec3::splat(0.9),
            diffuse: Vec3::ZERO,
            alpha: 0.05,
            ..ShadingPoint::lambert(&hit, Vec3::ONE)
        };
        // Gaussian slopes of σ = 0.08, by the quantiles of a regular lattice.
        let (sigma, n) = (0.08f32, 64);
        let (mut mean, mut sum, mut count) = (Vec3::ZERO, 0.0, 0.0);
        for i in 0..n {
            for j in 0..n {
                let radius = sigma * (-2.0 * (1.0 - (i as f32 + 0.5) / n as f32).ln()).sqrt();
                let (sin, cos) = (std::f32::consts::TAU * (j as f32 + 0.5) / n as f32).sin_cos();
                let normal = Vec3::new(radius * cos, radius * sin, 1.0).normalize();
                let bumpy = ShadingPoint {
                    shading_normal: normal,
                    ..metal
                };
                mean += normal;
                sum += eval(&bumpy, Vec3::Z, Vec3::Z).x;
                count += 1.0;
            }
        }
        let wide = spread_by_normals(&metal, mean.length() / count);
        let found = eval(&wide, Vec3::Z, Vec3::Z).x;
        // GGX lobes have long tails: one stands for the mean of many only about.
        let truth = sum / count;
        assert!((found / truth - 1.0).abs() < 0.25, "{found} {truth}");
        let narrow = eval(&metal, Vec3::Z, Vec3::Z).x;
        assert!(narrow > 3.0 * truth);
    }
}
