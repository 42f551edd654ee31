//! Light that is seen directly.

use glam::Vec3;
use rayon::prelude::*;
use relight_render::exposure::Exposure;
use relight_scene::light_set::{LightSet, MetEmitter};
use relight_scene::rays::Ray;
use relight_scene::surface::Surfaces;
use relight_scene::traced::{Look, TracedScene};

/// Light that each fragment shows directly: emissive surfaces that a light lets shine, environments, and
/// rectangles and spheres of the sequence. Of one light, or of all.
pub(super) fn emission_at(
    scene: &TracedScene,
    seen: &Exposure,
    lights: &LightSet,
    only: Option<usize>,
) -> Vec<Vec3> {
    // Looking at all fragments takes as long as their reconstruction.
    if seen.apart || (scene.emissive_triangles().is_empty() && !lights.any_along()) {
        return vec![Vec3::ZERO; seen.len()];
    }
    (0..seen.len())
        .into_par_iter()
        .with_min_len(1024)
        .map(|f| {
            let mut sum = Vec3::ZERO;
            let direction = seen.directions[f];
            let wanted = |light: usize| only.is_none_or(|o| o == light);
            let along = |sum: &mut Vec3, ray: &Ray, end: f32, tint: Vec3| {
                lights.along(ray.origin, ray.direction, end, |met| {
                    if wanted(met.light) {
                        *sum += met.radiance * tint;
                    }
                });
            };
            let eye = Ray::endless(seen.eye, seen.through(f));
            let look = if seen.is_bent(f) {
                scene.look(&eye, |part, end, tint| along(&mut sum, part, end, tint))
            } else {
                Look::straight(&eye, seen.hits[f])
            };
            let distance = look.hit.map_or(f32::INFINITY, |hit| hit.t);
            let tint = look.tint * scene.tint(&look.ray, distance);
            along(&mut sum, &look.ray, distance, tint);
            if let (Some(hit), Some(point)) = (&seen.hits[f], &seen.points[f])
                && point.emission != Vec3::ZERO
            {
                let material = scene.material(hit.primitive);
                // Of a texture the mean of what the rays meet.
                let places = if material.emission_texture.is_some() {
                    seen.places_of(scene, f)
                } else {
                    vec![*hit]
                };
                for place in &places {
                    let emitter = MetEmitter {
                        primitive: place.primitive,
                        barycentric: place.barycentric,
                        distance: f64::from(hit.t),
                        cos: f64::from(place.geometric_normal.dot(direction)),
                    };
                    lights.emitted(&emitter, None, |met| {
                        if wanted(met.light) {
                            sum += met.radiance * tint / places.len() as f32;
                        }
                    });
                }
                if only.is_none() && material.unlit {
                    sum += point.emission;
                }
            }
            sum
        })
        .collect()
}
