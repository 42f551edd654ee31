//! Frames that take nothing of the asset but its scene.

use super::settings::FrameSettings;
use super::stats::{PointStats, TracedDetail, TracedStats, TreeStats, milliseconds};
use crate::choice::Tracer;
use crate::shot::TracedShot;
use relight_render::lightcuts::{self, EyeRays};
use relight_render::many_lights::{PointLights, PointSettings};
use relight_render::picture::Picture;
use relight_render::watch::{Cancelled, Watch};
use relight_render::{brute, path, pixelcuts};
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
    let picture = Picture {
        spp: *samples,
        seed,
        light_layers,
        watch,
        ..Picture::new(scene, lights, camera, *size)
    };
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
            let start = Instant::now();
            if *reconstruction {
                let eye_rays = samples.map_or(EyeRays::default(), |spp| EyeRays {
                    least: spp,
                    most: spp,
                });
                let (layers, stats) =
                    lightcuts::render_reconstructed(&picture, &points, &clusters, cuts, eye_rays)?;
                let light = milliseconds(start);
                (layers, TracedDetail::Reconstruction { tree, light, stats })
            } else {
                let (layers, stats) = lightcuts::render(&picture, &points, &clusters, cuts)?;
                let light = milliseconds(start);
                (layers, TracedDetail::Lightcuts { tree, light, stats })
            }
        }
        Tracer::Pixelcuts { points, cuts } => {
            let (layers, stats) = pixelcuts::render(&picture, &points_of(points), cuts)?;
            (layers, TracedDetail::Pixelcuts(stats))
        }
        Tracer::BrutePoints(points) => {
            let (layers, shadow_rays) = brute::render_points(&picture, &points_of(points))?;
            (layers, TracedDetail::BrutePoints { shadow_rays })
        }
        Tracer::Brute => (brute::render(&picture)?, TracedDetail::Plain),
        Tracer::Path { max_bounces } => (path::render(&picture, *max_bounces)?, TracedDetail::Plain),
    };
    let stats = TracedStats {
        render: milliseconds(start),
        points: made,
        detail,
        pixels: size.width * size.height,
    };
    Ok((layers, stats))
}
