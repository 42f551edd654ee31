//! Which finest points walls separate from which of their neighbours.
//!
//! A wall between a place and a point that covers it has other points that cover the place on its own side of it, and separates the point
//! from those as well. So only where points that cover a place are separated from one another rays ask about the place itself.

use glam::Vec3;
use rayon::prelude::*;
use relight_scene::separation::{Pair, each_separated};
use relight_scene::surface::Surfaces;
use relight_transport::basis::Level;

/// Points that are separated, point by point.
#[derive(Clone, Debug, Default)]
pub(crate) struct Separated {
    /// Where each point's begin in `others`, and the last one's end; empty where there are none at all.
    offsets: Vec<u32>,
    others: Vec<u32>,
}

/// A place, by position and normal, of points that are `own` apart, m, and a point that something may separate it from.
pub(crate) fn pair_of(points: &Level, from: (Vec3, Vec3), own: f32, point: u32) -> Pair {
    let point = point as usize;
    Pair {
        from,
        to: (points.positions[point], points.normals[point]),
        scale: points.disk_radius_of(point),
        own,
    }
}

/// Points that are asked about together: their rays stay in fast memory.
const TOGETHER: usize = 256;

impl Separated {
    /// Asks about all neighbours among those points that are `near` a wall: of each point, or empty.
    pub fn find(surfaces: &dyn Surfaces, points: &Level, near: &[bool]) -> Separated {
        if !near.contains(&true) {
            return Separated::default();
        }
        let around = points.across_walls();
        let numbers: Vec<u32> = (0..points.len() as u32).collect();
        let found: Vec<Vec<[u32; 2]>> = (numbers.par_chunks(TOGETHER))
            .map(|numbers| {
                let (mut asked, mut pairs) = (Vec::new(), Vec::new());
                for &i in numbers.iter().filter(|&&i| near[i as usize]) {
                    let from = (points.positions[i as usize], points.normals[i as usize]);
                    let own = points.disk_radius_of(i as usize);
                    around.weights_at(from.0, from.1, |j, _| {
                        if j != i && near[j as usize] {
                            asked.push(pair_of(points, from, own, j));
                            pairs.push([i, j]);
                        }
                    });
                }
                let separated = pairs.into_iter().zip(each_separated(surfaces, &asked));
                (separated.filter(|pair| pair.1))
                    .flat_map(|([i, j], _)| [[i, j], [j, i]])
                    .collect()
            })
            .collect();
        let mut pairs = found.concat();
        pairs.par_sort_unstable();
        pairs.dedup();
        let mut offsets = vec![0; points.len() + 1];
        pairs.iter().for_each(|pair| offsets[pair[0] as usize + 1] += 1);
        for point in 0..points.len() {
            offsets[point + 1] += offsets[point];
        }
        Separated {
            offsets,
            others: pairs.into_iter().map(|pair| pair[1]).collect(),
        }
    }

    /// Points that one is separated from.
    #[inline]
    pub fn from(&self, point: u32) -> &[u32] {
        match self.offsets.get(point as usize..) {
            Some(&[start, end, ..]) => &self.others[start as usize..end as usize],
            _ => &[],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reconstruct::{Asked, weights_at};
    use glam::DVec3;
    use relight_scene::implicit::{ImplicitSurface, Sdf};
    use relight_transport::sparse::row;
    use std::sync::atomic::{AtomicUsize, Ordering};

    /// Distance of the points, m.
    const DISTANCE: f32 = 0.1;

    /// Truth: a wall of 2 mm across a floor, and which side of it points and places are on. Rays are asked near the wall alone.
    #[test]
    fn places_beside_a_wall_take_no_point_beyond_it_and_others_ask_no_ray() {
        let wall = Sdf::Ellipsoid {
            center: DVec3::ZERO,
            radii: DVec3::new(0.001, 1.0, 5.0),
        };
        let wall = ImplicitSurface::new(wall, (Vec3::splat(-5.0), Vec3::splat(5.0)), Vec3::ONE);
        let at = |i: i32| DISTANCE * (i as f32 + 0.4);
        let positions: Vec<Vec3> = (0..400)
            .map(|k| Vec3::new(at(k % 20 - 10), 0.0, at(k / 20 - 10)))
            .collect();
        let points = Level::new(positions, vec![Vec3::Y; 400], DISTANCE, 2.0 * DISTANCE);
        let separated = Separated::find(&wall, &points, &[true; 400]);
        let side = |x: Vec3| x.x > 0.0;
        let side_of = |point: u32| side(points.positions[point as usize]);
        let mut pairs = 0;
        for point in 0..400 {
            pairs += separated.from(point).len();
            assert!((separated.from(point).iter()).all(|&other| side_of(other) != side_of(point)));
        }
        assert!(pairs > 200, "{pairs}");
        let places: Vec<Option<(Vec3, Vec3)>> = (0..2000)
            .map(|k| 0.002 + 0.9 * ((k as f32 * 0.618_034) % 1.0))
            .zip((0..2000).map(|k| 0.9 - 1.8 * (k as f32 / 2000.0)))
            .map(|(x, z)| Some((Vec3::new(if z > 0.0 { x } else { -x }, 0.0, z), Vec3::Y)))
            .collect();
        let asked = AtomicUsize::new(0);
        let each_separated = |questions: &[Asked]| {
            asked.fetch_add(questions.len(), Ordering::Relaxed);
            (questions.iter())
                .map(|&((place, _), point)| {
                    assert!(place.x.abs() < 3.0 * DISTANCE, "{place} is far from the wall");
                    side(place) != side_of(point)
                })
                .collect()
        };
        let weights = weights_at(&points, &places, &separated, each_separated, &());
        for (k, place) in places.iter().enumerate() {
            let place = place.unwrap().0;
            assert!(
                row(&weights, k).all(|(point, _)| side_of(point) == side(place)),
                "{place}"
            );
            let sum: f32 = row(&weights, k).map(|entry| entry.1).sum();
            assert!((sum - 1.0).abs() < 1e-5, "{place}: {sum}");
        }
        assert!(asked.into_inner() > 500);
    }

    /// Truth: what the front of a sheet receives says nothing about its back.
    #[test]
    fn the_back_of_a_sheet_takes_no_point_of_its_front_and_a_gap_in_the_front_does() {
        let sheet = Sdf::Ellipsoid {
            center: DVec3::ZERO,
            radii: DVec3::new(2.0, 2.0, 0.0005),
        };
        let sheet = ImplicitSurface::new(sheet, (Vec3::splat(-2.0), Vec3::splat(2.0)), Vec3::ONE);
        let positions: Vec<Vec3> = (0..100)
            .map(|i| Vec3::new((i % 10) as f32 - 4.5, (i / 10) as f32 - 4.5, 0.01) * DISTANCE)
            .collect();
        let points = Level::new(positions, vec![Vec3::Z; 100], DISTANCE, 2.0 * DISTANCE);
        let each_separated = |questions: &[Asked]| {
            let pairs: Vec<Pair> = (questions.iter())
                .map(|&(place, point)| pair_of(&points, place, DISTANCE, point))
                .collect();
            each_separated(&sheet, &pairs)
        };
        let of = |place: (Vec3, Vec3)| {
            let weights = weights_at(
                &points,
                &[Some(place)],
                &Separated::default(),
                each_separated,
                &(),
            );
            row(&weights, 0).map(|entry| entry.1).sum::<f32>()
        };
        let at = |z: f32| Vec3::new(0.03, 0.02, z * 0.0005);
        assert!((of((at(1.0), Vec3::Z)) - 1.0).abs() < 1e-5);
        assert_eq!(of((at(-1.0), Vec3::NEG_Z)), 0.0);
        // A step in the front that has no points.
        assert_eq!(of((at(1.0), Vec3::X)), 1.0);
    }
}
