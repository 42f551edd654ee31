//! Irradiance at surface places from values at the finest points.
//!
//! Source: Lehtinen et al. 2008, equations 1 and 4.1 (flat basis for display), vector irradiance dotted with
//! the shading normal, so that normal maps work.

use glam::Vec3;
use rayon::prelude::*;
use relight_transport::basis::Level;
use relight_transport::pyramid::VectorIrradiance;
use relight_transport::sparse::Rows;

/// The finest level's functions at each pixel's surface; empty rows where there is no surface. `places` has
/// position and smooth normal of each pixel.
///
/// A place that no function covers (a crevice that no candidate met, the back of a thin rim) takes the nearest
/// points whatever their normals, and failing that stays empty.
pub fn weights_at(finest: &Level, places: &[Option<(Vec3, Vec3)>]) -> Rows {
    Rows::build(places.len(), finest.len(), |i, row| {
        if let Some((x, n)) = places[i] {
            finest.functions_or_nearest_at(x, n, row);
        }
    })
}

/// RGB irradiance for each pixel's shading normal; negative values, which only ringing makes, are kept: the
/// caller clamps the final sum.
pub fn irradiance(weights: &Rows, normals: &[Vec3], values: &[VectorIrradiance]) -> Vec<Vec3> {
    (0..weights.rows())
        .into_par_iter()
        .with_min_len(1024)
        .map(|i| {
            let mut sum = VectorIrradiance::default();
            for &(j, w) in weights.row(i) {
                sum.add_scaled(&values[j as usize], w);
            }
            sum.irradiance(normals[i])
        })
        .collect()
}
