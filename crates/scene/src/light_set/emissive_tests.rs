//! Emissive surfaces against Lambert's formula for the irradiance from a polygon, which knows neither trees nor samples.

use super::*;
use crate::animated::Animated;
use crate::light::{LightKind, LightTrack};
use crate::material::{Material, Texture, TextureUse, Wrap};
use crate::scene::{Instance, Mesh, Scene};
use crate::sequence::Sequence;
use crate::texture::png;
use crate::traced::{Shading, TracedScene};
use glam::{Affine2, Affine3A, DVec3, Vec2, Vec3};
use std::f64::consts::PI;
use std::sync::Arc;

struct Triangles(Vec<EmissiveTriangle>);

impl Emitters for Triangles {
    fn emissive_triangles(&self) -> &[EmissiveTriangle] {
        &self.0
    }
    fn material_names(&self) -> Vec<String> {
        let materials = self.0.iter().map(|t| t.material + 1).max().unwrap_or(0);
        (0..materials).map(|i| i.to_string()).collect()
    }
    fn emitted(&self, primitive: u32, _: [f32; 2]) -> Vec3 {
        self.0[primitive as usize].mean_radiance
    }
}

fn triangle(primitive: usize, vertices: [Vec3; 3], radiance: f32, double_sided: bool) -> EmissiveTriangle {
    EmissiveTriangle {
        primitive: primitive as u32,
        vertices,
        mean_radiance: Vec3::splat(radiance),
        parts: None,
        material: 0,
        double_sided,
    }
}

fn glow() -> Vec<LightTrack> {
    vec![LightTrack {
        name: "glow".into(),
        kind: LightKind::Emissive {
            material: None,
            scale: Animated::Constant(Vec3::ONE),
        },
    }]
}

/// Evenly spread numbers in [0, 1): Roberts' R3 sequence.
fn spread(i: usize) -> [f32; 3] {
    [0.819_172_513_396, 0.671_043_606_704, 0.549_700_477_902]
        .map(|step: f64| ((i as f64 + 0.5) * step).fract() as f32)
}

fn between(i: usize) -> Vec3 {
    Vec3::from(spread(i)) * 2.0 - 1.0
}

/// ∫ of the direction over what a triangle covers of the sphere around `x`, times π its irradiance on a surface that it
/// is wholly above (Lambert 1760): half the sum of the sides' angles times the normals of their planes.
fn vector_irradiance(x: DVec3, vertices: [DVec3; 3]) -> DVec3 {
    let d = vertices.map(|v| (v - x).normalize());
    let side = |a: DVec3, b: DVec3| {
        let across = a.cross(b);
        across.normalize_or_zero() * across.length().atan2(a.dot(b))
    };
    0.5 * (side(d[0], d[1]) + side(d[1], d[2]) + side(d[2], d[0]))
}

fn irradiance_of(t: &EmissiveTriangle, x: Vec3, normal: Vec3) -> f64 {
    let v = t.vertices.map(|v| v.as_dvec3());
    // Towards its front the formula is negative.
    let facing = -vector_irradiance(x.as_dvec3(), v).dot(normal.as_dvec3());
    let faces = (v[1] - v[0]).cross(v[2] - v[0]).dot(x.as_dvec3() - v[0]) > 0.0;
    let sign = if faces { 1.0 } else { -1.0 };
    if faces || t.double_sided {
        f64::from(t.mean_radiance.x) * facing * sign
    } else {
        0.0
    }
}

fn at(position: Vec3, normal: Vec3) -> ReferencePoint {
    ReferencePoint { position, normal }
}

/// Mean and standard error of the irradiance by samples.
fn sampled(lights: &LightSet, from: ReferencePoint, samples: usize) -> (f64, f64) {
    let (mut sum, mut squares) = (0.0, 0.0);
    for i in 0..samples {
        if let Some(sample) = lights.sample(0, from, spread(i)) {
            let cos = f64::from(sample.direction.dot(from.normal)).max(0.0);
            let value = f64::from(sample.radiance_over_pdf.x) * cos;
            sum += value;
            squares += value * value;
        }
    }
    let (mean, n) = (sum / samples as f64, samples as f64);
    (mean, ((squares / n - mean * mean).max(0.0) / n).sqrt())
}

/// Triangles of sizes from `least` upwards all over the place, some on both sides, some dark.
fn clutter(count: usize, least: f32) -> Triangles {
    Triangles(
        (0..count)
            .map(|i| {
                let middle = between(3 * i) + Vec3::Y * 1.3;
                let size = least + 0.2 * spread(7 * i)[0].powi(4);
                // Of a lattice: by squares, or all three would lie on a line.
                let corner = |k: usize| middle + between(5 * i + 11 * k * k + 3 * i * k) * size;
                let radiance = if i % 5 == 0 {
                    0.0
                } else {
                    spread(13 * i)[1].powi(3) * 10.0
                };
                triangle(i, [corner(1), corner(2), corner(3)], radiance, i % 3 == 0)
            })
            .collect(),
    )
}

/// Truth: Lambert's formula, summed over all triangles. Four standard errors; evenly spread samples have less.
#[test]
fn the_tree_gives_the_irradiance_of_all_triangles() {
    for count in [1, 2, 3, 40, 2000] {
        let triangles = clutter(count + 1, 0.01);
        let tracks = glow();
        let lights = LightSet::new(&triangles, &tracks, 0.0).unwrap();
        for i in 0..6 {
            let x = between(i) * Vec3::new(1.0, 0.0, 1.0);
            let truth: f64 = triangles.0.iter().map(|t| irradiance_of(t, x, Vec3::Y)).sum();
            let (mean, error) = sampled(&lights, at(x, Vec3::Y), 20_000);
            let tolerance = 4.0 * error + 1e-4 * truth;
            assert!(
                (mean - truth).abs() <= tolerance,
                "{count}: {mean} {truth} ± {error}"
            );
            assert!(error <= 0.03 * truth, "{count}: {error} of {truth}");
        }
    }
}

/// A sample's density is what whoever meets that place is told. Truth of their integral over the sphere: the share of draws
/// that give a sample. By 400 places of each triangle, to 1 %.
#[test]
fn densities_are_those_of_the_samples_and_integrate_to_one() {
    let triangles = clutter(60, 0.1);
    let tracks = glow();
    let lights = LightSet::new(&triangles, &tracks, 0.0).unwrap();
    for from in [at(Vec3::ZERO, Vec3::Y), Vec3::new(0.2, 1.0, 0.1).into()] {
        // Its density there, and the solid angle of the triangle per share of its area.
        let met = |t: &EmissiveTriangle, [a, b]: [f32; 2]| -> (f64, f64) {
            let v = t.vertices.map(|v| v.as_dvec3());
            let (u, w) = (v[1] - v[0], v[2] - v[0]);
            let d = v[0] + u * f64::from(a) + w * f64::from(b) - from.position.as_dvec3();
            let cross = u.cross(w);
            let (distance, cos) = (d.length(), d.dot(cross) / d.length() / cross.length());
            if cos >= 0.0 && !t.double_sided {
                return (0.0, 0.0);
            }
            let met = MetEmitter {
                primitive: t.primitive,
                barycentric: [a, b],
                distance,
                cos,
            };
            let mut pdf = 0.0;
            lights.emitted(&met, Some(&from), |hit| pdf = f64::from(hit.pdf));
            (pdf, 0.5 * cross.length() * cos.abs() / (distance * distance))
        };
        let (n, mut given) = (10_000, 0);
        for i in 0..n {
            let Some(sample) = lights.sample(0, from, spread(i)) else {
                continue;
            };
            given += 1;
            let emitter = sample.emitter.unwrap();
            let (found, _) = met(&triangles.0[emitter.primitive as usize], emitter.barycentric);
            assert!(
                (found / f64::from(sample.pdf) - 1.0).abs() < 1e-3,
                "{found} {sample:?}"
            );
        }
        let mut integral = 0.0;
        for t in &triangles.0 {
            for i in 0..400 {
                let [a, b, _] = spread(i);
                let (a, b) = if a + b > 1.0 { (1.0 - a, 1.0 - b) } else { (a, b) };
                let (pdf, angle) = met(t, [a, b]);
                integral += pdf * angle / 400.0;
            }
        }
        let share = f64::from(given) / n as f64;
        assert!((integral / share - 1.0).abs() < 0.01, "{integral} {share}");
    }
}

/// Truth: Lambert's formula of the one triangle that faces the floor; all others face away, and none of them may be drawn.
#[test]
fn of_a_hundred_thousand_triangles_the_one_that_is_seen_is_drawn() {
    let mut all: Vec<EmissiveTriangle> = (0..100_000)
        .map(|i| {
            let [x, y, z] = spread(i);
            let corner = Vec3::new(x * 10.0, 2.0 + y, z * 10.0);
            // Up, away from the floor.
            triangle(
                i,
                [corner, corner + Vec3::Z * 0.1, corner + Vec3::X * 0.1],
                5.0,
                false,
            )
        })
        .collect();
    let corner = Vec3::new(4.0, 1.5, 4.0);
    all[77_777] = triangle(
        77_777,
        [corner, corner + Vec3::X * 0.1, corner + Vec3::Z * 0.1],
        5.0,
        false,
    );
    let triangles = Triangles(all);
    let tracks = glow();
    let lights = LightSet::new(&triangles, &tracks, 0.0).unwrap();
    for x in [Vec3::new(4.0, 0.0, 4.0), Vec3::new(1.0, 0.0, 8.0)] {
        let truth = irradiance_of(&triangles.0[77_777], x, Vec3::Y);
        for i in 0..16 {
            let sample = lights.sample(0, at(x, Vec3::Y), spread(i)).expect("it is drawn");
            let value = f64::from(sample.radiance_over_pdf.x * sample.direction.y);
            assert!((value / truth - 1.0).abs() < 0.2, "{value} {truth}");
        }
    }
    // From above all but one are seen, from behind the floor none.
    assert!(lights.sample(0, Vec3::new(5.0, 9.0, 5.0), [0.5; 3]).is_some());
    assert!(lights.sample(0, at(Vec3::ZERO, Vec3::NEG_Y), [0.5; 3]).is_none());
}

#[test]
fn what_is_dark_or_turns_its_back_is_never_drawn() {
    let vertices = [Vec3::Y, Vec3::Y + Vec3::X, Vec3::Y + Vec3::Z];
    for (radiance, double_sided, above, below) in [
        (0.0, true, false, false),
        (1.0, false, false, true),
        (1.0, true, true, true),
    ] {
        let triangles = Triangles(vec![triangle(0, vertices, radiance, double_sided)]);
        let tracks = glow();
        let lights = LightSet::new(&triangles, &tracks, 0.0).unwrap();
        for (y, expected) in [(5.0, above), (0.0, below)] {
            let drawn = lights.sample(0, Vec3::new(0.2, y, 0.2), [0.3; 3]);
            assert_eq!(drawn.is_some(), expected, "{radiance} {double_sided} {y}");
        }
    }
    let nothing = Triangles(Vec::new());
    let tracks = glow();
    let lights = LightSet::new(&nothing, &tracks, 0.0).unwrap();
    assert!(lights.sample(0, Vec3::ZERO, [0.5; 3]).is_none());
}

/// A material for each of a thousand triangles gives the very samples that one for all does. Truth for a light for each of
/// them: Lambert's formula of that triangle alone.
#[test]
fn a_thousand_materials_are_as_good_as_one() {
    let one = clutter(1000, 0.05);
    let mut own = clutter(1000, 0.05);
    (own.0.iter_mut().zip(0..)).for_each(|(t, i)| t.material = i);
    let tracks = glow();
    let from = at(Vec3::new(0.3, 0.0, -0.2), Vec3::Y);
    let of_one = LightSet::new(&one, &tracks, 0.0).unwrap();
    let of_own = LightSet::new(&own, &tracks, 0.0).unwrap();
    for i in 0..1000 {
        assert_eq!(
            of_one.sample(0, from, spread(i)),
            of_own.sample(0, from, spread(i))
        );
    }
    let each: Vec<LightTrack> = (0..1000)
        .map(|i| LightTrack {
            name: i.to_string(),
            kind: LightKind::Emissive {
                material: Some(i.to_string()),
                scale: Animated::Constant(Vec3::ONE),
            },
        })
        .collect();
    let lights = LightSet::new(&own, &each, 0.0).unwrap();
    for (light, t) in own.0.iter().enumerate() {
        let truth = irradiance_of(t, from.position, Vec3::Y);
        let samples = (0..64).filter_map(|i| lights.sample(light, from, spread(i)));
        let mean = samples
            .map(|s| f64::from(s.radiance_over_pdf.x * s.direction.y) / 64.0)
            .sum::<f64>();
        // The cosine differs over a triangle.
        assert!(
            (mean - truth).abs() <= 0.1 * truth + 1e-7,
            "{light}: {mean} {truth}"
        );
    }
}

/// Places that have no number for what they see of a triangle: in its plane, at a vertex, on a side, on itself and, by
/// rounding, behind itself, far and near. Nothing arrives there but from others.
#[test]
fn triangles_without_area_and_places_in_a_triangles_plane_give_nothing() {
    let (a, b, c) = (
        Vec3::new(3.0, 1.1, 3.3),
        Vec3::new(3.4, 1.2, 3.3),
        Vec3::new(3.1, 1.3, 3.9),
    );
    let all = vec![
        triangle(0, [a, b, c], 1e30, true),
        triangle(1, [a, a, c], 1e30, true),
        triangle(2, [b, b, b], 1e30, true),
        triangle(3, [a, a.lerp(c, 0.5), c], 0.0, true),
    ];
    let triangles = Triangles(all);
    let tracks = glow();
    let lights = LightSet::new(&triangles, &tracks, 0.0).unwrap();
    let normal = (b - a).cross(c - a).normalize();
    let places = [
        a,
        b,
        c,
        a.lerp(b, 0.3),
        (a + b + c) / 3.0,
        a.lerp(b, 0.4).lerp(c, 0.6),
        a + 5.0 * (a - b),
        c + 1e4 * (c - a),
    ];
    for place in places {
        for away in [-2.0, -1.0, 0.0, 1.0, 2.0] {
            let x = place + normal * (away * f32::EPSILON);
            for normal in [normal, -normal, Vec3::ZERO] {
                for i in 0..16 {
                    let sample = lights.sample(0, at(x, normal), spread(i));
                    assert_eq!(sample, None, "{x} {normal}");
                }
            }
        }
    }
    // And a finite share of what there is where there is something.
    let above = lights.sample(0, a + normal, [0.4; 3]).unwrap();
    assert!(above.radiance_over_pdf.is_finite() && above.pdf > 0.0);
}

/// Truth: scaling all lengths changes no irradiance; 10^±15 of them are far from what f32 squares hold.
#[test]
fn scenes_of_any_scale_are_sampled_alike() {
    let lit = |scale: f32| {
        let mut triangles = clutter(50, 0.01);
        (triangles.0.iter_mut()).for_each(|t| t.vertices = t.vertices.map(|v| v * scale));
        let tracks = glow();
        let lights = LightSet::new(&triangles, &tracks, 0.0).unwrap();
        sampled(&lights, at(Vec3::new(0.1, 0.0, 0.2) * scale, Vec3::Y), 1000).0
    };
    let one = lit(1.0);
    for scale in [2f32.powi(-50), 2f32.powi(50)] {
        assert!(
            (lit(scale) / one - 1.0).abs() < 1e-3,
            "{scale}: {} {one}",
            lit(scale)
        );
    }
}

/// A screen of two triangles from (−1, 2, −1) to (1, 2, 1), looking down, that emits 100 times its texture.
fn screen(width: u32, height: u32, pixels: &[[u8; 4]]) -> TracedScene {
    let corner = |x: f32, z: f32| Vec3::new(x, 2.0, z);
    let mesh = Mesh {
        positions: vec![
            corner(-1.0, -1.0),
            corner(1.0, -1.0),
            corner(1.0, 1.0),
            corner(-1.0, 1.0),
        ],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        uvs: vec![vec![Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y]],
        ..Mesh::default()
    };
    let usage = TextureUse {
        texture: 0,
        uv_set: 0,
        texture_from_mesh: Affine2::IDENTITY,
    };
    let material = Material {
        emission: Vec3::splat(100.0),
        emission_texture: Some(usage),
        ..Material::default()
    };
    let texture = Texture {
        name: String::new(),
        encoded: png(width, height, pixels),
        wrap: [Wrap::Clamp; 2],
        nearest: false,
    };
    let scene = Scene {
        meshes: vec![mesh],
        instances: vec![Instance {
            mesh: 0,
            world_from_mesh: Affine3A::IDENTITY,
        }],
        materials: vec![material],
        textures: vec![texture],
        cameras: Vec::new(),
        sequence: Sequence {
            frames: 1,
            fps: 24.0,
            camera: None,
            lights: Vec::new(),
        },
        object_names: Vec::new(),
        variants: Vec::new(),
        notes: Vec::new(),
        offset: Default::default(),
    };
    TracedScene::new(Arc::new(scene), Shading::Lambert).unwrap()
}

/// Truth: a sum over eight lookups a texel along both sides, 2,000 of a bilinear texel. One bright texel in 256 × 256,
/// a checkerboard, noise: a single sample tells the light of each to a factor, a thousand to 2 %.
#[test]
fn emission_is_drawn_by_its_texture() {
    let size = 256;
    let black = [0, 0, 0, 255];
    let one_texel = |i: usize| if i == 77 * size + 200 { [255; 4] } else { black };
    let windows = |i: usize| {
        if (i / size / 32 + i % size / 16).is_multiple_of(4) {
            [255; 4]
        } else {
            black
        }
    };
    let noise = |i: usize| [(i.wrapping_mul(2_654_435_769) >> 24) as u8; 3];
    let images: [(&str, Vec<[u8; 4]>, f64); 3] = [
        ("one texel", (0..size * size).map(one_texel).collect(), 16.0),
        ("windows", (0..size * size).map(windows).collect(), 6.0),
        (
            "noise",
            (0..size * size)
                .map(|i| [noise(i)[0], noise(i)[1], noise(i)[2], 255])
                .collect(),
            16.0,
        ),
    ];
    for (name, pixels, brightest) in images {
        let scene = screen(size as u32, size as u32, &pixels);
        let emitters = SceneEmitters::new(&scene);
        let parts: usize = (emitters.emissive_triangles().iter())
            .map(|t| t.parts.as_ref().map_or(0, Vec::len))
            .sum();
        assert!((1..=20_000).contains(&parts), "{name}: {parts} parts");
        let tracks = glow();
        let lights = LightSet::new(&emitters, &tracks, 0.0).unwrap();
        // Near by, the tree knows less well what is nearest.
        for (x, factor) in [(Vec3::new(0.3, 0.0, 0.1), 1.0), (Vec3::new(0.55, 1.9, -0.4), 5.0)] {
            let n = 8 * size;
            let mut truth = 0.0;
            for k in 0..n * n {
                let place = |k: usize| (k as f32 + 0.5) / n as f32;
                let (u, v) = (place(k % n), place(k / n));
                let texel = (
                    pixels[(v * size as f32) as usize * size + (u * size as f32) as usize][0],
                    u,
                    v,
                );
                if texel.0 == 0
                    && name == "one texel"
                    && ((u - 0.783).abs() > 0.01 || (v - 0.303).abs() > 0.01)
                {
                    continue;
                }
                let d = Vec3::new(2.0 * u - 1.0, 2.0, 2.0 * v - 1.0) - x;
                // The triangles' diagonal runs from (0, 0) to (1, 1): weights of vertices 1 and 2.
                let (primitive, weights) = if u > v { (0, [u - v, v]) } else { (1, [u, v - u]) };
                let radiance = f64::from(emitters.emitted(primitive, weights).x);
                let (squared, y) = (f64::from(d.length_squared()), f64::from(d.y));
                truth += radiance * (y * y) / (squared * squared) * 4.0 / (n * n) as f64;
            }
            let from = at(x, Vec3::Y);
            let (mean, _) = sampled(&lights, from, 4000);
            assert!((mean / truth - 1.0).abs() < 0.03, "{name}: {mean} {truth}");
            let most = (0..4000)
                .filter_map(|i| lights.sample(0, from, spread(i)))
                .map(|s| f64::from(s.radiance_over_pdf.x * s.direction.y))
                .fold(0.0, f64::max);
            assert!(
                most < factor * brightest * truth,
                "{name} does not sparkle: {most} {truth}"
            );
        }
    }
    let dark = screen(4, 4, &[black; 16]);
    let emitters = SceneEmitters::new(&dark);
    let tracks = glow();
    let lights = LightSet::new(&emitters, &tracks, 0.0).unwrap();
    assert!(lights.sample(0, Vec3::ZERO, [0.5; 3]).is_none());
}

/// Truth: Lambert's formula is the mean direction times the solid angle, so even samples over it must have that mean.
#[test]
fn a_spherical_triangle_is_sampled_evenly() {
    use super::spherical_triangle::SphericalTriangle;
    for vertices in [
        [DVec3::X, DVec3::Y, DVec3::Z],
        [
            DVec3::new(1.0, 0.1, 0.0),
            DVec3::new(1.0, 0.2, 0.05),
            DVec3::new(0.9, 0.1, 0.3),
        ],
        [
            DVec3::new(3.0, -0.01, -2.0),
            DVec3::new(-3.0, -0.01, -2.0),
            DVec3::new(0.0, -0.01, 5.0),
        ],
    ] {
        let triangle = SphericalTriangle::new(DVec3::ZERO, vertices).unwrap();
        let n = 256;
        let mut mean = DVec3::ZERO;
        for i in 0..n * n {
            let place = |k: usize| (k as f64 + 0.5) / f64::from(n as u32);
            mean += triangle.direction([place(i % n), place(i / n)]) / (n * n) as f64;
        }
        let truth = vector_irradiance(DVec3::ZERO, vertices) / triangle.solid_angle;
        let error = (mean - truth).length().min((mean + truth).length());
        assert!(error < 2e-3, "{mean} {truth}");
    }
    let octant = SphericalTriangle::new(DVec3::ZERO, [DVec3::X, DVec3::Y, DVec3::Z]).unwrap();
    assert!((octant.solid_angle - PI / 2.0).abs() < 1e-12);
}
