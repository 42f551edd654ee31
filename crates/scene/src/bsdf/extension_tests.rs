//! Statements about what glTF's extensions change: against their appendices in f64, against quadrature of `eval`, and that
//! none makes light. Directions are spread and integrated as in [`super::tests`], but evenly over the hemisphere.

use super::*;
use crate::shading::{Gloss, Layers, MIN_ALPHA, ShadingPoint};
use glam::{DVec3, Vec3};
use proptest::prelude::*;
use std::f64::consts::{PI, TAU};

const COSINES: [f32; 6] = [0.03, 0.1, 0.25, 0.5, 0.8, 1.0];

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

fn at_cosine(cos: f32, phi: f32) -> Vec3 {
    let sin = (1.0 - cos * cos).max(0.0).sqrt();
    Vec3::new(sin * phi.cos(), sin * phi.sin(), cos)
}

/// Points under every extension, each with its name; all are as bright as they can be.
fn extended() -> Vec<(&'static str, ShadingPoint)> {
    let white = |alpha| material(Vec3::ONE, 0.0, alpha);
    let layers = Layers {
        coat: 0.0,
        coat_alpha: MIN_ALPHA,
        coat_normal: Vec3::Z,
        sheen: Vec3::ZERO,
        sheen_alpha: 0.25,
    };
    let over = |base: ShadingPoint, layers: Layers| ShadingPoint {
        layers: Some(layers),
        ..base
    };
    let coat = |coat_alpha| Layers {
        coat: 1.0,
        coat_alpha,
        ..layers
    };
    let sheen = |sheen_alpha| Layers {
        sheen: Vec3::new(1.0, 0.6, 0.1),
        sheen_alpha,
        ..layers
    };
    let brushed = |base: ShadingPoint, along| ShadingPoint {
        gloss: Gloss::GgxAnisotropic {
            alpha: [along, base.alpha],
            tangent: Vec3::new(0.8, 0.6, 0.0),
        },
        ..base
    };
    let mirrors = |f0: Vec3, f90: f32, alpha| ShadingPoint {
        f0,
        f90,
        veil: Some([f0.max_element(), f90]),
        ..white(alpha)
    };
    vec![
        (
            "diamond",
            ShadingPoint {
                f0: Vec3::splat(0.17),
                ..white(0.1)
            },
        ),
        (
            "coloured dielectric",
            mirrors(Vec3::new(0.5, 0.04, 0.0), 1.0, 0.3),
        ),
        ("weak dielectric", mirrors(Vec3::splat(0.02), 0.5, 0.2)),
        ("no specular", mirrors(Vec3::ZERO, 0.0, 0.5)),
        ("all specular", mirrors(Vec3::ONE, 1.0, 0.3)),
        ("sharp coat", over(white(0.5), coat(MIN_ALPHA))),
        ("rough coat", over(white(0.5), coat(0.4))),
        ("coated metal", over(material(Vec3::ONE, 1.0, 0.2), coat(0.05))),
        ("rim of sheen", over(white(0.8), sheen(MIN_SHEEN_ALPHA))),
        ("sheen", over(white(0.8), sheen(0.09))),
        ("even sheen", over(white(1.0), sheen(1.0))),
        ("brushed metal", brushed(material(Vec3::ONE, 1.0, 0.05), 0.5)),
        ("brushed plastic", brushed(white(0.01), 0.4)),
        ("grooves", brushed(white(0.04), 1.0)),
        (
            "index of air over nothing",
            ShadingPoint {
                f0: Vec3::ZERO,
                ..material(Vec3::ZERO, 0.0, 0.2)
            },
        ),
        (
            "all at once",
            over(
                brushed(mirrors(Vec3::new(0.1, 0.08, 0.05), 0.9, 0.1), 0.4),
                Layers {
                    sheen: Vec3::splat(0.7),
                    ..coat(0.02)
                },
            ),
        ),
    ]
}

/// Mean weight of samples of `sample`, whose density the tests below hold against `eval`, and its standard error.
fn albedo(point: &ShadingPoint, wo: Vec3, count: u32) -> (DVec3, f64) {
    let (mut sum, mut squares) = (DVec3::ZERO, DVec3::ZERO);
    for k in 0..count {
        if let Some(s) = sample(point, wo, random(k)) {
            let weight = s.weight.as_dvec3();
            sum += weight;
            squares += weight * weight;
        }
    }
    let mean = sum / f64::from(count);
    let variance = (squares / f64::from(count) - mean * mean).max_element();
    (mean, (variance.max(0.0) / f64::from(count)).sqrt())
}

/// Roberts' sequence in three dimensions.
fn random(k: u32) -> [f32; 3] {
    [0.819_172_513_f64, 0.671_043_607, 0.549_700_478].map(|step| ((f64::from(k) + 0.5) * step).fract() as f32)
}

/// ∫ f cosθ dω by directions even in the cosine, n² of them; for lobes that are not sharp.
fn quadrature(point: &ShadingPoint, wo: Vec3, n: u32) -> DVec3 {
    let mut sum = DVec3::ZERO;
    for k in 0..n * n {
        // Squared, for what is bright near the horizon.
        let root = (f64::from(k) + 0.5) / f64::from(n * n);
        let turn = (f64::from(k) * 0.618_033_988_749_894_9).fract();
        let wi = at_cosine((root * root) as f32, (turn * TAU) as f32);
        sum += (eval(point, wo, wi) * wi.z).as_dvec3() * (2.0 * root);
    }
    sum * TAU / f64::from(n * n)
}

fn is_sharp(point: &ShadingPoint) -> bool {
    point.alpha < 0.05
        || point
            .layers
            .is_some_and(|layers| layers.coat > 0.0 && layers.coat_alpha < 0.05)
}

/// White furnace, from any direction: Tolerance: five standard errors.
#[test]
fn no_extension_makes_light() {
    for (name, point) in extended() {
        for cos in COSINES {
            for phi in [0.0, 0.7, 1.6] {
                let (found, error) = albedo(&point, at_cosine(cos, phi), 20_000);
                assert!(
                    found.max_element() <= 1.0 + 5.0 * error + 1e-3 && found.min_element() >= 0.0,
                    "{name} at {cos}, {phi}: {found} ± {error}"
                );
            }
        }
    }
}

/// What samples find is what quadrature of `eval` finds.
#[test]
fn samples_weigh_what_the_brdf_reflects() {
    for (name, point) in extended().into_iter().filter(|(_, point)| !is_sharp(point)) {
        for cos in [0.1, 0.5, 0.95] {
            let wo = at_cosine(cos, 0.7);
            let (found, error) = albedo(&point, wo, 40_000);
            let truth = quadrature(&point, wo, 300);
            assert!(
                (found - truth).abs().max_element() < 5.0 * error + 3e-3,
                "{name} at {cos}: {found} ± {error}, truth {truth}"
            );
        }
    }
}

/// The two parts that transport and play take apart are the whole, and the lobe's samples weigh what its albedo says.
#[test]
fn lobe_and_matt_part_are_the_whole() {
    for (name, point) in extended() {
        let brushed = matches!(point.gloss, Gloss::GgxAnisotropic { .. });
        for cos in [0.25, 0.6, 0.95] {
            let wo = at_cosine(cos, 0.3);
            let (whole, error) = albedo(&point, wo, 40_000);
            let lobe = lobe_albedo(&point, wo);
            // The diffuse part is meant for light from one direction, averaged over views: close to what is seen from one.
            let parts = lobe + diffuse_reflectance(&point, cos);
            // An anisotropic lobe's albedo is that of no azimuth.
            let tolerance = if brushed { 0.13 } else { 0.045 };
            assert!(
                (parts.as_dvec3() - whole).abs().max_element() < tolerance + 5.0 * error,
                "{name} at {cos}: {parts}, whole {whole}"
            );
            let count = 20_000;
            let mut sum = DVec3::ZERO;
            for k in 0..count {
                let [a, b, _] = random(k);
                sum += sample_lobe(&point, wo, [a, b]).map_or(DVec3::ZERO, |(_, weight)| weight.as_dvec3());
            }
            let sampled = sum / f64::from(count);
            let tolerance = if brushed { 0.12 } else { 0.01 };
            assert!(
                (sampled - lobe.as_dvec3()).abs().max_element() < tolerance,
                "{name} at {cos}: lobe {lobe}, sampled {sampled}"
            );
        }
    }
}

/// Total reflectance for transport: truth is the mean of samples over views by their cosine.
#[test]
fn transport_gets_the_total_reflectance() {
    let mut worst = 0.0f64;
    for (name, point) in extended() {
        let views = 24;
        let mut truth = DVec3::ZERO;
        for k in 0..views {
            // Even in cos²: equal weights of the cosine.
            let cos = ((k as f32 + 0.5) / views as f32).sqrt();
            truth += albedo(&point, at_cosine(cos, 2.4 * k as f32), 4_000).0 / f64::from(views);
        }
        let found = hemispherical_albedo(&point).as_dvec3();
        let error = (found - truth).abs().max_element();
        worst = worst.max(error);
        let brushed = matches!(point.gloss, Gloss::GgxAnisotropic { .. });
        assert!(
            error < if brushed { 0.02 } else { 0.012 },
            "{name}: {found}, truth {truth}"
        );
    }
    println!("largest error of total reflectances: {worst:.1e}");
}

/// KHR_materials_specular and KHR_materials_ior: fresnel_mix of their appendices.
#[test]
fn dielectrics_are_those_of_the_appendix() {
    let (f0, f90, base, alpha) = (
        DVec3::new(0.09, 0.05, 0.01),
        0.8,
        DVec3::new(0.3, 0.2, 0.6),
        0.3f64,
    );
    let point = ShadingPoint {
        f0: f0.as_vec3(),
        f90: f90 as f32,
        veil: Some([0.09, 0.8]),
        ..material(base.as_vec3(), 0.0, alpha as f32)
    };
    for k in 0..200 {
        let wo = at_cosine(0.4 + 0.6 * (k as f32 * 0.618).fract(), k as f32);
        let wi = at_cosine(0.4 + 0.6 * (k as f32 * 0.414).fract(), 3.0 * k as f32);
        let (o, i) = (wo.as_dvec3(), wi.as_dvec3());
        let h = (o + i).normalize();
        let a2 = alpha * alpha;
        let d = a2 / (PI * (h.z * h.z * (a2 - 1.0) + 1.0).powi(2));
        let root = |z: f64| (z * z * (1.0 - a2) + a2).sqrt();
        let v = 0.5 / (i.z * root(o.z) + o.z * root(i.z));
        let weight = (1.0 - o.dot(h)).powi(5);
        let mirrored = f0 + (DVec3::splat(f90) - f0) * weight;
        let expected = base / PI * (1.0 - mirrored.max_element()) + mirrored * (d * v);
        let found = eval(&point, wo, wi).as_dvec3();
        assert!(
            ((found - expected) / expected).abs().max_element() < 1e-4,
            "{wo} {wi}: {found} {expected}"
        );
    }
}

/// KHR_materials_clearcoat: fresnel_coat of its appendix, over a base that is tested elsewhere.
#[test]
fn clearcoat_is_that_of_the_appendix() {
    let base = material(Vec3::new(0.5, 0.1, 0.2), 0.3, 0.4);
    let normal = DVec3::new(0.1, -0.2, 1.0).normalize();
    let alpha = 0.15f64;
    let coated = ShadingPoint {
        layers: Some(Layers {
            coat: 0.7,
            coat_alpha: alpha as f32,
            coat_normal: normal.as_vec3(),
            sheen: Vec3::ZERO,
            sheen_alpha: 1.0,
        }),
        ..base
    };
    for k in 0..200 {
        let wo = at_cosine(0.4 + 0.6 * (k as f32 * 0.618).fract(), k as f32);
        let wi = at_cosine(0.4 + 0.6 * (k as f32 * 0.414).fract(), 3.0 * k as f32);
        let (o, i) = (wo.as_dvec3(), wi.as_dvec3());
        let h = (o + i).normalize();
        let (nh, nl, nv) = (normal.dot(h), normal.dot(i), normal.dot(o));
        let a2 = alpha * alpha;
        let d = a2 / (PI * (nh * nh * (a2 - 1.0) + 1.0).powi(2));
        let v = 0.5 / (nl * (nv * nv * (1.0 - a2) + a2).sqrt() + nv * (nl * nl * (1.0 - a2) + a2).sqrt());
        let share = 0.7 * (0.04 + 0.96 * (1.0 - nv).powi(5));
        // Radiance: each lobe times the cosine with its own normal.
        let expected =
            eval(&base, wo, wi).as_dvec3() * i.z * (1.0 - share) + DVec3::splat(d * v * nl * share);
        let found = eval(&coated, wo, wi).as_dvec3() * i.z;
        assert!(
            ((found - expected) / expected).abs().max_element() < 1e-4,
            "{wo} {wi}: {found} {expected}"
        );
    }
}

/// KHR_materials_sheen: distribution, shadowing and albedo scaling of its appendix, in f64; the albedo by quadrature.
#[test]
fn sheen_is_that_of_the_appendix() {
    let (alpha, color) = (0.3f64, DVec3::new(0.2, 0.9, 0.4));
    let lambda = |cos: f64| {
        let t = (1.0 - alpha).powi(2);
        let mix = |x: f64, y: f64| x * (1.0 - t) + y * t;
        let l = |x: f64| {
            mix(21.5473, 25.3245) / (1.0 + mix(3.82987, 3.32435) * x.powf(mix(0.19823, 0.16801)))
                + mix(-1.97760, -1.27393) * x
                + mix(-4.32054, -4.85967)
        };
        if cos < 0.5 {
            l(cos).exp()
        } else {
            (2.0 * l(0.5) - l(1.0 - cos)).exp()
        }
    };
    let lobe = |o: DVec3, i: DVec3| {
        let h = (o + i).normalize();
        let d = (2.0 + 1.0 / alpha) * (1.0 - h.z * h.z).powf(0.5 / alpha) / TAU;
        d / ((1.0 + lambda(o.z) + lambda(i.z)) * 4.0 * o.z * i.z)
    };
    let base = material(Vec3::new(0.5, 0.1, 0.2), 0.0, 0.6);
    let cloth = ShadingPoint {
        layers: Some(Layers {
            coat: 0.0,
            coat_alpha: 1.0,
            coat_normal: Vec3::Z,
            sheen: color.as_vec3(),
            sheen_alpha: alpha as f32,
        }),
        ..base
    };
    for cos in [0.15f32, 0.4, 0.9] {
        let wo = at_cosine(cos, 0.2);
        let n = 400u32;
        let mut albedo = 0.0;
        for k in 0..n * n {
            let root = (f64::from(k) + 0.5) / f64::from(n * n);
            let wi = at_cosine(
                (root * root) as f32,
                (TAU * (f64::from(k) * 0.618_033_988_749_894_9).fract()) as f32,
            );
            let i = DVec3::new(f64::from(wi.x), f64::from(wi.y), root * root);
            albedo += lobe(wo.as_dvec3(), i) * i.z * 2.0 * root * TAU / f64::from(n * n);
        }
        for k in 0..50 {
            let wi = at_cosine(0.1 + 0.9 * (k as f32 * 0.414).fract(), 3.0 * k as f32);
            let scaling = 1.0 - color.max_element() * albedo;
            let expected =
                color * lobe(wo.as_dvec3(), wi.as_dvec3()) + eval(&base, wo, wi).as_dvec3() * scaling;
            let found = eval(&cloth, wo, wi).as_dvec3();
            // The table errs by some thousandths, and a margin of 5e-3 is held back.
            assert!(
                (found / expected - 1.0).abs().max_element() < 0.012,
                "{wo} {wi}: {found} {expected}"
            );
        }
    }
}

/// KHR_materials_anisotropy: D and V of its appendix, in f64.
#[test]
fn anisotropic_lobes_are_those_of_the_appendix() {
    let (at, ab) = (0.5f64, 0.1f64);
    let (t, b) = (DVec3::new(0.8, 0.6, 0.0), DVec3::new(-0.6, 0.8, 0.0));
    let metal = ShadingPoint {
        gloss: Gloss::GgxAnisotropic {
            alpha: [at as f32, ab as f32],
            tangent: t.as_vec3(),
        },
        ..material(Vec3::ONE, 1.0, ab as f32)
    };
    for k in 0..200 {
        let wo = at_cosine(0.2 + 0.8 * (k as f32 * 0.618).fract(), k as f32);
        let wi = at_cosine(0.2 + 0.8 * (k as f32 * 0.414).fract(), 3.0 * k as f32);
        let (v, l) = (wo.as_dvec3(), wi.as_dvec3());
        let h = (v + l).normalize();
        let a2 = at * ab;
        let f = DVec3::new(ab * t.dot(h), at * b.dot(h), a2 * h.z);
        let w2 = a2 / f.dot(f);
        let d = a2 * w2 * w2 / PI;
        let length = |w: DVec3| DVec3::new(at * t.dot(w), ab * b.dot(w), w.z).length();
        let expected = d * 0.5 / (l.z * length(v) + v.z * length(l));
        let found = f64::from(eval(&metal, wo, wi).x);
        assert!(
            (found / expected - 1.0).abs() < 1e-4,
            "{wo} {wi}: {found} {expected}"
        );
    }
}

proptest! {
    /// Finite and non-negative for any directions, grazing and below the horizon included; samples are where `pdf` says.
    #[test]
    fn nothing_is_nan_or_negative(
        z in prop::sample::select(vec![-1.0f32, 0.0, 1e-45, 1e-8, 2e-7, 1e-4, 0.3, 1.0]),
        w in prop::sample::select(vec![-1e-3f32, 0.0, 1e-20, 2e-7, 1e-6, 1e-3, 0.7, 1.0]),
        phi in prop::sample::select(vec![0f32, 1e-7, 1.0, 3.1]),
        which in 0usize..16,
        u in prop::array::uniform3(prop::sample::select(vec![0f32, 1e-8, 0.3, 0.5, 0.99999994])),
    ) {
        let points = extended();
        let (name, point) = &points[which.min(points.len() - 1)];
        let (wo, wi) = (at_cosine(z, 0.0), at_cosine(w, phi));
        for f in [eval(point, wo, wi), lobe_albedo(point, wo), diffuse_reflectance(point, z.max(0.0))] {
            prop_assert!(f.is_finite() && f.min_element() >= 0.0, "{name}: {f}");
        }
        let density = pdf(point, wo, wi);
        prop_assert!(density.is_finite() && density >= 0.0, "{name}: {density}");
        if let Some(s) = sample(point, wo, u) {
            prop_assert!(s.wi.is_normalized() && s.weight.is_finite() && s.weight.min_element() >= 0.0, "{name}: {s:?}");
            prop_assert!(s.pdf > 0.0 && s.pdf.is_finite() && s.wi.z > 0.0, "{name}: {s:?}");
        }
        if let Some((wi, weight)) = sample_lobe(point, wo, [u[0], u[1]]) {
            prop_assert!(wi.is_normalized() && weight.is_finite() && weight.min_element() >= 0.0, "{name}: {weight}");
        }
    }
}
