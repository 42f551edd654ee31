//! Frames that are traced; of the asset they take its scene, and virtual lights its points.

use super::settings::FrameSettings;
use super::stats::{PointStats, TracedDetail, TracedStats, TreeStats, milliseconds};
use super::virtual_lights::add_standing;
use crate::choice::Tracer;
use crate::prepared::PreparedScene;
use crate::shot::TracedShot;
use relight_render::lightcuts::{self, EyeRays};
use relight_render::many_lights::{PointLights, PointSettings};
use relight_render::picture::Picture;
use relight_render::watch::{Cancelled, Watch};
use relight_render::{brute, path, pixelcuts};
use relight_scene::image::Layers;
use relight_scene::light_set::LightSet;
use std::time::Instant;

/// Renders a frame with all its layers.
///
/// # Errors
/// [`Cancelled`] if `watch` says so.
pub fn traced(
    prepared: &PreparedScene,
    lights: &LightSet<'_>,
    shot: &TracedShot,
    frame: &FrameSettings,
    watch: &dyn Watch,
) -> Result<(Layers, TracedStats), Cancelled> {
    let start = Instant::now();
    let scene = &prepared.scene;
    let TracedShot {
        camera,
        size,
        samples,
        tracer,
    } = shot;
    let &FrameSettings {
        seed, light_layers, ..
    } = frame;
    let picture = Picture {
        spp: *samples,
        seed,
        light_layers,
        watch,
        ..Picture::new(scene, lights, camera, *size)
    };
    let mut made = None;
    let mut points_of = |settings: &PointSettings| -> Result<_, Cancelled> {
        let start = Instant::now();
        let settings = PointSettings { seed, ..*settings };
        let mut points = PointLights::that_shine(scene, lights, &settings);
        // A cut hardly grows with its tree: it takes them all.
        let most = match tracer {
            Tracer::Lightcuts { .. } if settings.vpls > 0 => u32::MAX,
            _ => settings.vpls,
        };
        let standing = add_standing(prepared, lights, frame, most, &mut points, watch)?;
        if standing.is_none() {
            points.add_virtual(scene, &settings);
        }
        made = Some(PointStats {
            milliseconds: milliseconds(start),
            lights: points.len(),
            virtual_lights: points.len() - points.direct,
        });
        Ok((points, standing))
    };
    let (layers, detail) = match tracer {
        Tracer::Lightcuts {
            points,
            cuts,
            reconstruction,
        } => {
            let (points, standing) = points_of(points)?;
            let standing = standing.as_ref().map(|sets| &sets.lights);
            let start = Instant::now();
            let clusters = lightcuts::trees(scene, &points, standing, light_layers, seed);
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
            let (layers, stats) = pixelcuts::render(&picture, &points_of(points)?.0, cuts)?;
            (layers, TracedDetail::Pixelcuts(stats))
        }
        Tracer::BrutePoints(points) => {
            let (layers, shadow_rays) = brute::render_points(&picture, &points_of(points)?.0)?;
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
