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
//! What glTF's extensions change: f0 and the 1 beside it (KHR_materials_ior, _specular, _iridescence), which take the most reflective
//! channel's share from all of the diffuse part; [`anisotropic`] lobes; [`layers`] of sheen and clearcoat over all of it.
//!
//! Sampling: one lobe, chosen by its albedo; the specular one by visible normals (Heitz 2018, in the form of
//! Dupuy and Benyoub 2023), the diffuse one by cosine. The density is that of the mixture.

pub mod albedo;
mod anisotropic;
pub mod bounds;
mod eval;
#[cfg(test)]
mod extension_tests;
mod frame;
mod integrate;
mod layers;
mod lobe;
mod microfacet;
mod mixture;
#[cfg(test)]
mod model_tests;
mod phong;
mod sheen;
#[cfg(test)]
mod tests;
mod ward;

pub use albedo::hemispherical_albedo;
pub use eval::{BsdfSample, diffuse_reflectance, eval, eval_diffuse, lobe_albedo, pdf, sample, sample_lobe};
pub use integrate::{Incident, Viewed, integrate, integrate_diffuse, irradiance};
pub use lobe::{Lobe, at_least_as_wide, is_sharp, lobe, spread_by_normals, strongest, width_facing};
pub use phong::{MAX_EXPONENT, exponent_of_alpha};
pub use sheen::MIN_SHEEN_ALPHA;
