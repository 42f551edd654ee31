//! The asset's points as virtual lights: what reaches them directly, and by all bounces of the operators, they pass on.
//!
//! Virtual lights after Walter et al. 2005, section 5, at places that stand still, with the light that transfer (Lehtinen et al. 2008) finds
//! there. No particle is traced for them, and indirect light does not flicker by where particles happen to land.

use crate::spread::own_places;
use crate::transfer::Transfer;
use glam::Vec3;
use rayon::prelude::*;
use relight_render::lightcuts::diagonal;
use relight_render::many_lights::{Stand, StandingLights};
use relight_scene::surface::{SurfaceHit, Surfaces, ray_end};
use relight_scene::traced::TracedScene;
use relight_transport::basis::NearestPoint;
use relight_transport::point_light::Patch;
use std::f32::consts::{FRAC_1_PI, PI};
use std::sync::{Arc, Mutex, PoisonError};

/// Places on a point's disk by which its area is measured: to some tenth each, which evens out over all.
const LOOKED_AT: usize = 32;

/// Half of a patch's thinner side, in roots of its area.
const THINNEST: f32 = 0.125;

/// Virtual lights at the points of an asset; made when they are first asked for, and kept until another number is.
#[derive(Debug, Default)]
pub struct VirtualPoints(Mutex<Option<(usize, Arc<PointSets>)>>);

/// Virtual lights, each for a set of points.
#[derive(Debug)]
pub struct PointSets {
    /// Where.
    pub lights: StandingLights,
    /// Points of each light with the area, m², that it has of each.
    sets: Vec<Vec<(u32, f32)>>,
}

impl VirtualPoints {
    /// Virtual lights for all points, at most `most` together.
    pub fn get(
        &self,
        scene: &TracedScene,
        transfer: &Transfer,
        points: &[Option<SurfaceHit>],
        most: usize,
    ) -> Arc<PointSets> {
        let mut kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, sets)) = kept.as_ref().filter(|(of, _)| *of == most) {
            return Arc::clone(sets);
        }
        let sets = Arc::new(PointSets::new(scene, transfer, points, most));
        *kept = Some((most, Arc::clone(&sets)));
        sets
    }
}

/// Some of a point's surface: all of it, or a quarter of that of a point that stands for more than others.
struct Cell {
    point: u32,
    /// Spread evenly over it; one or more.
    places: Vec<SurfaceHit>,
    /// m².
    area: f32,
}

impl PointSets {
    fn new(
        scene: &TracedScene,
        transfer: &Transfer,
        points: &[Option<SurfaceHit>],
        most: usize,
    ) -> PointSets {
        let nearest = NearestPoint::new(&transfer.finest);
        let cells: Vec<Cell> = (points.par_iter().enumerate())
            .with_min_len(64)
            .flat_map_iter(|(point, hit)| {
                hit.map_or(Vec::new(), |hit| cells_of(scene, &nearest, &hit, point))
            })
            .collect();
        let each: Vec<Stand> = cells.par_iter().map(|cell| stand(&[cell])).collect();
        let of = |cell: &Cell| (cell.point, cell.area);
        let diagonal = diagonal(scene);
        let lights = StandingLights::new(&each, diagonal);
        if cells.len() <= most {
            let sets = cells.iter().map(|cell| vec![of(cell)]).collect();
            return PointSets { lights, sets };
        }
        let sets = lights.sets(most);
        let stands: Vec<Stand> = (sets.par_iter())
            .map(|set| stand(&set.iter().map(|&i| &cells[i as usize]).collect::<Vec<_>>()))
            .collect();
        PointSets {
            lights: StandingLights::new(&stands, diagonal),
            sets: (sets.iter())
                .map(|set| set.iter().map(|&i| of(&cells[i as usize])).collect())
                .collect(),
        }
    }

    /// Intensities of the lights, W/sr along their normals, from the radiosity of the points, W/m².
    pub fn intensities(&self, radiosity: &[Vec3]) -> Vec<Vec3> {
        (self.sets.iter())
            .map(|set| {
                let flux: Vec3 = (set.iter())
                    .map(|&(point, area)| radiosity[point as usize].max(Vec3::ZERO) * area)
                    .sum();
                flux * FRAC_1_PI
            })
            .collect()
    }
}

/// A point's surface.
fn cells_of(surfaces: &dyn Surfaces, nearest: &NearestPoint, hit: &SurfaceHit, point: usize) -> Vec<Cell> {
    let radius = nearest.level.disk_radius_of(point);
    let each = PI * radius * radius / LOOKED_AT as f32;
    let normal = hit.geometric_normal;
    let mut found: Vec<SurfaceHit> = own_places(surfaces, nearest, hit, point, LOOKED_AT, 0).collect();
    if found.is_empty() {
        found.push(*hit);
    }
    let quarters = nearest.level.widenings.get(point).is_some_and(|&k| k > 0);
    let (u, v) = normal.any_orthonormal_pair();
    let mut cells: [Vec<SurfaceHit>; 4] = Default::default();
    for place in found {
        let aside = place.position - hit.position;
        let quarter = usize::from(aside.dot(u) > 0.0) + 2 * usize::from(aside.dot(v) > 0.0);
        cells[if quarters { quarter } else { 0 }].push(place);
    }
    (cells.into_iter())
        .filter(|places| !places.is_empty())
        .map(|places| Cell {
            point: point as u32,
            area: (places.iter())
                .map(|place| each / place.geometric_normal.dot(normal).abs())
                .sum(),
            places,
        })
        .collect()
}

/// A virtual light for cells: on the place nearest to their middle, with a rectangle that spreads as far as they do.
fn stand(cells: &[&Cell]) -> Stand {
    let places = || {
        cells.iter().flat_map(|cell| {
            let share = cell.area / cell.places.len() as f32;
            cell.places.iter().map(move |place| (place, share))
        })
    };
    let area: f32 = cells.iter().map(|cell| cell.area).sum();
    let middle = places()
        .map(|(place, share)| place.position * share)
        .sum::<Vec3>()
        / area;
    let off = |place: &SurfaceHit| place.position.distance_squared(middle);
    let nearest = places().fold(&cells[0].places[0], |best, (place, _)| {
        if off(place) < off(best) { place } else { best }
    });
    let end = ray_end(nearest);
    let (u, v) = end.normal.any_orthonormal_pair();
    // The spread across the normal, and its axes.
    let (mut uu, mut uv, mut vv) = (0.0, 0.0, 0.0);
    for (place, share) in places() {
        let aside = place.position - middle;
        let (a, b) = (aside.dot(u), aside.dot(v));
        uu += share * a * a / area;
        uv += share * a * b / area;
        vv += share * b * b / area;
    }
    let (sin, cos) = (0.5 * (2.0 * uv).atan2(uu - vv)).sin_cos();
    let along = uu * cos * cos + 2.0 * uv * sin * cos + vv * sin * sin;
    // A rectangle's variance along a side is a third of its half's square. Few places may lie in a line.
    let half = |variance: f32| (3.0 * variance).sqrt().max(THINNEST * area.sqrt());
    let aside = middle - end.position;
    Stand {
        end,
        patch: Patch {
            middle: aside - end.normal * aside.dot(end.normal),
            halves: [
                (u * cos + v * sin) * half(along),
                (v * cos - u * sin) * half((uu + vv - along).max(0.0)),
            ],
        },
        area,
    }
}
