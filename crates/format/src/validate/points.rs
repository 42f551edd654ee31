//! Rules of points, of the clusters that send and of what surfaces separate (SPEC 6.6, 6.11, 6.14).

use super::check::{
    check, check_above_zero, check_below, check_each, check_finite, check_length, check_unit,
};
use crate::asset::{Level, Senders, Separations};
use crate::error::Result;
use crate::layout::Kind;

/// Most that a point may be wider than its level, as a power of two: radii stay finite by far.
const MOST_WIDENED: u8 = 31;

impl Level {
    /// Checks radii, lengths, finiteness, unit normals, albedo of 0 to 1, widenings of 0 to 31. `index` is the level's.
    ///
    /// # Errors
    /// `Invalid` with the level or the point.
    pub fn validate(&self, index: usize) -> Result<()> {
        let kind = Kind::Points;
        check_above_zero(kind, index, "disk radius", self.disk_radius)?;
        check_above_zero(kind, index, "support radius", self.support_radius)?;
        let points = self.positions.len();
        check_length(kind, "normals, one per point", self.normals.len(), points)?;
        check_length(kind, "albedos, one per point", self.albedo.len(), points)?;
        if !self.widenings.is_empty() {
            let what = "widenings, one per point";
            check_length(kind, what, self.widenings.len(), points)?;
            let expected = format_args!("a widening of 0 to {MOST_WIDENED}");
            check_each(kind, &self.widenings, expected, |&k| k <= MOST_WIDENED)?;
        }
        check_finite(kind, "positions", &self.positions)?;
        check_unit(kind, "normals", &self.normals)?;
        let fraction = |rgb: &[f32; 3]| rgb.iter().all(|c| (0.0..=1.0).contains(c));
        check_each(kind, &self.albedo, "an albedo of 0 to 1", fraction)
    }
}

impl Senders {
    /// Checks that there is a cluster for every point of the coarsest levels, that every finest point has a
    /// cluster and every cluster but the coarsest a parent.
    ///
    /// # Errors
    /// `Invalid` with the sender level, the point or the cluster.
    pub fn validate(&self, points: &[Level]) -> Result<()> {
        let kind = Kind::Senders;
        let Senders {
            counts,
            leaf_of_point,
            importance,
            parents,
        } = self;
        let (levels, most) = (counts.len(), points.len());
        let expected = format_args!("1 to {most} sender levels, as many as levels of points");
        check((1..=most).contains(&levels), kind, 0, expected, levels)?;
        for (i, (&count, level)) in counts.iter().zip(points).enumerate() {
            let points = level.positions.len();
            let expected = format_args!("{points} clusters, as many as points of the level");
            check(count as usize == points, kind, i, expected, count)?;
        }
        let finest = points[most - 1].positions.len();
        let what = "clusters, one per finest point";
        check_assignment(what, leaf_of_point, finest, counts[levels - 1])?;
        let what = "importances, one per finest point";
        check_length(kind, what, importance.len(), finest)?;
        check_length(kind, "levels of parents", parents.len(), levels - 1)?;
        for (parents, pair) in parents.iter().zip(counts.windows(2)) {
            check_assignment("parents, one per cluster", parents, pair[1] as usize, pair[0])?;
        }
        Ok(())
    }
}

fn check_assignment(what: &str, clusters: &[u32], length: usize, end: u32) -> Result<()> {
    check_length(Kind::Senders, what, clusters.len(), length)?;
    let expected = format_args!("a cluster below {end}");
    check_each(Kind::Senders, clusters, expected, |&cluster| cluster < end)
}

impl Separations {
    /// Checks that pairs are of a point and one of a coarser level, that points beside walls are of the finest, and that
    /// both ascend.
    ///
    /// # Errors
    /// `Invalid` with the pair or the place among the points.
    pub fn validate(&self, levels: &[Level]) -> Result<()> {
        let kind = Kind::Separations;
        let counts = levels.iter().map(|level| level.positions.len());
        let ends: Vec<usize> = counts
            .scan(0, |end, count| {
                *end += count;
                Some(*end)
            })
            .collect();
        for (i, pair) in self.pairs.iter().enumerate() {
            let found = format_args!("{pair:?}");
            let ascending = i == 0 || self.pairs[i - 1] < *pair;
            check(ascending, kind, i, "pairs in ascending order", found)?;
            let [point, parent] = pair.map(|index| index as usize);
            let level = ends.partition_point(|&end| end <= point);
            let coarser = level.checked_sub(1).and_then(|above| ends.get(above));
            let fits = level < ends.len() && coarser.is_some_and(|&end| parent < end);
            check(fits, kind, i, "a point and a point of a coarser level", found)?;
        }
        let finest = levels.last().map_or(0, |level| level.positions.len());
        for (i, &near) in self.near.iter().enumerate() {
            let ascending = i == 0 || self.near[i - 1] < near;
            check(ascending, kind, i, "finest points in ascending order", near)?;
            check_below(kind, i, "finest point", near, finest)?;
        }
        Ok(())
    }
}
