//! Where a point's specular light comes from: the lobe's mean direction and width, for integrators that sample
//! light in clusters.

use super::{MIN_COSINE, phong};
use crate::shading::{Gloss, ShadingPoint};
use glam::Vec3;
use std::f32::consts::FRAC_PI_2;

/// Extent of a specular lobe.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lobe {
    /// Unit vector away from the surface; light from around there is reflected most.
    pub direction: Vec3,
    /// Angular radius around `direction`, radians in 0..=π/2, from which at least 90 % of the reflected specular
    /// light comes under even illumination (tested by sampling).
    pub width: f32,
}

/// The same point with a lobe whose half vectors spread by at least `slope` (the α of GGX and Ward): light that is known
/// at separate directions only would fall beside narrower ones.
pub fn at_least_as_wide(point: &ShadingPoint, slope: f32) -> ShadingPoint {
    let gloss = match point.gloss {
        Gloss::Ggx => Gloss::Ggx,
        Gloss::Ward { alpha, tangent } => Gloss::Ward {
            alpha: alpha.map(|a| a.max(slope)),
            tangent,
        },
        Gloss::Phong { exponent } => Gloss::Phong {
            exponent: exponent.min(phong::exponent_of_alpha(slope)),
        },
    };
    ShadingPoint {
        alpha: point.alpha.max(slope),
        gloss,
        ..*point
    }
}

/// The specular lobe seen from `wo` (unit, away from the surface); `None` where there is none: matt surfaces,
/// and views from below a horizon.
pub fn lobe(point: &ShadingPoint, wo: Vec3) -> Option<Lobe> {
    let normal = point.shading_normal;
    let above = normal.dot(wo) > MIN_COSINE && point.geometric_normal.dot(wo) > 0.0;
    if !above || point.lambert || point.f0 == Vec3::ZERO {
        return None;
    }
    let mirror = phong::mirrored(normal, wo);
    let (width, rough) = match point.gloss {
        // 90 % of GGX's half vectors lie within tan θ = 3α.
        Gloss::Ggx => (2.0 * (3.0 * point.alpha).atan(), point.alpha),
        // Gaussian slopes: 90 % within tan θ = √(ln 10) α = 1.52 α of the rougher direction.
        Gloss::Ward { alpha, .. } => {
            let alpha = alpha[0].max(alpha[1]);
            (2.0 * (1.52 * alpha).atan(), alpha)
        }
        // cosⁿ⁺¹ = 0.08: 92 %, since the direction below is a little off the middle.
        Gloss::Phong { exponent } => {
            let width = 0.08f32.powf(1.0 / (exponent + 1.0)).acos();
            (width, (2.0 * exponent + 1.0).recip().sqrt())
        }
    };
    // A rough lobe is cut off by the horizon, and what is left leans towards the normal (after Lagarde and de
    // Rousiers 2014, section 4.9.3).
    let smooth = (1.0 - rough) * ((1.0 - rough).max(0.0).sqrt() + rough);
    let direction = normal.lerp(mirror, smooth.clamp(0.0, 1.0)).try_normalize()?;
    Some(Lobe {
        direction,
        width: width.min(FRAC_PI_2),
    })
}
