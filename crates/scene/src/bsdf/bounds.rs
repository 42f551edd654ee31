//! Upper bounds of BRDF × cosine over many directions of light at once, of which only the smallest angles with a few
//! axes are known.
//!
//! Source: Walter et al. 2005 (lightcuts), section 4.1. Lambert and Phong as there. Lobes over the half vector h: the
//! reflection of the view about h is the light's direction, and turning a mirror by an angle turns what it reflects by
//! at most twice that. So a light whose angle with the mirror direction is γ has a half vector that leans by at least
//! γ/2 from the normal; in the plane of incidence that is exact. The lobes' other factors, as this crate evaluates them:
//!
//! * GGX: D falls with the lean. V cosθi = ½ / (R(θo) + cosθo R(θi) / cosθi) rises with cosθi, since R(θ)/cosθ falls.
//!   Fresnel's factor is largest for light that is farthest from the view. Of the diffuse part, 1 − F ≤ 1 − f0 and the
//!   factor that conserves energy is at most 1 for the light and known for the view.
//! * Anisotropic GGX: D is at most that of the rougher axis times α_max² / (αx αy), R at least that of the finer one.
//! * Ward: exp(−tan²θh/α²) / cos²θh falls with the lean (α ≤ 1); cosθi / (cosθo + cosθi)² is largest where the two are
//!   equal. An anisotropic lobe is bounded by its rougher axis in the exponential: right, not tight.
//! * Clearcoat is a GGX lobe about its own normal; sheen is bounded by the most that it can be at all. Right, not tight.

use super::anisotropic::Anisotropic;
use super::layers::{Over, coat_point};
use super::microfacet::{MIN_COSINE, ggx_distribution, smith_root};
use super::{albedo, phong, sheen};
use crate::shading::{Gloss, ShadingPoint};
use glam::Vec3;
use std::f32::consts::{FRAC_1_PI, PI};

/// Loosens every bound by more than the rounding of a dozen f32 operations.
const LOOSE: f32 = 1.0 + 1e-5;

/// Rounding, as a sine, of mirror direction and half vector: it matters to lobes of α below 0.01.
const MIRROR_ROUNDING: f32 = 2e-6;

/// Some times what half vectors are rounded by: over a lobe's width, what its value is.
const LOBE_ROUNDING: f32 = 2e-6;

/// Directions with which angles are asked for, as indices into [`ReflectionBound::axes`].
const NORMAL: usize = 0;
const GEOMETRIC: usize = 1;
const MIRROR: usize = 2;
const AWAY: usize = 3;
/// The clearcoat's own [`NORMAL`] to [`AWAY`] among those of the whole.
const OF_COAT: [usize; 4] = [4, GEOMETRIC, 5, AWAY];

/// A point and its viewer, prepared for bounds over many sets of directions.
#[derive(Clone, Debug)]
pub struct ReflectionBound {
    /// Unit vectors about which angles are asked for: shading normal, geometric normal, mirror direction, away from
    /// the viewer, and the clearcoat's normal and mirror direction. The middle two only where [`ReflectionBound::glossy`], the last two
    /// only where there is a clearcoat.
    pub axes: [Vec3; 6],
    /// The geometric normal differs from the shading normal.
    pub bent: bool,
    /// There is more than the Lambert part.
    pub glossy: bool,
    /// Lambert part × 1/π with all factors that don't depend on the light.
    diffuse: Vec3,
    f0: Vec3,
    f90: f32,
    cos_o: f32,
    lobe: Lobe,
    /// Loosens the lobe, and lessens it by what layers take.
    loose: f32,
    /// Most of the sheen's lobe × cosine.
    sheen: Vec3,
    coat: Option<Box<ReflectionBound>>,
}

#[derive(Clone, Copy, Debug)]
enum Lobe {
    None,
    Ggx {
        /// Of the rougher and of the finer axis.
        alpha: [f32; 2],
        root_o: f32,
        /// α_max² / (αx αy).
        scale: f32,
    },
    Phong {
        exponent: f32,
    },
    Ward {
        widest2: f32,
        scale: f32,
    },
}

impl ReflectionBound {
    /// `wo` is the unit vector to the viewer.
    pub fn new(point: &ShadingPoint, wo: Vec3) -> ReflectionBound {
        let mut bound = ReflectionBound::of_base(point, wo);
        if let Some(layers) = &point.layers
            && bound.cos_o > MIN_COSINE
            && point.geometric_normal.dot(wo) > 0.0
        {
            let over = Over::new(point, layers, wo);
            bound.diffuse *= over.base;
            bound.loose *= over.base;
            if over.sheen != Vec3::ZERO {
                bound.sheen = over.sheen * sheen::most(layers.sheen_alpha, bound.cos_o);
            }
            if over.coat > 0.0 {
                let mut coat = ReflectionBound::of_base(&coat_point(point, layers), wo);
                coat.loose *= over.coat;
                bound.axes[OF_COAT[NORMAL]] = coat.axes[NORMAL];
                bound.axes[OF_COAT[MIRROR]] = coat.axes[MIRROR];
                bound.coat = Some(Box::new(coat));
            }
        }
        bound
    }

    /// Without layers.
    fn of_base(point: &ShadingPoint, wo: Vec3) -> ReflectionBound {
        let normal = point.shading_normal;
        let cos_o = normal.dot(wo);
        let seen = cos_o > MIN_COSINE && point.geometric_normal.dot(wo) > 0.0;
        let mut bound = ReflectionBound {
            axes: [normal, point.geometric_normal, normal, -wo, normal, normal],
            bent: normal != point.geometric_normal,
            glossy: false,
            diffuse: Vec3::ZERO,
            f0: point.f0,
            f90: point.f90,
            cos_o,
            lobe: Lobe::None,
            loose: 1.0,
            sheen: Vec3::ZERO,
            coat: None,
        };
        if !seen {
            return bound;
        }
        bound.diffuse = point.diffuse * FRAC_1_PI;
        // Metallic-roughness reflects at grazing angles even where f0 is zero.
        if point.lambert || (point.f0 == Vec3::ZERO && !point.gloss.is_ggx()) {
            return bound;
        }
        bound.glossy = true;
        bound.axes[MIRROR] = phong::mirrored(normal, wo).normalize();
        bound.lobe = match point.gloss {
            Gloss::Ggx | Gloss::GgxAnisotropic { .. } => {
                if point.diffuse != Vec3::ZERO {
                    let veil = point.veil.map_or(point.f0, |[v0, _]| Vec3::splat(v0));
                    bound.diffuse *= (Vec3::ONE - veil) * albedo::diffuse_scale(point, cos_o);
                }
                match (point.gloss, Anisotropic::of(point)) {
                    (Gloss::GgxAnisotropic { alpha: [x, y], .. }, Some(lobe)) => Lobe::Ggx {
                        alpha: [x.max(y), x.min(y)],
                        root_o: lobe.root_of(wo),
                        scale: x.max(y) / x.min(y),
                    },
                    _ => Lobe::Ggx {
                        alpha: [point.alpha; 2],
                        root_o: smith_root(cos_o, point.alpha),
                        scale: 1.0,
                    },
                }
            }
            Gloss::Phong { exponent } => Lobe::Phong { exponent },
            Gloss::Ward { alpha, .. } => Lobe::Ward {
                widest2: alpha[0].max(alpha[1]).powi(2),
                scale: 1.0 / (PI * alpha[0] * alpha[1]),
            },
        };
        let width = match bound.lobe {
            Lobe::None => 1.0,
            Lobe::Ggx { alpha, .. } => alpha[1],
            Lobe::Phong { exponent } => (2.0 * exponent + 1.0).sqrt().recip(),
            Lobe::Ward { widest2, .. } => widest2.sqrt(),
        };
        bound.loose = 1.0 + LOBE_ROUNDING / width;
        bound
    }

    /// Most that BRDF × cosine can be for any direction of a set, RGB in 1/sr. `angle(axis)` is asked for indices into
    /// [`ReflectionBound::axes`] and returns the largest cosine of the set with that axis, and the sine of that smallest
    /// angle or less.
    #[inline]
    pub fn bound(&self, angle: impl Fn(usize) -> (f32, f32)) -> Vec3 {
        let most = self.base(&angle);
        match &self.coat {
            Some(coat) => most + coat.base(&|axis| angle(OF_COAT[axis])),
            None => most,
        }
    }

    /// Without clearcoat.
    #[inline]
    fn base(&self, angle: &impl Fn(usize) -> (f32, f32)) -> Vec3 {
        let (cos_i, _) = angle(NORMAL);
        if cos_i <= 0.0 || (self.bent && angle(GEOMETRIC).0 <= 0.0) {
            return Vec3::ZERO;
        }
        let cos_i = cos_i.min(1.0);
        let mut most = self.diffuse * cos_i + self.sheen;
        if self.glossy {
            most += self.specular(cos_i, angle) * self.loose;
        }
        most * LOOSE
    }

    #[inline]
    fn specular(&self, cos_i: f32, angle: &impl Fn(usize) -> (f32, f32)) -> Vec3 {
        let (cos, sin) = angle(MIRROR);
        let sin = (sin - MIRROR_ROUNDING).max(0.0);
        match self.lobe {
            Lobe::None => Vec3::ZERO,
            Lobe::Phong { exponent } => {
                if cos <= 0.0 {
                    return Vec3::ZERO;
                }
                let power = if exponent == 0.0 {
                    1.0
                } else {
                    (0.5 * exponent * (-(sin * sin).min(1.0)).ln_1p()).exp()
                };
                self.f0 * (power * (exponent + 2.0) * (0.5 * FRAC_1_PI) * cos_i)
            }
            Lobe::Ggx { alpha, root_o, scale } => {
                let [rougher, finer] = alpha;
                let lobe = ggx_distribution(half_sine_squared(cos, sin), rougher) * scale;
                let masked = 0.5 / (root_o + self.cos_o * smith_root(cos_i, finer) / cos_i);
                // The half vector's cosine with the view is that of half the angle between view and light.
                let farthest = -angle(AWAY).0;
                let cos_oh = (0.5 + 0.5 * farthest).max(0.0).sqrt();
                let schlick = (1.0 - cos_oh + 1e-6).clamp(0.0, 1.0).powi(5);
                (self.f0 + (Vec3::splat(self.f90) - self.f0) * schlick) * (lobe * masked)
            }
            Lobe::Ward { widest2, scale } => {
                let sine2 = half_sine_squared(cos, sin);
                let secant2 = 1.0 / (1.0 - sine2);
                let lobe = (-(sine2 * secant2) / widest2).exp() * secant2 * scale;
                let cos = cos_i.min(self.cos_o);
                self.f0 * (lobe * cos / (self.cos_o + cos).powi(2))
            }
        }
    }
}

/// sin²(γ/2) from cosine and sine of γ; for small angles from the sine alone. At most ½: no light above the horizon,
/// seen from above it, has a half vector that leans by more than a right angle, and beyond ½ lobes hardly fall.
#[inline]
fn half_sine_squared(cos: f32, sin: f32) -> f32 {
    if cos > 0.0 {
        0.5 * sin * sin / (1.0 + cos)
    } else {
        // Here the cosine is the safe one.
        (0.5 - 0.5 * cos).min(0.999)
    }
}
