//! Dart throwing: Poisson-disk points under the oriented distance.
//!
//! Source: Lehtinen et al. 2008, section 2.3 and equation 11. A level accepts candidates in order; it is
//! full after [`FAILURES`] rejections in a row.
//!
//! Deviation: candidates come in batches whose conflicts with the points accepted so far are tested in
//! parallel; what survives is tested again in order against the newcomers. The result is that of the serial
//! algorithm on the same candidates, whatever the number of threads.

use crate::grid::{CellHasher, cell_at};
use crate::kernel::{disk_distance_squared, width};
use glam::{IVec3, Vec3};
use rayon::prelude::*;
use std::collections::HashMap;
use std::hash::BuildHasherDefault;

/// Rejections in a row after which a level counts as full (section 2.3).
pub const FAILURES: u32 = 2000;

/// What a rejected dart counts: one for a wide disk little, for there are few of those to throw, and where narrow ones belong may still be
/// room.
fn rejection(dart: &Dart) -> u32 {
    if dart.widening == 0 { WHOLE } else { 1 }
}
const WHOLE: u32 = 64;

/// Where a disk may be put.
#[derive(Clone, Copy, Debug)]
pub struct Dart {
    /// World space.
    pub position: Vec3,
    /// Unit normal.
    pub normal: Vec3,
    /// By how much the disk is wider than the set's radius, as a power of two.
    pub widening: u8,
}

impl Dart {
    /// For a disk of the set's own radius.
    pub fn plain(position: Vec3, normal: Vec3) -> Dart {
        Dart {
            position,
            normal,
            widening: 0,
        }
    }
}

/// A growing set of points that keep their distance: of two disks, the radius of the smaller one.
#[derive(Default)]
pub struct Disks {
    radius: f32,
    /// World space, in order of acceptance.
    pub positions: Vec<Vec3>,
    /// Unit normals.
    pub normals: Vec<Vec3>,
    /// By how much the disk of each point is wider than `radius`, as a power of two.
    pub widenings: Vec<u8>,
    /// Which candidate each point was.
    pub candidates: Vec<u64>,
    /// For each widening the newest point in each cell; `next` chains to older ones.
    newest: Vec<HashMap<u64, u32, BuildHasherDefault<CellHasher>>>,
    next: Vec<u32>,
    failures: u32,
}

const END: u32 = u32::MAX;

impl Disks {
    /// An empty set with disk radius `radius` (scene units).
    pub fn new(radius: f32) -> Disks {
        Disks {
            radius,
            ..Disks::default()
        }
    }

    /// Disk radius.
    pub fn radius(&self) -> f32 {
        self.radius
    }

    /// Whether [`FAILURES`] candidates in a row were rejected; those for wide disks count little.
    pub fn is_full(&self) -> bool {
        self.failures >= FAILURES * WHOLE
    }

    fn radius_of(&self, widening: usize) -> f32 {
        self.radius * width(widening as u8)
    }

    fn cell(x: Vec3, radius: f32, shift: f32) -> IVec3 {
        cell_at(x * (0.5 / radius) - shift)
    }

    fn key(cell: IVec3) -> u64 {
        let part = |v: i32| u64::from(v as u32) & 0x1f_ffff;
        part(cell.x) | (part(cell.y) << 21) | (part(cell.z) << 42)
    }

    /// Whether a point of index `first` or later lies within the disk radius of the candidate. Equation 11
    /// is never below the Euclidean distance, so cells of twice the radius, two along each axis, suffice.
    fn conflicts(&self, dart: &Dart, first: u32) -> bool {
        let widening = usize::from(dart.widening);
        let own = self.radius_of(widening);
        // Those as wide first: nearly all that conflicts, conflicts with them.
        let others = (0..self.newest.len()).filter(|&other| other != widening);
        std::iter::once(widening)
            .chain(others)
            .filter_map(|widening| Some((widening, self.newest.get(widening)?)))
            .filter(|(_, cells)| !cells.is_empty())
            .any(|(widening, cells)| {
                let radius = self.radius_of(widening);
                let limit = radius.min(own) * radius.min(own);
                let base = Disks::cell(dart.position, radius, 0.5);
                (0..8).any(|corner| {
                    let key = Disks::key(base + IVec3::new(corner & 1, (corner >> 1) & 1, corner >> 2));
                    let mut i = cells.get(&key).copied().unwrap_or(END);
                    // Chains run from newest to oldest.
                    while i != END && i >= first {
                        let other = (self.positions[i as usize], self.normals[i as usize]);
                        if disk_distance_squared((dart.position, dart.normal), other) < limit {
                            return true;
                        }
                        i = self.next[i as usize];
                    }
                    false
                })
            })
    }

    fn insert(&mut self, dart: &Dart, candidate: u64) {
        let widening = usize::from(dart.widening);
        if self.newest.len() <= widening {
            self.newest.resize_with(widening + 1, HashMap::default);
        }
        let index = self.positions.len() as u32;
        let key = Disks::key(Disks::cell(dart.position, self.radius_of(widening), 0.0));
        let older = self.newest[widening].insert(key, index).unwrap_or(END);
        self.positions.push(dart.position);
        self.normals.push(dart.normal);
        self.widenings.push(dart.widening);
        self.candidates.push(candidate);
        self.next.push(older);
    }

    /// Adds a point that another set has accepted, whatever lies near it.
    pub fn adopt(&mut self, dart: &Dart, candidate: u64) {
        self.insert(dart, candidate);
    }

    /// Adds points that this set has accepted before, in the order in which it did, and the rejections in a row since
    /// the last of them.
    pub fn restore(&mut self, points: impl IntoIterator<Item = (Dart, u64)>, failures: u32) {
        for (dart, candidate) in points {
            self.insert(&dart, candidate);
        }
        self.failures = failures;
    }

    /// What was rejected in a row since the last that was accepted, as [`Disks::restore`] takes it.
    pub fn failures(&self) -> u32 {
        self.failures
    }

    /// Throws a batch of candidates, whose numbers start at `first_candidate`. A candidate that keeps its
    /// distance from all points so far must also be admitted by `admits` (index within the batch).
    /// Candidates after the one that fills the level are ignored.
    pub fn throw(&mut self, darts: &[Dart], first_candidate: u64, admits: impl Fn(usize) -> bool + Sync) {
        // Sub-batches grow with the set: early on nearly all survive the parallel test and would then
        // conflict with each other.
        let mut start = 0;
        while start < darts.len() && !self.is_full() {
            let end = (start + (self.positions.len() * 2).max(256)).min(darts.len());
            let survivors: Vec<bool> = (start..end)
                .into_par_iter()
                .with_min_len(256)
                .map(|i| !self.conflicts(&darts[i], 0) && admits(i))
                .collect();
            let old = self.positions.len() as u32;
            for (i, survives) in (start..end).zip(survivors) {
                if survives && !self.conflicts(&darts[i], old) {
                    self.insert(&darts[i], first_candidate + i as u64);
                    if darts[i].widening == 0 {
                        self.failures = 0;
                    }
                } else {
                    self.failures += rejection(&darts[i]);
                    if self.is_full() {
                        break;
                    }
                }
            }
            start = end;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_random::directions;

    fn darts(places: &[Vec3]) -> Vec<Dart> {
        places.iter().map(|&x| Dart::plain(x, x)).collect()
    }

    #[test]
    fn points_keep_their_distance_and_leave_no_gap() {
        let candidates = darts(&directions(11, 200_000));
        let mut disks = Disks::new(0.2);
        disks.throw(&candidates, 0, |_| true);
        assert!(disks.is_full());
        let points: Vec<(Vec3, Vec3)> = disks
            .positions
            .iter()
            .copied()
            .zip(disks.normals.iter().copied())
            .collect();
        for i in 0..points.len() {
            for j in 0..i {
                assert!(disk_distance_squared(points[i], points[j]) >= 0.2f32 * 0.2);
            }
        }
        // Full means that at most about one candidate in 2000 still finds room; 5 in 2000 is beyond chance.
        let fresh = &directions(11, 200_000)[100_000..];
        let room = fresh
            .iter()
            .filter(|&&c| {
                points
                    .iter()
                    .all(|&p| disk_distance_squared((c, c), p) >= 0.2f32 * 0.2)
            })
            .count();
        assert!(
            room * 2000 <= 5 * fresh.len(),
            "{room} of {} candidates find room",
            fresh.len()
        );
    }

    #[test]
    fn a_restored_set_goes_on_as_if_it_had_never_stopped() {
        let candidates = darts(&directions(11, 20_000));
        let (first, second) = candidates.split_at(3000);
        let mut whole = Disks::new(0.15);
        whole.throw(&candidates, 0, |_| true);
        let mut stopped = Disks::new(0.15);
        stopped.throw(first, 0, |_| true);
        let mut restored = Disks::new(0.15);
        let points = (0..stopped.positions.len()).map(|i| {
            (
                Dart::plain(stopped.positions[i], stopped.normals[i]),
                stopped.candidates[i],
            )
        });
        restored.restore(points, stopped.failures());
        restored.throw(second, 3000, |_| true);
        assert_eq!(restored.candidates, whole.candidates);
        assert_eq!(restored.failures(), whole.failures());
    }

    #[test]
    fn batches_give_what_one_by_one_gives() {
        let candidates = darts(&directions(11, 20_000));
        let mut batched = Disks::new(0.15);
        batched.throw(&candidates, 0, |i| i % 3 != 0);
        let mut single = Disks::new(0.15);
        for (i, c) in candidates.iter().enumerate() {
            if single.is_full() {
                break;
            }
            single.throw(&[*c], i as u64, |_| i % 3 != 0);
        }
        assert_eq!(batched.candidates, single.candidates);
    }
}
