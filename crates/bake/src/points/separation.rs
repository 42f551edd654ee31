//! Which points surfaces separate from each other: what may not be interpolated between.

use glam::Vec3;
use rayon::prelude::*;
use relight_scene::separation::{Pair, are_separated};
use relight_scene::surface::Surfaces;
use relight_transport::basis::{Level, NearestPoint};
use relight_transport::pyramid::{LevelRanges, fine_from_coarse};
use relight_transport::sparse::SparseMatrix;
use std::sync::Mutex;

/// Points that surfaces separate from their neighbours.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Separations {
    /// Points and points of coarser levels that would be their parents, numbered over all levels; ascending.
    pub pairs: Vec<[u32; 2]>,
    /// Of each finest point, whether a surface separates it from another whose function it lies in.
    pub near: Vec<bool>,
}

/// Finds them, and the parents that are left (see [`fine_from_coarse`]).
pub fn find(surfaces: &dyn Surfaces, levels: &[Level]) -> (Separations, SparseMatrix) {
    let finest = levels.last().map_or(0.0, |finest| finest.disk_radius);
    let widths: Vec<f32> = (levels.iter())
        .flat_map(|level| (0..level.len()).map(|i| level.disk_radius_of(i) / level.disk_radius))
        .collect();
    let places: Vec<_> = levels
        .iter()
        .flat_map(|level| level.positions.iter().copied().zip(level.normals.iter().copied()))
        .collect();
    let separated = |a: usize, b: usize| {
        let pair = Pair {
            from: places[a],
            to: places[b],
            scale: finest * widths[b],
            own: finest * widths[a],
        };
        are_separated(surfaces, &pair)
    };
    let pairs = Mutex::new(Vec::new());
    let rows = fine_from_coarse(levels, |point, parent| {
        let separated = separated(point as usize, parent as usize);
        if separated && let Ok(mut pairs) = pairs.lock() {
            pairs.push([point, parent]);
        }
        separated
    });
    let mut pairs = pairs.into_inner().unwrap_or_default();
    pairs.sort_unstable();
    (
        Separations {
            pairs,
            near: near(levels, separated),
        },
        rows,
    )
}

/// `nearest`, the finest point nearest to a place (position, normal), or the next one on the place's side of all walls, if there is one.
/// `near`: [`Separations::near`].
#[inline]
pub fn on_same_side(
    surfaces: &dyn Surfaces,
    points: &NearestPoint,
    near: &[bool],
    place: (Vec3, Vec3),
    nearest: u32,
) -> u32 {
    let level = points.level;
    let separated = |point: u32| {
        let point = point as usize;
        let pair = Pair {
            from: place,
            to: (level.positions[point], level.normals[point]),
            scale: level.disk_radius_of(point),
            own: level.disk_radius,
        };
        are_separated(surfaces, &pair)
    };
    points.on_same_side(place, nearest, near, separated)
}

/// `separated` of two points, numbered over all levels.
fn near(levels: &[Level], separated: impl Fn(usize, usize) -> bool + Sync) -> Vec<bool> {
    let Some(finest) = levels.last() else {
        return Vec::new();
    };
    let first = LevelRanges::new(levels.iter().map(Level::len))
        .range(levels.len() - 1)
        .start;
    let around = finest.across_walls();
    let neighbours: Vec<Vec<u32>> = (0..finest.len())
        .into_par_iter()
        .with_min_len(256)
        .map(|i| {
            let mut found = Vec::new();
            // Each pair once; a wider point's function alone may reach the other.
            around.weights_at(finest.positions[i], finest.normals[i], |j, _| {
                let j_is_wider = finest.disk_radius_of(j as usize) > finest.disk_radius_of(i);
                if (j_is_wider || (j as usize) < i) && separated(first + i, first + j as usize) {
                    found.push(j);
                }
            });
            found
        })
        .collect();
    let mut near = vec![false; finest.len()];
    for (i, found) in neighbours.iter().enumerate() {
        near[i] |= !found.is_empty();
        found.iter().for_each(|&j| near[j as usize] = true);
    }
    near
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use relight_scene::implicit::{ImplicitSurface, Sdf};
    use relight_transport::sparse::row;

    #[test]
    fn no_point_has_parents_behind_a_wall() {
        // A floor with points 0.1 and 0.05 apart, and a wall of 2 mm between x < 0 and x > 0.
        let wall = Sdf::Ellipsoid {
            center: DVec3::ZERO,
            radii: DVec3::new(0.001, 1.0, 5.0),
        };
        let wall = ImplicitSurface::new(wall, (Vec3::splat(-5.0), Vec3::splat(5.0)), Vec3::ONE);
        let levels: Vec<Level> = [0.1f32, 0.05]
            .map(|distance| {
                let places: Vec<Vec3> = (-10..10)
                    .flat_map(|i| (-10..10).map(move |j| (i, j)))
                    .map(|(i, j)| Vec3::new(i as f32 + 0.5, 0.0, j as f32) * distance)
                    .collect();
                let normals = vec![Vec3::Y; places.len()];
                Level::new(places, normals, distance, 2.0 * distance)
            })
            .to_vec();
        let (separations, rows) = find(&wall, &levels);
        let places: Vec<Vec3> = levels.iter().flat_map(|l| l.positions.iter().copied()).collect();
        let behind = |a: usize, b: usize| places[a].x * places[b].x < 0.0;
        assert!(
            separations
                .pairs
                .iter()
                .all(|pair| behind(pair[0] as usize, pair[1] as usize))
        );
        assert!(separations.pairs.is_sorted(), "a reader looks pairs up");
        let without = fine_from_coarse(&levels, |_, _| false);
        let mut leaks = 0;
        for i in 0..places.len() {
            assert!(row(&rows, i).all(|e| !behind(i, e.0 as usize)));
            assert!(
                (row(&rows, i).len() == 0) == (row(&without, i).len() == 0),
                "each keeps some parents"
            );
            leaks += row(&without, i).filter(|e| behind(i, e.0 as usize)).count();
        }
        assert_eq!(separations.pairs.len(), leaks);
        assert!(leaks > 20, "{leaks}");
        // Neighbours end at three distances.
        for (place, near) in levels[1].positions.iter().zip(&separations.near) {
            assert_eq!(*near, place.x.abs() < 0.1, "{place}");
        }
    }
}
