//! How much of the scene's surface the points cover.
//!
//! Surfaces that no importance reached get no points; what that leaves out is measured here
//! by surface samples, evenly by area.

use crate::points::candidates::Candidate;
use crate::points::poisson::{self, PointLevels};
use crate::points::relevance::Relevance;
use glam::Vec3;
use relight_scene::surface::SurfaceHit;
use relight_scene::traced::TracedScene;
use relight_transport::basis::{Level, NearestPoint};
use relight_transport::grid::morton_order;
use relight_transport::kernel::width;
use relight_transport::poisson::{Dart, Disks};
use relight_transport::random::Stream;

/// Surface samples: enough to see one per cent of the surface to within a tenth of itself.
const SAMPLES: u64 = 10_000;
/// Stage number of the random stream.
const STAGE: u32 = 10;

/// Area of the scene and how much of it has points on neither side.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Coverage {
    /// All triangles, m², cut-out parts not counted.
    pub area: f64,
    /// The part of `area` without points, m².
    pub uncovered: f64,
}

/// Places spread evenly over the area of all triangles.
struct Samples<'a> {
    scene: &'a TracedScene,
    /// Sums of the triangles' areas.
    sums: Vec<f64>,
}

impl<'a> Samples<'a> {
    /// `None` where there is no area.
    fn new(scene: &'a TracedScene) -> Option<Samples<'a>> {
        let mut sums = Vec::with_capacity(scene.triangle_count());
        let mut total = 0.0f64;
        for triangle in 0..scene.triangle_count() as u32 {
            total += f64::from(scene.triangle_area(triangle));
            sums.push(total);
        }
        (total > 0.0).then_some(Samples { scene, sums })
    }

    fn total(&self) -> f64 {
        self.sums.last().copied().unwrap_or(0.0)
    }

    /// The place at `at` of all area, 0 to 1; `None` in a hole of it.
    fn at(&self, at: f64, stream: &mut Stream, front: bool) -> Option<SurfaceHit> {
        let at = at * self.total();
        let triangle = self
            .sums
            .partition_point(|sum| *sum < at)
            .min(self.sums.len() - 1) as u32;
        let root = stream.uniform().sqrt();
        let v = stream.uniform() * root;
        let barycentric = [root - v, v];
        (self.scene.coverage(triangle, barycentric) > 0.0)
            .then(|| self.scene.surface_at(triangle, barycentric, front))
    }
}

/// Candidates per round, of which either half is on one side.
const ROUND: u64 = 16_384;
/// Rounds after which levels are taken as they are.
const MOST_ROUNDS: u64 = 1 << 12;
/// Stage number of the random stream.
const STAGE_EVERYWHERE: u32 = 11;

/// Adds points on all surfaces, both sides, that have none (`--keep points`); those that are there keep their places and
/// their order before the new ones.
pub fn everywhere(
    scene: &TracedScene,
    mut points: PointLevels,
    relevance: &Relevance,
    seed: u64,
) -> PointLevels {
    let Some(samples) = Samples::new(scene) else {
        return points;
    };
    let finest = points.levels.len().saturating_sub(1);
    let directions = poisson::crevice_directions(seed);
    let (mut disks, mut more): (Vec<Disks>, Vec<Vec<Candidate>>) = (points.levels.iter())
        .map(|level| {
            let darts: Vec<Dart> = (level.points.iter())
                .map(|p| Dart {
                    position: p.position,
                    normal: p.normal,
                    widening: p.widening,
                })
                .collect();
            let mut disks = Disks::new(level.disk_radius);
            disks.restore(darts.into_iter().map(|dart| (dart, 0)), 0);
            (disks, Vec::new())
        })
        .unzip();
    for round in 0..MOST_ROUNDS {
        if disks.iter().all(Disks::is_full) {
            break;
        }
        let batch: Vec<SurfaceHit> = (0..ROUND)
            .filter_map(|i| {
                let mut stream = Stream::new(seed, STAGE_EVERYWHERE, round * ROUND + i);
                let at = f64::from(stream.uniform());
                samples.at(at, &mut stream, i % 2 == 0)
            })
            .collect();
        let darts: Vec<Dart> = batch.iter().map(|hit| poisson::dart(relevance, hit)).collect();
        for (l, disks) in disks.iter_mut().enumerate() {
            let radius = disks.radius();
            let old = disks.candidates.len();
            disks.throw(&darts, 0, |i| {
                let radius = radius * width(darts[i].widening);
                l == finest || poisson::is_open(scene, &batch[i], radius, &directions)
            });
            let taken = disks.candidates[old..].iter().map(|&c| c as usize);
            more[l].extend(taken.map(|c| Candidate::at(scene, &batch[c], darts[c].widening)));
        }
    }
    for (level, more) in points.levels.iter_mut().zip(more) {
        let positions: Vec<Vec3> = more.iter().map(|p| p.position).collect();
        let order = morton_order(&positions);
        (level.points).extend(order.into_iter().map(|i| more[i as usize]));
    }
    points
}

/// Measures coverage by the finest level.
pub fn coverage(scene: &TracedScene, finest: &Level, seed: u64) -> Coverage {
    let Some(samples) = Samples::new(scene) else {
        return Coverage::default();
    };
    let nearest = NearestPoint::new(finest);
    let (mut there, mut bare) = (0u64, 0u64);
    for i in 0..SAMPLES {
        let mut stream = Stream::new(seed, STAGE, i);
        // One sample in each of equally large parts.
        let at = (i as f64 + f64::from(stream.uniform())) / SAMPLES as f64;
        let Some(hit) = samples.at(at, &mut stream, true) else {
            continue;
        };
        there += 1;
        let covered = |normal| nearest.at(hit.position, normal).is_some();
        bare += u64::from(!covered(hit.normal) && !covered(-hit.normal));
    }
    let share = samples.total() / SAMPLES as f64;
    Coverage {
        area: there as f64 * share,
        uncovered: bare as f64 * share,
    }
}
