//! Frames that take nothing of the asset but its scene.

use super::settings::FrameSettings;
use super::stats::{PointStats, TracedDetail, TracedStats, TreeStats, milliseconds};
use crate::choice::Tracer;
use crate::shot::TracedShot;
use relight_render::brute::{self, BruteSettings, PointsSettings};
use relight_render::lightcuts::{self, EyeRays, LightcutSettings};
use relight_render::many_lights::{PointLights, PointSettings};
use relight_render::path::{self, PathSettings};
use relight_render::pixelcuts::{self, PixelcutsSettings};
use relight_render::watch::{Cancelled, Watch};
use relight_scene::image::Layers;
use relight_scene::light_set::LightSet;
use relight_scene::traced::TracedScene;
use std::time::Instant;

/// Renders a frame with all its layers.
///
/// # Errors
/// [`Cancelled`] if `watch` says so.
pub fn traced(
    scene: &TracedScene,
    lights: &LightSet<'_>,
    shot: &TracedShot,
    settings: &FrameSettings,
    watch: &dyn Watch,
) -> Result<(Layers, TracedStats), Cancelled> {
    let start = Instant::now();
    let TracedShot {
        camera,
        size,
        samples,
        tracer,
    } = shot;
    let &FrameSettings {
        seed, light_layers, ..
    } = settings;
    let spp = |otherwise: u32| samples.unwrap_or(otherwise);
    let mut made = None;
    let mut points_of = |settings: &PointSettings| {
        let start = Instant::now();
        let points = PointLights::new(scene, lights, &PointSettings { seed, ..*settings });
        made = Some(PointStats {
            milliseconds: milliseconds(start),
            lights: points.len(),
            virtual_lights: points.len() - points.direct,
        });
        points
    };
    let (layers, detail) = match tracer {
        Tracer::Lightcuts {
            points,
            cuts,
            reconstruction,
        } => {
            let points = points_of(points);
            let start = Instant::now();
            let clusters = lightcuts::trees(scene, &points, light_layers, seed);
            let tree = TreeStats {
                milliseconds: milliseconds(start),
                bytes: clusters.bytes(),
            };
            let cuts = LightcutSettings {
                spp: spp(LightcutSettings::default().spp),
                seed,
                light_layers,
                ..*cuts
            };
            let start = Instant::now();
            if *reconstruction {
                let eye_rays = samples.map_or(EyeRays::default(), |spp| EyeRays {
                    least: spp,
                    most: spp,
                });
                let (layers, stats) = lightcuts::render_reconstructed(
                    scene, lights, &points, &clusters, camera, *size, &cuts, eye_rays, watch,
                )?;
                let light = milliseconds(start);
                (layers, TracedDetail::Reconstruction { tree, light, stats })
            } else {
                let (layers, stats) =
                    lightcuts::render(scene, lights, &points, &clusters, camera, *size, &cuts, watch)?;
                let light = milliseconds(start);
                (layers, TracedDetail::Lightcuts { tree, light, stats })
            }
        }
        Tracer::Pixelcuts { points, cuts } => {
            let points = points_of(points);
            let cuts = PixelcutsSettings {
                spp: spp(PixelcutsSettings::default().spp),
                seed,
                light_layers,
                ..*cuts
            };
            let (layers, stats) = pixelcuts::render(scene, lights, &points, camera, *size, &cuts, watch)?;
            (layers, TracedDetail::Pixelcuts(stats))
        }
        Tracer::BrutePoints(points) => {
            let points = points_of(points);
            let settings = PointsSettings {
                spp: spp(BruteSettings::default().spp),
                seed,
                light_layers,
                packets: true,
            };
            let (layers, shadow_rays) =
                brute::render_points(scene, lights, &points, camera, *size, &settings, watch)?;
            (layers, TracedDetail::BrutePoints { shadow_rays })
        }
        Tracer::Brute => {
            let settings = BruteSettings {
                spp: spp(BruteSettings::default().spp),
                seed,
                light_layers,
                ..BruteSettings::default()
            };
            let layers = brute::render(scene, lights, camera, *size, &settings, watch)?;
            (layers, TracedDetail::Plain)
        }
        Tracer::Path { max_bounces } => {
            let settings = PathSettings {
                spp: spp(PathSettings::default().spp),
                max_bounces: *max_bounces,
                seed,
                light_layers,
            };
            let layers = path::render(scene, lights, camera, *size, &settings, watch)?;
            (layers, TracedDetail::Plain)
        }
    };
    let stats = TracedStats {
        render: milliseconds(start),
        points: made,
        detail,
        pixels: size.width * size.height,
    };
    Ok((layers, stats))
}
