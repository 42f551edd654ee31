//! Statements about reflection. The independent truth is numerical quadrature of `eval` over the hemisphere (two
//! grids, one even in the cosine-weighted hemisphere, one even under the GGX distribution of half vectors,
//! combined by the balance heuristic) and a transcription of appendix B of the glTF 2.0 specification in f64.

use super::*;
use crate::shading::{Gloss, MIN_ALPHA, ShadingPoint};
use glam::{DVec3, Vec3};
use proptest::prelude::*;
use std::f32::consts::{PI, TAU};

const ALPHAS: [f32; 7] = [MIN_ALPHA, 1e-3, 1e-2, 0.05, 0.2, 0.5, 1.0];
const COSINES: [f32; 7] = [1e-3, 0.02, 0.1, 0.25, 0.5, 0.8, 1.0];

/// A glTF material with the normal along +Z.
fn material(base: Vec3, metallic: f32, alpha: f32) -> ShadingPoint {
    ShadingPoint {
        position: Vec3::ZERO,
        geometric_normal: Vec3::Z,
        normal: Vec3::Z,
        shading_normal: Vec3::Z,
        base_color: base,
        diffuse: base * (1.0 - metallic),
        f0: Vec3::splat(0.04 * (1.0 - metallic)) + base * metallic,
        f90: 1.0,
        veil: None,
        alpha,
        lambert: false,
        gloss: Gloss::Ggx,
        layers: None,
        emission: Vec3::ZERO,
        material: 0,
    }
}

fn lambert(albedo: Vec3) -> ShadingPoint {
    ShadingPoint {
        lambert: true,
        f0: Vec3::ZERO,
        ..material(albedo, 0.0, 1.0)
    }
}

fn at_cosine(cos: f32, phi: f32) -> Vec3 {
    let sin = (1.0 - cos * cos).max(0.0).sqrt();
    Vec3::new(sin * phi.cos(), sin * phi.sin(), cos)
}

/// The golden ratio's fraction: multiples of it spread evenly over the unit interval.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// ∫ g(wi) dω by both grids, Kronecker lattices of n² nodes each: directional cut-offs that are aligned with an
/// axis cost an error of 1/n², where a square grid would have 1/n.
fn integrate(alpha: f32, wo: Vec3, n: usize, g: impl Fn(Vec3) -> Vec3) -> DVec3 {
    let (alpha, wo64) = (f64::from(alpha), wo.as_dvec3());
    let cosine_pdf = |wi: DVec3| wi.z / std::f64::consts::PI;
    // Density of wi when its half vector has density D cosθ_h.
    let half_pdf = |h: DVec3| {
        let sin2 = h.x * h.x + h.y * h.y;
        let root = alpha * alpha * h.z * h.z + sin2;
        alpha * alpha / (std::f64::consts::PI * root * root) * h.z / (4.0 * wo64.dot(h))
    };
    let mut sum = DVec3::ZERO;
    for k in 0..n * n {
        let (a, b) = ((k as f64 + 0.5) / (n * n) as f64, (k as f64 * GOLDEN).fract());
        let (sin_phi, cos_phi) = (std::f64::consts::TAU * b).sin_cos();
        let wi = DVec3::new(a.sqrt() * cos_phi, a.sqrt() * sin_phi, (1.0 - a).sqrt());
        let h = (wi + wo64).normalize();
        sum += g(wi.as_vec3()).as_dvec3() / (cosine_pdf(wi) + half_pdf(h));

        let cos2 = (1.0 - a) / (1.0 + (alpha * alpha - 1.0) * a);
        let (sin, cos) = ((1.0 - cos2).max(0.0).sqrt(), cos2.sqrt());
        let h = DVec3::new(sin * cos_phi, sin * sin_phi, cos);
        let wi = 2.0 * wo64.dot(h) * h - wo64;
        if wi.z > 0.0 && wo64.dot(h) > 0.0 {
            sum += g(wi.as_vec3()).as_dvec3() / (cosine_pdf(wi) + half_pdf(h));
        }
    }
    sum / (n * n) as f64
}

fn directional_albedo(point: &ShadingPoint, wo: Vec3, n: usize) -> DVec3 {
    integrate(point.alpha, wo, n, |wi| eval(point, wo, wi) * wi.z)
}

/// Appendix B as printed, in f64.
fn appendix_b(base: DVec3, metallic: f64, alpha: f64, wo: DVec3, wi: DVec3) -> DVec3 {
    let pi = std::f64::consts::PI;
    let h = (wo + wi).normalize();
    let (nl, nv, nh, vh) = (wi.z, wo.z, h.z, wo.dot(h));
    let a2 = alpha * alpha;
    let d = a2 / (pi * (nh * nh * (a2 - 1.0) + 1.0).powi(2));
    let v = 0.5 / (nl * (nv * nv * (1.0 - a2) + a2).sqrt() + nv * (nl * nl * (1.0 - a2) + a2).sqrt());
    let specular = d * v;
    let weight = (1.0 - vh).powi(5);
    let metal = (base + (DVec3::ONE - base) * weight) * specular;
    let fresnel = 0.04 + 0.96 * weight;
    let dielectric = base / pi * (1.0 - fresnel) + fresnel * specular;
    dielectric * (1.0 - metallic) + metal * metallic
}

/// Tolerance: f32 rounding of the half vector, some 2e-7, moves D by 2e-7/α times a few.
#[test]
fn the_brdf_is_the_one_of_appendix_b_where_that_conserves_energy() {
    let base = Vec3::new(0.5, 0.3, 0.1);
    for metallic in [0.0, 1.0] {
        for alpha in ALPHAS {
            let point = material(base, metallic, alpha);
            for k in 0..200 {
                let wo = at_cosine(0.35 + 0.6 * (k as f32 * 0.618).fract(), k as f32);
                // Half of the directions near the mirror direction, half anywhere.
                let mirror = Vec3::new(-wo.x, -wo.y, wo.z);
                let away = at_cosine(0.4 + 0.6 * (k as f32 * 0.414).fract(), 3.0 * k as f32);
                let wi = if k % 2 == 0 {
                    away
                } else {
                    (mirror + away * 2.0 * alpha).normalize()
                };
                if wi.z < 0.35 {
                    continue;
                }
                // Normalised again in f64: appendix B's form loses 1 − n·h in f32.
                let expected = appendix_b(
                    base.as_dvec3(),
                    f64::from(metallic),
                    f64::from(alpha),
                    wo.as_dvec3().normalize(),
                    wi.as_dvec3().normalize(),
                );
                let found = eval(&point, wo, wi).as_dvec3();
                let tolerance = 1e-5 + 4e-6 / f64::from(alpha);
                assert!(
                    ((found - expected) / expected).abs().max_element() < tolerance,
                    "alpha {alpha}, metallic {metallic}, wo {wo}, wi {wi}: {found} instead of {expected}"
                );
            }
        }
    }
}

proptest! {
    /// Helmholtz: light takes the same share along the path reversed.
    #[test]
    fn reflection_is_reciprocal(
        cos_o in 1e-6f32..1.0, cos_i in 1e-6f32..1.0, phi in 0f32..7.0,
        alpha in prop::sample::select(ALPHAS.to_vec()), metallic in 0f32..1.0, base in 0f32..=1.0,
    ) {
        let point = material(Vec3::splat(base), metallic, alpha);
        let (wo, wi) = (at_cosine(cos_o, 0.3), at_cosine(cos_i, phi));
        let (f, g) = (eval(&point, wo, wi).x, eval(&point, wi, wo).x);
        prop_assert!((f - g).abs() <= 1e-4 * f.max(g), "{f} {g}");
    }

    /// Finite and non-negative for any directions, grazing, opposite and below the horizon included.
    #[test]
    fn nothing_is_nan_or_negative(
        z in prop::sample::select(vec![-1.0f32, -1e-7, -0.0, 0.0, 1e-45, 1e-30, 1e-8, 2e-7, 1e-6, 1e-4, 0.3, 1.0]),
        w in prop::sample::select(vec![-1e-3f32, 0.0, 1e-40, 1e-20, 1e-7, 2e-7, 1e-6, 1e-3, 0.7, 1.0]),
        phi in prop::sample::select(vec![0f32, 1e-7, 1.0, PI]),
        alpha in prop::sample::select(ALPHAS.to_vec()), metallic in 0f32..=1.0,
        u in prop::array::uniform3(prop::sample::select(vec![0f32, 1e-8, 0.3, 0.99999994])),
    ) {
        let point = material(Vec3::new(1.0, 0.5, 0.0), metallic, alpha);
        let (wo, wi) = (at_cosine(z, 0.0), at_cosine(w, phi));
        let f = eval(&point, wo, wi);
        prop_assert!(f.is_finite() && f.min_element() >= 0.0, "{f}");
        let density = pdf(&point, wo, wi);
        prop_assert!(density.is_finite() && density >= 0.0, "{density}");
        if let Some(s) = sample(&point, wo, u) {
            prop_assert!(s.wi.is_normalized() && s.weight.is_finite() && s.weight.min_element() >= 0.0, "{s:?}");
            prop_assert!(s.pdf > 0.0 && s.pdf.is_finite() && s.wi.z > 0.0, "{s:?}");
        }
    }
}

/// No material sends out more light than it gets, from any direction. Tolerance: the quadrature's error.
#[test]
fn energy_is_conserved() {
    for metallic in [0.0, 0.3, 0.7, 1.0] {
        for alpha in ALPHAS {
            let point = material(Vec3::new(1.0, 0.9, 0.5), metallic, alpha);
            for cos in COSINES {
                let albedo = directional_albedo(&point, at_cosine(cos, 0.4), 128);
                assert!(
                    albedo.max_element() <= 1.0 + 1e-3 && albedo.min_element() > 0.0,
                    "metallic {metallic}, alpha {alpha}, cosine {cos}: {albedo}"
                );
            }
        }
    }
}

/// Truth: the product of both factors, as far as there is a diffuse part.
#[test]
fn what_directions_leave_of_the_diffuse_part_is_told_at_once_where_it_is_all() {
    for metallic in [0.0, 0.5] {
        for alpha in ALPHAS {
            for base in [0.0, 0.3, 0.6, 0.8, 0.9, 0.95, 0.98, 1.0] {
                let point = material(Vec3::new(base, 0.5 * base, 0.1), metallic, alpha);
                for k in 0..400 {
                    let [cos_o, cos_i] = [k % 20, k / 20].map(|k| ((k as f32 + 0.5) / 20.0).powi(2));
                    let truth = albedo::diffuse_scale(&point, cos_o) * albedo::diffuse_scale(&point, cos_i);
                    let found = albedo::diffuse_scales(&point, cos_o, cos_i);
                    assert_eq!(point.diffuse * found, point.diffuse * truth);
                    let is_told = albedo::are_unscaled(&point, cos_o.min(cos_i));
                    assert!(
                        is_told || base > 0.8 || cos_o.min(cos_i) < 0.5,
                        "{base} {alpha} {cos_o} {cos_i}"
                    );
                }
            }
        }
    }
}

/// The tables behind everything above: E of a white and of a black-based specular part against quadrature.
#[test]
fn the_specular_albedo_is_right_to_its_stated_error() {
    let mut worst = 0.0f64;
    for alpha in [
        1e-4f32, 5e-4, 3e-3, 0.013, 0.04, 0.09, 0.19, 0.37, 0.61, 0.83, 1.0,
    ] {
        for f0 in [0.0f32, 0.04, 1.0] {
            let mut point = material(Vec3::ZERO, 1.0, alpha);
            point.f0 = Vec3::splat(f0);
            for cos in [0.003f32, 0.011, 0.03, 0.07, 0.13, 0.22, 0.4, 0.63, 0.9, 1.0] {
                let truth = directional_albedo(&point, at_cosine(cos, 0.4), 200).x;
                let error = f64::from(albedo::specular(&point, cos).x) - truth;
                worst = worst.max(error.abs());
                assert!(
                    error.abs() < 3e-3,
                    "alpha {alpha}, f0 {f0}, cosine {cos}: {error} off {truth}"
                );
            }
        }
    }
    println!("largest error of the specular albedo: {worst:.1e}");
}

#[test]
fn the_hemispherical_albedo_is_right_to_its_stated_error() {
    let mut worst = 0.0f64;
    for base in [Vec3::new(1.0, 0.5, 0.1), Vec3::new(0.8, 0.04, 0.0)] {
        for metallic in [0.0, 0.5, 1.0] {
            for alpha in ALPHAS {
                let point = material(base, metallic, alpha);
                // ∫ 2μ E(μ) dμ with x = √μ: ∫ 4x³ E dx, by midpoints.
                let nodes = 24;
                let mut truth = DVec3::ZERO;
                for k in 0..nodes {
                    let x = (k as f32 + 0.5) / nodes as f32;
                    let weight = f64::from(4.0 * x * x * x) / nodes as f64;
                    truth += directional_albedo(&point, at_cosine(x * x, 0.0), 40) * weight;
                }
                let found = hemispherical_albedo(&point);
                let error = (found.as_dvec3() - truth).abs().max_element();
                worst = worst.max(error);
                assert!(
                    error < 1e-2,
                    "{base} {metallic} {alpha}: {found} instead of {truth}"
                );
                assert!(found.max_element() <= 1.0 && found.min_element() >= 0.0);
            }
        }
    }
    println!("largest error of the hemispherical albedo: {worst:.1e}");
}

#[test]
fn a_lambert_surface_reflects_its_albedo_from_everywhere() {
    let point = lambert(Vec3::new(0.8, 0.5, 0.2));
    assert_eq!(hemispherical_albedo(&point), point.diffuse);
    for cos in COSINES {
        // Midpoint rule on a constant integrand: exact but for rounding.
        let albedo = directional_albedo(&point, at_cosine(cos, 1.0), 32);
        assert!(
            (albedo - point.diffuse.as_dvec3()).abs().max_element() < 2e-3,
            "{albedo}"
        );
    }
}

/// Counter-based uniform numbers.
fn uniform(index: u32, dimension: u32) -> f32 {
    let mut z = (u64::from(index) << 3 | u64::from(dimension)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 40) as f32 / (1u64 << 24) as f32
}

fn random(index: u32) -> [f32; 3] {
    [0, 1, 2].map(|dimension| uniform(index, dimension))
}

/// Pearson's test over 12 × 16 bins of (cosine, azimuth); expected counts by quadrature of `pdf`, 48² nodes a
/// bin. Its statistic has mean k and variance 2k for k degrees of freedom: five standard deviations above
/// happen once in a million. Directions that `sample` rejects form one more bin.
#[test]
fn directions_are_sampled_with_the_stated_density() {
    const ROWS: usize = 12;
    const COLUMNS: usize = 16;
    const SAMPLES: u32 = 200_000;
    // A tilted normal, so that both horizons matter.
    let geometric = Vec3::new(0.3, -0.2, 1.0).normalize();
    for (metallic, alpha) in [(0.0, 0.09), (0.0, 0.6), (0.5, 0.3), (1.0, 0.15), (1.0, 1.0)] {
        for cos in [0.15f32, 0.6, 0.97] {
            let mut point = material(Vec3::new(0.9, 0.6, 0.3), metallic, alpha);
            point.geometric_normal = geometric;
            let wo = at_cosine(cos, 0.5);
            let mut counts = [0u32; ROWS * COLUMNS + 1];
            for k in 0..SAMPLES {
                let bin = sample(&point, wo, random(k)).map_or(ROWS * COLUMNS, |s| {
                    let row = ((s.wi.z * ROWS as f32) as usize).min(ROWS - 1);
                    let turn = (s.wi.y.atan2(s.wi.x) / TAU).rem_euclid(1.0);
                    row * COLUMNS + ((turn * COLUMNS as f32) as usize).min(COLUMNS - 1)
                });
                counts[bin] += 1;
            }
            let nodes = 48;
            let cell = f64::from(TAU) / (ROWS * COLUMNS * nodes * nodes) as f64;
            let mut expected: Vec<f64> = (0..ROWS * COLUMNS)
                .map(|bin| {
                    let mut sum = 0.0;
                    for k in 0..nodes * nodes {
                        let row = (bin / COLUMNS) as f32 + ((k / nodes) as f32 + 0.5) / nodes as f32;
                        let column = (bin % COLUMNS) as f32 + ((k % nodes) as f32 + 0.5) / nodes as f32;
                        let wi = at_cosine(row / ROWS as f32, column / COLUMNS as f32 * TAU);
                        sum += f64::from(pdf(&point, wo, wi));
                    }
                    sum * cell
                })
                .collect();
            let total: f64 = expected.iter().sum();
            assert!(total < 1.0 + 1e-3, "the density integrates to {total}");
            expected.push(1.0 - total);
            let (mut statistic, mut degrees) = (0.0, 0.0);
            let (mut rest_found, mut rest_expected) = (0.0, 0.0);
            for (&count, &share) in counts.iter().zip(&expected) {
                let (found, expected) = (f64::from(count), share * f64::from(SAMPLES));
                // Bins with few samples are pooled, as the test's normal approximation needs.
                if expected < 20.0 {
                    rest_found += found;
                    rest_expected += expected;
                    continue;
                }
                statistic += (found - expected).powi(2) / expected;
                degrees += 1.0;
            }
            assert!(
                (rest_found - rest_expected).abs() < 5.0 * rest_expected.max(9.0).sqrt() + 20.0,
                "{rest_found} samples where {rest_expected} are due"
            );
            let limit = degrees + 5.0 * (2.0f64 * degrees).sqrt();
            assert!(
                statistic < limit,
                "metallic {metallic}, alpha {alpha}, cosine {cos}: chi-square {statistic} over {limit}"
            );
        }
    }
}

/// The mean weight of samples is the directional albedo, at every roughness. Tolerance: 5 standard errors of the
/// samples, plus the quadrature's error.
#[test]
fn sample_weights_average_to_the_albedo() {
    for metallic in [0.0, 1.0] {
        for alpha in ALPHAS {
            let point = material(Vec3::splat(0.8), metallic, alpha);
            for cos in [0.02, 0.25, 0.8] {
                let wo = at_cosine(cos, 2.0);
                let (mut sum, mut squares) = (0.0f64, 0.0f64);
                let count = 40_000;
                for k in 0..count {
                    if let Some(s) = sample(&point, wo, random(k)) {
                        sum += f64::from(s.weight.x);
                        squares += f64::from(s.weight.x).powi(2);
                    }
                }
                let mean = sum / f64::from(count);
                let error = ((squares / f64::from(count) - mean * mean).max(0.0) / f64::from(count)).sqrt();
                let truth = directional_albedo(&point, wo, 128).x;
                assert!(
                    (mean - truth).abs() < 5.0 * error + 1e-3,
                    "metallic {metallic}, alpha {alpha}, cosine {cos}: {mean} ± {error}, truth {truth}"
                );
            }
        }
    }
}

/// A sample's weight and density are those that `eval` and `pdf` give for its direction. Tolerance: the direction
/// is rounded to f32, which moves D by some 3e-7/α relative.
#[test]
fn samples_agree_with_eval_and_pdf() {
    for alpha in ALPHAS {
        let point = material(Vec3::new(0.9, 0.5, 0.1), 0.4, alpha);
        for k in 0..2_000 {
            let wo = at_cosine(0.02 + 0.98 * uniform(k, 4), 10.0 * uniform(k, 5));
            let Some(s) = sample(&point, wo, random(k)) else {
                continue;
            };
            let density = pdf(&point, wo, s.wi);
            let tolerance = 1e-3 + 5e-6 / alpha;
            assert!(
                (density / s.pdf - 1.0).abs() < tolerance,
                "alpha {alpha}: pdf {density} instead of {}",
                s.pdf
            );
            let weight = eval(&point, wo, s.wi) * s.wi.z / density;
            assert!(
                (weight - s.weight).abs().max_element() < tolerance * s.weight.max_element().max(0.1),
                "alpha {alpha}: weight {weight} instead of {}",
                s.weight
            );
        }
    }
}

#[test]
fn nothing_is_reflected_through_the_surface() {
    let mut point = material(Vec3::ONE, 0.0, 0.25);
    point.geometric_normal = Vec3::new(1.0, 0.0, 1.0).normalize();
    let wo = Vec3::new(0.5, 0.0, 1.0).normalize();
    // Above the shading normal's horizon, below the geometric one.
    let wi = Vec3::new(-1.0, 0.0, 0.5).normalize();
    assert_eq!(eval(&point, wo, wi), Vec3::ZERO);
    assert_eq!(pdf(&point, wo, wi), 0.0);
    for k in 0..10_000 {
        if let Some(s) = sample(&point, wo, random(k)) {
            assert!(s.wi.dot(point.geometric_normal) > 0.0 && s.wi.dot(point.shading_normal) > 0.0);
        }
    }
}

/// Truth: the largest of the specular part's values over views on a grid that are no more grazing than 14.5°, or than the light.
#[test]
fn the_strongest_reflection_is_about_the_largest_of_all_views() {
    for metallic in [0.0, 1.0] {
        for alpha in [0.1, 0.2, 0.5, 1.0] {
            for cos_i in [0.1, 0.25, 0.5, 0.8, 1.0] {
                let point = material(Vec3::splat(0.8), metallic, alpha);
                let wi = at_cosine(cos_i, PI);
                let specular = |wo: Vec3| (eval(&point, wo, wi) - eval_diffuse(&point, wo, wi)).max_element();
                let least = cos_i.min(0.25);
                let views = (0..400).flat_map(|i| {
                    let cos = least + (1.0 - least) * i as f32 / 399.0;
                    (0..32).map(move |j| at_cosine(cos, j as f32 * PI / 31.0))
                });
                let largest = views.map(specular).fold(0.0, f32::max);
                let ratio = strongest(&point, cos_i) / largest;
                assert!(
                    (0.9..1.05).contains(&ratio),
                    "metallic {metallic}, α {alpha}, cosine {cos_i}: {ratio} of {largest}"
                );
            }
        }
    }
}
