//! Reflectance of a thin film on a surface (KHR_materials_iridescence), as the mean over angles.
//!
//! Source: Belcour and Barla 2017, "A practical extension to microfacet theory for the modeling of varying iridescence", section 4,
//! with the simplifications and constants of the extension's appendix: Schlick's terms at both interfaces, no polarisation, two orders
//! of interference, sensitivities as Gaussians in the optical path difference.
//!
//! Deviation: colours don't change with the angle. The film's reflectance is averaged over directions by their cosine, and what is returned
//! is the reflectance at normal incidence for which Schlick's term has that mean. Outside the film is air, also under clearcoat.

use glam::{Mat3, Vec3};
use std::f32::consts::{PI, TAU};

/// Nodes of the mean over angles: orders of interference beyond those that are kept vary no faster.
const NODES: usize = 16;

/// The cosine-weighted mean of (1 − cosθ)⁵.
const SCHLICK_MEAN: f32 = 1.0 / 21.0;

/// Reflectance at normal incidence, linear RGB in 0..=1, that stands for a film of index `ior` (at least 1) and `thickness`
/// (nanometres) on a surface that mirrors `f0` without it.
pub fn mean_reflectance(f0: Vec3, ior: f32, thickness: f32) -> Vec3 {
    let mut mean = Vec3::ZERO;
    for k in 0..NODES {
        // Even in cos²: weights of the cosine are equal.
        let cos = ((k as f32 + 0.5) / NODES as f32).sqrt();
        mean += reflectance(f0, ior, thickness, cos) / NODES as f32;
    }
    ((mean - SCHLICK_MEAN) / (1.0 - SCHLICK_MEAN)).clamp(Vec3::ZERO, Vec3::ONE)
}

/// F of the film, linear RGB in 0..=1, where light meets it at cosine `cos`.
fn reflectance(f0: Vec3, ior: f32, thickness: f32, cos: f32) -> Vec3 {
    let schlick = |r0: f32, cos: f32| r0 + (1.0 - r0) * (1.0 - cos).powi(5);
    let interface = |n: f32, m: f32| ((n - m) / (n + m)).powi(2);
    let cos_inside = (1.0 - (1.0 - cos * cos) / (ior * ior)).max(0.0).sqrt();
    let first = schlick(interface(ior, 1.0), cos);
    let passed = 1.0 - first;
    // The index that mirrors f0 in air; just below 1, or it would be infinite.
    let base_ior = f0.map(|f| {
        let root = f.clamp(0.0, 0.9999).sqrt();
        (1.0 + root) / (1.0 - root)
    });
    let second = base_ior.map(|n| schlick(interface(n, ior), cos_inside));
    // Half a wave is lost where light comes back from the denser side.
    let phase = base_ior.map(|n| if n < ior { TAU } else { PI });
    let both = (second * first).clamp(Vec3::splat(1e-5), Vec3::splat(0.9999));
    let inside = second * (passed * passed) / (Vec3::ONE - both);
    let mut total = Vec3::splat(first) + inside;
    let mut amplitude = inside - passed;
    let path = 2.0 * ior * thickness * cos_inside;
    for order in 1..=2 {
        amplitude *= both.map(f32::sqrt);
        total += amplitude * 2.0 * sensitivity(order as f32 * path, phase * order as f32);
    }
    total.clamp(Vec3::ZERO, Vec3::ONE)
}

/// How the eye's colours, as linear Rec. 709, respond to light that interferes with itself over a path difference (nanometres) and a
/// phase: the Fourier transform of the colour matching functions as Gaussians.
fn sensitivity(path: f32, phase: Vec3) -> Vec3 {
    let angle = TAU * path * 1e-9;
    let lobe = |weight: f32, middle: f32, variance: f32, phase: f32| {
        weight * (TAU * variance).sqrt() * (middle * angle + phase).cos() * (-angle * angle * variance).exp()
    };
    let xyz = Vec3::new(
        lobe(5.4856e-13, 1.6810e6, 4.3278e9, phase.x) + lobe(9.7470e-14, 2.2399e6, 4.5282e9, phase.x),
        lobe(4.4201e-13, 1.7953e6, 9.3046e9, phase.y),
        lobe(5.2481e-13, 2.2084e6, 6.6121e9, phase.z),
    ) / 1.0685e-7;
    let rgb_from_xyz = Mat3::from_cols(
        Vec3::new(3.240_454_2, -0.969_266, 0.055_643_4),
        Vec3::new(-1.537_138_5, 1.876_010_8, -0.204_025_9),
        Vec3::new(-0.498_531_4, 0.041_556, 1.057_225_2),
    );
    rgb_from_xyz * xyz
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Airy's formula at one wavelength, averaged over the spectrum by the eye's luminance (Wyman et al. 2013), at normal
    /// incidence: what the Gaussians stand for.
    fn luminance(ior: f64, base: f64, thickness: f64) -> f64 {
        let (mut sum, mut weights) = (0.0, 0.0);
        for k in 0..400 {
            let wavelength = 380.0 + f64::from(k);
            let lobe = |middle: f64, low: f64, high: f64| {
                let t = (wavelength - middle) * if wavelength < middle { low } else { high };
                (-0.5 * t * t).exp()
            };
            let weight = 0.821 * lobe(568.8, 0.0213, 0.0247) + 0.286 * lobe(530.9, 0.0613, 0.0322);
            let (r1, r2) = ((1.0 - ior) / (1.0 + ior), (ior - base) / (ior + base));
            let delta = 4.0 * std::f64::consts::PI * ior * thickness / wavelength;
            let top = r1 * r1 + r2 * r2 + 2.0 * r1 * r2 * delta.cos();
            sum += weight * top / (1.0 + r1 * r1 * r2 * r2 + 2.0 * r1 * r2 * delta.cos());
            weights += weight;
        }
        sum / weights
    }

    #[test]
    fn a_film_is_as_bright_as_airys_formula_says() {
        for (ior, base, thickness) in [
            (1.33, 1.5, 100.0),
            (1.33, 1.5, 320.0),
            (1.8, 1.5, 150.0),
            (1.8, 1.5, 260.0),
            (1.4, 2.5, 400.0),
        ] {
            let f0 = ((base - 1.0) / (base + 1.0_f64)).powi(2) as f32;
            let found = reflectance(Vec3::splat(f0), ior as f32, thickness as f32, 1.0);
            let found = f64::from(found.dot(Vec3::new(0.2126, 0.7152, 0.0722)));
            let truth = luminance(ior, base, thickness);
            // The eye's curves as Gaussians, and clamped colours.
            assert!(
                (found - truth).abs() < 0.012,
                "{ior} {base} {thickness}: {found} {truth}"
            );
        }
    }

    #[test]
    fn a_film_like_what_it_lies_on_changes_nothing() {
        // No second interface; but for Schlick's terms under the guard of 1e-5, of which the root interferes.
        let found = mean_reflectance(Vec3::splat(0.04), 1.5, 400.0);
        assert!((found - 0.04).abs().max_element() < 0.01, "{found}");
    }

    #[test]
    fn films_are_coloured_and_mirror_no_more_than_all() {
        for f0 in [0.0, 0.04, 0.5, 1.0] {
            for ior in [1.0, 1.3, 2.0, 3.0] {
                for thickness in [0.0, 50.0, 250.0, 600.0, 5000.0] {
                    let found = mean_reflectance(Vec3::splat(f0), ior, thickness);
                    assert!(
                        found.min_element() >= 0.0 && found.max_element() <= 1.0,
                        "{found}"
                    );
                }
            }
        }
        let found = mean_reflectance(Vec3::splat(0.04), 2.0, 300.0);
        assert!(found.max_element() > 1.3 * found.min_element(), "{found}");
    }
}
