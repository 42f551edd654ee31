//! Adaptive refinement of the single-bounce operator T, one receiver level at a time.
//!
//! Source: Lehtinen et al. 2008, section 3.2 and figure 5. Rows of one level only need coarser rows, so a
//! level is a parallel sweep instead of a queue.
//!
//! Equation 17 subtracts what was stored: quantised and corrected links, so that errors do not add up over
//! levels.

use crate::candidates::Candidate;
use crate::error::BakeError;
use crate::gather::{RowScratch, SenderField, gather, scalar_row};
use crate::select::{Row, SelectScratch, TypicalLight, select};
use glam::{Mat3, Vec3, Vec3A};
use rayon::prelude::*;
use relight_scene::surface::Surfaces;
use relight_transport::links::Links;
use relight_transport::pyramid::{LevelRanges, carry};
use relight_transport::random::Stream;
use relight_transport::sampling::DirectionSet;
use relight_transport::senders::SenderTree;
use relight_transport::sparse::Rows;
use std::sync::atomic::{AtomicU64, Ordering};

/// What refinement works on.
pub struct Refinement<'a> {
    /// The scene.
    pub surfaces: &'a dyn Surfaces,
    /// All points, level by level.
    pub places: &'a [Candidate],
    /// Levels of `places`.
    pub ranges: &'a LevelRanges,
    /// Parents of every point (rows and columns: all points).
    pub fine_from_coarse: &'a Rows,
    /// What rays see.
    pub field: SenderField<'a>,
    /// What is lit how well in the mean.
    pub typical: &'a TypicalLight,
    /// Positions of the senders of the coarsest level.
    pub coarse_positions: &'a [Vec3],
    /// Rays per receiver of the finest level.
    pub rays: usize,
    /// ε at the finest level.
    pub epsilon: f32,
    /// Sender level of the bounce operator.
    pub bounce_level: usize,
    /// Receiver level whose gathers make the bounce operator; `None`: it is not needed.
    pub bounce_receivers: Option<usize>,
    /// Receivers that are worth a gather; empty: all.
    pub wanted: &'a [bool],
    /// Seed of the direction sets.
    pub seed: u64,
}

/// What refinement finds.
#[derive(Debug, Default)]
pub struct Refined {
    /// T: all points × all senders.
    pub links: Links,
    /// Scalar irradiance responses of the bounce sender level at the points of the bounce receiver level
    /// (local indices).
    pub bounce_rows: Vec<Vec<(u32, f32)>>,
    /// Receivers gathered per level.
    pub gathered: Vec<usize>,
    /// Rays cast.
    pub rays: u64,
    /// Rays that met a surface without points.
    pub lost: u64,
    /// Links that gathers found and that were dropped as too weak.
    pub dropped: u64,
    /// Rays of receivers that were not gathered: their parents keep no link, or they were not wanted.
    pub spared: Spared,
}

/// Gathers that were not made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Spared {
    /// Receivers whose parents keep no link, so that theirs would be too weak.
    pub weak: u64,
    /// Rays of those.
    pub weak_rays: u64,
    /// Receivers that were not wanted.
    pub unwanted: u64,
    /// Rays of those.
    pub unwanted_rays: u64,
}

/// Most rays a receiver gets: the coarsest rows are few, and all others rest on them.
const MOST_RAYS: usize = 1 << 14;

/// Entries of a reconstructed row below this share of ε are forgotten, except on the coarsest sender level, whose
/// sum is the row's answer to even light. Rows would else hold half of all senders: forgetting 2 % takes half of the
/// memory and a third of the time and changes errors by 1 %, 10 % of ε by 13 % (docs/transfer.md).
const NEGLIGIBLE: f32 = 0.04;

/// Stage number of the direction sets' stream.
const STAGE: u32 = 3;

/// One receiver's outcome.
struct Receiver {
    links: Vec<(u32, Vec3)>,
    /// Reconstructed row for finer levels; empty on the two finest.
    reconstructed: Vec<(u32, Vec3)>,
    bounce: Vec<(u32, f32)>,
    gathered: bool,
    /// Links that were dropped.
    dropped: u64,
}

/// Room to work in, for one thread.
struct Room {
    gathered: RowScratch,
    predicted: RowScratch,
    select: SelectScratch,
}

/// What the coarser levels came to.
struct Coarser {
    links: Links,
    /// Reconstructed rows of all but the two finest levels.
    rows: Vec<Vec<(u32, Vec3)>>,
    /// Whether a row kept any link.
    keeps: Vec<bool>,
}

/// One receiver level's sweep.
struct Sweep<'a> {
    refinement: &'a Refinement<'a>,
    level: usize,
    coarser: &'a Coarser,
    directions: DirectionSet,
    threshold: f32,
    /// Whether finer levels need the reconstructed rows.
    remembered: bool,
}

/// Runs the refinement. `step(receivers done)` reports progress and may stop the bake.
pub fn refine(
    r: &Refinement,
    quantised: impl Fn(Vec3) -> Vec3 + Sync,
    step: impl Fn(usize) -> Result<(), BakeError> + Sync,
) -> Result<Refined, BakeError> {
    let levels = r.ranges.levels();
    let mut refined = Refined::default();
    let senders = r.field.tree.ranges.total();
    let mut coarser = Coarser {
        links: Links {
            receivers: r.ranges.total() as u32,
            senders: senders as u32,
            row_offsets: vec![0],
            ..Links::default()
        },
        rows: Vec::new(),
        keeps: Vec::with_capacity(r.ranges.total()),
    };
    let lost = AtomicU64::new(0);
    let done = AtomicU64::new(0);
    for level in 0..levels {
        let sweep = Sweep::new(r, level, &coarser);
        let receivers: Result<Vec<Receiver>, BakeError> = r
            .ranges
            .range(level)
            .into_par_iter()
            .with_min_len(16)
            .map_init(
                || Room::new(r.field.tree),
                |room, i| {
                    let receiver = sweep.receiver(i, &quantised, room, &lost);
                    step(done.fetch_add(1, Ordering::Relaxed) as usize)?;
                    Ok(receiver)
                },
            )
            .collect();
        let (rays, remembered) = (sweep.directions.directions.len() as u64, sweep.remembered);
        let mut gathered = 0;
        for receiver in receivers? {
            coarser.keeps.push(!receiver.links.is_empty());
            for (j, vector) in receiver.links {
                coarser.links.columns.push(j);
                coarser.links.vectors.push(vector);
            }
            coarser.links.row_offsets.push(coarser.links.columns.len() as u32);
            if remembered {
                coarser.rows.push(receiver.reconstructed);
            }
            gathered += usize::from(receiver.gathered);
            refined.dropped += receiver.dropped;
            if !receiver.gathered {
                // Receivers come in order, one for each entry of `keeps`.
                let wanted = r.is_wanted(coarser.keeps.len() - 1);
                let Spared {
                    weak,
                    weak_rays,
                    unwanted,
                    unwanted_rays,
                } = &mut refined.spared;
                let (count, sum) = if wanted {
                    (weak, weak_rays)
                } else {
                    (unwanted, unwanted_rays)
                };
                *count += 1;
                *sum += rays;
            }
            if Some(level) == r.bounce_receivers {
                refined.bounce_rows.push(receiver.bounce);
            }
        }
        refined.gathered.push(gathered);
        refined.rays += gathered as u64 * rays;
    }
    refined.links = coarser.links;
    refined.lost = lost.into_inner();
    Ok(refined)
}

impl Refinement<'_> {
    fn is_wanted(&self, i: usize) -> bool {
        self.wanted.get(i).copied().unwrap_or(true)
    }
}

impl Room {
    fn new(tree: &SenderTree) -> Room {
        let senders = tree.ranges.total();
        Room {
            gathered: RowScratch::new(senders),
            predicted: RowScratch::new(senders),
            select: SelectScratch::new(tree),
        }
    }
}

impl<'a> Sweep<'a> {
    fn new(r: &'a Refinement, level: usize, coarser: &'a Coarser) -> Sweep<'a> {
        let above_finest = r.ranges.levels() - 1 - level;
        let count = (r.rays << above_finest.min(20)).min(MOST_RAYS.max(r.rays));
        Sweep {
            refinement: r,
            level,
            coarser,
            directions: DirectionSet::uniform(count, &mut Stream::new(r.seed, STAGE, level as u64)),
            threshold: threshold(r.epsilon, above_finest),
            remembered: above_finest >= 2,
        }
    }

    /// A row is looked at when one of its parents kept a link (figure 5).
    fn is_active(&self, i: usize) -> bool {
        let parents = self.refinement.fine_from_coarse.row(i);
        self.refinement.is_wanted(i)
            && (parents.is_empty() || parents.iter().any(|&(k, _)| self.coarser.keeps[k as usize]))
    }

    /// The outcome of receiver `i`.
    fn receiver(
        &self,
        i: usize,
        quantised: &impl Fn(Vec3) -> Vec3,
        room: &mut Room,
        lost: &AtomicU64,
    ) -> Receiver {
        let r = self.refinement;
        let active = self.is_active(i);
        let bounces = Some(self.level) == r.bounce_receivers;
        let Room {
            gathered,
            predicted,
            select: scratch,
        } = room;
        gathered.clear();
        predicted.clear();
        if active || self.remembered {
            predict(r, i, self.coarser, predicted);
        }
        let mut receiver = Receiver {
            links: Vec::new(),
            reconstructed: Vec::new(),
            bounce: Vec::new(),
            gathered: active || bounces,
            dropped: 0,
        };
        if receiver.gathered {
            let missed = gather(r.surfaces, &r.field, &r.places[i], &self.directions, gathered);
            lost.fetch_add(u64::from(missed), Ordering::Relaxed);
        }
        if bounces {
            let normal = r.places[i].geometric_normal;
            receiver.bounce = scalar_row(gathered, &r.field.tree.ranges, r.bounce_level, normal);
        }
        if active {
            let row = Row {
                tree: r.field.tree,
                typical: r.typical,
                coarse_positions: r.coarse_positions,
                gathered,
                predicted,
                normal: Vec3A::from(r.places[i].normal),
                threshold: self.threshold,
            };
            receiver.links = select(&row, quantised, scratch);
            receiver.dropped = (gathered.touched.len() as u64).saturating_sub(receiver.links.len() as u64);
        }
        if self.remembered {
            receiver.reconstructed = self.reconstructed(predicted, &receiver.links);
        }
        receiver
    }

    /// The row as the file will have it: what the parents predict, and its own links.
    fn reconstructed(&self, predicted: &mut RowScratch, links: &[(u32, Vec3)]) -> Vec<(u32, Vec3)> {
        for &(j, vector) in links {
            predicted.add(j, Vec3A::from(vector));
        }
        let coarse_senders = self.refinement.field.tree.ranges.range(0).len() as u32;
        let negligible = (self.refinement.epsilon * NEGLIGIBLE).powi(2);
        predicted
            .touched
            .iter()
            .map(|&j| (j, Vec3::from(predicted.sum[j as usize])))
            .filter(|link| link.0 < coarse_senders || link.1.length_squared() > negligible)
            .collect()
    }
}

/// The row of receiver `i` that its parents' rows give, as link coefficients.
///
/// Reconstructed rows are long, and three quarters of those that are needed are on the level above the finest.
/// They are not stored: such a parent stands for its own links and its parents' rows.
fn predict(r: &Refinement, i: usize, coarser: &Coarser, predicted: &mut RowScratch) {
    let Coarser { links, rows, .. } = coarser;
    let normal = |k: u32| r.places[k as usize].normal;
    let carried = |k: u32, i: u32, share: f32| carry(normal(k), normal(i)) * share;
    let mut terms: Vec<(u32, Mat3)> = Vec::new();
    for &(k, share) in r.fine_from_coarse.row(i) {
        let m = carried(k, i as u32, share);
        if (k as usize) < rows.len() {
            terms.push((k, m));
            continue;
        }
        for (j, vector) in links.row(k as usize) {
            predicted.add(j, Vec3A::from(m * vector));
        }
        let grandparents = r.fine_from_coarse.row(k as usize);
        terms.extend(
            grandparents
                .iter()
                .map(|&(g, share)| (g, m * carried(g, k, share))),
        );
    }
    terms.sort_by_key(|term| term.0);
    for same in terms.chunk_by(|a, b| a.0 == b.0) {
        let m: Mat3 = same.iter().map(|term| term.1).sum();
        for &(j, vector) in &rows[same[0].0 as usize] {
            predicted.add(j, Vec3A::from(m * vector));
        }
    }
}

/// Reflectance that stands for every sender's in the threshold: ε is meant on reflectance times link (section
/// 3.2), and links are tested without (see [`select`](crate::select)).
const TYPICAL_REFLECTANCE: f32 = 0.8;

/// Ratio of the thresholds of a level and the next coarser one. A coarser receiver's function covers four times
/// the area, so that for the same squared error over the surface a link of half the size earns its place there.
/// What a coarse row drops also errs to the same side in all rows below it, so more than half pays: of 2, 2.5 and
/// 3, the higher keep the mean and the lower the detail (docs/transfer.md).
const LEVEL_RATIO: f32 = 2.5;

/// Threshold on links of a receiver level that is `coarser` levels above the finest.
fn threshold(epsilon: f32, coarser: usize) -> f32 {
    epsilon / TYPICAL_REFLECTANCE / LEVEL_RATIO.powi(coarser as i32)
}
