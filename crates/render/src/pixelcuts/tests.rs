//! Truths: `brute` over the same points, which shares neither trees, nor harmonics, nor sums.

use super::*;
use crate::brute::{self, PointsSettings};
use crate::many_lights::PointSettings;
use crate::many_lights::tests::{SIZE, mean, spot_inside};
use crate::test_scenes::{
    bulb, camera, constant, day, globe, glow, level, light, matt, panel, room, sky, sun, traced,
};
use relight_scene::light::{LightKind, LightTrack};
use relight_scene::light_set::SceneEmitters;
use relight_scene::material::Material;

/// A closed room with a table in it.
fn hall() -> TracedScene {
    traced(
        vec![room(0), level(0.4, -0.4, 1)],
        vec![
            matt(0.6, 0.0),
            Material {
                double_sided: true,
                ..matt(0.3, 0.0)
            },
        ],
    )
}

fn inside() -> Camera {
    camera(Vec3::new(0.1, 0.2, 0.9), Vec3::new(0.0, -0.4, -1.0), 70.0)
}

struct Lit<'a> {
    scene: &'a TracedScene,
    view: Camera,
    size: RenderSize,
    points: PointSettings,
}

impl Lit<'_> {
    fn by_pixelcuts(&self, tracks: &[LightTrack], settings: &PixelcutsSettings) -> (Layers, PixelcutsStats) {
        self.watched(tracks, |lights, points, watch| {
            render(self.scene, lights, points, &self.view, self.size, settings, watch).unwrap()
        })
    }

    fn by_brute(&self, tracks: &[LightTrack], spp: u32) -> Layers {
        self.watched(tracks, |lights, points, watch| {
            let settings = PointsSettings {
                spp,
                seed: 0,
                light_layers: false,
                packets: true,
            };
            brute::render_points(
                self.scene, lights, points, &self.view, self.size, &settings, watch,
            )
            .unwrap()
            .0
        })
    }

    fn watched<R>(
        &self,
        tracks: &[LightTrack],
        call: impl FnOnce(&LightSet<'_>, &PointLights, &dyn Watch) -> R,
    ) -> R {
        let emitters = SceneEmitters::new(self.scene);
        let lights = LightSet::new(&emitters, tracks, 0.0).unwrap();
        let points = PointLights::new(self.scene, &lights, &self.points);
        call(&lights, &points, &())
    }
}

fn relative_mse(found: &Layers, truth: &Layers, name: &str) -> f64 {
    let [found, truth] = [found, truth].map(|layers| &layers.layer(name).unwrap().data);
    let mean = truth.iter().map(|&v| f64::from(v)).sum::<f64>() / truth.len() as f64;
    let errors = found.iter().zip(truth).map(|(&f, &t)| {
        let (f, t) = (f64::from(f), f64::from(t));
        (f - t).powi(2) / (t * t + 0.01 * mean * mean)
    });
    errors.sum::<f64>() / truth.len() as f64
}

/// As many clusters as there are pixels, nothing exact beforehand, nothing filtered.
fn every_pixel() -> PixelcutsSettings {
    PixelcutsSettings {
        clusters: 1 << 20,
        trees: 3,
        exact: 0,
        filter: false,
        ..PixelcutsSettings::default()
    }
}

#[test]
fn with_a_cluster_for_each_pixel_matt_surfaces_are_as_by_brute_force() {
    let scene = hall();
    let unclamped = PointSettings {
        area_samples: Some(60),
        vpls: 300,
        clamp: f32::INFINITY,
        ..PointSettings::default()
    };
    let lit = Lit {
        scene: &scene,
        view: inside(),
        size: SIZE,
        points: unclamped,
    };
    for track in [
        panel(),
        globe(),
        spot_inside(),
        bulb(Vec3::new(0.3, 0.5, -0.2), 1.0),
    ] {
        let tracks = [track];
        for spp in [1, 3] {
            let (found, stats) = lit.by_pixelcuts(&tracks, &PixelcutsSettings { spp, ..every_pixel() });
            let truth = lit.by_brute(&tracks, spp);
            for name in [
                "beauty", "emission", "direct", "indirect", "albedo", "normal", "depth",
            ] {
                let [found, truth] = [&found, &truth].map(|layers| &layers.layer(name).unwrap().data);
                let scale = truth.iter().fold(0.0f32, |m, v| m.max(v.abs()));
                for (f, t) in found.iter().zip(truth) {
                    assert!(
                        (f - t).abs() <= 1e-5 * scale,
                        "{} {name}: {f}, not {t}",
                        tracks[0].name
                    );
                }
            }
            assert_eq!(stats.points, (SIZE.width * SIZE.height) * spp as usize);
        }
    }
}

#[test]
fn harmonics_and_clusters_stay_near_brute_force() {
    let scene = hall();
    let lit = Lit {
        scene: &scene,
        view: inside(),
        size: RenderSize {
            width: 64,
            height: 48,
        },
        points: PointSettings {
            area_samples: Some(64),
            vpls: 600,
            ..PointSettings::default()
        },
    };
    let tracks = [panel()];
    let truth = lit.by_brute(&tracks, 1);
    let error = |settings: PixelcutsSettings| {
        let (found, stats) = lit.by_pixelcuts(&tracks, &settings);
        let error = relative_mse(&found, &truth, "beauty");
        println!(
            "{error:.5} {:.1} rays per pixel",
            stats.shadow_rays as f64 / stats.points as f64
        );
        error
    };
    let standard = PixelcutsSettings {
        clusters: 512,
        ..PixelcutsSettings::default()
    };
    let error_of_standard = error(standard);
    assert!(error_of_standard < 0.01);
    assert!(
        error(PixelcutsSettings {
            flat: false,
            ..standard
        }) < 0.01
    );
    // Fewer clusters cost accuracy: the measure can tell.
    assert!(
        error(PixelcutsSettings {
            clusters: 16,
            threshold: 1.0,
            exact: 0,
            ..standard
        }) > error_of_standard
    );
}

#[test]
fn the_image_does_not_depend_on_the_number_of_threads() {
    let scene = hall();
    let points = PointSettings {
        area_samples: Some(60),
        vpls: 200,
        ..PointSettings::default()
    };
    let lit = Lit {
        scene: &scene,
        view: inside(),
        size: SIZE,
        points,
    };
    let settings = PixelcutsSettings {
        clusters: 50,
        trees: 4,
        exact: 5,
        ..PixelcutsSettings::default()
    };
    let tracks = [panel(), sun()];
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| {
            lit.by_pixelcuts(&tracks, &settings)
                .0
                .layer("beauty")
                .unwrap()
                .data
                .clone()
        })
    };
    let first = on(1);
    assert_eq!(first, on(3));
    assert!(first.iter().any(|&v| v > 0.0));
}

#[test]
fn light_layers_add_up() {
    let scene = hall();
    let points = PointSettings {
        area_samples: Some(60),
        vpls: 200,
        ..PointSettings::default()
    };
    let lit = Lit {
        scene: &scene,
        view: inside(),
        size: SIZE,
        points,
    };
    let settings = PixelcutsSettings {
        clusters: 50,
        trees: 2,
        light_layers: true,
        ..PixelcutsSettings::default()
    };
    let tracks = [panel(), spot_inside()];
    let (layers, _) = lit.by_pixelcuts(&tracks, &settings);
    let data = |name: &str| &layers.layer(name).unwrap().data;
    let largest = data("beauty").iter().fold(0.0f32, |m, v| m.max(*v));
    for (i, beauty) in data("beauty").iter().enumerate() {
        let sum = data("light.panel")[i] + data("light.spot")[i];
        assert!((sum - beauty).abs() <= 1e-5 * largest, "{sum}, not {beauty}");
    }
}

#[test]
fn bad_cases_give_finite_images() {
    let (closed, open) = (hall(), traced(vec![level(1.0, 0.0, 0)], vec![matt(0.5, 3.0)]));
    let strong = |intensity| bulb(Vec3::new(0.3, 0.5, -0.2), intensity);
    let large = LightKind::Sphere {
        center: constant(Vec3::ZERO),
        radius: constant(0.9),
        radiance: constant(Vec3::ONE),
    };
    let cases: Vec<Vec<LightTrack>> = vec![
        vec![],
        vec![strong(0.0)],
        vec![strong(1e20), strong(1e-20), strong(0.0), sky()],
        vec![strong(1e-20)],
        vec![day(), glow()],
        vec![
            bulb(Vec3::new(1.0, 0.5, 0.0), 1.0),
            bulb(Vec3::new(3.0, 0.5, 0.0), 1.0),
        ],
        vec![light("large", large)],
        (0..200).map(|_| strong(1.0)).collect(),
    ];
    let away = camera(Vec3::new(0.0, 5.0, 0.0), Vec3::new(0.0, 6.0, 0.1), 40.0);
    for (scene, view) in [(&closed, inside()), (&open, inside()), (&open, away)] {
        for size in [
            RenderSize { width: 1, height: 1 },
            RenderSize { width: 5, height: 3 },
        ] {
            for tracks in &cases {
                for exact in [0, 64] {
                    let points = PointSettings {
                        environment: 50,
                        sky: 50,
                        vpls: 40,
                        ..PointSettings::default()
                    };
                    let lit = Lit {
                        scene,
                        view,
                        size,
                        points,
                    };
                    let settings = PixelcutsSettings {
                        clusters: 8,
                        exact,
                        ..PixelcutsSettings::default()
                    };
                    let (layers, _) = lit.by_pixelcuts(tracks, &settings);
                    assert!(layers.layers.iter().all(|l| l.data.iter().all(|v| v.is_finite())));
                }
            }
        }
    }
    // One pixel: one cluster, and so as by brute force.
    let points = PointSettings {
        vpls: 40,
        clamp: f32::INFINITY,
        ..PointSettings::default()
    };
    let lit = Lit {
        scene: &closed,
        view: inside(),
        size: RenderSize { width: 1, height: 1 },
        points,
    };
    for intensity in [1e-20, 1.0, 1e20] {
        let tracks = [strong(intensity)];
        let (found, truth) = (
            lit.by_pixelcuts(&tracks, &every_pixel()).0,
            lit.by_brute(&tracks, 1),
        );
        let (found, truth) = (mean(&found, "beauty"), mean(&truth, "beauty"));
        assert!(
            truth > 0.0 && (found / truth - 1.0).abs() < 1e-5,
            "{found}, not {truth}"
        );
    }
}
