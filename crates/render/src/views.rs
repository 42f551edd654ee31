//! What an exposure shows besides light: reflectance, normals, depth. Means over what of a pixel is covered by
//! surfaces; 0 where nothing is.

use crate::exposure::Exposure;
use glam::Vec3;
use relight_scene::bsdf;

/// Total hemispherical reflectance, linear RGB.
pub fn albedo(seen: &Exposure) -> Vec<Vec3> {
    means(seen, |f| {
        seen.points[f].as_ref().map_or(Vec3::ZERO, |point| {
            if point.lambert {
                point.diffuse
            } else {
                bsdf::hemispherical_albedo(point)
            }
        })
    })
}

/// Unit shading normals, world space.
pub fn normals(seen: &Exposure) -> Vec<Vec3> {
    let mut normals = means(seen, |f| {
        seen.points[f]
            .as_ref()
            .map_or(Vec3::ZERO, |point| point.shading_normal)
    });
    normals.iter_mut().for_each(|n| *n = n.normalize_or_zero());
    normals
}

/// Distance along the eye ray, metres.
pub fn depth(seen: &Exposure) -> Vec<f32> {
    let distance = |f: usize| seen.hits[f].as_ref().map_or(0.0, |hit| hit.t);
    means(seen, |f| Vec3::splat(distance(f)))
        .into_iter()
        .map(|v| v.x)
        .collect()
}

fn means(seen: &Exposure, value: impl Fn(usize) -> Vec3) -> Vec<Vec3> {
    (0..seen.width * seen.height)
        .map(|pixel| {
            let (sum, covered) = seen
                .fragments_of(pixel)
                .filter(|&f| seen.hits[f].is_some())
                .fold((Vec3::ZERO, 0.0f32), |(sum, covered), f| {
                    (sum + value(f) * seen.coverage[f], covered + seen.coverage[f])
                });
            if covered > 0.0 { sum / covered } else { Vec3::ZERO }
        })
        .collect()
}
