//! Irradiance at surface places from values at the finest points.
//!
//! Source: Lehtinen et al. 2008, equations 1 and 4.1 (flat basis for display), vector irradiance dotted with
//! the shading normal, so that normal maps work.

use crate::separated::Separated;
use glam::{Vec3, Vec3A};
use rayon::prelude::*;
use relight_render::watch::Watch;
use relight_transport::basis::{FunctionsInOrder, Level};
use relight_transport::pyramid::{VectorIrradiance, carried_back};
use relight_transport::sparse::{SparseMatrix, build_runs, fill_rows, row};

/// A place, by position and smooth normal, and a finest point that covers it.
pub(crate) type Asked = ((Vec3, Vec3), u32);

/// The finest level's functions at each pixel's surface; empty rows where there is no surface. `places` has
/// position and smooth normal of each pixel.
///
/// A place that no function covers (a crevice that no candidate met) takes the nearest point that no surface separates from it, whatever
/// its normal, and failing that stays empty: the back of a sheet knows nothing of its front's light. Of several points that cover a place,
/// those that a surface separates from it count for nothing, as long as others are left: `each_separated` is asked of many places at a
/// time, about those alone that are `separated` from others that cover the place. Rows from where on `watch` stops it stay empty.
pub(crate) fn weights_at(
    finest: &Level,
    places: &[Option<(Vec3, Vec3)>],
    separated: &Separated,
    each_separated: impl Fn(&[Asked]) -> Vec<bool> + Sync,
    watch: &dyn Watch,
) -> SparseMatrix {
    let rows_in_order = || RowsInOrder {
        functions: FunctionsInOrder::new(finest),
        covering: Covering::of(finest.len()),
        entries: Vec::new(),
        ends: Vec::new(),
        asked: Vec::new(),
    };
    build_runs(places.len(), finest.len(), rows_in_order, |run_of, run, rows| {
        let RowsInOrder {
            functions,
            covering,
            entries,
            ends,
            asked,
        } = run_of;
        entries.clear();
        ends.clear();
        asked.clear();
        let goes_on = !watch.stopped();
        for place in &places[run] {
            let first = entries.len();
            if let Some(place) = place.filter(|_| goes_on) {
                let is_separated = |point| each_separated(&[(place, point)]).contains(&true);
                functions.functions_or_nearest_at(place.0, place.1, is_separated, entries);
                let in_doubt = covering.in_doubt(&entries[first..], separated);
                asked.extend(in_doubt.map(|at| (first + at, (place, entries[first + at].0))));
            }
            ends.push(entries.len());
        }
        let questions: Vec<Asked> = asked.iter().map(|asked| asked.1).collect();
        let answers = each_separated(&questions);
        let mut beyond = asked.iter().zip(answers).filter(|(_, beyond)| *beyond).peekable();
        let mut start = 0;
        for &end in ends.iter() {
            let at = |k: usize| start + k;
            let kept = keep(&mut entries[start..end], |k| {
                beyond.next_if(|((asked, _), _)| *asked == at(k)).is_some()
            });
            rows.push(kept);
            start = end;
        }
    })
}

/// What runs of rows of [`weights_at`] share.
struct RowsInOrder<'a> {
    functions: FunctionsInOrder<'a>,
    covering: Covering,
    /// Entries of the rows of a run, and the end of each.
    entries: Vec<(u32, f32)>,
    ends: Vec<usize>,
    /// Those of them that are in doubt, with their places and points.
    asked: Vec<(usize, Asked)>,
}

/// Which points cover the place that is looked at.
struct Covering {
    /// Of each point the last place that it covered.
    place_of: Vec<u32>,
    place: u32,
}

impl Covering {
    fn of(points: usize) -> Covering {
        Covering {
            place_of: vec![0; points],
            place: 0,
        }
    }

    /// Entries of the next row whose points are separated from others of the row.
    fn in_doubt<'a>(
        &'a mut self,
        row: &'a [(u32, f32)],
        separated: &'a Separated,
    ) -> impl Iterator<Item = usize> + 'a {
        self.place += 1;
        for entry in row {
            self.place_of[entry.0 as usize] = self.place;
        }
        let covers = |point: &u32| self.place_of[*point as usize] == self.place;
        let is_in_doubt = move |point: u32| separated.from(point).iter().any(covers);
        (row.iter().enumerate())
            .filter(move |(_, entry)| is_in_doubt(entry.0))
            .map(|(at, _)| at)
    }
}

/// Moves the entries of a row that are not `beyond` a wall to its front and scales them to a sum of 1; all as they were, where none is left.
fn keep(row: &mut [(u32, f32)], mut beyond: impl FnMut(usize) -> bool) -> &mut [(u32, f32)] {
    let mut kept = 0;
    let mut sum = 0.0;
    for at in 0..row.len() {
        if !beyond(at) {
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
    separated: &Separated,
    is_separated: impl Fn((Vec3, Vec3), u32) -> bool,
    row: &mut Vec<(u32, f32)>,
) {
    let first = row.len();
    functions.functions_or_nearest_at(place.0, place.1, |point| is_separated(place, point), row);
    let points: Vec<u32> = row[first..].iter().map(|entry| entry.0).collect();
    let is_in_doubt = |point: u32| separated.from(point).iter().any(|other| points.contains(other));
    let beyond = |at: usize| is_in_doubt(points[at]) && is_separated(place, points[at]);
    let kept = keep(&mut row[first..], beyond).len();
    row.truncate(first + kept);
}

/// Weights of the pixels' rows on the components of vector irradiance: row weight times what the shading normal
/// takes of each point's value once that is carried to the pixel. Same layout as the rows' entries.
pub fn components(weights: &SparseMatrix, finest: &Level, normals: &[(Vec3, Vec3)]) -> Vec<Vec3> {
    // By all cores: of a large image they are hundreds of megabytes, which the system hands out as they are written.
    let mut components: Vec<Vec3> = (0..weights.nnz()).into_par_iter().map(|_| Vec3::ZERO).collect();
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
