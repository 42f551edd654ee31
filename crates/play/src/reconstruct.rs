//! Irradiance at surface places from values at the finest points.
//!
//! Source: Lehtinen et al. 2008, equations 1 and 4.1 (flat basis for display), vector irradiance dotted with
//! the shading normal, so that normal maps work.

use glam::{Vec3, Vec3A};
use rayon::prelude::*;
use relight_transport::basis::{FunctionsInOrder, Level};
use relight_transport::pyramid::{VectorIrradiance, carried_back};
use relight_transport::sparse::{SparseMatrix, build_runs, fill_rows, row};

/// The finest level's functions at each pixel's surface; empty rows where there is no surface. `places` has
/// position and smooth normal of each pixel.
///
/// A place that no function covers (a crevice that no candidate met, the back of a thin rim) takes the nearest
/// points whatever their normals, and failing that stays empty. Points that a surface separates from it count for nothing, as
/// long as others are left: `each_separated` is asked about those in `near_separated` alone, of many places at a time.
pub fn weights_at(
    finest: &Level,
    places: &[Option<(Vec3, Vec3)>],
    near_separated: &[bool],
    each_separated: impl Fn(&[((Vec3, Vec3), u32)]) -> Vec<bool> + Sync,
) -> SparseMatrix {
    let functions = || (FunctionsInOrder::new(finest), Vec::new(), Vec::new());
    let is_near = |j: u32| near_separated.get(j as usize).copied().unwrap_or(false);
    build_runs(
        places.len(),
        finest.len(),
        functions,
        |(functions, entries, ends), run, rows| {
            entries.clear();
            ends.clear();
            let mut asked = Vec::new();
            for place in &places[run] {
                let first = entries.len();
                if let Some(place) = *place {
                    functions.functions_or_nearest_at(place.0, place.1, entries);
                    let near = entries[first..].iter().filter(|entry| is_near(entry.0));
                    asked.extend(near.map(|entry| (place, entry.0)));
                }
                ends.push(entries.len());
            }
            let mut separated = each_separated(&asked).into_iter();
            let mut start = 0;
            for &end in ends.iter() {
                let row = &mut entries[start..end];
                start = end;
                let kept = keep(row, |j| is_near(j) && separated.next().unwrap_or(false));
                rows.push(kept);
            }
        },
    )
}

/// Moves the entries of a row that no surface separates from it to its front and scales them to a sum of 1; all as they were, where none is left.
fn keep(row: &mut [(u32, f32)], mut is_separated: impl FnMut(u32) -> bool) -> &mut [(u32, f32)] {
    let mut kept = 0;
    let mut sum = 0.0;
    for at in 0..row.len() {
        if !is_separated(row[at].0) {
            sum += row[at].1;
            row.swap(kept, at);
            kept += 1;
        }
    }
    if kept == row.len() || sum <= 0.0 {
        return row;
    }
    row[..kept].iter_mut().for_each(|entry| entry.1 /= sum);
    &mut row[..kept]
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
    let kept = keep(&mut row[first..], |j| near(j) && is_separated(place, j)).len();
    row.truncate(first + kept);
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

/// RGB irradiance for each pixel from `values` of the finest points. Below zero where a shading normal turns away from most of
/// the light that the points have: vector irradiance holds no more of it (docs/notebook/transfer.md, "Light adds up").
pub fn irradiance(weights: &SparseMatrix, components: &[Vec3], values: &[VectorIrradiance]) -> Vec<Vec3> {
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
            Vec3::from(sum)
        })
        .collect()
}
