//! Statements about light that have closed forms, and sampling against its own stated density.

use super::*;
use crate::animated::Animated;
use crate::light::{EnvironmentMap, LightKind, LightTrack};
use glam::{DVec3, Vec3};
use std::f64::consts::PI;
use std::sync::Arc;

/// Stratified numbers for Monte Carlo sums: an n × n grid of cell centres, and the golden-ratio sequence as
/// the third.
fn stratified(n: usize) -> impl Iterator<Item = [f32; 3]> {
    (0..n * n).map(move |i| {
        let third = (i as f64 * 0.618_033_988_749_894_9).fract();
        [
            ((i % n) as f32 + 0.5) / n as f32,
            ((i / n) as f32 + 0.5) / n as f32,
            third as f32,
        ]
    })
}

fn constant<T>(value: T) -> Animated<T> {
    Animated::Constant(value)
}

fn track(kind: LightKind) -> Vec<LightTrack> {
    vec![LightTrack {
        name: "light".into(),
        kind,
    }]
}

/// Irradiance at `x` on a surface with `normal`, by 256² samples.
fn irradiance(emitters: &dyn Emitters, kind: LightKind, x: Vec3, normal: Vec3) -> Vec3 {
    let tracks = track(kind);
    let lights = LightSet::new(emitters, &tracks, 0.0).unwrap();
    let n = 256;
    let mut sum = DVec3::ZERO;
    for random in stratified(n) {
        if let Some(sample) = lights.sample(0, x, random) {
            assert!((sample.direction.length() - 1.0).abs() < 1e-5);
            sum += sample.radiance_over_pdf.as_dvec3() * f64::from(sample.direction.dot(normal).max(0.0));
        }
    }
    (sum / (n * n) as f64).as_vec3()
}

fn assert_close(found: f32, truth: f64, tolerance: f64) {
    let error = (f64::from(found) / truth - 1.0).abs();
    assert!(
        error < tolerance,
        "found {found}, truth {truth}, relative error {error}"
    );
}

fn rect(center: Vec3, edge_u: Vec3, edge_v: Vec3, radiance: f32) -> LightKind {
    LightKind::Rect {
        center: constant(center),
        edge_u: constant(edge_u),
        edge_v: constant(edge_v),
        radiance: constant(Vec3::splat(radiance)),
    }
}

fn sphere(center: Vec3, radius: f32, radiance: f32) -> LightKind {
    LightKind::Sphere {
        center: constant(center),
        radius: constant(radius),
        radiance: constant(Vec3::splat(radiance)),
    }
}

/// Truth: irradiance at a point from a parallel rectangle whose corner lies above it, sides a and b at height
/// c (Howell, *A Catalog of Radiation Heat Transfer Configuration Factors*, B-3):
/// F = (A/√(1+A²) atan(B/√(1+A²)) + B/√(1+B²) atan(A/√(1+B²))) / 2π with A = a/c, B = b/c; E = π L F.
#[test]
fn rect_light_has_the_form_factor_of_the_catalogue() {
    for scale in [1e-4, 1.0, 1e5] {
        for (a, b, c) in [
            (1.0f64, 2.0f64, 1.5f64),
            (0.3, 0.2, 4.0),
            (5.0, 3.0, 0.05),
            (0.01, 0.01, 10.0),
        ] {
            let (ra, rb) = (a / c, b / c);
            let term = |p: f64, q: f64| p / (1.0 + p * p).sqrt() * (q / (1.0 + p * p).sqrt()).atan();
            let truth = PI * 7.0 * (term(ra, rb) + term(rb, ra)) / (2.0 * PI);
            let s = scale as f32;
            // Emits downwards: u × v = X × Z = −Y.
            let light = rect(
                Vec3::new(a as f32 / 2.0, c as f32, b as f32 / 2.0) * s,
                Vec3::X * a as f32 * s,
                Vec3::Z * b as f32 * s,
                7.0,
            );
            // Midpoint rule on 256² cells of an analytic integrand; f32 in and out.
            assert_close(irradiance(&NoEmitters, light, Vec3::ZERO, Vec3::Y).x, truth, 1e-3);
        }
    }
}

/// A parallelogram with skewed edges is sampled by area; truth is the sum over a fine grid of its surface.
#[test]
fn skewed_rect_agrees_with_quadrature_over_its_area() {
    let (center, u, v) = (
        Vec3::new(0.3, 1.0, 0.1),
        Vec3::new(1.0, 0.2, 0.3),
        Vec3::new(0.5, 0.0, 1.0),
    );
    let (n, mut truth) = (512, 0.0f64);
    let cross = u.as_dvec3().cross(v.as_dvec3());
    for i in 0..n * n {
        let (a, b) = ((i % n) as f64 + 0.5, (i / n) as f64 + 0.5);
        let p = center.as_dvec3() + u.as_dvec3() * (a / n as f64 - 0.5) + v.as_dvec3() * (b / n as f64 - 0.5);
        truth += p.normalize().y * -p.normalize().dot(cross) / p.length_squared() / (n * n) as f64;
    }
    assert_close(
        irradiance(&NoEmitters, rect(center, u, v, 1.0), Vec3::ZERO, Vec3::Y).x,
        truth,
        1e-3,
    );
}

/// Truth: E = π L (r/d)² sin(height), for a sphere wholly above the horizon.
#[test]
fn sphere_light_gives_the_closed_form_irradiance() {
    for (center, radius) in [
        (Vec3::new(0.0, 2.0, 0.0), 0.5f32),
        (Vec3::new(3.0, 4.0, 0.0), 0.1),
        (Vec3::new(0.0, 1.0, 0.0), 0.999),
        (Vec3::new(0.0, 1e4, 1e4), 1e-3),
        (Vec3::new(0.0, 1e-4, 0.0), 1e-5),
    ] {
        let d = f64::from(center.length());
        let truth = PI * 3.0 * (f64::from(radius) / d).powi(2) * f64::from(center.y) / d;
        assert_close(
            irradiance(&NoEmitters, sphere(center, radius, 3.0), Vec3::ZERO, Vec3::Y).x,
            truth,
            1e-3,
        );
    }
}

#[test]
fn sphere_emits_nothing_inwards_and_rect_nothing_backwards() {
    let inside = track(sphere(Vec3::ZERO, 2.0, 1.0));
    assert!(
        LightSet::new(&NoEmitters, &inside, 0.0)
            .unwrap()
            .sample(0, Vec3::X, [0.5; 3])
            .is_none()
    );
    let panel = track(rect(Vec3::Y, Vec3::X, Vec3::Z, 1.0));
    let lights = LightSet::new(&NoEmitters, &panel, 0.0).unwrap();
    assert!(lights.sample(0, Vec3::new(0.0, 2.0, 0.0), [0.5; 3]).is_none());
    let mut seen = 0;
    lights.along(Vec3::new(0.0, 2.0, 0.0), Vec3::NEG_Y, f32::INFINITY, |_| {
        seen += 1
    });
    assert_eq!(seen, 0);
    lights.along(Vec3::ZERO, Vec3::Y, f32::INFINITY, |_| seen += 1);
    assert_eq!(seen, 1);
}

/// Truth: I cos θ / d², and KHR_lights_punctual's ramp at the middle of the cosine range:
/// a quarter.
#[test]
fn point_and_spot_follow_the_inverse_square_and_the_ramp() {
    let point = LightKind::Point {
        position: constant(Vec3::new(0.0, 2.0, 0.0)),
        intensity: constant(Vec3::splat(8.0)),
    };
    assert_close(irradiance(&NoEmitters, point, Vec3::ZERO, Vec3::Y).x, 2.0, 1e-6);
    let (inner, outer) = (20f32, 40f32);
    let spot = track(LightKind::Spot {
        position: constant(Vec3::ZERO),
        direction: constant(Vec3::NEG_Y * 3.0),
        inner_angle_deg: constant(inner),
        outer_angle_deg: constant(outer),
        intensity: constant(Vec3::ONE),
    });
    let lights = LightSet::new(&NoEmitters, &spot, 0.0).unwrap();
    let at = |cos: f32| {
        let x = Vec3::new((1.0 - cos * cos).sqrt(), -cos, 0.0) * 2.0;
        lights
            .sample(0, x, [0.5; 3])
            .map_or(0.0, |s| s.radiance_over_pdf.x * 4.0)
    };
    let (cos_inner, cos_outer) = (inner.to_radians().cos(), outer.to_radians().cos());
    assert!((at(1.0) - 1.0).abs() < 1e-5 && (at(cos_inner + 1e-3) - 1.0).abs() < 1e-5);
    assert!((at((cos_inner + cos_outer) / 2.0) - 0.25).abs() < 1e-4);
    assert_eq!(at(cos_outer - 1e-3), 0.0);
}

struct Triangles {
    triangles: Vec<EmissiveTriangle>,
}

impl Emitters for Triangles {
    fn emissive_triangles(&self) -> &[EmissiveTriangle] {
        &self.triangles
    }
    fn material_names(&self) -> Vec<String> {
        vec!["neon".into(), "lamp".into()]
    }
    fn emitted(&self, primitive: u32, _: [f32; 2]) -> Vec3 {
        self.triangles
            .iter()
            .find(|t| t.primitive == primitive)
            .unwrap()
            .mean_radiance
    }
}

/// Two triangles that form the rectangle of `rect(center, u, v)`.
fn quad(center: Vec3, u: Vec3, v: Vec3, radiance: f32) -> Triangles {
    let corner = |a: f32, b: f32| center + u * a + v * b;
    let triangle = |primitive, vertices| EmissiveTriangle {
        primitive,
        vertices,
        mean_radiance: Vec3::splat(radiance),
        parts: None,
        material: 0,
        double_sided: false,
    };
    Triangles {
        triangles: vec![
            triangle(5, [corner(-0.5, -0.5), corner(0.5, -0.5), corner(0.5, 0.5)]),
            triangle(9, [corner(-0.5, -0.5), corner(0.5, 0.5), corner(-0.5, 0.5)]),
        ],
    }
}

/// Truth: the rectangle light of the same shape, whose sampling has nothing in common with that of triangles.
#[test]
fn emissive_triangles_shine_as_the_rect_that_they_form() {
    let (center, u, v) = (Vec3::new(0.5, 1.0, 0.2), Vec3::X * 2.0, Vec3::Z);
    let triangles = quad(center, u, v, 3.0);
    let emissive = LightKind::Emissive {
        material: Some("neon".into()),
        scale: constant(Vec3::splat(2.0)),
    };
    let found = irradiance(&triangles, emissive, Vec3::ZERO, Vec3::Y).x;
    let truth = irradiance(&NoEmitters, rect(center, u, v, 6.0), Vec3::ZERO, Vec3::Y).x;
    assert_close(found, f64::from(truth), 3e-3);
}

#[test]
fn a_material_that_does_not_emit_is_refused_with_those_that_do() {
    let triangles = quad(Vec3::Y, Vec3::X, Vec3::Z, 1.0);
    let tracks = track(LightKind::Emissive {
        material: Some("lamp".into()),
        scale: constant(Vec3::ONE),
    });
    let error = LightSet::new(&triangles, &tracks, 0.0).err().unwrap().to_string();
    assert!(error.contains("\"lamp\"") && error.contains("neon"), "{error}");
}

fn gradient_map() -> Arc<EnvironmentMap> {
    let (width, height) = (32, 16);
    let pixels = (0..width * height)
        .map(|i| Vec3::splat(1.0 + (i % 7) as f32 + (i / width) as f32))
        .collect();
    Arc::new(EnvironmentMap {
        width,
        height,
        pixels,
    })
}

/// What is sampled must be what a ray in that direction finds: same radiance, same density. Tolerance: f32
/// directions.
#[test]
fn samples_and_rays_agree_on_radiance_and_density() {
    let kinds = [
        rect(Vec3::new(0.2, 1.0, 0.3), Vec3::X, Vec3::Z * 2.0, 5.0),
        rect(
            Vec3::new(0.2, 1.0, 0.3),
            Vec3::new(1.0, 0.0, 0.5),
            Vec3::Z * 2.0,
            5.0,
        ),
        sphere(Vec3::new(1.0, 2.0, 0.0), 0.4, 5.0),
        LightKind::Environment {
            maps: gradient_map().into(),
            file: String::new().into(),
            scale: constant(Vec3::ONE),
            rotation_deg: constant(70.0),
        },
        LightKind::SunSky {
            turbidity: constant(3.0),
            sun_direction: constant(Vec3::new(1.0, 0.7, 0.2)),
            scale: constant(Vec3::ONE),
        },
    ];
    for kind in kinds {
        let tracks = track(kind);
        let lights = LightSet::new(&NoEmitters, &tracks, 0.0).unwrap();
        let (mut all, mut agreeing) = (0, 0);
        for random in stratified(32) {
            let Some(sample) = lights.sample(0, Vec3::ZERO, random) else {
                continue;
            };
            all += 1;
            lights.along(Vec3::ZERO, sample.direction, f32::INFINITY, |hit| {
                let radiance = sample.radiance_over_pdf * sample.pdf;
                let same_pdf = (hit.pdf / sample.pdf - 1.0).abs() < 1e-2;
                agreeing +=
                    i32::from(same_pdf && (radiance - hit.radiance).length() < 1e-2 * radiance.length());
            });
        }
        // Samples at the very rim may fall off it in f32, and next to it the sun's density jumps.
        assert!(all > 1000 && agreeing >= all * 99 / 100, "{agreeing} of {all}");
    }
}

/// Truth: a light turned by +90° about +Y brings what was at +Z to +X (counter-clockwise
/// seen from above).
#[test]
fn rotation_turns_the_map_counter_clockwise_seen_from_above() {
    let (width, height) = (64, 32);
    let mut pixels = vec![Vec3::ZERO; width * height];
    pixels[16 * width + 32] = Vec3::ONE;
    let map = Arc::new(EnvironmentMap {
        width,
        height,
        pixels,
    });
    for (degrees, towards) in [
        (0.0, Vec3::Z),
        (90.0, Vec3::X),
        (180.0, Vec3::NEG_Z),
        (-90.0, Vec3::NEG_X),
    ] {
        let tracks = track(LightKind::Environment {
            maps: map.clone().into(),
            file: String::new().into(),
            scale: constant(Vec3::ONE),
            rotation_deg: constant(degrees),
        });
        let lights = LightSet::new(&NoEmitters, &tracks, 0.0).unwrap();
        let sample = lights.sample(0, Vec3::ZERO, [0.5; 3]).unwrap();
        assert!(
            sample.direction.dot(towards) > 0.98,
            "{degrees}: {}",
            sample.direction
        );
        let mut seen = 0.0;
        lights.along(Vec3::ZERO, towards, f32::INFINITY, |hit| seen += hit.radiance.x);
        assert!(seen > 0.2, "{degrees}: {seen}");
    }
}

/// Truth: transport is linear: 2^k times the intensity gives exactly 2^k times the sample.
#[test]
fn intensities_of_forty_decades_stay_finite_and_in_proportion() {
    for exponent in [-66, -20, 0, 20, 66] {
        let factor = 2f32.powi(exponent);
        for make in [
            |s: f32| LightKind::Point {
                position: constant(Vec3::Y),
                intensity: constant(Vec3::splat(s)),
            },
            |s: f32| rect(Vec3::Y, Vec3::X, Vec3::Z, s),
            |s: f32| sphere(Vec3::Y, 0.1, s),
            |s: f32| LightKind::Environment {
                maps: gradient_map().into(),
                file: String::new().into(),
                scale: constant(Vec3::splat(s)),
                rotation_deg: constant(0.0),
            },
        ] {
            let (base, scaled) = (track(make(1.0)), track(make(factor)));
            let base = LightSet::new(&NoEmitters, &base, 0.0).unwrap();
            let scaled = LightSet::new(&NoEmitters, &scaled, 0.0).unwrap();
            let a = base.sample(0, Vec3::ZERO, [0.3, 0.6, 0.1]).unwrap();
            let b = scaled.sample(0, Vec3::ZERO, [0.3, 0.6, 0.1]).unwrap();
            assert_eq!(a.radiance_over_pdf * factor, b.radiance_over_pdf);
            assert_eq!((a.direction, a.pdf), (b.direction, b.pdf));
            assert!(scaled.importance(0, Vec3::ZERO).is_finite() && scaled.power(0, 1.0).is_finite());
        }
    }
}

/// Truth: power is the integral of irradiance over a sphere around the light, W.
#[test]
fn power_is_what_a_surrounding_sphere_receives() {
    let kinds = [
        rect(Vec3::ZERO, Vec3::X * 0.1, Vec3::Y * 0.2, 3.0),
        sphere(Vec3::ZERO, 0.05, 3.0),
        LightKind::Spot {
            position: constant(Vec3::ZERO),
            direction: constant(Vec3::X),
            inner_angle_deg: constant(30.0),
            outer_angle_deg: constant(60.0),
            intensity: constant(Vec3::ONE),
        },
    ];
    for kind in kinds {
        let tracks = track(kind);
        let lights = LightSet::new(&NoEmitters, &tracks, 0.0).unwrap();
        let (n, mut sum, radius) = (256, 0.0f64, 10.0f32);
        for [a, b, _] in stratified(n) {
            let (y, phi) = (1.0 - 2.0 * a, b * std::f32::consts::TAU);
            let d = Vec3::new(
                (1.0 - y * y).sqrt() * phi.cos(),
                y,
                (1.0 - y * y).sqrt() * phi.sin(),
            );
            if let Some(sample) = lights.sample(0, d * radius, [0.5; 3]) {
                sum += f64::from(sample.radiance_over_pdf.x * -sample.direction.dot(d));
            }
        }
        let truth = sum / (n * n) as f64 * 4.0 * PI * f64::from(radius * radius);
        assert_close(lights.power(0, 1.0).x, truth, 1e-2);
    }
}
