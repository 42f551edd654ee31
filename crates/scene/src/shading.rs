//! What a surface does with light at one point: what BRDFs need to know of it. [`crate::traced`] evaluates materials to this.

use crate::surface::SurfaceHit;
use glam::Vec3;

/// Reflectance of a dielectric at normal incidence: index of refraction 1.5 (glTF 2.0 appendix B).
pub(crate) const DIELECTRIC_F0: f32 = 0.04;

/// Smallest GGX alpha: below it the distribution's peak, 1/(πα²), leaves what f32 resolves around a half
/// vector (some 1e-7 per component).
pub const MIN_ALPHA: f32 = 1e-4;

/// Smallest cosine between a bent shading normal and the geometric normal or the viewer: a tenth of a degree
/// above the horizon, enough for sampling to work.
const MIN_BENT_COSINE: f32 = 2e-3;

/// Shape of the specular lobe.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Gloss {
    /// Metallic-roughness: GGX of [`ShadingPoint::alpha`] with Schlick's Fresnel term over `f0`.
    Ggx,
    /// The same, anisotropic: [`ShadingPoint::alpha`] is the smaller of the two.
    GgxAnisotropic {
        /// Along and across the tangent, each from [`MIN_ALPHA`] to 1.
        alpha: [f32; 2],
        /// World space, about perpendicular to the shading normal.
        tangent: Vec3,
    },
    /// `f0` times a normalised Phong lobe.
    Phong {
        /// From 0 to [`crate::bsdf::MAX_EXPONENT`].
        exponent: f32,
    },
    /// `f0` times Ward's lobe.
    Ward {
        /// Along and across the tangent, each from [`MIN_ALPHA`] to 1.
        alpha: [f32; 2],
        /// World space, about perpendicular to the shading normal.
        tangent: Vec3,
    },
}

impl Gloss {
    /// Whether it is GGX, isotropic or not.
    pub fn is_ggx(&self) -> bool {
        matches!(self, Gloss::Ggx | Gloss::GgxAnisotropic { .. })
    }
}

/// What lies over a metallic-roughness surface: sheen, and clearcoat over that.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Layers {
    /// Strength of the clearcoat, 0..=1.
    pub coat: f32,
    /// GGX α of the clearcoat, from [`MIN_ALPHA`] to 1.
    pub coat_alpha: f32,
    /// The clearcoat's shading normal, world space, on the side of the others.
    pub coat_normal: Vec3,
    /// Colour of the sheen, linear RGB in 0..=1.
    pub sheen: Vec3,
    /// Charlie α of the sheen, from [`crate::bsdf::MIN_SHEEN_ALPHA`] to 1.
    pub sheen_alpha: f32,
}

/// A surface point as BRDFs see it. All vectors are in world space and unit vectors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShadingPoint {
    /// World space.
    pub position: Vec3,
    /// Normal of the true surface, on the side the ray came from.
    pub geometric_normal: Vec3,
    /// Smooth normal without normal map, on the same side.
    pub normal: Vec3,
    /// Normal with normal map, on the same side.
    pub shading_normal: Vec3,
    /// Linear RGB in 0..=1: factor × texture × vertex colour.
    pub base_color: Vec3,
    /// Albedo of the Lambert part (glTF's c_diff), linear RGB in 0..=1.
    pub diffuse: Vec3,
    /// Reflectance of the specular part at normal incidence, linear RGB in 0..=1. With a [`Gloss`] other than
    /// GGX, `diffuse` + `f0` is at most 1 in each channel.
    pub f0: Vec3,
    /// Reflectance of the GGX part at grazing angles, from `f0` to 1: 1, but where KHR_materials_specular lowers it.
    pub f90: f32,
    /// Schlick's term, as reflectances at normal incidence and at grazing angles, that the diffuse part under GGX loses;
    /// `None`: that of `f0` and `f90`, channel by channel.
    pub veil: Option<[f32; 2]>,
    /// GGX α, from [`MIN_ALPHA`] to 1.
    pub alpha: f32,
    /// Shape of the specular part.
    pub gloss: Gloss,
    /// Whether the Lambert part is all there is; `f0` is then zero.
    pub lambert: bool,
    /// What lies over GGX and the Lambert part.
    pub layers: Option<Layers>,
    /// Radiance towards the side the ray came from, W/(m² sr). Zero on the back of materials that are not
    /// double-sided.
    pub emission: Vec3,
    /// Index into [`crate::scene::Scene::materials`].
    pub material: u32,
}

impl ShadingPoint {
    /// A Lambert reflector, for surfaces without materials.
    pub fn lambert(hit: &SurfaceHit, albedo: Vec3) -> ShadingPoint {
        ShadingPoint {
            position: hit.position,
            geometric_normal: hit.geometric_normal,
            normal: hit.normal,
            shading_normal: hit.normal,
            base_color: albedo,
            diffuse: albedo,
            f0: Vec3::ZERO,
            f90: 1.0,
            veil: None,
            alpha: 1.0,
            gloss: Gloss::Ggx,
            lambert: true,
            layers: None,
            emission: Vec3::ZERO,
            material: 0,
        }
    }

    /// The same point with its shading normal bent towards a viewer in direction `wo` (unit, away from the
    /// surface), if it would otherwise face away from it: interpolated and mapped normals do that near
    /// silhouettes, and the BRDF would be black there.
    pub fn facing(mut self, wo: Vec3) -> ShadingPoint {
        self.shading_normal = bend_towards(self.shading_normal, wo);
        if let Some(layers) = &mut self.layers {
            layers.coat_normal = bend_towards(layers.coat_normal, wo);
        }
        self
    }
}

/// `normal` if its cosine with `direction` is at least [`MIN_BENT_COSINE`], otherwise bent until it is.
pub(crate) fn bend_towards(normal: Vec3, direction: Vec3) -> Vec3 {
    let cosine = normal.dot(direction);
    if cosine >= MIN_BENT_COSINE {
        return normal;
    }
    // Without its part along the direction, plus a little of the direction; if nothing else is left, the
    // direction itself.
    let across = (normal - direction * cosine)
        .try_normalize()
        .unwrap_or(Vec3::ZERO);
    // The factor 2 covers the rounding of the normalisation.
    (across + direction * (2.0 * MIN_BENT_COSINE)).normalize()
}
