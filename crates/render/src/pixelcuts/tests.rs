//! Truths: `brute` over the same points, which shares neither trees, nor harmonics, nor sums.

use super::*;
use crate::layers::RenderSize;
use crate::many_lights::PointSettings;
use crate::test_images::*;
use crate::test_scenes::*;
use relight_scene::camera::Camera;
use relight_scene::light::LightTrack;
use relight_scene::material::Material;
use relight_scene::traced::TracedScene;

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

struct Lit {
    scene: TracedScene,
    view: Camera,
    size: RenderSize,
    points: PointSettings,
}

impl Lit {
    fn new(points: PointSettings) -> Lit {
        Lit {
            scene: hall(),
            view: inside(),
            size: SIZE,
            points,
        }
    }

    fn by_pixelcuts(
        &self,
        tracks: &[LightTrack],
        spp: u32,
        settings: &PixelcutsSettings,
    ) -> (Layers, PixelcutsStats) {
        self.pictured(tracks, spp, |picture| {
            let points = PointLights::new(picture.scene, picture.lights, &self.points);
            render(&picture, &points, settings).unwrap()
        })
    }

    fn by_brute(&self, tracks: &[LightTrack], spp: u32) -> Layers {
        self.pictured(tracks, spp, |picture| by_points(&picture, &self.points))
    }

    fn pictured<R>(&self, tracks: &[LightTrack], spp: u32, make: impl FnOnce(Picture<'_>) -> R) -> R {
        pictured(&self.scene, tracks, &self.view, spp, |picture| {
            make(Picture {
                size: self.size,
                ..picture
            })
        })
    }
}

fn relative_mse(found: &Layers, truth: &Layers, name: &str) -> f64 {
    let [found, truth] = [found, truth].map(|layers| data(layers, name));
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
    let lit = Lit::new(PointSettings {
        area_samples: Some(60),
        vpls: 300,
        clamp: f32::INFINITY,
        ..PointSettings::default()
    });
    for track in [
        panel(),
        globe(),
        spot_inside(),
        bulb(Vec3::new(0.3, 0.5, -0.2), 1.0),
    ] {
        let tracks = [track];
        for spp in [1, 3] {
            let (found, stats) = lit.by_pixelcuts(&tracks, spp, &every_pixel());
            let truth = lit.by_brute(&tracks, spp);
            for name in [
                "beauty",
                "A",
                "emission",
                "direct",
                "indirect",
                "background",
                "albedo",
                "normal",
                "depth",
                "depth.ray",
            ] {
                let [found, truth] = [&found, &truth].map(|layers| data(layers, name));
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
    let lit = Lit {
        size: RenderSize {
            width: 64,
            height: 48,
        },
        ..Lit::new(PointSettings {
            area_samples: Some(64),
            vpls: 600,
            ..PointSettings::default()
        })
    };
    let tracks = [panel(), measured(Vec3::new(0.3, 0.8, 0.2), 1.0)];
    let truth = lit.by_brute(&tracks, 1);
    let error = |settings: PixelcutsSettings| {
        let (found, _) = lit.by_pixelcuts(&tracks, 1, &settings);
        relative_mse(&found, &truth, "beauty")
    };
    let standard = PixelcutsSettings {
        clusters: 512,
        ..PixelcutsSettings::default()
    };
    let error_of_standard = error(standard);
    assert!(error_of_standard < 0.01);
    let by_harmonics = PixelcutsSettings {
        flat: false,
        ..standard
    };
    assert!(error(by_harmonics) < 0.01);
    // Fewer clusters cost accuracy: the measure can tell.
    let coarse = PixelcutsSettings {
        clusters: 16,
        threshold: 1.0,
        exact: 0,
        ..standard
    };
    assert!(error(coarse) > error_of_standard);
}

#[test]
fn layers_of_lights_add_up_and_threads_change_nothing() {
    let lit = Lit::new(PointSettings {
        area_samples: Some(60),
        vpls: 200,
        ..PointSettings::default()
    });
    let settings = PixelcutsSettings {
        clusters: 50,
        exact: 5,
        ..PixelcutsSettings::default()
    };
    let tracks = [panel(), sun(), spot_inside()];
    let layers = same_on_any_threads(|| {
        lit.pictured(&tracks, 1, |picture| {
            let light_layers = true;
            let picture = Picture {
                light_layers,
                ..picture
            };
            let points = PointLights::new(picture.scene, picture.lights, &lit.points);
            render(&picture, &points, &settings).unwrap().0
        })
    });
    let largest = data(&layers, "beauty").iter().fold(0.0f32, |m, v| m.max(*v));
    assert!(largest > 0.0);
    for (i, beauty) in data(&layers, "beauty").iter().enumerate() {
        let sum: f32 = ["light.panel", "light.sun", "light.spot"]
            .map(|name| data(&layers, name)[i])
            .iter()
            .sum();
        assert!((sum - beauty).abs() <= 1e-5 * largest, "{sum}, not {beauty}");
    }
}

#[test]
fn bad_cases_give_finite_images() {
    let open = || traced(vec![level(1.0, 0.0, 0)], vec![matt(0.5, 3.0)]);
    let strong = |intensity| bulb(Vec3::new(0.3, 0.5, -0.2), intensity);
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
        vec![ball(Vec3::ZERO, 0.9, Vec3::ONE)],
        (0..200).map(|_| strong(1.0)).collect(),
    ];
    let away = camera(Vec3::new(0.0, 5.0, 0.0), Vec3::new(0.0, 6.0, 0.1), 40.0);
    let mut lit = Lit::new(PointSettings {
        environment: 50,
        sky: 50,
        vpls: 40,
        ..PointSettings::default()
    });
    for (scene, view) in [(hall(), inside()), (open(), inside()), (open(), away)] {
        (lit.scene, lit.view) = (scene, view);
        for (width, height) in [(1, 1), (5, 3)] {
            lit.size = RenderSize { width, height };
            for tracks in &cases {
                for exact in [0, 64] {
                    let settings = PixelcutsSettings {
                        clusters: 8,
                        exact,
                        ..PixelcutsSettings::default()
                    };
                    let (layers, _) = lit.by_pixelcuts(tracks, 1, &settings);
                    assert!(layers.layers.iter().all(|l| l.data.iter().all(|v| v.is_finite())));
                }
            }
        }
    }
    // One pixel: one cluster, and so as by brute force.
    let lit = Lit {
        size: RenderSize { width: 1, height: 1 },
        ..Lit::new(PointSettings {
            vpls: 40,
            clamp: f32::INFINITY,
            ..PointSettings::default()
        })
    };
    for intensity in [1e-20, 1.0, 1e20] {
        let tracks = [strong(intensity)];
        let (found, _) = lit.by_pixelcuts(&tracks, 1, &every_pixel());
        let (found, truth) = (mean(&found, "beauty"), mean(&lit.by_brute(&tracks, 1), "beauty"));
        let off = (found / truth - 1.0).abs();
        assert!(truth > 0.0 && off < 1e-5, "{found}, not {truth}");
    }
}
