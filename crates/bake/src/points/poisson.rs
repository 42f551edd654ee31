//! The hierarchy of points: Poisson-disk sets of halving radius over the reachable surfaces.
//!
//! Source: Lehtinen et al. 2008, section 2.3. Deviations: radii of a level are wider where places matter less (`relevance`), and finer levels
//! have no points of their own where surfaces see nothing near (`openness`).

use crate::error::BakeError;
use crate::points::candidates::{self, Candidate};
use crate::points::openness::{Asked, Openness, mean_distance};
use crate::points::relevance::Relevance;
use crate::units::Units;
use glam::Vec3;
use rayon::prelude::*;
use relight_scene::surface::{SurfaceHit, Surfaces};
use relight_transport::basis::Level;
use relight_transport::grid::morton_order;
use relight_transport::kernel::width;
use relight_transport::poisson::{Dart, Disks};
use relight_transport::random::Stream;
use relight_transport::sampling::DirectionSet;
use std::sync::atomic::{AtomicU64, Ordering};

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

impl PointLevels {
    /// Points of all levels.
    pub fn count(&self) -> usize {
        self.levels.iter().map(|level| level.points.len()).sum()
    }
}

/// The basis of the points.
pub fn levels_of(points: &PointLevels) -> Vec<Level> {
    points
        .levels
        .iter()
        .map(|level| {
            Level::widened(
                level.points.iter().map(|p| p.position).collect(),
                level.points.iter().map(|p| p.normal).collect(),
                level.widenings(),
                level.disk_radius,
                level.support_radius,
            )
        })
        .collect()
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

impl PointLevel {
    /// By how much each point's radii are wider than the level's, as a power of two; none where none is.
    pub fn widenings(&self) -> Vec<u8> {
        let widenings: Vec<u8> = self.points.iter().map(|p| p.widening).collect();
        if widenings.iter().any(|&k| k > 0) {
            widenings
        } else {
            Vec::new()
        }
    }
}

/// C in r = C·R: from 1.5 on the coarsest level to 2 on the finest. The paper goes to 2.5 (section 2.3); 2 looks
/// as smooth and blurs less (docs/notebook/transfer.md).
fn support_over_disk(level: usize, levels: usize) -> f32 {
    let t = if levels > 1 {
        level as f32 / (levels - 1) as f32
    } else {
        1.0
    };
    1.5 + 0.5 * t
}

/// Part of the finest points' distance that a particle must have come from for its landing to count.
///
/// A point stands for all of its cell. Most of what sees a cell looks from farther away, and not into a crevice in it: points in crevices
/// made leaves some 1 % too dark (docs/notebook/transfer.md).
const NEAR: f32 = 0.5;

/// Particles per batch; each gives up to 27 candidates.
const BATCH: usize = 8192;

/// Candidates per point of the finest level after which a level that is still not full is taken as it is:
/// surfaces that importance hardly reaches would otherwise be hunted for without end.
const MOST_CANDIDATES: u64 = 1 << 28;

/// Batches that may meet nothing. Half of them are a quarter of a million particles: if none has met anything by
/// then, there is nothing.
const MOST_BARREN: u64 = 64;

/// Rays of the crevice test, over the hemisphere.
const CREVICE_RAYS: usize = 32;

/// Batches per unit of work: about a second.
const BATCHES_PER_UNIT: usize = 8;

/// Distributes the points. `coarse_radius` is R of level 0; `openness` is for the same and as many levels. `step` is told of each batch and may stop the bake; units are
/// of batches that build on each other.
///
/// # Errors
/// Nothing is reachable, what `step` returns, or a unit cannot be kept.
pub fn distribute(
    surfaces: &dyn Surfaces,
    relevance: &Relevance,
    openness: Openness,
    levels: usize,
    coarse_radius: f32,
    seed: u64,
    units: Units,
    mut step: impl FnMut(&Spread) -> Result<(), BakeError>,
) -> Result<PointLevels, BakeError> {
    let inputs = units.inputs(|key| {
        key.vectors(relevance.viewpoints.iter())
            .vectors(openness.lamps().iter())
            .f32s(&[coarse_radius])
            .u64s(&[levels as u64, seed, u64::from(openness.widens())]);
    });
    let mut spread = Spread::new(levels, coarse_radius, relevance, openness);
    let directions = crevice_directions(seed);
    let mut batches = 0;
    while !spread.is_done() {
        let range = batches..batches + BATCHES_PER_UNIT;
        batches = range.end;
        if let Some(growth) = units.taken("points", inputs, &range) {
            spread.grow(growth);
            step(&spread)?;
            continue;
        }
        let before: Vec<usize> = spread.kept.iter().map(Vec::len).collect();
        for _ in range.clone() {
            if !spread.is_done() {
                spread.throw_batch(surfaces, seed, &directions)?;
                step(&spread)?;
            }
        }
        if units.are_kept() {
            units.keep("points", inputs, &range, &spread.growth_since(&before))?;
        }
    }
    Ok(spread.into_levels(surfaces))
}

/// Points in the making.
pub struct Spread<'a> {
    relevance: &'a Relevance,
    openness: Openness,
    disks: Vec<Disks>,
    /// Where the points of each level are, in the order in which they were accepted.
    kept: Vec<Vec<SurfaceHit>>,
    /// Of each level which of its points are the coarser one's, by their places in that order.
    inherited: Vec<Vec<u32>>,
    particles: u64,
    candidates: u64,
    rays: u64,
    /// Batches that met nothing.
    barren: u64,
}

/// What some batches added to a [`Spread`].
pub struct Growth {
    /// Per level the points that were accepted, and which candidates they were.
    pub points: Vec<(Vec<SurfaceHit>, Vec<u64>)>,
    /// By how much they are wider than their levels' radii, level by level.
    pub widenings: Vec<u8>,
    /// Whether they are the coarser level's.
    pub inherited: Vec<u8>,
    /// What was found of places.
    pub openness: Vec<Asked>,
    /// Per level the rejections in a row at the end.
    pub failures: Vec<u32>,
    /// Particles, candidates, rays and barren batches so far.
    pub totals: [u64; 4],
}

impl<'a> Spread<'a> {
    fn new(levels: usize, coarse_radius: f32, relevance: &'a Relevance, openness: Openness) -> Spread<'a> {
        Spread {
            relevance,
            openness,
            disks: (0..levels)
                .map(|l| Disks::new(coarse_radius / (1u64 << l) as f32))
                .collect(),
            kept: vec![Vec::new(); levels],
            inherited: vec![Vec::new(); levels],
            particles: 0,
            candidates: 0,
            rays: 0,
            barren: 0,
        }
    }

    /// Candidates so far.
    pub fn candidates(&self) -> u64 {
        self.candidates
    }

    /// See [`NEAR`].
    fn near(&self) -> f32 {
        NEAR * self.disks.last().map_or(0.0, Disks::radius)
    }

    fn is_done(&self) -> bool {
        self.disks.iter().all(Disks::is_full)
            || self.candidates >= MOST_CANDIDATES
            || self.barren > MOST_BARREN
    }

    fn throw_batch(
        &mut self,
        surfaces: &dyn Surfaces,
        seed: u64,
        directions: &DirectionSet,
    ) -> Result<(), BakeError> {
        let (batch, cast) =
            candidates::trace(surfaces, self.relevance, seed, self.particles, BATCH, self.near());
        self.particles += BATCH as u64;
        self.rays += cast;
        if batch.is_empty() {
            self.barren += 1;
            return if self.barren == MOST_BARREN / 2 && self.candidates == 0 {
                Err(BakeError::NothingReachable {
                    viewpoints: self.relevance.viewpoints.clone(),
                })
            } else {
                Ok(())
            };
        }
        let relevant: Vec<u8> = (batch.par_iter())
            .with_min_len(1024)
            .map(|hit| self.relevance.widening(hit.position))
            .collect();
        let (open, asked) = self.openness.widenings(surfaces, &batch, &relevant);
        self.rays += asked;
        let crevice_rays = AtomicU64::new(0);
        let (first, levels) = (self.candidates, self.disks.len());
        for level in 0..levels {
            if self.disks[level].is_full() {
                continue;
            }
            let above_finest = levels - 1 - level;
            let (finest, radius) = (above_finest == 0, self.disks[level].radius());
            let darts: Vec<Dart> = (batch.par_iter().zip(relevant.par_iter().zip(&open)))
                .with_min_len(1024)
                .map(|(hit, (&relevant, &open))| Dart {
                    widening: widening(relevant, open, above_finest),
                    ..Dart::plain(hit.position, hit.normal)
                })
                .collect();
            let inherits = |i: usize| level > 0 && is_inherited(relevant[i], open[i], above_finest);
            let disks = &mut self.disks[level];
            let old = disks.candidates.len();
            disks.throw(&darts, first, |i| {
                !inherits(i)
                    && (finest || {
                        crevice_rays.fetch_add(CREVICE_RAYS as u64, Ordering::Relaxed);
                        is_open(surfaces, &batch[i], radius * width(darts[i].widening), directions)
                    })
            });
            let new: Vec<usize> = (disks.candidates[old..].iter())
                .map(|&c| (c - first) as usize)
                .collect();
            self.kept[level].extend(new.iter().map(|&i| batch[i]));
            for i in new {
                self.hand_down(level, &batch[i], (relevant[i], open[i]), first + i as u64);
            }
        }
        self.candidates += batch.len() as u64;
        self.rays += crevice_rays.into_inner();
        Ok(())
    }

    /// Gives a new point of a level to the finer ones that have none around it.
    fn hand_down(&mut self, level: usize, hit: &SurfaceHit, (relevant, open): (u8, u8), candidate: u64) {
        for finer in level + 1..self.disks.len() {
            let above_finest = self.disks.len() - 1 - finer;
            if !is_inherited(relevant, open, above_finest) {
                return;
            }
            let dart = Dart {
                widening: widening(relevant, open, above_finest),
                ..Dart::plain(hit.position, hit.normal)
            };
            self.disks[finer].adopt(&dart, candidate);
            self.inherited[finer].push(self.kept[finer].len() as u32);
            self.kept[finer].push(*hit);
        }
    }

    fn growth_since(&mut self, before: &[usize]) -> Growth {
        let points = (self.kept.iter().zip(&self.disks).zip(before))
            .map(|((kept, disks), &old)| (kept[old..].to_vec(), disks.candidates[old..].to_vec()))
            .collect();
        let widenings =
            (self.disks.iter().zip(before)).flat_map(|(disks, &old)| disks.widenings[old..].to_vec());
        let inherited = (0..self.kept.len()).flat_map(|l| {
            let flags = self.inherited_flags(l);
            flags[before[l]..].to_vec()
        });
        Growth {
            points,
            widenings: widenings.collect(),
            inherited: inherited.collect(),
            openness: self.openness.take_asked(),
            failures: self.disks.iter().map(Disks::failures).collect(),
            totals: [self.particles, self.candidates, self.rays, self.barren],
        }
    }

    /// Of each point of a level whether it is the coarser one's.
    fn inherited_flags(&self, level: usize) -> Vec<u8> {
        let mut flags = vec![0; self.kept[level].len()];
        (self.inherited[level].iter()).for_each(|&i| flags[i as usize] = 1);
        flags
    }

    fn grow(&mut self, growth: Growth) {
        let mut widths = growth.widenings.into_iter().zip(growth.inherited);
        for (l, ((hits, candidates), failures)) in growth.points.into_iter().zip(growth.failures).enumerate()
        {
            let mut darts = Vec::with_capacity(hits.len());
            for ((hit, &candidate), (widening, inherited)) in hits.iter().zip(&candidates).zip(&mut widths) {
                if inherited != 0 {
                    self.inherited[l].push((self.kept[l].len() + darts.len()) as u32);
                }
                let dart = Dart {
                    widening,
                    ..Dart::plain(hit.position, hit.normal)
                };
                darts.push((dart, candidate));
            }
            self.disks[l].restore(darts, failures);
            self.kept[l].extend(hits);
        }
        self.openness.restore(growth.openness);
        [self.particles, self.candidates, self.rays, self.barren] = growth.totals;
    }

    fn into_levels(mut self, surfaces: &dyn Surfaces) -> PointLevels {
        let levels = self.kept.len();
        let (coarse, finest) = self.kept.split_at_mut(levels - 1);
        let widenings = self.disks[levels - 1].widenings.clone();
        for (disks, kept) in self.disks[..levels - 1]
            .iter_mut()
            .zip(coarse)
            .filter(|level| level.1.is_empty())
        {
            (*kept, disks.widenings) = without_openness(&finest[0], &widenings, disks.radius());
        }
        let level = |l: usize| {
            let (hits, disk_radius) = (&self.kept[l], self.disks[l].radius());
            let positions: Vec<Vec3> = hits.iter().map(|c| c.position).collect();
            let inherited = self.inherited_flags(l);
            PointLevel {
                disk_radius,
                support_radius: disk_radius * support_over_disk(l, levels),
                points: morton_order(&positions)
                    .into_par_iter()
                    .map(|i| Candidate {
                        inherited: inherited[i as usize] != 0,
                        ..Candidate::at(surfaces, &hits[i as usize], self.disks[l].widenings[i as usize])
                    })
                    .collect(),
            }
        };
        PointLevels {
            levels: (0..levels).map(level).collect(),
            candidates: self.candidates,
            rays: self.rays,
        }
    }
}

/// By how much the radii of a level are wider where the finest's would be by `open`, and those of all levels are by `relevant`.
fn widening(relevant: u8, open: u8, above_finest: usize) -> u8 {
    relevant.max(open.saturating_sub(above_finest as u8))
}

/// Whether a level has no points of its own at such a place: its disks would be as wide as those of the coarser one.
fn is_inherited(relevant: u8, open: u8, above_finest: usize) -> bool {
    widening(relevant, open, above_finest) > widening(relevant, open, above_finest + 1)
}

/// A disk at a landing.
pub fn dart(relevance: &Relevance, hit: &SurfaceHit) -> Dart {
    Dart {
        widening: relevance.widening(hit.position),
        ..Dart::plain(hit.position, hit.normal)
    }
}

/// Points of a level on which all places count as crevices, as disks wider than the scene do: a maximal set of the finest
/// points, because every level must have some.
fn without_openness(finest: &[SurfaceHit], widenings: &[u8], radius: f32) -> (Vec<SurfaceHit>, Vec<u8>) {
    let darts: Vec<Dart> = (finest.iter().zip(widenings))
        .map(|(hit, &widening)| Dart {
            widening,
            ..Dart::plain(hit.position, hit.normal)
        })
        .collect();
    let mut disks = Disks::new(radius);
    disks.throw(&darts, 0, |_| true);
    (
        (disks.candidates.iter()).map(|&c| finest[c as usize]).collect(),
        disks.widenings,
    )
}

/// The crevice test's directions.
pub fn crevice_directions(seed: u64) -> DirectionSet {
    DirectionSet::uniform(CREVICE_RAYS, &mut Stream::new(seed, 2, 0))
}

/// Section 2.3, last paragraph: whether the harmonic mean distance to the geometry above a place, along rays
/// of length 3R, misses counting as 3R, is at least R/6.
pub fn is_open(surfaces: &dyn Surfaces, place: &SurfaceHit, radius: f32, directions: &DirectionSet) -> bool {
    mean_distance(surfaces, place, 3.0 * radius, directions) >= radius / 6.0
}

/// Points that the finest level of preset `standard` is given: with five coarser levels, that makes about
/// the paper's 190,000 on the plain Sponza (table 1).
const FINEST_POINTS: f32 = 195_000.0;

/// Points of the finest of `levels`, about, if the coarsest radius was chosen for `of` levels.
pub fn expected(of: usize, levels: usize) -> f32 {
    FINEST_POINTS * 4.0f32.powi(levels as i32 - of as i32)
}

/// Points of a maximal Poisson-disk set of radius R per R² (Lagae and Dutré 2008).
pub const DENSITY: f64 = 0.70;

/// A radius for the coarsest level such that the finest has about [`FINEST_POINTS`] points.
///
/// Dart throwing at a trial radius measures the reachable area, each part of it by how relevant it is: a maximal Poisson-disk set holds
/// [`DENSITY`] points per R², so counts scale with 1/R².
pub fn coarse_radius_for(
    surfaces: &dyn Surfaces,
    relevance: &Relevance,
    levels: usize,
    seed: u64,
    units: Units,
) -> Result<(f32, u64), BakeError> {
    let Some((min, max)) = surfaces.bounds() else {
        return Err(BakeError::NothingReachable {
            viewpoints: relevance.viewpoints.clone(),
        });
    };
    // Fine enough to see the scene's objects and what is relevant in a vast one, coarse enough to take some ten thousand candidates.
    let trial = ((max - min).length() / 64.0).min(relevance.trial_radius());
    let points = distribute(
        surfaces,
        relevance,
        Openness::none(),
        1,
        trial,
        seed,
        units,
        |_| Ok(()),
    )?;
    let count = points.levels[0].points.len().max(1) as f32;
    let finest = trial * (count / FINEST_POINTS).sqrt();
    Ok((finest * (1u64 << (levels - 1)) as f32, points.rays))
}
