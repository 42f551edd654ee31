//! One level of the meshless basis: Shepard functions over oriented points.
//!
//! Source: Lehtinen et al. 2008, equations 1 to 3 (Shepard approximation and its basis functions) and 8 to
//! 10 (weights). The functions of a level sum to one wherever any of them is non-zero and vanish beyond the
//! support radius.

use crate::grid::{DiskGrid, DiskMemo, Entry, PointGrid};
use crate::kernel;
use glam::Vec3;

/// Cosine between normals above which two places count as facing the same way: 60°, at which the squared
/// cosine of equation 8 has fallen to a quarter.
const FACING: f32 = 0.5;

/// Supports within which a place that no function covers and that has no point near looks for one: crevices that no
/// candidate met are narrower, and the light of places farther away says nothing about its own.
const FAR: f32 = 8.0;

/// Points of one level with the functions they carry.
#[derive(Clone, Debug)]
pub struct Level {
    /// Poisson-disk radius R of the level: points are at least this far apart under equation 11.
    pub disk_radius: f32,
    /// Support radius r = C·R of every function of the level.
    pub support_radius: f32,
    /// World space.
    pub positions: Vec<Vec3>,
    /// Unit normals.
    pub normals: Vec<Vec3>,
    grid: PointGrid,
}

impl Level {
    /// A level over the given points.
    pub fn new(positions: Vec<Vec3>, normals: Vec<Vec3>, disk_radius: f32, support_radius: f32) -> Level {
        let grid = PointGrid::new(&positions, &normals, support_radius);
        Level {
            disk_radius,
            support_radius,
            positions,
            normals,
            grid,
        }
    }

    /// Number of functions.
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// Whether the level has no point at all.
    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }

    /// Calls `visit(index, weight)` for every function whose weight w_j (equation 8) is positive at
    /// (`x`, `normal`).
    #[inline]
    pub fn weights_at(&self, x: Vec3, normal: Vec3, mut visit: impl FnMut(u32, f32)) {
        let inverse = 1.0 / self.support_radius;
        self.grid.near(x, |entry| {
            let w = kernel::weight(
                x - entry.position,
                entry.normal,
                inverse,
                entry.normal.dot(normal),
            );
            if w > 0.0 {
                visit(entry.index, w);
            }
        });
    }

    /// Appends (index, B_j(x, normal)) of equation 2 for every function that is non-zero there. Appends
    /// nothing where no function covers the place.
    pub fn functions_at(&self, x: Vec3, normal: Vec3, out: &mut Vec<(u32, f32)>) {
        self.functions_among(x, normal, |_| true, out);
    }

    /// As [`Level::functions_at`] for those of the level's points alone that `counts` accepts.
    pub fn functions_among(
        &self,
        x: Vec3,
        normal: Vec3,
        counts: impl Fn(u32) -> bool,
        out: &mut Vec<(u32, f32)>,
    ) {
        let start = out.len();
        let mut sum = 0.0;
        self.weights_at(x, normal, |j, w| {
            if counts(j) {
                out.push((j, w));
                sum += w;
            }
        });
        for entry in &mut out[start..] {
            entry.1 /= sum;
        }
    }

    /// As [`Level::functions_at`], but where no function covers the place, the nearest point within the support
    /// radius takes it all, whatever its normal; failing that, the nearest of the same side within [`FAR`] supports.
    /// Appends nothing only where there is no such point either.
    pub fn functions_or_nearest_at(&self, x: Vec3, normal: Vec3, out: &mut Vec<(u32, f32)>) {
        let start = out.len();
        self.functions_at(x, normal, out);
        if out.len() == start {
            out.extend(self.nearest_in_gap(x, normal).map(|index| (index, 1.0)));
        }
    }

    /// What stands for a place that no function covers.
    #[cold]
    fn nearest_in_gap(&self, x: Vec3, normal: Vec3) -> Option<u32> {
        self.nearest_of_any_normal(x)
            .or_else(|| self.far_of_same_side(x, normal))
    }

    /// The nearest point within [`FAR`] supports that faces the same half space. Ties go to the lower index.
    #[cold]
    fn far_of_same_side(&self, x: Vec3, normal: Vec3) -> Option<u32> {
        let mut best = Nearest::within(FAR * self.support_radius);
        self.grid.around(x, (FAR / 2.0) as i32, |entry| {
            if entry.normal.dot(normal) > 0.0 {
                best.offer(entry.position.distance_squared(x), entry.index);
            }
        });
        best.index()
    }

    /// The nearest point within a support radius, whatever its normal. Ties go to the lower index.
    fn nearest_of_any_normal(&self, x: Vec3) -> Option<u32> {
        let mut best = Nearest::within(self.support_radius);
        (self.grid).near(x, |entry| {
            best.offer(entry.position.distance_squared(x), entry.index)
        });
        best.index()
    }
}

/// The nearest point that was offered: squared distance, index.
#[derive(Clone, Copy, Debug)]
struct Nearest(f32, u32);

impl Nearest {
    /// None so far, and none as far as `reach`.
    fn within(reach: f32) -> Nearest {
        Nearest(reach * reach, u32::MAX)
    }

    /// Ties go to the lower index.
    #[inline]
    fn is_beaten_by(self, squared: f32, index: u32) -> bool {
        (squared, index) < (self.0, self.1)
    }

    #[inline]
    fn offer(&mut self, squared: f32, index: u32) {
        if self.is_beaten_by(squared, index) {
            *self = Nearest(squared, index);
        }
    }

    #[inline]
    fn index(self) -> Option<u32> {
        (self.1 != u32::MAX).then_some(self.1)
    }
}

/// Finds functions at one place after another; the faster, the closer together places that follow each other lie.
#[derive(Clone, Debug)]
pub struct FunctionsInOrder<'a> {
    level: &'a Level,
    memo: DiskMemo<'a>,
    weights: Vec<f32>,
}

impl<'a> FunctionsInOrder<'a> {
    /// Of a level's functions.
    pub fn new(level: &'a Level) -> FunctionsInOrder<'a> {
        FunctionsInOrder {
            level,
            memo: DiskMemo::new(&level.grid),
            weights: Vec::new(),
        }
    }

    /// [`Level::functions_or_nearest_at`], bit by bit.
    pub fn functions_or_nearest_at(&mut self, x: Vec3, normal: Vec3, out: &mut Vec<(u32, f32)>) {
        let start = out.len();
        let indices = self.memo.weights(x, normal, &mut self.weights);
        let mut sum = 0.0;
        for (&j, &w) in indices.iter().zip(&self.weights) {
            if w > 0.0 {
                out.push((j, w));
                sum += w;
            }
        }
        for entry in &mut out[start..] {
            entry.1 /= sum;
        }
        if out.len() == start {
            out.extend((self.level.nearest_in_gap(x, normal)).map(|index| (index, 1.0)));
        }
    }
}

/// Places that [`NearestPoint::at_each`] looks up together: enough to keep memory busy, few enough for the stack.
const TOGETHER: usize = 64;

/// Finds the nearest point of a level, again and again.
#[derive(Clone, Debug)]
pub struct NearestPoint<'a> {
    /// The points.
    pub level: &'a Level,
    disks: DiskGrid,
}

impl<'a> NearestPoint<'a> {
    /// Prepares the look-up. The nearest point of a maximal disk set is within a disk radius.
    pub fn new(level: &'a Level) -> NearestPoint<'a> {
        NearestPoint {
            level,
            disks: DiskGrid::new(&level.positions, &level.normals, level.disk_radius),
        }
    }

    /// The nearest point under the distance of equation 10 that faces the same way, if there is one within a
    /// support radius; else the nearest one within a support radius, whatever its normal. Ties go to the lower
    /// index.
    #[inline]
    pub fn at(&self, x: Vec3, normal: Vec3) -> Option<u32> {
        let best = self.nearer(self.disks.covering(x), (x, normal), self.no_point());
        self.found(best, (x, normal))
    }

    /// [`NearestPoint::at`] of several places, each a position and a normal, into `found`, as long. Faster than one by
    /// one: the table of cells and the cells are larger than caches, and no place waits for what another one loads.
    pub fn at_each(&self, places: &[(Vec3, Vec3)], found: &mut [Option<u32>]) {
        for (places, found) in places.chunks(TOGETHER).zip(found.chunks_mut(TOGETHER)) {
            let mut numbers = [0; TOGETHER];
            let mut spans = [(0, 0); TOGETHER];
            let mut best = [self.no_point(); TOGETHER];
            for (number, place) in numbers.iter_mut().zip(places) {
                *number = self.disks.number(place.0);
            }
            for (span, &number) in spans.iter_mut().zip(&numbers[..places.len()]) {
                *span = self.disks.span(number);
            }
            for ((best, &span), &place) in best.iter_mut().zip(&spans).zip(places) {
                *best = self.nearer(self.disks.points(span).take(1), place, *best);
            }
            for (((found, &best), &span), &place) in found.iter_mut().zip(&best).zip(&spans).zip(places) {
                *found = self.found(self.nearer(self.disks.points(span).skip(1), place, best), place);
            }
        }
    }

    /// What is farther than a disk radius is found in another way.
    #[inline]
    fn no_point(&self) -> Nearest {
        Nearest::within(self.level.disk_radius)
    }

    /// The nearest of some points that face the same way, if it is nearer than `best`.
    #[inline]
    fn nearer<'b>(
        &self,
        entries: impl Iterator<Item = &'b Entry>,
        (x, normal): (Vec3, Vec3),
        mut best: Nearest,
    ) -> Nearest {
        for entry in entries {
            let squared = kernel::distance_squared(x - entry.position, entry.normal);
            // In this order: hardly any point is nearer.
            if best.is_beaten_by(squared, entry.index) && entry.normal.dot(normal) > FACING {
                best = Nearest(squared, entry.index);
            }
        }
        best
    }

    #[inline]
    fn found(&self, best: Nearest, (x, normal): (Vec3, Vec3)) -> Option<u32> {
        best.index().or_else(|| self.beyond_disks(x, normal))
    }

    /// `nearest`, the point nearest to a place, or the next one on the place's side of all walls, if there is one.
    /// `near_separated`: points that a surface separates from a neighbour, empty where none are; `is_separated` is asked about no others
    /// at first.
    #[inline]
    pub fn on_same_side(
        &self,
        (x, normal): (Vec3, Vec3),
        nearest: u32,
        near_separated: &[bool],
        is_separated: impl Fn(u32) -> bool,
    ) -> u32 {
        if !near_separated.get(nearest as usize).copied().unwrap_or(false) || !is_separated(nearest) {
            return nearest;
        }
        self.at_unseparated(x, normal, is_separated).unwrap_or(nearest)
    }

    /// Of the points whose disks cover a place the nearest that faces the same way and that `is_separated` does not reject.
    #[cold]
    fn at_unseparated(&self, x: Vec3, normal: Vec3, is_separated: impl Fn(u32) -> bool) -> Option<u32> {
        let mut near: Vec<(f32, u32)> = (self.disks.covering(x))
            .filter(|entry| entry.normal.dot(normal) > FACING)
            .map(|entry| {
                let squared = kernel::distance_squared(x - entry.position, entry.normal);
                (squared, entry.index)
            })
            .collect();
        near.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        near.into_iter()
            .map(|(_, index)| index)
            .find(|&index| !is_separated(index))
    }

    /// As [`NearestPoint::at`] for places that no disk covers.
    #[cold]
    fn beyond_disks(&self, x: Vec3, normal: Vec3) -> Option<u32> {
        let mut best = Nearest::within(self.level.support_radius);
        (self.level.grid).near(x, |entry| {
            best = self.nearer(std::iter::once(entry), (x, normal), best)
        });
        (best.index()).or_else(|| self.level.nearest_of_any_normal(x))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::poisson::Disks;
    use crate::random::Stream;
    use crate::test_random::{direction, directions};

    fn sphere_level(radius: f32) -> Level {
        let candidates = directions(2, 100_000);
        let mut disks = Disks::new(radius);
        disks.throw(&candidates, &candidates, 0, |_| true);
        Level::new(disks.positions, disks.normals, radius, 2.0 * radius)
    }

    #[test]
    fn functions_sum_to_one_and_end_at_the_support_radius() {
        let level = sphere_level(0.2);
        let mut s = Stream::new(3, 0, 0);
        let mut row = Vec::new();
        for _ in 0..2000 {
            let x = direction(&mut s);
            row.clear();
            level.functions_at(x, x, &mut row);
            assert!(!row.is_empty(), "maximal disks leave no place uncovered");
            let sum: f32 = row.iter().map(|e| e.1).sum();
            // A few dozen roundings of numbers below 1.
            assert!((sum - 1.0).abs() < 1e-5);
            for &(j, b) in &row {
                assert!(b > 0.0 && level.positions[j as usize].distance(x) < level.support_radius);
            }
        }
        row.clear();
        level.functions_at(Vec3::X, Vec3::NEG_X, &mut row);
        assert!(row.is_empty(), "the back of a surface is another place");
    }

    #[test]
    fn functions_found_in_order_are_those_found_alone() {
        let level = sphere_level(0.02);
        let mut memo = FunctionsInOrder::new(&level);
        let mut s = Stream::new(13, 0, 0);
        // Along paths over the sphere and off it, so that cells come again, and through more than are remembered.
        let (mut alone, mut in_order) = (Vec::new(), Vec::new());
        for _ in 0..300 {
            let (from, to) = (direction(&mut s), direction(&mut s));
            for step in 0..50 {
                let normal = from.lerp(to, step as f32 / 50.0).normalize_or(from);
                let x = normal * [1.0, 1.01, 1.3][step % 3];
                level.functions_or_nearest_at(x, normal, &mut alone);
                memo.functions_or_nearest_at(x, normal, &mut in_order);
            }
        }
        assert!(alone.len() > 50_000, "{}", alone.len());
        assert_eq!(alone, in_order);
    }

    #[test]
    fn a_place_in_a_gap_takes_the_nearest_point_of_its_side() {
        let positions = vec![Vec3::ZERO, Vec3::new(0.0, 0.0, 2.5), Vec3::new(0.0, 0.0, 30.0)];
        let normals = vec![Vec3::NEG_Y, Vec3::Y, Vec3::Y];
        let level = Level::new(positions, normals, 0.5, 1.0);
        let at = |z: f32| {
            let mut row = Vec::new();
            level.functions_or_nearest_at(Vec3::new(0.0, 0.0, z), Vec3::Y, &mut row);
            row
        };
        assert_eq!(
            at(0.5),
            [(0, 1.0)],
            "within a support the other side is better than nothing"
        );
        assert_eq!(at(1.1), [(1, 1.0)], "farther away it is not");
        assert_eq!(at(10.4), [(1, 1.0)]);
        assert!(at(15.0).is_empty(), "beyond eight supports light says nothing");
    }

    #[test]
    fn places_looked_up_together_find_what_each_finds_alone() {
        let level = sphere_level(0.1);
        let nearest = NearestPoint::new(&level);
        let mut s = Stream::new(12, 0, 0);
        // On the sphere, off it, far from it, and facing away.
        let places: Vec<(Vec3, Vec3)> = (0..1000)
            .map(|i| {
                let x = direction(&mut s);
                let far = [1.0, 1.02, 1.19, 3.0][i % 4];
                (x * far, if i % 7 == 0 { -x } else { x })
            })
            .collect();
        let mut found = vec![None; places.len()];
        nearest.at_each(&places, &mut found);
        for (&(x, normal), &found) in places.iter().zip(&found) {
            assert_eq!(found, nearest.at(x, normal));
        }
        assert!(found.contains(&None) && found.iter().flatten().count() > 500);
    }
}
