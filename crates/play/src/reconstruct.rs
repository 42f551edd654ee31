//! Irradiance at surface places from values at the finest points.
//!
//! Source: Lehtinen et al. 2008, equations 1 and 4.1 (flat basis for display), vector irradiance dotted with
//! the shading normal, so that normal maps work.

use glam::{Vec3, Vec3A};
use rayon::prelude::*;
use relight_transport::basis::{FunctionsInOrder, Level};
use relight_transport::pyramid::{LEAST_LEFT, VectorIrradiance, carried_back};
use relight_transport::sparse::{SparseMatrix, build_with, fill_rows, row};

/// The finest level's functions at each pixel's surface; empty rows where there is no surface. `places` has
/// position and smooth normal of each pixel.
///
/// A place that no function covers (a crevice that no candidate met, the back of a thin rim) takes the nearest
/// points whatever their normals, and failing that stays empty. Points that `is_separated` from it count for nothing, as
/// long as others are left; it is asked about those in `near_separated` alone.
pub fn weights_at(
    finest: &Level,
    places: &[Option<(Vec3, Vec3)>],
    near_separated: &[bool],
    is_separated: impl Fn((Vec3, Vec3), u32) -> bool + Sync,
) -> SparseMatrix {
    let functions = || FunctionsInOrder::new(finest);
    build_with(places.len(), finest.len(), functions, |functions, i, row| {
        if let Some(place) = places[i] {
            functions_at(functions, place, near_separated, &is_separated, row);
        }
    })
}

/// Appends a row of [`weights_at`].
pub(crate) fn functions_at(
    functions: &mut FunctionsInOrder,
    place: (Vec3, Vec3),
    near_separated: &[bool],
    is_separated: impl Fn((Vec3, Vec3), u32) -> bool,
    row: &mut Vec<(u32, f32)>,
) {
    let first = row.len();
    functions.functions_or_nearest_at(place.0, place.1, row);
    let near = |j: u32| near_separated.get(j as usize).copied().unwrap_or(false);
    if !row[first..].iter().any(|e| near(e.0)) {
        return;
    }
    let kept: Vec<(u32, f32)> = (row[first..].iter().copied())
        .filter(|e| !(near(e.0) && is_separated(place, e.0)))
        .collect();
    let sum: f32 = kept.iter().map(|e| e.1).sum();
    if sum > 0.0 {
        row.truncate(first);
        row.extend(kept.iter().map(|e| (e.0, e.1 / sum)));
    }
}

/// Weights of the pixels' rows on the components of vector irradiance: row weight times what the shading normal
/// takes of each point's value once that is carried to the pixel. Same layout as the rows' entries.
pub fn components(weights: &SparseMatrix, finest: &Level, normals: &[(Vec3, Vec3)]) -> Vec<Vec3> {
    let mut components = vec![Vec3::ZERO; weights.nnz()];
    fill_rows(weights, &mut components, |i, components| {
        let (smooth, shading) = normals[i];
        for (component, (j, w)) in components.iter_mut().zip(row(weights, i)) {
            *component = carried_back(shading, smooth, finest.normals[j as usize]) * w;
        }
    });
    components
}

/// RGB irradiance for each pixel. `finest` are the points of `values`. Where a shading normal turns away from what
/// light the points have, and vector irradiance would say nothing or less, [`LEAST_LEFT`] of the light that the points
/// themselves receive is left.
pub fn irradiance(
    weights: &SparseMatrix,
    components: &[Vec3],
    finest: &Level,
    values: &[VectorIrradiance],
) -> Vec<Vec3> {
    (0..weights.rows())
        .into_par_iter()
        .with_min_len(1024)
        .map(|i| {
            let components = &components[weights.indptr().outer_inds_sz(i)];
            let mut sum = Vec3A::ZERO;
            for ((j, _), c) in row(weights, i).zip(components) {
                let value = &values[j as usize];
                sum += value.x * c.x + value.y * c.y + value.z * c.z;
            }
            if sum.min_element() < 0.0 {
                let received =
                    |(j, w): (u32, f32)| values[j as usize].irradiance(finest.normals[j as usize]) * w;
                let around: Vec3 = row(weights, i).map(received).sum();
                return Vec3::from(sum).max(around.max(Vec3::ZERO) * LEAST_LEFT);
            }
            Vec3::from(sum)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shading_normal_that_turns_away_from_the_light_still_shows_some() {
        // Light along x over a floor that also gets 0.2 of it; a normal map that leans to −x sees less than nothing.
        let finest = Level::new(vec![Vec3::ZERO], vec![Vec3::Y], 1.0, 1.0);
        let places = [Some((Vec3::ZERO, Vec3::Y)); 2];
        let weights = weights_at(&finest, &places, &[], |_, _| false);
        let leaning = Vec3::new(-0.6, 0.8, 0.0);
        let parts = components(&weights, &finest, &[(Vec3::Y, Vec3::Y), (Vec3::Y, leaning)]);
        let mut light = VectorIrradiance::default();
        light.add(Vec3::new(1.0, 0.2, 0.0), Vec3A::ONE);
        let seen = irradiance(&weights, &parts, &finest, &[light]);
        // Rounding of numbers below 1.
        assert!((seen[0] - 0.2).abs().max_element() < 1e-6, "{}", seen[0]);
        assert!(
            (seen[1] - 0.2 * LEAST_LEFT).abs().max_element() < 1e-6,
            "{}",
            seen[1]
        );
    }
}
