//! What a shot shows besides light: reflectance, normals, depth. Means over what of a pixel is covered by
//! surfaces; 0 where nothing is.

use crate::shot::Shot;
use glam::Vec3;
use relight_scene::bsdf;

/// Total hemispherical reflectance, linear RGB.
pub fn albedo(shot: &Shot) -> Vec<Vec3> {
    means(shot, |f| {
        shot.points[f].as_ref().map_or(Vec3::ZERO, |point| {
            if point.lambert {
                point.diffuse
            } else {
                bsdf::hemispherical_albedo(point)
            }
        })
    })
}

/// Unit shading normals, world space.
pub fn normals(shot: &Shot) -> Vec<Vec3> {
    let mut normals = means(shot, |f| {
        shot.points[f]
            .as_ref()
            .map_or(Vec3::ZERO, |point| point.shading_normal)
    });
    normals.iter_mut().for_each(|n| *n = n.normalize_or_zero());
    normals
}

/// Distance along the eye ray, metres.
pub fn depth(shot: &Shot) -> Vec<f32> {
    let distance = |f: usize| shot.hits[f].as_ref().map_or(0.0, |hit| hit.t);
    means(shot, |f| Vec3::splat(distance(f)))
        .into_iter()
        .map(|v| v.x)
        .collect()
}

fn means(shot: &Shot, value: impl Fn(usize) -> Vec3) -> Vec<Vec3> {
    (0..shot.width * shot.height)
        .map(|pixel| {
            let fragments = shot.offsets[pixel] as usize..shot.offsets[pixel + 1] as usize;
            let (sum, covered) = fragments
                .filter(|&f| shot.hits[f].is_some())
                .fold((Vec3::ZERO, 0.0f32), |(sum, covered), f| {
                    (sum + value(f) * shot.coverage[f], covered + shot.coverage[f])
                });
            if covered > 0.0 { sum / covered } else { Vec3::ZERO }
        })
        .collect()
}
