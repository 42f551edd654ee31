//! Irradiance at surface places from values at the finest points.
//!
//! Source: Lehtinen et al. 2008, equations 1 and 4.1 (flat basis for display), vector irradiance dotted with
//! the shading normal, so that normal maps work.

use glam::{Vec3, Vec3A};
use rayon::prelude::*;
use relight_transport::basis::Level;
use relight_transport::pyramid::{VectorIrradiance, carry};
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

/// Weights of the pixels' rows on the components of vector irradiance: row weight times what the shading normal
/// takes of each point's value once that is carried to the pixel. Same layout as the rows' entries.
pub fn components(weights: &Rows, finest: &Level, normals: &[(Vec3, Vec3)]) -> Vec<Vec3> {
    let chunks: Vec<Vec<Vec3>> = (0..weights.rows())
        .into_par_iter()
        .with_min_len(1024)
        .map(|i| {
            let (smooth, shading) = normals[i];
            let back = |j: u32| carry(finest.normals[j as usize], smooth).transpose();
            let carried = |&(j, w): &(u32, f32)| back(j) * shading * w;
            weights.row(i).iter().map(carried).collect()
        })
        .collect();
    chunks.into_iter().flatten().collect()
}

/// RGB irradiance for each pixel; negative values, which only ringing makes, are kept: the caller clamps the
/// final sum.
pub fn irradiance(weights: &Rows, components: &[Vec3], values: &[VectorIrradiance]) -> Vec<Vec3> {
    (0..weights.rows())
        .into_par_iter()
        .with_min_len(1024)
        .map(|i| {
            let range = weights.offsets[i] as usize..weights.offsets[i + 1] as usize;
            let mut sum = Vec3A::ZERO;
            for (&(j, _), c) in weights.entries[range.clone()].iter().zip(&components[range]) {
                let value = &values[j as usize];
                sum += value.x * c.x + value.y * c.y + value.z * c.z;
            }
            Vec3::from(sum)
        })
        .collect()
}
