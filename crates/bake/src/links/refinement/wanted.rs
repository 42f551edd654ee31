//! Which rows are to be made, in units of work, and how many rays that will take.

use super::work::{Refinement, is_remembered, rays_of};
use crate::units::Units;
use relight_transport::sparse::row;
use std::ops::Range;

/// Rays per unit of work: half a second or so.
const RAYS_PER_UNIT: usize = 1 << 21;

/// Which ranges of which levels are looked at.
#[derive(Clone, Debug)]
pub struct Wanted(pub(super) Vec<Vec<(Range<usize>, bool)>>);

impl Wanted {
    /// All ranges, none of them wanted.
    pub fn none(r: &Refinement, units: Units) -> Wanted {
        let of_level = |level| {
            let per_unit = (RAYS_PER_UNIT / rays_of(r, level)).max(1);
            let ranges = units.ranges(r.ranges.range(level), per_unit);
            ranges.map(|range| (range, false)).collect()
        };
        Wanted((0..r.ranges.levels()).map(of_level).collect())
    }

    /// All ranges of all levels.
    pub fn all(r: &Refinement, units: Units) -> Wanted {
        let mut wanted = Wanted::none(r, units);
        wanted.0.iter_mut().flatten().for_each(|range| range.1 = true);
        wanted
    }

    /// Part `index` of `of` of each level's ranges.
    pub fn part(r: &Refinement, units: Units, index: usize, of: usize) -> Wanted {
        let mut wanted = Wanted::none(r, units);
        for level in &mut wanted.0 {
            let part = index * level.len() / of..(index + 1) * level.len() / of;
            level[part].iter_mut().for_each(|range| range.1 = true);
        }
        wanted
    }

    /// The ranges of the coarsest levels, up to so many receivers in all.
    pub fn coarsest(r: &Refinement, units: Units, most: usize) -> Wanted {
        let mut wanted = Wanted::none(r, units);
        for (level, ranges) in wanted.0.iter_mut().enumerate() {
            if r.ranges.range(level).end <= most {
                ranges.iter_mut().for_each(|range| range.1 = true);
            }
        }
        wanted
    }

    /// Also what the wanted rows need: the ranges of their parents, and of those, and so on.
    pub(super) fn with_ancestors(mut self, r: &Refinement) -> Wanted {
        let mut needed = vec![false; r.ranges.total()];
        for level in (0..self.0.len()).rev() {
            for (range, wanted) in &mut self.0[level] {
                *wanted |= needed[range.clone()].contains(&true);
                for i in range.clone().filter(|_| *wanted) {
                    row(r.fine_from_coarse, i).for_each(|parent| needed[parent.0 as usize] = true);
                }
            }
        }
        self
    }

    /// Per receiver the finest level whose rows are predicted from its own, when those of `self` are made and what that needs
    /// is known; 0 for none. Parents may be more than one level above.
    pub(super) fn rows_needed(&self, r: &Refinement) -> Vec<u8> {
        let mut until = vec![0; r.ranges.total()];
        for (level, ranges) in self.0.iter().enumerate().rev() {
            for (range, is_made) in ranges {
                for i in range.clone() {
                    // Of two levels the rows are not kept: what is predicted from them starts from their parents'.
                    let through = if is_remembered(r, level) { 0 } else { until[i] };
                    let own = if *is_made || until[i] > 0 { level as u8 } else { 0 };
                    for parent in row(r.fine_from_coarse, i) {
                        let parent = &mut until[parent.0 as usize];
                        *parent = own.max(through).max(*parent);
                    }
                }
            }
        }
        until
    }

    /// Receivers in the wanted ranges.
    pub fn receivers(&self) -> usize {
        (self.0.iter().flatten())
            .filter(|range| range.1)
            .map(|range| range.0.len())
            .sum()
    }
}

/// Guesses how many rays will be cast: of a level whose parents are known it is certain, and from level to level the
/// share of rows that are looked at is taken to change as it did last.
#[derive(Default)]
pub(super) struct Forecast {
    /// Rays up to the level at hand.
    cast: u64,
    /// Share of rows that are looked at, on the last level that had any to make.
    share: Option<f64>,
}

impl Forecast {
    /// Rays of all levels, as far as is known at `level`; `is_active`: whether a receiver of it is looked at.
    pub fn rays(
        &mut self,
        r: &Refinement,
        level: usize,
        missing: &Wanted,
        is_active: impl Fn(usize) -> bool,
    ) -> u64 {
        let of = |level: usize| {
            let ranges = missing.0[level].iter().filter(|range| range.1);
            ranges.flat_map(|range| range.0.clone())
        };
        // All receivers of one level cast rays, for the bounces.
        let rays = |level: usize, share: f64| {
            let share = if Some(level) == r.bounce_receivers {
                1.0
            } else {
                share
            };
            share * (of(level).count() * rays_of(r, level)) as f64
        };
        let rows = of(level).count();
        let active = of(level).filter(|&i| is_active(i)).count();
        let mut share = active as f64 / rows.max(1) as f64;
        // 0 of 0 changes nothing.
        let change = self
            .share
            .map_or(1.0, |last| share / last.max(share).max(f64::MIN_POSITIVE));
        if rows > 0 {
            self.share = Some(share);
        }
        self.cast += rays(level, share) as u64;
        let mut finer_rays = 0.0;
        for finer in level + 1..r.ranges.levels() {
            share *= change;
            finer_rays += rays(finer, share);
        }
        self.cast + finer_rays as u64
    }
}
