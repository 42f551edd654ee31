//! Statements about lightcuts and reconstruction cuts. Truth is every point light with a shadow ray of its own.

use super::lit::Receiver;
use super::*;
use crate::direct::reflected;
use crate::layers::RenderSize;
use crate::many_lights::PointSettings;
use crate::path;
use crate::test_images::*;
use crate::test_scenes::*;
use glam::{DVec3, Vec2};
use relight_scene::camera::Camera;
use relight_scene::image::metrics;
use relight_scene::light::{LightKind, LightTrack};
use relight_scene::material::Material;
use relight_scene::traced::Shading;
use relight_transport::random::Stream;

const SIZE: RenderSize = RenderSize {
    width: 24,
    height: 20,
};

/// A room of 4 m with a matt and a glossy box in it.
fn furnished() -> TracedScene {
    let material = |color: Vec3, metallic: f32, roughness: f32| Material {
        base_color: color.extend(1.0),
        metallic,
        roughness,
        ..Material::default()
    };
    let materials = vec![
        material(Vec3::new(0.7, 0.6, 0.5), 0.0, 1.0),
        material(Vec3::new(0.2, 0.4, 0.8), 0.0, 0.4),
        material(Vec3::new(0.9, 0.8, 0.5), 1.0, 0.3),
    ];
    let meshes = vec![
        cuboid(Vec3::splat(-2.0), Vec3::splat(2.0), true, 0),
        cuboid(Vec3::new(-1.2, -2.0, -1.0), Vec3::new(-0.3, -0.6, 0.0), false, 1),
        cuboid(Vec3::new(0.4, -2.0, -0.8), Vec3::new(1.2, -1.2, 0.2), false, 2),
    ];
    traced_with(meshes, materials, Shading::Full)
}

fn eye() -> Camera {
    let (position, look_at) = (Vec3::new(0.3, 0.2, 1.9), Vec3::new(0.0, -0.8, -1.0));
    Camera::looking(
        position,
        (look_at - position).normalize(),
        Vec3::Y,
        37.5f32.to_radians().tan(),
    )
}

/// Lamps of every type.
fn lamps() -> Vec<LightTrack> {
    let panel = |name: &str, x: f32, radiance: Vec3| {
        let edges = [Vec3::X * 0.8, Vec3::Z * 0.8];
        rect(name, Vec3::new(x, 1.95, 0.0), edges, radiance)
    };
    let spot = LightKind::Spot {
        position: constant(Vec3::new(1.5, 1.5, 1.5)),
        direction: constant(Vec3::new(-1.0, -1.2, -1.0)),
        inner_angle_deg: constant(15.0),
        outer_angle_deg: constant(30.0),
        intensity: constant(Vec3::splat(3.0)),
    };
    vec![
        panel("left", -1.2, Vec3::new(3.0, 2.0, 1.0)),
        panel("right", 1.2, Vec3::new(1.0, 2.0, 3.0)),
        ball(Vec3::new(-1.4, -1.5, 1.2), 0.2, Vec3::splat(2.0)),
        light("spot", spot),
        measured(Vec3::new(-0.5, 1.4, 0.3), 1.5),
    ]
}

struct Run {
    scene: TracedScene,
    tracks: Vec<LightTrack>,
    points: PointSettings,
    settings: LightcutSettings,
    size: RenderSize,
    spp: u32,
    light_layers: bool,
}

impl Run {
    fn new(tracks: Vec<LightTrack>, area_samples: u32, vpls: u32) -> Run {
        Run {
            scene: furnished(),
            tracks,
            points: PointSettings {
                area_samples: Some(area_samples),
                vpls,
                ..PointSettings::default()
            },
            settings: LightcutSettings::default(),
            size: SIZE,
            spp: 1,
            light_layers: false,
        }
    }

    fn with<T>(&self, run: impl FnOnce(&Picture<'_>, &PointLights, &LightClusters) -> T) -> T {
        pictured(&self.scene, &self.tracks, &eye(), self.spp, |picture| {
            let picture = Picture {
                size: self.size,
                light_layers: self.light_layers,
                ..picture
            };
            let points = PointLights::new(&self.scene, picture.lights, &self.points);
            let clusters = trees(&self.scene, &points, None, self.light_layers, 0);
            run(&picture, &points, &clusters)
        })
    }

    fn cuts(&self) -> (Layers, LightcutStats) {
        self.with(|picture, points, clusters| render(picture, points, clusters, &self.settings).unwrap())
    }

    fn reconstructed(&self, eye_rays: EyeRays) -> (Layers, ReconstructionStats) {
        self.with(|picture, points, clusters| {
            render_reconstructed(picture, points, clusters, &self.settings, eye_rays).unwrap()
        })
    }

    fn all(&self) -> Layers {
        self.with(|picture, _, _| by_points(picture, &self.points))
    }
}

fn pixels(layers: &Layers, name: &str) -> Vec<Vec3> {
    data(layers, name).chunks_exact(3).map(Vec3::from_slice).collect()
}

/// Largest difference of two layers, relative to the first one's pixel.
fn difference(a: &Layers, b: &Layers, name: &str) -> f32 {
    (pixels(a, name).iter().zip(pixels(b, name)))
        .map(|(&a, b)| (a - b).abs().max_element() / a.max_element().max(f32::MIN_POSITIVE))
        .fold(0.0, f32::max)
}

/// Truth: every light, clamped in the same way. Beside a ball, whose rays end before its points, nothing is hidden for
/// sure; without it the room's boxes hide much.
#[test]
fn without_any_error_a_lightcut_is_every_light() {
    let without_ball = || lamps().into_iter().filter(|lamp| lamp.name != "globe").collect();
    for (vpls, tracks) in [
        (0, lamps()),
        (700, lamps()),
        (0, without_ball()),
        (700, without_ball()),
    ] {
        let mut run = Run::new(tracks, 500, vpls);
        run.settings.error_ratio = 0.0;
        run.settings.max_nodes = usize::MAX;
        let (cuts, stats) = run.cuts();
        let all = run.all();
        for layer in ["beauty", "emission", "direct", "indirect"] {
            let off = difference(&all, &cuts, layer);
            assert!(off < 1e-5, "{vpls} virtual lights, {layer}: {off}");
        }
        assert!(stats.nodes > 0 && pixels(&all, "indirect").iter().any(|p| *p != Vec3::ZERO) == (vpls > 0));
    }
}

/// Truth: every light. Of area lights 99 % of the pixels are within 2 %; of virtual lights, whose shadows have no
/// common edges, fewer are (docs/notebook/lightcuts.md), but the mean is right.
#[test]
fn at_two_percent_nearly_all_pixels_are_within_two_percent() {
    for vpls in [0, 2000] {
        let mut run = Run::new(lamps(), 4000, vpls);
        run.settings.max_nodes = usize::MAX;
        let (cuts, stats) = run.cuts();
        let all = run.all();
        let (a, b) = (pixels(&cuts, "beauty"), pixels(&all, "beauty"));
        let within = (a.iter().zip(&b))
            .filter(|(a, b)| (a.max_element() - b.max_element()).abs() <= 0.02 * b.max_element())
            .count();
        if vpls == 0 {
            assert!(within * 100 >= a.len() * 99, "{within} of {}", a.len());
        }
        let sum = |p: &[Vec3]| p.iter().map(|p| f64::from(p.element_sum())).sum::<f64>();
        let mean = sum(&a) / sum(&b) - 1.0;
        assert!(mean.abs() < 0.003, "{mean}");
        // Far fewer nodes than lights, or it would be no lightcut.
        assert!(
            stats.nodes < stats.cuts * 400,
            "{} nodes per cut",
            stats.nodes / stats.cuts
        );
    }
}

#[test]
fn layers_of_lights_add_up_and_threads_change_nothing() {
    let mut run = Run::new(lamps(), 300, 300);
    run.light_layers = true;
    let (layers, _) = run.cuts();
    let beauty = pixels(&layers, "beauty");
    let mut sum = vec![Vec3::ZERO; beauty.len()];
    for track in &run.tracks {
        for (sum, light) in sum
            .iter_mut()
            .zip(pixels(&layers, &format!("light.{}", track.name)))
        {
            *sum += light;
        }
    }
    for (sum, beauty) in sum.iter().zip(&beauty) {
        assert!((*sum - *beauty).abs().max_element() <= 1e-5 * beauty.max_element());
    }
    let eye_rays = EyeRays { least: 3, most: 12 };
    same_on_any_threads(|| (run.cuts().0, run.reconstructed(eye_rays).0));
}

/// Truth: every light, where f32 can hold it; all pixels must be finite.
#[test]
fn degenerate_lights_give_finite_images() {
    let point = |x: f32, intensity: f32| bulb(Vec3::new(x, 0.5, 0.3), intensity);
    let many = |n: usize, intensity: &dyn Fn(usize) -> f32, spread: f32| -> Vec<LightTrack> {
        (0..n).map(|i| point(spread * i as f32, intensity(i))).collect()
    };
    let cases = [
        vec![],
        many(1, &|_| 1.0, 0.0),
        many(40, &|_| 1.0, 0.0),
        many(40, &|_| 0.0, 0.01),
        many(40, &|i| if i % 2 == 0 { 1e-20 } else { 1e20 }, 0.01),
        many(40, &|_| 1e-20, 0.01),
        // Inside a wall and outside of the room.
        many(10, &|_| 1.0, 2.0),
    ];
    for (case, tracks) in cases.into_iter().enumerate() {
        let mut run = Run::new(tracks, 0, 0);
        for size in [SIZE, RenderSize { width: 1, height: 1 }] {
            run.size = size;
            let (cuts, _) = run.cuts();
            let (reconstructed, _) = run.reconstructed(EyeRays::default());
            let all = run.all();
            for layers in [&cuts, &reconstructed] {
                let valid = |v: &f32| v.is_finite() && *v >= 0.0;
                assert!(data(layers, "beauty").iter().all(valid));
            }
            let [a, b] = [&cuts, &all].map(|l| pixels(l, "beauty").iter().map(|p| p.x as f64).sum::<f64>());
            assert!((a - b).abs() <= 0.03 * b, "case {case}: {a} {b}");
        }
    }
}

/// Truth: lightcuts with the same eye rays; the bound is the issue's.
#[test]
fn reconstruction_cuts_are_lightcuts_but_for_little() {
    let mut run = Run::new(lamps(), 1000, 500);
    run.size = RenderSize {
        width: 96,
        height: 80,
    };
    run.spp = 4;
    let (cuts, _) = run.cuts();
    let (reconstructed, stats) = run.reconstructed(EyeRays { least: 4, most: 4 });
    let [a, b] = [&reconstructed, &cuts].map(|l| l.rgb("beauty").unwrap());
    let error = metrics::relmse(&a, &b).unwrap();
    assert!(error < 0.002, "{error}");
    // Few samples, or nothing would be gained.
    assert!(stats.samples * 2 < stats.eye_rays, "{stats:?}");
}

/// Truth: path tracing to the second bounce, which at a mirror is the light that falls on what it shows.
#[test]
fn a_mirror_shows_the_light_on_what_it_reflects() {
    let mut run = Run::new(lamps(), 400, 0);
    let mirror = Material {
        base_color: Vec3::new(0.9, 0.8, 0.7).extend(1.0),
        metallic: 1.0,
        roughness: 0.0,
        ..Material::default()
    };
    let mut materials = run.scene.materials().to_vec();
    // The two boxes.
    materials[1] = mirror.clone();
    materials[2] = mirror;
    run.scene.set_materials(materials).unwrap();
    run.spp = 16;
    let (cuts, _) = run.cuts();
    let traced = run.with(|picture, _, _| {
        let spp = Some(256);
        path::render(&Picture { spp, ..*picture }, Some(2)).unwrap()
    });
    let (found, truth) = (pixels(&cuts, "indirect"), pixels(&traced, "indirect"));
    let covered = pixels(&cuts, "direct");
    // Pixels that are all mirror: nothing matt gives them direct light.
    let whole: Vec<usize> = (0..found.len())
        .filter(|&i| found[i] != Vec3::ZERO && covered[i] == Vec3::ZERO)
        .collect();
    assert!(whole.len() > 20, "{}", whole.len());
    let sum = |p: &[Vec3]| whole.iter().map(|&i| p[i].as_dvec3()).sum::<DVec3>();
    let off = (sum(&found) / sum(&truth) - 1.0).abs().max_element();
    assert!(off < 0.03, "{off}");
}

/// Truth: lightcuts with many eye rays.
#[test]
fn more_eye_rays_go_where_pixels_need_them() {
    let mut run = Run::new(lamps(), 200, 0);
    run.size = RenderSize {
        width: 48,
        height: 40,
    };
    run.spp = 64;
    let (truth, _) = run.cuts();
    let pixels = (run.size.width * run.size.height) as u64;
    let reconstructed = |most| {
        let (layers, stats) = run.reconstructed(EyeRays { least: 5, most });
        let [a, b] = [&layers, &truth].map(|l| l.rgb("beauty").unwrap());
        (metrics::relmse(&a, &b).unwrap(), stats.eye_rays)
    };
    let (few, fixed) = reconstructed(5);
    let (adaptive, rays) = reconstructed(50);
    assert_eq!(fixed, 5 * pixels);
    assert!(
        rays > 6 * pixels && rays < 40 * pixels,
        "{} per pixel",
        rays / pixels
    );
    assert!(adaptive < 0.5 * few, "{adaptive} {few}");
}

/// Truth: all lights of the clusters, one by one; random clusters at the pixels' middles, of any depth.
#[test]
fn bounds_hold_and_are_met_by_half_where_they_are_used() {
    let run = Run::new(lamps(), 2000, 1000);
    run.with(|picture, points, clusters| {
        // True largest value over bound.
        let mut shares = Vec::new();
        let (mut members, mut stack) = (Vec::new(), Vec::new());
        for pixel in 0..SIZE.width * SIZE.height {
            let place = Vec2::new((pixel % SIZE.width) as f32, (pixel / SIZE.width) as f32) + 0.5;
            let ray = picture.ray_through(place);
            let Some(hit) = run.scene.closest_hit(&ray) else {
                continue;
            };
            let wo = -ray.direction;
            let point = run.scene.shading_point(&hit).facing(wo);
            let receiver = Receiver::new(&hit, &point, wo);
            for k in 0..64 {
                let mut random = Stream::new(pixel as u64, 0, k);
                let root = (random.uniform() * clusters.roots.len() as f32) as usize;
                let mut node = clusters.roots[root].node;
                for _ in 0..(random.uniform() * 20.0) as u32 {
                    let Some(children) = clusters.children(node) else {
                        break;
                    };
                    node = children[usize::from(random.uniform() < 0.5)];
                }
                members.clear();
                stack.push(node);
                while let Some(at) = stack.pop() {
                    match clusters.children(at) {
                        Some(children) => stack.extend(children),
                        None => members.push(clusters.nodes[at as usize].representative),
                    }
                }
                let intensity = clusters.nodes[node as usize].intensity;
                let most = (members.iter())
                    .filter_map(|&i| points.arrival(i as usize, hit.position))
                    .map(|a| (reflected(&point, wo, a.direction) * a.factor * intensity).max_element())
                    .fold(0.0, f32::max);
                let bound = receiver.node_bound(clusters, node);
                assert!(most <= bound, "{most} {bound}");
                // Infinite within a cluster's box.
                if members.len() > 1 && most > 0.0 && bound < f32::INFINITY {
                    shares.push(most / bound);
                }
            }
        }
        shares.sort_by(f32::total_cmp);
        assert!(shares.len() > 5000, "{}", shares.len());
        assert!(shares[shares.len() / 2] > 0.5, "{}", shares[shares.len() / 2]);
    });
}
