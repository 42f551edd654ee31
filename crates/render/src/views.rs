//! What an exposure shows besides light: reflectance, normals, depths. Means over what of a pixel is covered by
//! surfaces; 0 where nothing is. And how much of it is.

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

/// Distances from the camera's plane and along the eye ray, metres.
pub fn depths(seen: &Exposure) -> (Vec<f32>, Vec<f32>) {
    let distances = |f: usize| {
        let along = seen.hits[f].as_ref().map_or(0.0, |hit| hit.t);
        Vec3::new(along * seen.through(f).dot(seen.forward), along, 0.0)
    };
    (means(seen, distances).into_iter()).map(|v| (v.x, v.y)).unzip()
}

/// Share of each pixel that is covered by surfaces, 0 to 1.
pub fn alpha(seen: &Exposure) -> Vec<f32> {
    (0..seen.width * seen.height)
        .map(|pixel| {
            let surfaces = seen.fragments_of(pixel).filter(|&f| seen.hits[f].is_some());
            // Shares of what has several fragments are rounded.
            surfaces.map(|f| seen.coverage[f]).sum::<f32>().min(1.0)
        })
        .collect()
}

/// Of light at the fragments what comes from where nothing is.
pub fn background(seen: &Exposure, fragments: &[Vec3]) -> Vec<Vec3> {
    let beyond: Vec<Vec3> = (fragments.iter().zip(&seen.hits))
        .map(|(light, hit)| if hit.is_none() { *light } else { Vec3::ZERO })
        .collect();
    seen.resolve(&beyond)
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
