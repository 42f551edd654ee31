//! Statements about lightcuts and reconstruction cuts. Truth is every point light with a shadow ray of its own.

#[path = "../examples/lightcuts/tightness.rs"]
#[allow(dead_code, reason = "the example also prints it")]
mod tightness;

use glam::{Affine3A, DVec3, Vec3};
use relight_render::brute::{self, PointsSettings};
use relight_render::layers::RenderSize;
use relight_render::lightcuts::{self, EyeRays, LightcutSettings, LightcutStats, ReconstructionStats};
use relight_render::many_lights::{PointLights, PointSettings};
use relight_render::path::{self, PathSettings};
use relight_render::watch::Watch;
use relight_scene::animated::Animated;
use relight_scene::camera::{Camera, CameraTrack};
use relight_scene::image::{Layers, metrics};
use relight_scene::light::{LightKind, LightTrack};
use relight_scene::light_set::{LightSet, SceneEmitters};
use relight_scene::material::Material;
use relight_scene::scene::{Instance, Mesh, Scene};
use relight_scene::sequence::Sequence;
use relight_scene::traced::{Shading, TracedScene};
use std::sync::Arc;

const SIZE: RenderSize = RenderSize {
    width: 24,
    height: 20,
};

fn constant<T>(value: T) -> Animated<T> {
    Animated::Constant(value)
}

/// An axis-aligned box, fronts outwards or inwards.
fn cuboid(low: Vec3, high: Vec3, inwards: bool, material: u32) -> Mesh {
    let positions: Vec<Vec3> = (0..8)
        .map(|i| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32))
        .map(|p| low + (high - low) * p)
        .collect();
    let middle = (low + high) * 0.5;
    let mut triangles = Vec::new();
    for [a, b, c, d] in [
        [0, 1, 3, 2],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 3, 7, 6],
        [0, 2, 6, 4],
        [1, 3, 7, 5],
    ] {
        for [i, j, k] in [[a, b, c], [a, c, d]] {
            let [p, q, r] = [i, j, k].map(|v: u32| positions[v as usize]);
            let outwards = (q - p).cross(r - p).dot(p + q + r - middle * 3.0) > 0.0;
            triangles.push(if outwards != inwards { [i, j, k] } else { [i, k, j] });
        }
    }
    Mesh {
        positions,
        triangles,
        material,
        ..Mesh::default()
    }
}

/// A room of 4 m with a matt and a glossy box in it.
fn room() -> TracedScene {
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
    let instances = (0..meshes.len() as u32)
        .map(|mesh| Instance {
            mesh,
            world_from_mesh: Affine3A::IDENTITY,
        })
        .collect();
    let scene = Scene {
        meshes,
        instances,
        materials,
        textures: Vec::new(),
        cameras: Vec::new(),
        sequence: Sequence {
            frames: 1,
            fps: 24.0,
            camera: None,
            lights: Vec::new(),
        },
        notes: Vec::new(),
    };
    TracedScene::new(Arc::new(scene), Shading::Full).unwrap()
}

fn camera() -> Camera {
    CameraTrack {
        name: String::new(),
        position: constant(Vec3::new(0.3, 0.2, 1.9)),
        look_at: constant(Vec3::new(0.0, -0.8, -1.0)),
        up: constant(Vec3::Y),
        vfov_deg: constant(75.0),
        aspect: None,
    }
    .at(0.0)
}

fn light(name: &str, kind: LightKind) -> LightTrack {
    LightTrack {
        name: name.into(),
        kind,
    }
}

/// Lamps of every type.
fn lamps() -> Vec<LightTrack> {
    let rect = |x: f32, radiance: Vec3| LightKind::Rect {
        center: constant(Vec3::new(x, 1.95, 0.0)),
        edge_u: constant(Vec3::new(0.8, 0.0, 0.0)),
        edge_v: constant(Vec3::new(0.0, 0.0, 0.8)),
        radiance: constant(radiance),
    };
    vec![
        light("left", rect(-1.2, Vec3::new(3.0, 2.0, 1.0))),
        light("right", rect(1.2, Vec3::new(1.0, 2.0, 3.0))),
        light(
            "ball",
            LightKind::Sphere {
                center: constant(Vec3::new(-1.4, -1.5, 1.2)),
                radius: constant(0.2),
                radiance: constant(Vec3::splat(2.0)),
            },
        ),
        light(
            "spot",
            LightKind::Spot {
                position: constant(Vec3::new(1.5, 1.5, 1.5)),
                direction: constant(Vec3::new(-1.0, -1.2, -1.0)),
                inner_angle_deg: constant(15.0),
                outer_angle_deg: constant(30.0),
                intensity: constant(Vec3::splat(3.0)),
            },
        ),
    ]
}

struct Run {
    scene: TracedScene,
    tracks: Vec<LightTrack>,
    points: PointSettings,
    settings: LightcutSettings,
    size: RenderSize,
}

impl Run {
    fn new(tracks: Vec<LightTrack>, area_samples: u32, vpls: u32) -> Run {
        Run {
            scene: room(),
            tracks,
            points: PointSettings {
                area_samples: Some(area_samples),
                vpls,
                ..PointSettings::default()
            },
            settings: LightcutSettings {
                spp: 1,
                ..LightcutSettings::default()
            },
            size: SIZE,
        }
    }

    fn with<T>(&self, run: impl FnOnce(&LightSet<'_>, &PointLights, &dyn Watch) -> T) -> T {
        let emitters = SceneEmitters::new(&self.scene);
        let lights = LightSet::new(&emitters, &self.tracks, 0.0).unwrap();
        let points = PointLights::new(&self.scene, &lights, &self.points);
        run(&lights, &points, &())
    }

    fn cuts(&self) -> (Layers, LightcutStats) {
        self.with(|lights, points, watch| {
            let clusters = lightcuts::trees(&self.scene, points, self.settings.light_layers, 0);
            lightcuts::render(
                &self.scene,
                lights,
                points,
                &clusters,
                &camera(),
                self.size,
                &self.settings,
                watch,
            )
            .unwrap()
        })
    }

    fn reconstructed(&self, eye_rays: EyeRays) -> (Layers, ReconstructionStats) {
        self.with(|lights, points, watch| {
            let clusters = lightcuts::trees(&self.scene, points, self.settings.light_layers, 0);
            lightcuts::render_reconstructed(
                &self.scene,
                lights,
                points,
                &clusters,
                &camera(),
                self.size,
                &self.settings,
                eye_rays,
                watch,
            )
            .unwrap()
        })
    }

    fn all(&self) -> Layers {
        self.with(|lights, points, watch| {
            let settings = PointsSettings {
                spp: self.settings.spp,
                seed: self.settings.seed,
                light_layers: self.settings.light_layers,
                packets: true,
            };
            brute::render_points(
                &self.scene,
                lights,
                points,
                &camera(),
                self.size,
                &settings,
                watch,
            )
            .unwrap()
            .0
        })
    }
}

fn pixels(layers: &Layers, name: &str) -> Vec<Vec3> {
    layers
        .rgb(name)
        .unwrap()
        .pixels
        .iter()
        .map(|&p| Vec3::from(p))
        .collect()
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
    let without_ball = || lamps().into_iter().filter(|lamp| lamp.name != "ball").collect();
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
    run.settings.light_layers = true;
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
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| (run.cuts().0, run.reconstructed(eye_rays).0))
    };
    let (one, three) = (on(1), on(3));
    assert!(one.0.layers == three.0.layers && one.1.layers == three.1.layers);
}

/// Truth: every light, where f32 can hold it; all pixels must be finite.
#[test]
fn degenerate_lights_give_finite_images() {
    let point = |x: f32, intensity: f32| {
        light(
            &format!("p{x}{intensity}"),
            LightKind::Point {
                position: constant(Vec3::new(x, 0.5, 0.3)),
                intensity: constant(Vec3::splat(intensity)),
            },
        )
    };
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
                assert!(
                    pixels(layers, "beauty")
                        .iter()
                        .all(|p| p.is_finite() && p.min_element() >= 0.0)
                );
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
    run.settings.spp = 4;
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
    run.settings.spp = 16;
    let (cuts, _) = run.cuts();
    let traced = run.with(|lights, _, watch| {
        let settings = PathSettings {
            spp: 256,
            max_bounces: Some(2),
            ..PathSettings::default()
        };
        path::render(&run.scene, lights, &camera(), run.size, &settings, watch).unwrap()
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
    run.settings.spp = 64;
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

/// Truth: all lights of the clusters, one by one.
#[test]
fn bounds_hold_where_they_are_used() {
    let run = Run::new(lamps(), 2000, 1000);
    run.with(|_, points, _| {
        let clusters = lightcuts::trees(&run.scene, points, false, 0);
        let found = tightness::bound_tightness(&run.scene, points, &clusters, &camera(), SIZE, 64);
        assert_eq!(found.violated, 0);
        assert!(found.shares.len() > 5000);
        assert!(found.shares[found.shares.len() / 2] > 0.5, "{found}");
    });
}
