//! What points reflect: the mean over the places for which each stands.
//!
//! A ray that ends anywhere takes the light of the nearest point. What that point lies on need not be what most rays meet around
//! it: small things of another colour have points of their own that stand for the wall around them, too, and of a texture a
//! point is one texel. So points reflect what their cells do in the mean over importance particles
//! (docs/notebook/openness.md: without, the first bounce of Crytek's Sponza is 1.8 % darker).
//!
//! Nothing else in a bake hangs on colours but a baked solution, so units of work hold none.

use crate::error::BakeError;
use crate::points::particles::walk;
use crate::points::relevance::Relevance;
use crate::points::separation::on_same_side;
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use relight_scene::surface::Surfaces;
use relight_transport::basis::NearestPoint;
use relight_transport::random::Stream;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};

/// Landings per finest point, in the mean: a cell's is known to a quarter of how much its places differ, for 1.6 % of the rays of Crytek's Sponza in
/// `draft` (docs/notebook/openness.md).
const LANDINGS_PER_POINT: usize = 16;

/// Most particles per finest point, of which most leave an open scene at once.
const MOST_PER_POINT: usize = 32;

/// Surfaces on which a particle lands: what is seen, and what lights that.
const LANDINGS: usize = 3;

/// Stage number of the random stream.
const STAGE: u32 = 14;

/// Particles between looks at whether there are enough: far less than a second, and as many as a small scene may have in any case.
const TOGETHER: usize = 1 << 14;

/// Units of a sum of reflectances: a power of two, so that those above 1/256 are exact, and so are sums, in whatever order. 2³² landings fit.
const UNITS: f64 = (1u64 << 32) as f64;

/// Mean reflectances of the cells of `finest`, whose points have `own` themselves, and the number of rays cast. `near_separated`:
/// [`Separations::near`](crate::points::separation::Separations::near).
///
/// # Errors
/// What `go_on` returns.
pub fn cell_reflectances(
    surfaces: &dyn Surfaces,
    finest: &NearestPoint,
    near_separated: &[bool],
    relevance: &Relevance,
    own: impl Iterator<Item = Vec3>,
    seed: u64,
    go_on: impl Fn() -> Result<(), BakeError>,
) -> Result<(Vec<Vec3>, u64), BakeError> {
    let sums = CellSums::new(finest.level.len());
    let particle = |number: usize| {
        let mut s = Stream::new(seed, STAGE, number as u64);
        let start = relevance.start(number as u64, &mut s);
        walk(surfaces, start, &mut s, LANDINGS, |_, hit, _| {
            let place = (hit.position, hit.normal);
            if let Some(nearest) = finest.at(place.0, place.1) {
                let point = on_same_side(surfaces, finest, near_separated, place, nearest);
                sums.landed(point as usize, surfaces.albedo(hit));
            }
            true
        })
    };
    let points = finest.level.len();
    let mut rays = 0;
    for first in (0..points * MOST_PER_POINT).step_by(TOGETHER) {
        go_on()?;
        let numbers = first..first + TOGETHER;
        rays += (numbers.into_par_iter().with_min_len(256).map(particle)).sum::<u64>();
        if sums.landings() >= points * LANDINGS_PER_POINT {
            break;
        }
    }
    Ok((sums.means(own), rays))
}

/// What landed on each point's cell.
struct CellSums {
    landings: Vec<AtomicU32>,
    /// Sums of reflectances, three channels each, in parts of 2⁻³².
    reflected: Vec<AtomicU64>,
}

impl CellSums {
    fn new(points: usize) -> CellSums {
        CellSums {
            landings: (0..points).map(|_| AtomicU32::new(0)).collect(),
            reflected: (0..3 * points).map(|_| AtomicU64::new(0)).collect(),
        }
    }

    fn landed(&self, point: usize, reflectance: Vec3) {
        self.landings[point].fetch_add(1, Ordering::Relaxed);
        let units = reflectance.clamp(Vec3::ZERO, Vec3::ONE).as_dvec3() * UNITS;
        for (sum, units) in self.reflected[3 * point..][..3].iter().zip(units.to_array()) {
            sum.fetch_add(units as u64, Ordering::Relaxed);
        }
    }

    /// Of all points.
    fn landings(&self) -> usize {
        let of_each = self.landings.iter();
        of_each.map(|n| n.load(Ordering::Relaxed) as usize).sum()
    }

    /// Means; a point's `own` counts as one place.
    fn means(self, own: impl Iterator<Item = Vec3>) -> Vec<Vec3> {
        let cells = self.landings.into_iter().zip(self.reflected.chunks_exact(3));
        (own.zip(cells))
            .map(|(own, (landings, sum))| {
                let sum = DVec3::from_array(std::array::from_fn(|c| sum[c].load(Ordering::Relaxed) as f64));
                ((sum / UNITS + own.as_dvec3()) / (f64::from(landings.into_inner()) + 1.0)).as_vec3()
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::hollow;
    use relight_transport::basis::Level;

    #[test]
    fn what_is_the_same_all_over_a_cell_is_its_mean_exactly_and_halves_are_a_half() {
        let sums = CellSums::new(3);
        let even = Vec3::new(0.999, 0.1, 0.5);
        (0..999).for_each(|_| sums.landed(0, even));
        for k in 0..7 {
            sums.landed(1, if k < 4 { Vec3::ONE } else { Vec3::ZERO });
        }
        let own = [even, Vec3::ZERO, Vec3::X];
        assert_eq!(sums.means(own.into_iter()), [even, Vec3::splat(0.5), Vec3::X]);
    }

    /// Truth: a ball that reflects 0.5 all over, whatever its points say: each counts as one of many places.
    #[test]
    fn points_that_reflect_otherwise_than_what_lies_around_them_are_taken_for_that() {
        let (ball, points) = hollow(0.5);
        let level = points.levels.last().unwrap();
        let positions: Vec<Vec3> = level.points.iter().map(|p| p.position).collect();
        let normals: Vec<Vec3> = level.points.iter().map(|p| p.normal).collect();
        let (count, disk) = (positions.len(), level.disk_radius);
        let level = Level::new(positions, normals, disk, 2.0 * disk);
        let means = |go_on: &dyn Fn() -> Result<(), BakeError>| {
            cell_reflectances(
                &ball,
                &NearestPoint::new(&level),
                &[],
                &Relevance::even(&[Vec3::ZERO]),
                std::iter::repeat_n(Vec3::ZERO, count),
                0,
                go_on,
            )
        };
        let (found, rays) = means(&|| Ok(())).unwrap();
        assert_eq!(rays as usize % (TOGETHER * LANDINGS), 0, "nothing leaves a ball");
        let mean = found.iter().map(|albedo| f64::from(albedo.x)).sum::<f64>() / count as f64;
        assert!((0.45..0.5).contains(&mean), "{mean}");
        assert!(found.iter().all(|albedo| albedo.x <= 0.5));
        assert!(matches!(
            means(&|| Err(BakeError::Stopped)),
            Err(BakeError::Stopped)
        ));
    }
}
