//! Adaptive refinement of the single-bounce operator T, one receiver level at a time.
//!
//! Source: Lehtinen et al. 2008, section 3.2 and figure 5. Rows of one level only need coarser rows, so a
//! level is a parallel sweep instead of a queue.
//!
//! The coarsest levels keep links above a threshold ([`select`]), finer ones those that lights ask for
//! ([`select_by_pursuit`]).
//!
//! Equation 17 subtracts what was stored: quantised and corrected links, so that errors do not add up over
//! levels.

mod predicted;
mod wanted;
mod work;

use crate::error::BakeError;
use crate::links::bounces::BounceSums;
use crate::links::choice::{PursuitGoal, select, select_by_pursuit};
use crate::links::fitting::Answers;
use crate::links::gather::{Gathered, RowScratch, gather, scalar_row};
use crate::links::row::{Row, SelectScratch};
use crate::units::Units;
use crate::units::key::Key;
use glam::{Vec3, Vec3A};
use predicted::Predicted;
use rayon::prelude::*;
use relight_transport::links::Links;
use relight_transport::random::Stream;
use relight_transport::sampling::DirectionSet;
use relight_transport::sparse::row;
use std::ops::Range;
use wanted::Forecast;
use work::{is_remembered, rays_of};

pub use wanted::Wanted;
pub use work::{Receiver, Receivers, Reconstructed, Refinement, most_rays};

/// What refinement finds.
#[derive(Debug, Default)]
pub struct Refined {
    /// T: all points × all senders.
    pub links: Links,
    /// Receivers gathered per level.
    pub gathered: Vec<usize>,
    /// Rays cast, and those that were not because they are below a smooth normal's horizon.
    pub rays: u64,
    /// Rays that met a surface without points.
    pub lost: u64,
    /// Links that gathers found and that were dropped as too weak.
    pub dropped: u64,
    /// Gathers that were not made.
    pub spared: Spared,
    /// Memory that reconstructed rows took, bytes.
    pub row_bytes: u64,
}

/// Gathers that were not made, and the rays that they would have cast.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Spared {
    /// Receivers whose parents keep no link, so that theirs would be too weak.
    pub weak: u64,
    /// Rays of those.
    pub weak_rays: u64,
    /// Receivers that were not worth one.
    pub unwanted: u64,
    /// Rays of those.
    pub unwanted_rays: u64,
}

impl Spared {
    fn count(&mut self, is_worthwhile: bool, rays: u64) {
        let (count, sum) = if is_worthwhile {
            (&mut self.weak, &mut self.weak_rays)
        } else {
            (&mut self.unwanted, &mut self.unwanted_rays)
        };
        *count += 1;
        *sum += rays;
    }
}

/// The coarsest level whose links are chosen by what lights make of them. Those above are few, all others rest on them, and
/// what they keep beyond that no later one needs to mend (docs/notebook/transfer.md).
const FIRST_PURSUED: usize = 2;

/// ε below which all links are above thresholds: there are hundreds in each row then, and to choose them one after the other
/// takes the square of their number.
const LEAST_PURSUED: f32 = 0.0025;

/// Whether links of a receiver level, 0 for the coarsest, are chosen by pursuit at this ε.
pub fn is_pursued(level: usize, epsilon: f32) -> bool {
    level >= FIRST_PURSUED && epsilon >= LEAST_PURSUED
}

/// Stage number of the direction sets' stream.
const STAGE: u32 = 3;

/// Room to work in, for one thread.
struct Workspace {
    gathered: RowScratch,
    predicted: Predicted,
    select: SelectScratch,
}

/// One receiver level's sweep.
struct Sweep<'a> {
    refinement: &'a Refinement<'a>,
    level: usize,
    directions: DirectionSet,
    threshold: f32,
    /// Squared error that a link takes away at least.
    gain: f32,
    /// Whether finer levels need the reconstructed rows.
    remembered: bool,
}

/// Who watches rows being made.
pub trait RowWatch: Sync {
    /// All that rows depend on is there, and rows begin: at most so many rays.
    fn begin(&self, most_rays: u64);
    /// So many rays were cast; may stop the bake.
    ///
    /// # Errors
    /// [`BakeError::Stopped`].
    fn cast(&self, rays: usize) -> Result<(), BakeError>;
    /// So many rays will be cast in all, as far as is known by now: which rows are looked at follows from coarser ones.
    fn expect(&self, rays: u64);
}

impl<F: Fn(usize) -> Result<(), BakeError> + Sync> RowWatch for F {
    fn cast(&self, rays: usize) -> Result<(), BakeError> {
        self(rays)
    }
    fn begin(&self, _: u64) {}
    fn expect(&self, _: u64) {}
}

/// Runs the refinement. `bounces` adds up the rows of the bounce receiver level, by their places in it.
pub fn refine(
    r: &Refinement,
    quantised: impl Fn(Vec3) -> Vec3 + Sync,
    bounces: &mut BounceSums,
    units: Units,
    watch: &impl RowWatch,
) -> Result<Refined, BakeError> {
    let (receivers, row_bytes) = rows(r, Wanted::all(r, units), quantised, Some(bounces), units, watch)?;
    let mut refined = Refined {
        row_bytes,
        links: Links {
            receivers: r.ranges.total() as u32,
            senders: r.field.tree.ranges.total() as u32,
            row_offsets: vec![0],
            ..Links::default()
        },
        ..Refined::default()
    };
    let mut receivers = receivers.into_iter();
    for level in 0..r.ranges.levels() {
        let mut gathered = 0;
        let range = r.ranges.range(level);
        for (i, receiver) in range.clone().zip(receivers.by_ref().take(range.len())) {
            for (j, vector) in receiver.links {
                refined.links.columns.push(j);
                refined.links.vectors.push(vector);
            }
            refined.links.row_offsets.push(refined.links.columns.len() as u32);
            gathered += usize::from(receiver.gathered);
            refined.lost += u64::from(receiver.lost);
            refined.dropped += u64::from(receiver.dropped);
            if !receiver.gathered && !r.places[i].inherited {
                refined.spared.count(r.is_worthwhile(i), rays_of(r, level) as u64);
            }
        }
        refined.gathered.push(gathered);
        refined.rays += gathered as u64 * rays_of(r, level) as u64;
    }
    Ok(refined)
}

/// The rows of the wanted ranges and of all that those need which have to be made; those of others are empty. Responses
/// for bounces, which are long, go to `bounces` in order, if there is one, and are not returned, nor are reconstructed
/// rows: second, how many bytes of those there were at once.
pub fn rows(
    r: &Refinement,
    wanted: Wanted,
    quantised: impl Fn(Vec3) -> Vec3 + Sync,
    mut bounces: Option<&mut BounceSums>,
    units: Units,
    watch: &impl RowWatch,
) -> Result<(Vec<Receiver>, u64), BakeError> {
    let inputs = units.inputs(|key| inputs(r, key));
    let mut known = vec![Receiver::default(); r.ranges.total()];
    let bounce_range = r
        .bounce_receivers
        .map_or(0..0, |level| 0..r.ranges.range(level).end);
    let mut add_up = |known: &mut [Receiver], range: &Range<usize>| {
        let rows = &mut known[range.clone()];
        match &mut bounces {
            Some(sums) if bounce_range.contains(&range.start) => {
                // In order, so that sums are the same however rows came.
                if sums.added() == range.start {
                    rows.iter_mut()
                        .for_each(|row| sums.add(&std::mem::take(&mut row.bounce)));
                }
            }
            _ => rows.iter_mut().for_each(|row| row.bounce = Vec::new()),
        }
    };
    let mut take = |known: &mut [Receiver], range: &Range<usize>| {
        let kept: Option<Receivers> = units.taken("refine", inputs, range);
        let kept = kept.filter(|kept| fits(r, kept));
        let is_kept = kept.is_some();
        if let Some(kept) = kept {
            remember(known, range, kept);
            add_up(known, range);
        }
        is_kept
    };
    let mut missing = wanted.clone();
    for (range, is_missing) in missing.0.iter_mut().flatten().filter(|range| range.1) {
        *is_missing = !take(&mut known, range);
    }
    // Only what is to be made needs the rows of parents, which may have to be made, too.
    let needed = missing.clone().with_ancestors(r);
    for ((range, is_needed), (is_missing, is_wanted)) in needed.0.iter().flatten().zip(
        (missing.0.iter_mut().flatten().map(|range| &mut range.1))
            .zip(wanted.0.iter().flatten().map(|range| range.1)),
    ) {
        if *is_needed && !is_wanted {
            *is_missing = !take(&mut known, range);
        }
    }
    let needed_until = missing.rows_needed(r);
    let mut row_bytes = 0;
    let mut forecast = Forecast::default();
    for level in 0..r.ranges.levels() {
        let sweep = Sweep::new(r, level);
        watch.expect(forecast.rays(r, level, &missing, |i| sweep.is_active(i, &known)));
        for ((range, is_needed), (_, is_missing)) in needed.0[level].iter().zip(&missing.0[level]) {
            if *is_missing {
                let made = sweep.rows(range.clone(), &known, &quantised, watch)?;
                units.keep("refine", inputs, range, &made)?;
                remember(&mut known, range, made);
            } else if *is_needed {
                sweep.recall(range.clone(), &needed_until, &mut known);
            }
            add_up(&mut known, range);
        }
        row_bytes = known.iter().map(Receiver::row_bytes).sum::<u64>().max(row_bytes);
        for (row, &until) in known.iter_mut().zip(&needed_until) {
            if usize::from(until) <= level {
                row.reconstructed = Reconstructed::default();
            }
        }
    }
    Ok((known, row_bytes))
}

fn remember(known: &mut [Receiver], range: &Range<usize>, rows: Receivers) {
    for (slot, row) in known[range.clone()].iter_mut().zip(rows.0) {
        *slot = row;
    }
}

/// Whether kept receivers can be these: their senders exist.
fn fits(r: &Refinement, kept: &Receivers) -> bool {
    let senders = r.field.tree.ranges.total() as u32;
    let clusters = r.field.tree.ranges.range(r.bounce_level).len() as u32;
    kept.0.iter().all(|receiver| {
        receiver.links.iter().all(|link| link.0 < senders) && receiver.bounce.iter().all(|e| e.0 < clusters)
    })
}

/// What rows depend on.
fn inputs(r: &Refinement, key: &mut Key) {
    let tree = r.field.tree;
    key.places(r.places).level(r.field.points.level);
    for level in 0..r.ranges.levels() {
        key.u64s(&[r.ranges.range(level).len() as u64]);
    }
    for level in 0..tree.levels() {
        key.u64s(&[tree.ranges.range(level).len() as u64]);
    }
    tree.parents.iter().for_each(|parents| {
        key.u32s(parents);
    });
    r.trials.at_points.iter().for_each(|light| {
        key.f32s(&light.wide());
    });
    r.test_lights.leaf_means.iter().for_each(|light| {
        key.f32s(light);
    });
    key.u32s(&tree.leaf_of_point)
        .bytes(&tree.importance)
        .vectors(r.coarse_positions.iter())
        .f32s(&[r.epsilon])
        .u64s(&[
            r.rays as u64,
            r.bounce_level as u64,
            r.bounce_receivers.map_or(u64::MAX, |level| level as u64),
            r.seed,
            u64::from(r.short_links),
        ]);
    let worthwhile: Vec<u8> = r.worthwhile.iter().map(|&w| u8::from(w)).collect();
    let near: Vec<u8> = r.field.near_separated.iter().map(|&n| u8::from(n)).collect();
    key.bytes(&worthwhile)
        .bytes(&near)
        .u32s(r.separated_pairs.as_flattened());
    // Parents follow from the points, and rows of parents from all of this.
}

impl Workspace {
    fn new(r: &Refinement) -> Workspace {
        let tree = r.field.tree;
        Workspace {
            gathered: RowScratch::new(tree.ranges.total()),
            predicted: Predicted::new(r),
            select: SelectScratch::new(tree),
        }
    }
}

impl<'a> Sweep<'a> {
    fn new(r: &'a Refinement, level: usize) -> Sweep<'a> {
        let above_finest = r.ranges.levels() - 1 - level;
        let count = rays_of(r, level);
        Sweep {
            refinement: r,
            level,
            directions: DirectionSet::uniform(count, &mut Stream::new(r.seed, STAGE, level as u64)),
            threshold: threshold(r.epsilon, above_finest),
            gain: gain(r.epsilon, above_finest),
            remembered: is_remembered(r, level),
        }
    }

    /// Rows of a range, from those of the coarser levels.
    fn rows(
        &self,
        range: Range<usize>,
        known: &[Receiver],
        quantised: &(impl Fn(Vec3) -> Vec3 + Sync),
        watch: &impl RowWatch,
    ) -> Result<Receivers, BakeError> {
        let rows: Result<Vec<Receiver>, BakeError> = range
            .into_par_iter()
            .with_min_len(16)
            .map_init(
                || Workspace::new(self.refinement),
                |room, i| {
                    let receiver = self.receiver(i, known, quantised, room);
                    watch.cast(if receiver.gathered {
                        self.directions.directions.len()
                    } else {
                        0
                    })?;
                    Ok(receiver)
                },
            )
            .collect();
        rows.map(Receivers)
    }

    /// Reconstructed rows of receivers whose links were kept, where they are needed.
    fn recall(&self, range: Range<usize>, needed_until: &[u8], known: &mut [Receiver]) {
        if !self.remembered {
            return;
        }
        // Parents are on coarser levels, which come first.
        let (coarser, own) = known.split_at_mut(range.start);
        own[..range.len()]
            .par_iter_mut()
            .zip(range)
            .filter(|(_, i)| needed_until[*i] > 0)
            .for_each_init(
                || Predicted::new(self.refinement),
                |predicted, (receiver, i)| {
                    predicted.clear();
                    predicted.predict(self.refinement, i, coarser);
                    receiver.reconstructed = predicted.reconstruct(self.refinement, &receiver.links);
                },
            );
    }

    /// Whether links are chosen by pursuit.
    fn pursues(&self) -> bool {
        is_pursued(self.level, self.refinement.epsilon)
    }

    /// A row is looked at when one of its parents kept a link (figure 5). That says nothing where links are chosen by pursuit:
    /// a parent that lacks little may need none.
    fn is_active(&self, i: usize, known: &[Receiver]) -> bool {
        let mut parents = row(self.refinement.fine_from_coarse, i);
        !self.refinement.places[i].inherited
            && self.refinement.is_worthwhile(i)
            && (parents.len() == 0
                || (self.pursues() && self.level > FIRST_PURSUED)
                || parents.any(|(k, _)| !known[k as usize].links.is_empty()))
    }

    /// The outcome of receiver `i`.
    fn receiver(
        &self,
        i: usize,
        known: &[Receiver],
        quantised: &impl Fn(Vec3) -> Vec3,
        room: &mut Workspace,
    ) -> Receiver {
        let r = self.refinement;
        let active = self.is_active(i, known);
        let bounces = r.serves_bounces(self.level, i);
        let Workspace {
            gathered,
            predicted,
            select: scratch,
        } = room;
        gathered.clear();
        predicted.clear();
        let mut answers = Answers::default();
        if active || self.remembered {
            predicted.predict(r, i, known);
        }
        let mut receiver = Receiver {
            gathered: active || bounces,
            ..Receiver::default()
        };
        let mut found = Gathered::default();
        if receiver.gathered {
            found = gather(
                r.surfaces,
                &r.field,
                &r.places[i],
                &self.directions,
                gathered,
                &mut answers,
            );
            receiver.lost = found.lost;
        }
        if bounces {
            let normal = r.places[i].normal;
            let ranges = &r.field.tree.ranges;
            receiver.bounce = scalar_row(gathered, ranges, r.bounce_level, normal, found.full);
        }
        if active {
            let row = Row {
                tree: r.field.tree,
                trials: r.trials,
                answers: &answers,
                coarse_positions: r.coarse_positions,
                gathered,
                predicted: &predicted.row,
                normal: Vec3A::from(r.places[i].normal),
                threshold: self.threshold,
            };
            receiver.links = if self.pursues() {
                let light = PursuitGoal {
                    test_lights: r.test_lights,
                    predicted: &predicted.answers,
                    gain: self.gain,
                };
                select_by_pursuit(&row, &light, quantised, scratch)
            } else {
                select(&row, quantised, scratch)
            };
            receiver.dropped = gathered.touched.len().saturating_sub(receiver.links.len()) as u32;
        }
        if self.remembered {
            receiver.reconstructed = predicted.reconstruct(r, &receiver.links);
        }
        receiver.shrink();
        receiver
    }
}

/// Reflectance that stands for every sender's in the threshold: ε is meant on reflectance times link (section
/// 3.2), and links are tested without (see [`select`](crate::links::choice)).
const TYPICAL_REFLECTANCE: f32 = 0.5;

/// Ratio of the thresholds of a level and the next coarser one. A coarser receiver's function covers four times
/// the area, so that for the same squared error over the surface a link of half the size earns its place there.
/// What a coarse row drops also errs to the same side in all rows below it, so more than half pays: of 2, 2.5 and
/// 3, the higher keep the mean and the lower the detail (docs/notebook/transfer.md).
const LEVEL_RATIO: f32 = 2.5;

/// Threshold on links of a receiver level that is `coarser` levels above the finest.
fn threshold(epsilon: f32, coarser: usize) -> f32 {
    epsilon / TYPICAL_REFLECTANCE / LEVEL_RATIO.powi(coarser as i32)
}

/// Squared error, over ε², that a link of the finest level takes away at least: what makes the paper's ε of 0.025 give no more
/// links than it has in the paper (docs/notebook/transfer.md).
const GAIN: f32 = 160.0;

/// Ratio of the gains of a level and the next coarser one. Of 4 to 6, any gives the same error for the same links.
const GAIN_RATIO: f32 = 5.0;

/// Squared error that a link takes away at least, on a receiver level that is `coarser` levels above the finest.
fn gain(epsilon: f32, coarser: usize) -> f32 {
    GAIN * epsilon * epsilon / GAIN_RATIO.powi(coarser as i32)
}
