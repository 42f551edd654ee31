//! Statements about Phong and Ward, and about the lobes of all models. Truth: quadrature of `eval` by directions
//! that are even under the lobe and under the cosine (balance heuristic with densities written out here in f64),
//! and closed forms.

use super::*;
use crate::shading::{Gloss, MIN_ALPHA, ShadingPoint};
use glam::{DVec3, Vec3};
use proptest::prelude::*;
use std::f32::consts::PI;
use std::f64::consts::{PI as PI64, TAU as TAU64};

const COSINES: [f32; 6] = [0.02, 0.1, 0.25, 0.5, 0.8, 1.0];

fn point(diffuse: f32, specular: f32, gloss: Gloss) -> ShadingPoint {
    ShadingPoint {
        position: Vec3::ZERO,
        geometric_normal: Vec3::Z,
        normal: Vec3::Z,
        shading_normal: Vec3::Z,
        base_color: Vec3::splat(diffuse),
        diffuse: Vec3::splat(diffuse),
        f0: Vec3::splat(specular),
        f90: 1.0,
        veil: None,
        alpha: match gloss {
            Gloss::Ward { alpha, .. } => alpha[0],
            _ => 1.0,
        },
        gloss,
        lambert: false,
        layers: None,
        emission: Vec3::ZERO,
        material: 0,
    }
}

fn phong(exponent: f32) -> Gloss {
    Gloss::Phong { exponent }
}

fn ward(u: f32, v: f32) -> Gloss {
    Gloss::Ward {
        alpha: [u, v],
        tangent: Vec3::new(0.8, 0.6, 0.0),
    }
}

fn glosses() -> Vec<Gloss> {
    let mut all = [0.0, 0.5, 1.0, 7.0, 40.0, 1e3, 3e4, MAX_EXPONENT]
        .map(phong)
        .to_vec();
    all.extend(
        [
            (MIN_ALPHA, MIN_ALPHA),
            (1e-3, 1e-3),
            (0.05, 0.05),
            (0.3, 0.3),
            (1.0, 1.0),
            (0.02, 0.4),
            (0.6, 0.1),
            (MIN_ALPHA, 1.0),
        ]
        .map(|(u, v)| ward(u, v)),
    );
    all
}

fn at_cosine(cos: f32, phi: f32) -> Vec3 {
    let sin = (1.0 - cos * cos).max(0.0).sqrt();
    Vec3::new(sin * phi.cos(), sin * phi.sin(), cos)
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

/// Coordinates of a direction along tangent, bitangent and normal.
fn local(gloss: Gloss, d: DVec3) -> DVec3 {
    let Gloss::Ward { tangent, .. } = gloss else {
        return d;
    };
    let t = tangent.as_dvec3();
    DVec3::new(t.dot(d), DVec3::Z.cross(t).dot(d), d.z)
}

/// Density of the lobe's own grid, in f64 and in terms of angles, not as the program computes it.
fn lobe_density(gloss: Gloss, wo: DVec3, wi: DVec3) -> f64 {
    match gloss {
        Gloss::Phong { exponent } => {
            let mirror = DVec3::new(-wo.x, -wo.y, wo.z);
            let n = f64::from(exponent);
            let cos = mirror.dot(wi);
            if cos > 0.0 {
                (n + 1.0) / TAU64 * cos.powf(n)
            } else {
                0.0
            }
        }
        Gloss::Ward { alpha, .. } => {
            let h = local(gloss, (wo + wi).normalize());
            let (u, v) = (f64::from(alpha[0]), f64::from(alpha[1]));
            let (tan2, phi) = ((h.x * h.x + h.y * h.y) / (h.z * h.z), h.y.atan2(h.x));
            let e = (-tan2 * ((phi.cos() / u).powi(2) + (phi.sin() / v).powi(2))).exp();
            e / (PI64 * u * v * h.z.powi(3)) / (4.0 * h.dot(local(gloss, wo)))
        }
        Gloss::Ggx | Gloss::GgxAnisotropic { .. } => unreachable!(),
    }
}

fn lobe_direction(gloss: Gloss, wo: DVec3, a: f64, b: f64) -> DVec3 {
    match gloss {
        Gloss::Phong { exponent } => {
            let mirror = DVec3::new(-wo.x, -wo.y, wo.z);
            let (x, y) = mirror.any_orthonormal_pair();
            let cos = (1.0 - a).powf(1.0 / (f64::from(exponent) + 1.0));
            let sin = (1.0 - cos * cos).max(0.0).sqrt();
            mirror * cos + (x * (TAU64 * b).cos() + y * (TAU64 * b).sin()) * sin
        }
        Gloss::Ward { alpha, tangent } => {
            let r = (-(1.0 - a).ln()).sqrt();
            let (x, y) = (
                f64::from(alpha[0]) * r * (TAU64 * b).cos(),
                f64::from(alpha[1]) * r * (TAU64 * b).sin(),
            );
            let t = tangent.as_dvec3();
            let h = (t * x + DVec3::Z.cross(t) * y + DVec3::Z).normalize();
            2.0 * wo.dot(h) * h - wo
        }
        Gloss::Ggx | Gloss::GgxAnisotropic { .. } => unreachable!(),
    }
}

/// ∫ f cosθ dω by both grids, `n` points each.
fn directional_albedo(point: &ShadingPoint, wo: Vec3, n: usize) -> f64 {
    let wo64 = wo.as_dvec3().normalize();
    let mut sum = 0.0;
    let mut add = |wi: DVec3| {
        if wi.z > 0.0 {
            let density = wi.z / PI64 + lobe_density(point.gloss, wo64, wi);
            if density > 0.0 {
                sum += f64::from(eval(point, wo, wi.as_vec3()).x) * wi.z / density;
            }
        }
    };
    for k in 0..n {
        let (a, b) = (
            (k as f64 + 0.5) / n as f64,
            (k as f64 * 0.618_033_988_749_894_9).fract(),
        );
        let (sin, cos) = (TAU64 * b).sin_cos();
        add(DVec3::new(a.sqrt() * cos, a.sqrt() * sin, (1.0 - a).sqrt()));
        add(lobe_direction(point.gloss, wo64, a, b));
    }
    sum / n as f64
}

proptest! {
    /// Tolerance: a mirror direction or half vector known to 2e-7, over the lobe's width.
    #[test]
    fn reflection_is_reciprocal(
        cos_o in 1e-3f32..1.0, phi in 0f32..7.0, near in 0f32..1.0,
        gloss in prop::sample::select(glosses()), away in 0.05f32..1.0,
    ) {
        let p = point(0.3, 0.6, gloss);
        let wo = at_cosine(cos_o, 0.3);
        // From the lobe's middle to anywhere.
        let mirror = Vec3::new(-wo.x, -wo.y, wo.z);
        let wi = mirror.lerp(at_cosine(away, phi), near * near * near).normalize();
        let (f, g) = (eval(&p, wo, wi).x, eval(&p, wi, wo).x);
        let width = lobe(&p, wo).unwrap().width.min(lobe(&p, wi).map_or(1.0, |l| l.width));
        let across = match gloss { Gloss::Ward { alpha, .. } => alpha[0].min(alpha[1]), _ => 0.3 * width };
        prop_assert!((f - g).abs() <= (1e-4 + 2e-5 / across) * f.max(g), "{f} {g}");
    }

    /// Finite and non-negative for any directions, grazing, opposite and below the horizon included.
    #[test]
    fn nothing_is_nan_or_negative(
        z in prop::sample::select(vec![-1.0f32, -1e-7, -0.0, 0.0, 1e-45, 1e-8, 2e-7, 1e-6, 1e-4, 0.3, 1.0]),
        w in prop::sample::select(vec![-1e-3f32, 0.0, 1e-40, 1e-7, 2e-7, 1e-6, 1e-3, 0.7, 1.0]),
        phi in prop::sample::select(vec![0f32, 1e-7, 1.0, PI]),
        gloss in prop::sample::select(glosses()),
        u in prop::array::uniform3(prop::sample::select(vec![0f32, 1e-8, 0.3, 0.99999994])),
    ) {
        for p in [point(0.5, 0.5, gloss), point(0.0, 1.0, gloss)] {
            let (wo, wi) = (at_cosine(z, 0.0), at_cosine(w, phi));
            let f = eval(&p, wo, wi);
            prop_assert!(f.is_finite() && f.min_element() >= 0.0, "{f}");
            let density = pdf(&p, wo, wi);
            prop_assert!(density.is_finite() && density >= 0.0, "{density}");
            if w < 0.0 || z < 0.0 {
                prop_assert_eq!(f, Vec3::ZERO);
            }
            if let Some(s) = sample(&p, wo, u) {
                prop_assert!(s.wi.is_normalized() && s.weight.is_finite() && s.weight.min_element() >= 0.0);
                prop_assert!(s.pdf > 0.0 && s.pdf.is_finite() && s.wi.z > 0.0, "{s:?}");
            }
        }
    }
}

/// A white surface sends out at most what it gets, from every direction. Tolerance: the quadrature's error.
#[test]
fn energy_is_conserved() {
    for gloss in glosses() {
        for (diffuse, specular) in [(0.0, 1.0), (0.6, 0.4)] {
            let p = point(diffuse, specular, gloss);
            for cos in COSINES {
                let albedo = directional_albedo(&p, at_cosine(cos, 0.4), 1 << 14);
                assert!(albedo <= 1.0 + 2e-3, "{gloss:?}, cosine {cos}: {albedo}");
                assert!(albedo > 0.0);
            }
        }
    }
}

/// At normal incidence Phong's lobe reflects exactly its specular factor: ∫ (n+2)/2π cosⁿ⁺¹ dω = 1. Near it a
/// narrow Ward lobe does, too: samples weigh 2 cosθi / (cosθi + 1), 1 − O(α²).
#[test]
fn the_specular_factor_is_what_is_reflected_at_normal_incidence() {
    for gloss in glosses() {
        let narrow = match gloss {
            Gloss::Phong { .. } => true,
            Gloss::Ward { alpha, .. } => alpha[0].max(alpha[1]) < 0.01,
            Gloss::Ggx | Gloss::GgxAnisotropic { .. } => false,
        };
        if narrow {
            let albedo = directional_albedo(&point(0.0, 0.7, gloss), Vec3::Z, 1 << 14);
            assert!((albedo - 0.7).abs() < 2e-3, "{gloss:?}: {albedo}");
        }
    }
}

#[test]
fn the_hemispherical_albedo_is_right_to_its_stated_error() {
    let mut worst = 0.0f64;
    for gloss in glosses()
        .into_iter()
        .chain([ward(0.17, 0.55), ward(0.8, 0.8), phong(3.0)])
    {
        let p = point(0.2, 0.8, gloss);
        let (nodes, turns) = (24, 8);
        let mut truth = 0.0;
        for k in 0..nodes * turns {
            // ∫ 2μ E dμ with x = √μ, and over the azimuth.
            let x = ((k / turns) as f32 + 0.5) / nodes as f32;
            let phi = (k % turns) as f32 * 0.41;
            truth += directional_albedo(&p, at_cosine(x * x, phi), 1 << 11) * f64::from(4.0 * x * x * x);
        }
        truth /= f64::from(nodes * turns);
        let error = f64::from(hemispherical_albedo(&p).x) - truth;
        worst = worst.max(error.abs());
        assert!(error.abs() < 5e-3, "{gloss:?}: {error} off {truth}");
    }
    println!("largest error of the hemispherical albedo: {worst:.1e}");
}

/// Sampling and quadrature give the same directional albedo. Tolerance: 5 standard errors, plus the quadrature's.
#[test]
fn sample_weights_average_to_the_albedo() {
    for gloss in glosses() {
        let p = point(0.3, 0.5, gloss);
        for cos in [0.05, 0.3, 0.9] {
            let wo = at_cosine(cos, 2.0);
            let (mut sum, mut squares) = (0.0f64, 0.0f64);
            let count = 40_000;
            for k in 0..count {
                let weight = sample(&p, wo, random(k)).map_or(0.0, |s| f64::from(s.weight.x));
                sum += weight;
                squares += weight * weight;
            }
            let mean = sum / f64::from(count);
            let error = ((squares / f64::from(count) - mean * mean).max(0.0) / f64::from(count)).sqrt();
            let truth = directional_albedo(&p, wo, 1 << 14);
            assert!(
                (mean - truth).abs() < 5.0 * error + 2e-3,
                "{gloss:?}, cosine {cos}: {mean} ± {error}, truth {truth}"
            );
        }
    }
}

/// The density integrates to at most 1, and to what share of the samples is above the horizon.
#[test]
fn samples_of_the_lobe_alone_average_to_what_the_matt_part_leaves() {
    let ggx = [0.01f32, 0.2, 1.0].map(|alpha| ShadingPoint {
        alpha,
        ..point(0.0, 0.4, Gloss::Ggx)
    });
    let others = glosses().into_iter().map(|gloss| point(0.3, 0.4, gloss));
    for point in ggx.into_iter().chain(others) {
        for cos in [0.2, 0.6, 1.0] {
            let wo = at_cosine(cos, 0.7);
            let n = 1 << 14;
            let mean = |sum: f64| sum / f64::from(n);
            let lobe = (0..n).filter_map(|i| sample_lobe(&point, wo, [uniform(i, 0), uniform(i, 1)]));
            let lobe = mean(lobe.map(|(_, weight)| f64::from(weight.x)).sum());
            let all = (0..n).filter_map(|i| sample(&point, wo, random(i)));
            let all = mean(all.map(|sample| f64::from(sample.weight.x)).sum());
            // Weights up to some 1 / 0.02 of few samples of the mixture: 0.01 is three deviations of 16,384.
            let matt = f64::from(diffuse_reflectance(&point, cos).x);
            assert!(
                (lobe + matt - all).abs() < 0.01,
                "{point:?} {cos}: {lobe} + {matt}, not {all}"
            );
        }
    }
}

#[test]
fn densities_integrate_to_the_share_of_samples_above_the_horizon() {
    for gloss in [
        phong(0.0),
        phong(9.0),
        phong(100.0),
        ward(0.2, 0.2),
        ward(0.7, 0.2),
        ward(1.0, 1.0),
    ] {
        let p = point(0.4, 0.6, gloss);
        for cos in [0.1, 0.5, 0.95] {
            let wo = at_cosine(cos, 0.7);
            let wo64 = wo.as_dvec3().normalize();
            let mut total = 0.0;
            let n = 1 << 15;
            for k in 0..n {
                let (a, b) = (
                    (k as f64 + 0.5) / f64::from(n),
                    (k as f64 * 0.618_033_988_749_894_9).fract(),
                );
                let (sin, cos) = (TAU64 * b).sin_cos();
                let even = DVec3::new(a.sqrt() * cos, a.sqrt() * sin, (1.0 - a).sqrt());
                for wi in [even, lobe_direction(gloss, wo64, a, b)] {
                    if wi.z > 0.0 {
                        let density = wi.z / PI64 + lobe_density(gloss, wo64, wi);
                        total += f64::from(pdf(&p, wo, wi.as_vec3())) / density / f64::from(n);
                    }
                }
            }
            let above = (0..40_000)
                .filter(|&k| sample(&p, wo, random(k)).is_some())
                .count() as f64
                / 40_000.0;
            assert!(
                total <= 1.0 + 1e-3 && (total - above).abs() < 0.012,
                "{gloss:?} {cos}: {total} {above}"
            );
        }
    }
}

/// A sample's weight and density are those of `eval` and `pdf`: by construction up to rounding, so exactly here.
#[test]
fn samples_agree_with_eval_and_pdf() {
    for gloss in glosses() {
        let p = point(0.2, 0.7, gloss);
        for k in 0..1000 {
            let wo = at_cosine(0.02 + 0.98 * uniform(k, 4), 10.0 * uniform(k, 5));
            if let Some(s) = sample(&p, wo, random(k)) {
                assert_eq!(s.pdf, pdf(&p, wo, s.wi));
                assert_eq!(s.weight, eval(&p, wo, s.wi) * (s.wi.z / s.pdf));
            }
        }
    }
}

/// Independent of the orientation of an isotropic lobe's tangent; an anisotropic one is wide along its wide axis.
#[test]
fn the_tangent_matters_to_anisotropic_lobes_only() {
    let turned = |u, v, tangent| {
        point(
            0.0,
            1.0,
            Gloss::Ward {
                alpha: [u, v],
                tangent,
            },
        )
    };
    let wo = at_cosine(0.8, 0.0);
    let wi = Vec3::new(-wo.x, 0.3, wo.z).normalize();
    let (a, b) = (
        turned(0.2, 0.2, Vec3::X),
        turned(0.2, 0.2, Vec3::new(0.6, 0.8, 0.0)),
    );
    assert!((eval(&a, wo, wi).x / eval(&b, wo, wi).x - 1.0).abs() < 1e-4);
    // wi deviates along Y.
    let (along, across) = (turned(0.05, 0.5, Vec3::X), turned(0.5, 0.05, Vec3::X));
    assert!(eval(&along, wo, wi).x > 100.0 * eval(&across, wo, wi).x);
    // A tangent along the normal gives some frame.
    assert!(eval(&turned(0.2, 0.3, Vec3::Z), wo, wi).is_finite());
}

/// Ward at α and Phong at its exponent are as wide as each other and as GGX's core: half of the lobe's peak at
/// normal incidence is reached at θ_h = α √ln 2 (Gaussian), GGX's at α √(√2 − 1), a quarter less.
#[test]
fn lobes_of_equal_alpha_are_equally_wide() {
    for alpha in [0.01f32, 0.05, 0.1] {
        let half_angle = |p: &ShadingPoint| {
            let peak = eval(p, Vec3::Z, Vec3::Z).x;
            (1..100_000)
                .map(|k| k as f32 * 1e-5)
                .find(|&theta| eval(p, Vec3::Z, at_cosine((2.0 * theta).cos(), 0.0)).x < 0.5 * peak)
                .unwrap()
        };
        let gaussian = alpha * 2f32.ln().sqrt();
        let found = half_angle(&point(0.0, 1.0, ward(alpha, alpha)));
        assert!(
            (found / gaussian - 1.0).abs() < 0.05,
            "Ward {alpha}: {found} {gaussian}"
        );
        let found = half_angle(&point(0.0, 1.0, phong(exponent_of_alpha(alpha))));
        assert!(
            (found / gaussian - 1.0).abs() < 0.05,
            "Phong {alpha}: {found} {gaussian}"
        );
        let mut ggx = point(0.0, 1.0, Gloss::Ggx);
        ggx.alpha = alpha;
        let found = half_angle(&ggx);
        assert!(
            (found / (alpha * 0.6436) - 1.0).abs() < 0.05,
            "GGX {alpha}: {found}"
        );
    }
}

#[test]
fn nothing_is_reflected_through_the_surface() {
    for gloss in [phong(5.0), ward(0.5, 0.2)] {
        let mut p = point(0.5, 0.5, gloss);
        p.geometric_normal = Vec3::new(1.0, 0.0, 1.0).normalize();
        let wo = Vec3::new(0.5, 0.0, 1.0).normalize();
        let wi = Vec3::new(-1.0, 0.0, 0.5).normalize();
        assert_eq!(eval(&p, wo, wi), Vec3::ZERO);
        assert_eq!(pdf(&p, wo, wi), 0.0);
        for k in 0..10_000 {
            if let Some(s) = sample(&p, wo, random(k)) {
                assert!(s.wi.dot(p.geometric_normal) > 0.0 && s.wi.dot(p.shading_normal) > 0.0);
            }
        }
    }
}

/// At least 90 % of the specular energy comes from within the lobe that [`lobe`] states, for all models; and the
/// lobe is no wider than it need be: one of half the width holds less than 95 %, but for anisotropic lobes, whose
/// circle is as wide as their wider axis, and for GGX where it is not white.
#[test]
fn the_stated_lobe_holds_nine_tenths_of_the_energy() {
    let mut all: Vec<ShadingPoint> = glosses()
        .into_iter()
        .map(|gloss| point(0.0, 1.0, gloss))
        .collect();
    for alpha in [MIN_ALPHA, 1e-3, 0.01, 0.05, 0.1, 0.2, 0.35, 0.5, 0.7, 1.0] {
        for f0 in [0.04, 1.0] {
            let mut p = point(0.0, f0, Gloss::Ggx);
            p.alpha = alpha;
            all.push(p);
        }
    }
    let mut least = (1.0f64, String::new());
    let mut wrong = Vec::new();
    for p in &all {
        for cos in COSINES {
            let wo = at_cosine(cos, 0.4);
            let found = lobe(p, wo).unwrap();
            assert!(found.direction.is_normalized() && found.width > 0.0 && found.width <= 1.6);
            let (mut all, mut within, mut core) = (0.0f64, 0.0f64, 0.0f64);
            for k in 0..20_000 {
                let Some(s) = sample(p, wo, random(k)) else {
                    continue;
                };
                let weight = f64::from(s.weight.x);
                // From the chord: cosines of small angles have lost their digits.
                let angle = 2.0 * (0.5 * s.wi.distance(found.direction)).min(1.0).asin();
                all += weight;
                within += if angle <= found.width * 1.001 { weight } else { 0.0 };
                core += if angle <= 0.5 * found.width { weight } else { 0.0 };
            }
            let label = format!("{:?} alpha {} f0 {} cosine {cos}", p.gloss, p.alpha, p.f0.x);
            if within / all < least.0 {
                least = (within / all, label.clone());
            }
            // A dielectric reflects a grazing view's lobe more narrowly than the metal that the table is for.
            let tight = p.f0.x == 1.0 && !matches!(p.gloss, Gloss::Ward { alpha: [u, v], .. } if u != v);
            if within / all < 0.9 || (tight && core / all > 0.95) {
                wrong.push(format!(
                    "{label}: {:.3} within {found:?}, {:.3} in its core",
                    within / all,
                    core / all
                ));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    println!(
        "least energy within the stated lobe: {:.3} ({})",
        least.0, least.1
    );
    let mut matt = point(0.5, 0.0, phong(3.0));
    assert_eq!(lobe(&matt, Vec3::Z), None);
    matt.lambert = true;
    matt.f0 = Vec3::ONE;
    assert_eq!(lobe(&matt, Vec3::Z), None);
    assert_eq!(lobe(&point(0.0, 1.0, phong(3.0)), -Vec3::Z), None);
}
