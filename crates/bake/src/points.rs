//! The hierarchy of points: Poisson-disk sets of halving radius over the reachable surfaces.
//!
//! Source: Lehtinen et al. 2008, section 2.3.

use crate::candidates::{self, Candidate};
use crate::error::BakeError;
use glam::Vec3;
use relight_scene::rays::Ray;
use relight_scene::surface::Surfaces;
use relight_transport::grid::morton_order;
use relight_transport::poisson::Disks;
use relight_transport::random::Stream;
use relight_transport::sampling::{DirectionSet, Frame};

/// Points of all levels, coarsest first.
#[derive(Debug, Default)]
pub struct PointLevels {
    /// Disk radius and points per level.
    pub levels: Vec<PointLevel>,
    /// Candidates that were traced.
    pub candidates: u64,
    /// Rays cast for them and for the crevice test.
    pub rays: u64,
}

/// One level.
#[derive(Debug)]
pub struct PointLevel {
    /// Poisson-disk radius R, scene units.
    pub disk_radius: f32,
    /// Support radius r = C·R.
    pub support_radius: f32,
    /// The points, along a Morton curve.
    pub points: Vec<Candidate>,
}

/// C in r = C·R: from 1.5 on the coarsest level to 2 on the finest. The paper goes to 2.5 (section 2.3); 2 looks
/// as smooth and blurs less (docs/transfer.md).
fn support_over_disk(level: usize, levels: usize) -> f32 {
    let t = if levels > 1 {
        level as f32 / (levels - 1) as f32
    } else {
        1.0
    };
    1.5 + 0.5 * t
}

/// Particles per batch; each gives up to 27 candidates.
const BATCH: usize = 8192;

/// Candidates per point of the finest level after which a level that is still not full is taken as it is:
/// surfaces that importance hardly reaches would otherwise be hunted for without end.
const MOST_CANDIDATES: u64 = 1 << 28;

/// Rays of the crevice test, over the hemisphere.
const CREVICE_RAYS: usize = 32;

/// Distributes the points. `coarse_radius` is R of level 0.
pub fn distribute(
    surfaces: &dyn Surfaces,
    viewpoints: &[Vec3],
    levels: usize,
    coarse_radius: f32,
    seed: u64,
    mut step: impl FnMut(usize) -> Result<(), BakeError>,
) -> Result<PointLevels, BakeError> {
    let mut disks: Vec<Disks> = (0..levels)
        .map(|l| Disks::new(coarse_radius / (1u64 << l) as f32))
        .collect();
    let mut kept: Vec<Vec<Candidate>> = vec![Vec::new(); levels];
    let directions = crevice_directions(seed);
    let crevice_rays = std::sync::atomic::AtomicU64::new(0);
    let (mut particles, mut traced, mut rays) = (0u64, 0u64, 0u64);
    let mut barren = 0;
    while disks.iter().any(|d| !d.is_full()) && traced < MOST_CANDIDATES {
        let (batch, cast) = candidates::trace(surfaces, viewpoints, seed, particles, BATCH);
        particles += BATCH as u64;
        rays += cast;
        if batch.is_empty() {
            barren += 1;
            // 32 batches are a quarter of a million particles that met nothing.
            if barren == 32 && traced == 0 {
                return Err(BakeError::NothingReachable {
                    viewpoints: viewpoints.to_vec(),
                });
            }
            if barren > 64 {
                break;
            }
            continue;
        }
        let positions: Vec<Vec3> = batch.iter().map(|c| c.position).collect();
        let normals: Vec<Vec3> = batch.iter().map(|c| c.normal).collect();
        for (level, disks) in disks.iter_mut().enumerate() {
            let finest = level + 1 == levels;
            let radius = disks.radius();
            let old = disks.candidates.len();
            disks.throw(&positions, &normals, traced, |i| {
                finest || {
                    crevice_rays.fetch_add(CREVICE_RAYS as u64, std::sync::atomic::Ordering::Relaxed);
                    is_open(surfaces, &batch[i], radius, &directions)
                }
            });
            kept[level].extend(
                disks.candidates[old..]
                    .iter()
                    .map(|&c| batch[(c - traced) as usize]),
            );
        }
        traced += batch.len() as u64;
        step(kept[levels - 1].len())?;
    }
    let (coarse, finest) = kept.split_at_mut(levels - 1);
    for (disks, kept) in disks.iter().zip(coarse).filter(|level| level.1.is_empty()) {
        *kept = without_openness(&finest[0], disks.radius());
    }
    let levels = (0..levels)
        .map(|l| {
            let positions: Vec<Vec3> = kept[l].iter().map(|c| c.position).collect();
            PointLevel {
                disk_radius: disks[l].radius(),
                support_radius: disks[l].radius() * support_over_disk(l, levels),
                points: morton_order(&positions)
                    .into_iter()
                    .map(|i| kept[l][i as usize])
                    .collect(),
            }
        })
        .collect();
    Ok(PointLevels {
        levels,
        candidates: traced,
        rays: rays + crevice_rays.into_inner(),
    })
}

/// Points of a level on which all places count as crevices, as disks wider than the scene do: a maximal set of the finest
/// points, because every level must have some.
fn without_openness(finest: &[Candidate], radius: f32) -> Vec<Candidate> {
    let positions: Vec<Vec3> = finest.iter().map(|c| c.position).collect();
    let normals: Vec<Vec3> = finest.iter().map(|c| c.normal).collect();
    let mut disks = Disks::new(radius);
    disks.throw(&positions, &normals, 0, |_| true);
    (disks.candidates.iter()).map(|&c| finest[c as usize]).collect()
}

/// The crevice test's directions.
pub fn crevice_directions(seed: u64) -> DirectionSet {
    DirectionSet::uniform(CREVICE_RAYS, &mut Stream::new(seed, 2, 0))
}

/// Section 2.3, last paragraph: whether the harmonic mean distance to the geometry above a place, along rays
/// of length 3R, misses counting as 3R, is at least R/6.
pub fn is_open(surfaces: &dyn Surfaces, place: &Candidate, radius: f32, directions: &DirectionSet) -> bool {
    let frame = Frame::around(place.geometric_normal);
    let longest = 3.0 * radius;
    let sum: f32 = directions
        .directions
        .iter()
        .map(|&d| {
            let direction = frame.world_from_local(d);
            let ray = Ray {
                origin: place.origin,
                direction,
                t_min: 0.0,
                t_max: longest,
            };
            let distance = surfaces.closest_hit(&ray).map_or(longest, |hit| hit.t);
            1.0 / distance.max(longest * f32::EPSILON)
        })
        .sum();
    directions.directions.len() as f32 / sum >= radius / 6.0
}

/// Points that the finest level of preset `standard` is given: with five coarser levels, that makes about
/// the paper's 190,000 on the plain Sponza (table 1).
const FINEST_POINTS: f32 = 195_000.0;

/// A radius for the coarsest level such that the finest has about [`FINEST_POINTS`] points.
///
/// Dart throwing at a trial radius measures the reachable area: a maximal Poisson-disk set of radius R holds
/// about 0.70 points per R² (Lagae and Dutré 2008), so counts scale with 1/R².
pub fn coarse_radius_for(
    surfaces: &dyn Surfaces,
    viewpoints: &[Vec3],
    levels: usize,
    seed: u64,
) -> Result<(f32, u64), BakeError> {
    let Some((min, max)) = surfaces.bounds() else {
        return Err(BakeError::NothingReachable {
            viewpoints: viewpoints.to_vec(),
        });
    };
    // Fine enough to see the scene's objects, coarse enough to take some ten thousand candidates.
    let trial = (max - min).length() / 64.0;
    let points = distribute(surfaces, viewpoints, 1, trial, seed, |_| Ok(()))?;
    let count = points.levels[0].points.len().max(1) as f32;
    let finest = trial * (count / FINEST_POINTS).sqrt();
    Ok((finest * (1u64 << (levels - 1)) as f32, points.rays))
}
