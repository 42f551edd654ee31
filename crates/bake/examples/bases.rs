//! What bases for light on surfaces do at a thin wall and at shadow edges (Lehtinen et al. 2008, section 5.2):
//! the command behind docs/notebook/bases.md.
//!
//! `cargo run --release -p relight-bake --example bases`, in the repository root.

#[path = "radiosity/point_light.rs"]
mod point_light;

use glam::{Vec2, Vec3};
use point_light::from_point_light;
use rayon::prelude::*;
use relight_bake::points::candidates::{self, Candidate};
use relight_bake::points::poisson::distribute;
use relight_bake::points::poisson::levels_of;
use relight_bake::units::Units;
use relight_scene::gltf::{ImportOptions, import};
use relight_scene::rays::Ray;
use relight_scene::surface::Surfaces;
use relight_scene::traced::{Shading, TracedScene};
use relight_transport::basis::{Level, NearestPoint};
use relight_transport::random::Stream;
use relight_transport::sampling::{Frame, cosine_hemisphere};
use relight_transport::senders::{PILOTS, Signed, nearest_seeds};
use relight_transport::sparse::{SparseMatrix, build, normalise, row};
use std::error::Error;
use std::path::Path;
use std::sync::Arc;

/// Levels, and the coarsest one's disk radius in metres: 0.8 m to 5 cm in rooms of 4 m, with a wall of 2 cm.
const LEVELS: usize = 5;
const COARSE_RADIUS: f32 = 0.8;
/// The lamp of data/two_rooms_far.lights.json.
const LAMP: Vec3 = Vec3::new(2.0, 2.2, 0.6);
/// Particles whose landings are the places where fields are compared.
const PARTICLES: usize = 2000;
/// Half the wall's thickness with a margin: what lies within is a jamb of the door and belongs to neither room.
const JAMB: f32 = 0.012;

/// Everything that the bases are built on.
struct Study {
    levels: Vec<Level>,
    /// Per level which pilots each point sees.
    seen: Vec<Vec<Signed>>,
    places: Vec<Candidate>,
    place_seen: Vec<Signed>,
}

fn main() -> Result<(), Box<dyn Error>> {
    let scene = Arc::new(import(
        Path::new("data/two_rooms.glb"),
        &ImportOptions::default(),
    )?);
    let traced = TracedScene::new(scene.clone(), Shading::Lambert)?;
    let eyes: Vec<Vec3> = scene.cameras.iter().map(|c| c.at(0.0).position).collect();
    let points = distribute(
        &traced,
        &eyes,
        LEVELS,
        COARSE_RADIUS,
        0,
        Units::none(),
        |_| Ok(()),
    )?;
    // Another seed than the points', or places would be points.
    let (landings, _) = candidates::trace(&traced, &eyes, 1, 0, PARTICLES, 0.0);
    let places: Vec<Candidate> = landings
        .iter()
        .map(|hit| Candidate::at(&traced, hit))
        .filter(|p| p.position.x.abs() > JAMB || p.normal.x.abs() > 0.5)
        .collect();
    let finest = &points.levels[LEVELS - 1].points;
    let pilots = pilots(&traced, finest);
    let study = Study {
        levels: levels_of(&points),
        seen: points
            .levels
            .iter()
            .map(|l| signed(&traced, &l.points, &pilots))
            .collect(),
        place_seen: signed(&traced, &places, &pilots),
        places,
    };
    let counts: Vec<usize> = study.levels.iter().map(Level::len).collect();
    println!("points {counts:?}, compared at {} places\n", study.places.len());
    let room = |p: &Candidate| if p.origin.x > 0.0 { 1.0f32 } else { 0.0 };
    let lamp = |p: &Candidate| from_point_light(&traced, p, LAMP, Vec3::ONE).x;
    for (name, field) in [
        (
            "far room 1, near room 0",
            &room as &(dyn Fn(&Candidate) -> f32 + Sync),
        ),
        ("direct light of a lamp in the far room", &lamp),
    ] {
        let at_points: Vec<Vec<f32>> = points
            .levels
            .iter()
            .map(|l| l.points.par_iter().map(field).collect())
            .collect();
        let truth: Vec<f32> = study.places.par_iter().map(field).collect();
        let header: String = (0..LEVELS).map(|l| format!(" 0–{l} |")).collect();
        println!("| {name} | |{header}\n| --- | --- |{}", " --- |".repeat(LEVELS));
        for (basis, results) in [
            ("Shepard, sampled, flattened", sampled(&study, &at_points)),
            ("Shepard, sampled, summed (eq. 5)", summed(&study, &at_points)),
            (
                "Shepard, averaged",
                averaged(&study, &at_points[LEVELS - 1], shepard),
            ),
            (
                "nearest point, averaged",
                averaged(&study, &at_points[LEVELS - 1], nearest),
            ),
            (
                "nearest alike in sight, averaged",
                averaged(&study, &at_points[LEVELS - 1], alike),
            ),
        ] {
            let measured: Vec<[f64; 5]> = results
                .iter()
                .map(|values| measures(&study.places, &truth, values))
                .collect();
            for (i, measure) in MEASURES.iter().enumerate() {
                let row: String = measured.iter().map(|m| format!(" {:.2} |", m[i])).collect();
                println!("| {basis} | {measure} |{row}");
            }
        }
        println!();
    }
    Ok(())
}

fn rows_at(level: &Level, places: &[(Vec3, Vec3)]) -> SparseMatrix {
    build(places.len(), level.len(), |i, row| {
        level.functions_or_nearest_at(places[i].0, places[i].1, row);
    })
}

fn apply(rows: &SparseMatrix, values: &[f32]) -> Vec<f32> {
    (0..rows.rows())
        .map(|i| row(rows, i).map(|(j, w)| values[j as usize] * w).sum())
        .collect()
}

fn oriented(study: &Study) -> Vec<(Vec3, Vec3)> {
    study.places.iter().map(|p| (p.position, p.normal)).collect()
}

fn oriented_points(level: &Level) -> Vec<(Vec3, Vec3)> {
    level
        .positions
        .iter()
        .copied()
        .zip(level.normals.iter().copied())
        .collect()
}

/// Each level interpolates its own samples: what relight's receivers are displayed with.
fn sampled(study: &Study, at_points: &[Vec<f32>]) -> Vec<Vec<f32>> {
    let places = oriented(study);
    study
        .levels
        .iter()
        .zip(at_points)
        .map(|(level, f)| apply(&rows_at(level, &places), f))
        .collect()
}

/// Equations 4 and 5 as printed: at every place the sum of all levels' contributions.
fn summed(study: &Study, at_points: &[Vec<f32>]) -> Vec<Vec<f32>> {
    let places = oriented(study);
    let mut coefficients: Vec<Vec<f32>> = Vec::new();
    let mut sums: Vec<Vec<f32>> = Vec::new();
    for (l, level) in study.levels.iter().enumerate() {
        let mut own = at_points[l].clone();
        let points = oriented_points(level);
        for (coarse, c) in study.levels[..l].iter().zip(&coefficients) {
            own.iter_mut()
                .zip(apply(&rows_at(coarse, &points), c))
                .for_each(|(a, b)| *a -= b);
        }
        let mut sum = apply(&rows_at(level, &places), &own);
        if let Some(before) = sums.last() {
            sum.iter_mut().zip(before).for_each(|(a, b)| *a += b);
        }
        coefficients.push(own);
        sums.push(sum);
    }
    sums
}

/// Weights of one level's functions at the finest points and at the places.
type Weights = fn(&Study, usize) -> (SparseMatrix, SparseMatrix);

/// Each function takes the mean of the finest points under it and gives it back with the same weights: senders.
fn averaged(study: &Study, at_finest: &[f32], weights: Weights) -> Vec<Vec<f32>> {
    (0..LEVELS)
        .map(|l| {
            let (at_points, at_places) = weights(study, l);
            let mut below = at_points.transpose_view().to_csr();
            normalise(&mut below);
            apply(&at_places, &apply(&below, at_finest))
        })
        .collect()
}

fn shepard(study: &Study, l: usize) -> (SparseMatrix, SparseMatrix) {
    let level = &study.levels[l];
    (
        rows_at(level, &oriented_points(&study.levels[LEVELS - 1])),
        rows_at(level, &oriented(study)),
    )
}

fn nearest(study: &Study, l: usize) -> (SparseMatrix, SparseMatrix) {
    let level = &study.levels[l];
    let nearest = NearestPoint::new(level);
    let rows = |places: Vec<(Vec3, Vec3)>| {
        build(places.len(), level.len(), |i, row| {
            row.extend(nearest.at(places[i].0, places[i].1).map(|j| (j, 1.0)));
        })
    };
    (
        rows(oriented_points(&study.levels[LEVELS - 1])),
        rows(oriented(study)),
    )
}

fn alike(study: &Study, l: usize) -> (SparseMatrix, SparseMatrix) {
    let level = &study.levels[l];
    let rows = |places: &[Signed]| {
        let of = nearest_seeds(places, &study.seen[l], level.disk_radius);
        build(places.len(), level.len(), |i, row| row.push((of[i], 1.0)))
    };
    (rows(&study.seen[LEVELS - 1]), rows(&study.place_seen))
}

const MEASURES: [&str; 5] = ["leak %", "on the wall %", "negative %", "least %", "error %"];

/// Leak: light put into the near room where there is none, of all light, and the part of it on the wall itself.
/// Negative: the sum of what is below 0, of all light. Least: the lowest value, of the highest true one.
/// Error: root mean square of the difference over that of the truth.
fn measures(places: &[Candidate], truth: &[f32], values: &[f32]) -> [f64; 5] {
    let sum = |f: &dyn Fn(usize) -> f64| (0..truth.len()).map(f).sum::<f64>();
    let all = sum(&|i| f64::from(truth[i]));
    let dark_near = |i: usize| truth[i] == 0.0 && places[i].origin.x < 0.0;
    let on_wall = |i: usize| places[i].position.x > -JAMB && places[i].normal.x < -0.5;
    let leaked = |i: usize| {
        if dark_near(i) {
            f64::from(values[i].max(0.0))
        } else {
            0.0
        }
    };
    let highest = truth.iter().copied().fold(0.0f32, f32::max);
    let least = values.iter().copied().fold(0.0f32, f32::min);
    let squares = sum(&|i| f64::from(values[i] - truth[i]).powi(2)) / sum(&|i| f64::from(truth[i]).powi(2));
    [
        sum(&leaked) / all,
        sum(&|i| if on_wall(i) { leaked(i) } else { 0.0 }) / all,
        sum(&|i| f64::from((-values[i]).max(0.0))) / all,
        f64::from(least / highest),
        squares.sqrt(),
    ]
    // Plus zero: no −0 in the table.
    .map(|share| 100.0 * share + 0.0)
}

/// Places in open space, on straight ways between surfaces.
fn pilots(surfaces: &dyn Surfaces, places: &[Candidate]) -> Vec<Vec3> {
    (0..PILOTS)
        .map(|i| {
            let mut s = Stream::new(0, 100, i as u64);
            let place = &places[((s.uniform() * places.len() as f32) as usize).min(places.len() - 1)];
            let direction = Frame::around(place.geometric_normal)
                .world_from_local(cosine_hemisphere(Vec2::new(s.uniform(), s.uniform())));
            let ray = Ray {
                origin: place.origin,
                direction,
                t_min: 0.0,
                t_max: f32::INFINITY,
            };
            place.origin + direction * surfaces.closest_hit(&ray).map_or(1.0, |hit| hit.t) * s.uniform()
        })
        .collect()
}

fn signed(surfaces: &dyn Surfaces, places: &[Candidate], pilots: &[Vec3]) -> Vec<Signed> {
    let sees = |place: &Candidate, pilot: Vec3| {
        let way = pilot - place.origin;
        let ray = Ray {
            origin: place.origin,
            direction: way,
            t_min: 0.0,
            t_max: 1.0,
        };
        way.dot(place.geometric_normal) > 0.0 && !surfaces.occluded(&ray)
    };
    places
        .par_iter()
        .map(|place| Signed {
            position: place.position,
            normal: place.normal,
            signature: pilots
                .iter()
                .rev()
                .fold(0, |bits, &pilot| bits << 1 | u128::from(sees(place, pilot))),
        })
        .collect()
}
