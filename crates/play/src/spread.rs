//! Direct light of points that stand for more surface than their level's others: the mean over places that are spread over it.
//!
//! Points are far apart where indirect light changes slowly, but an edge of a shadow may cross their surfaces anywhere. So each is lit at as
//! many places as finest points would be there.

use glam::{Vec2, Vec3};
use rayon::prelude::*;
use relight_scene::rays::Ray;
use relight_scene::surface::{SurfaceHit, Surfaces, ray_from};
use relight_transport::basis::{Level, NearestPoint};
use relight_transport::sampling::Frame;

/// Most places of a point: those of 2³ times the radius.
const MOST: usize = 64;

/// Places that are looked at for each that is wanted. All that a point of a maximal set stands for is within its disk, whose area is
/// 0.70·π times that (Lagae and Dutré 2008: 0.70 points for each squared radius).
const LOOKED_AT: f32 = 2.2;

/// How far above and below the point's plane its surface is looked for, as a share of the way there.
const HEIGHT: f32 = 0.25;

/// Cosine between normals from which on a place belongs to its point.
const FACING: f32 = 0.7;

/// Places at which points are lit.
#[derive(Clone, Debug, Default)]
pub struct PointPlaces {
    /// All places, point by point; the point's own is the first of each.
    pub hits: Vec<Option<SurfaceHit>>,
    /// Start of each point's places, and the end of the last; empty where each point has one.
    offsets: Vec<u32>,
}

impl PointPlaces {
    /// Of points of a level that lie at `points`.
    pub fn new(surfaces: &dyn Surfaces, level: &Level, points: &[Option<SurfaceHit>]) -> PointPlaces {
        if level.widenings.iter().all(|&k| k == 0) {
            return PointPlaces {
                hits: points.to_vec(),
                offsets: Vec::new(),
            };
        }
        let nearest = NearestPoint::new(level);
        let around: Vec<Vec<SurfaceHit>> = (points.par_iter().enumerate())
            .with_min_len(64)
            .map(|(i, point)| {
                let wanted = 4usize.saturating_pow(level.widenings[i].into()).min(MOST);
                point.map_or(Vec::new(), |point| around(surfaces, &nearest, &point, i, wanted))
            })
            .collect();
        let mut places = PointPlaces {
            hits: Vec::new(),
            offsets: vec![0],
        };
        for (point, around) in points.iter().zip(around) {
            places.hits.push(*point);
            places.hits.extend(around.into_iter().map(Some));
            places.offsets.push(places.hits.len() as u32);
        }
        places
    }

    /// Number of points.
    pub fn points(&self) -> usize {
        match self.offsets.len() {
            0 => self.hits.len(),
            ends => ends - 1,
        }
    }

    /// Means over points' places of what is known at each.
    pub fn means(&self, of_places: Vec<Vec3>) -> Vec<Vec3> {
        if self.offsets.is_empty() {
            return of_places;
        }
        (self.offsets.windows(2))
            .map(|ends| {
                let own = &of_places[ends[0] as usize..ends[1] as usize];
                own.iter().sum::<Vec3>() / own.len() as f32
            })
            .collect()
    }
}

/// Some `wanted` places to which point `number`, which lies at `point`, is nearest, on its own surface and within its reach.
fn around(
    surfaces: &dyn Surfaces,
    nearest: &NearestPoint,
    point: &SurfaceHit,
    number: usize,
    wanted: usize,
) -> Vec<SurfaceHit> {
    if wanted == 1 {
        return Vec::new();
    }
    let count = (wanted as f32 * LOOKED_AT) as usize;
    own_places(surfaces, nearest, point, number, count, 1).collect()
}

/// Those of `count` places spread evenly over a point's disk to which it is nearest, on its own surface; from number `first` on, outwards
/// from the middle.
pub(crate) fn own_places(
    surfaces: &dyn Surfaces,
    nearest: &NearestPoint,
    point: &SurfaceHit,
    number: usize,
    count: usize,
    first: usize,
) -> impl Iterator<Item = SurfaceHit> {
    let normal = point.geometric_normal;
    let frame = Frame::around(normal);
    let reach = nearest.level.disk_radius_of(number);
    (first..count).filter_map(move |k| {
        let offset = sunflower(k, count, number) * reach;
        let aside = frame.world_from_local(offset.extend(0.0));
        if nearest.at(point.position + aside, point.normal) != Some(number as u32) {
            return None;
        }
        let height = HEIGHT * offset.length();
        let across = frame.world_from_local(Vec3::new(offset.x, offset.y, height));
        let way = Ray {
            t_max: 1.0,
            ..ray_from(point, across)
        };
        if surfaces.closest_hit(&way).is_some() {
            return None;
        }
        let down = Ray {
            origin: way.origin + across,
            direction: -normal,
            t_min: 0.0,
            t_max: 2.0 * height,
        };
        (surfaces.closest_hit(&down)).filter(|hit| hit.geometric_normal.dot(normal) > FACING)
    })
}

/// Places spread evenly over the unit disk, turned for each point (Vogel 1979).
pub(crate) fn sunflower(k: usize, of: usize, point: usize) -> Vec2 {
    const GOLDEN: f32 = 2.399_963;
    let radius = ((k as f32 + 0.5) / of as f32).sqrt();
    Vec2::from_angle(GOLDEN * (k as f32 + point as f32)) * radius
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::{level, matt, traced};

    /// Truth: half of a floor is beyond a thin wall.
    #[test]
    fn a_wide_point_is_lit_where_its_surface_is_and_not_beyond_a_wall() {
        let mut wall = level(1.0, 0.0, 0);
        for p in &mut wall.positions {
            *p = Vec3::new(0.05, p.x, p.z);
        }
        let scene = traced(vec![level(1.0, 0.0, 0), wall], vec![matt(0.5, 0.0)]);
        let down = Ray {
            origin: Vec3::new(0.0, 0.3, 0.0),
            direction: Vec3::NEG_Y,
            t_min: 0.0,
            t_max: 1.0,
        };
        let point = scene.closest_hit(&down);
        let points = Level::widened(vec![Vec3::ZERO], vec![Vec3::Y], vec![2], 0.1, 0.2);
        let places = PointPlaces::new(&scene, &points, &[point]);
        assert_eq!(places.points(), 1);
        assert!((5..=20).contains(&places.hits.len()), "{}", places.hits.len());
        for hit in places.hits.iter().flatten() {
            assert!(hit.position.y.abs() < 1e-5 && hit.position.x < 0.05, "{hit:?}");
            assert!(hit.position.length() <= 0.4 + 1e-5);
        }
        let ones = vec![Vec3::ONE; places.hits.len()];
        assert!((places.means(ones)[0] - Vec3::ONE).length() < 1e-6);
    }
}
