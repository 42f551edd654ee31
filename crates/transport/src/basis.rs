//! One level of the meshless basis: Shepard functions over oriented points.
//!
//! Source: Lehtinen et al. 2008, equations 1 to 3 (Shepard approximation and its basis functions) and 8 to
//! 10 (weights). The functions of a level sum to one wherever any of them is non-zero and vanish beyond the
//! support radius.

use crate::grid::{DiskGrid, DiskMemo, Entry, PointGrid, entries};
use crate::kernel::{self, width};
use glam::Vec3;
use std::sync::OnceLock;

/// Cosine between normals above which two places count as facing the same way: 60°, at which the squared
/// cosine of equation 8 has fallen to a quarter.
const FACING: f32 = 0.5;

/// Supports within which a place that no function covers and that has no point near looks for one: crevices that no
/// candidate met are narrower, and the light of places farther away says nothing about its own.
const FAR: f32 = 8.0;

/// Disk radii within which another point may be the nearest on its own side of a wall to a place that a point's disk covers from beyond:
/// one to the place, and, since disks know of no walls and may leave a strip along one to the next room's points, two from there.
const ACROSS: f32 = 3.0;

/// Points around a crevice that are asked whether surfaces separate them from it, nearest first: what none of so many sees is closed.
const ASKED: usize = 16;

/// Points of one level with the functions they carry.
#[derive(Clone, Debug)]
pub struct Level {
    /// Poisson-disk radius R of the level: points are at least this far apart under equation 11, times their widenings.
    pub disk_radius: f32,
    /// Support radius r = C·R of every function of the level, times its point's widening.
    pub support_radius: f32,
    /// World space.
    pub positions: Vec<Vec3>,
    /// Unit normals.
    pub normals: Vec<Vec3>,
    /// How much wider than the level's the radii of each point are, as a power of two; empty: none is.
    pub widenings: Vec<u8>,
    /// The points by widening, from the narrowest.
    bands: Vec<Band>,
    /// Where their disks are, found when it is first asked for.
    disks: OnceLock<Vec<WideDisks>>,
}

/// Disks of points that are equally wide.
#[derive(Clone, Debug)]
struct WideDisks {
    radius: f32,
    grid: DiskGrid,
}

/// Points of a level whose radii are equally wide.
#[derive(Clone, Debug)]
struct Band {
    /// Their radii over the level's.
    width: f32,
    grid: PointGrid,
}

impl Band {
    /// What their weights are multiplied by: the narrower a point, the more it knows of its surroundings, and where there are narrow ones a
    /// wide one from far away has no say.
    #[inline]
    fn say(&self) -> f32 {
        1.0 / (self.width * self.width)
    }
}

/// Points by widening, from the narrowest, with their widenings' [`width`].
pub(crate) fn by_width(positions: &[Vec3], normals: &[Vec3], widenings: &[u8]) -> Vec<(f32, Vec<Entry>)> {
    let all = entries(positions, normals);
    let Some(&widest) = widenings.iter().max() else {
        return vec![(1.0, all)];
    };
    let mut bands: Vec<(f32, Vec<Entry>)> = (0..=widest).map(|k| (width(k), Vec::new())).collect();
    for (entry, &widening) in all.into_iter().zip(widenings) {
        bands[usize::from(widening)].1.push(entry);
    }
    bands.retain(|band| !band.1.is_empty());
    bands
}

impl Level {
    /// A level over the given points, all as wide as the level says.
    pub fn new(positions: Vec<Vec3>, normals: Vec<Vec3>, disk_radius: f32, support_radius: f32) -> Level {
        Level::widened(positions, normals, Vec::new(), disk_radius, support_radius)
    }

    /// A level over the given points. `widenings`: one for each, or none at all.
    pub fn widened(
        positions: Vec<Vec3>,
        normals: Vec<Vec3>,
        widenings: Vec<u8>,
        disk_radius: f32,
        support_radius: f32,
    ) -> Level {
        let bands = by_width(&positions, &normals, &widenings)
            .into_iter()
            .map(|(width, points)| Band {
                width,
                grid: PointGrid::of(points, support_radius * width),
            })
            .collect();
        Level {
            disk_radius,
            support_radius,
            positions,
            normals,
            widenings,
            bands,
            disks: OnceLock::new(),
        }
    }

    /// Their disks by width, from the narrowest.
    fn disks(&self) -> &[WideDisks] {
        self.disks.get_or_init(|| {
            let of = |(width, points)| {
                let radius = self.disk_radius * width;
                let grid = DiskGrid::of(points, radius);
                WideDisks { radius, grid }
            };
            let by_width = by_width(&self.positions, &self.normals, &self.widenings);
            by_width.into_iter().map(of).collect()
        })
    }

    /// The same points with functions of another support radius.
    pub fn with_support(&self, support_radius: f32) -> Level {
        Level::widened(
            self.positions.clone(),
            self.normals.clone(),
            self.widenings.clone(),
            self.disk_radius,
            support_radius,
        )
    }

    /// The same points, with functions that reach all neighbours that a wall may separate them from.
    pub fn across_walls(&self) -> Level {
        self.with_support(self.support_radius.max(ACROSS * self.disk_radius))
    }

    /// Poisson-disk radius of a point.
    #[inline]
    pub fn disk_radius_of(&self, point: usize) -> f32 {
        (self.widenings.get(point)).map_or(self.disk_radius, |&k| self.disk_radius * width(k))
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
        for band in &self.bands {
            let inverse = 1.0 / (self.support_radius * band.width);
            let say = band.say();
            band.grid.near(x, |entry| {
                let w = kernel::weight(
                    x - entry.position,
                    entry.normal,
                    inverse,
                    entry.normal.dot(normal),
                );
                if w > 0.0 {
                    visit(entry.index, w * say);
                }
            });
        }
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
            out.extend((self.nearest_in_gap(x, normal, |_| false)).map(|index| (index, 1.0)));
        }
    }

    /// What stands for a place that no function covers: the nearest point within a support radius that `is_separated` does not reject, whatever
    /// its normal; failing that, the nearest of the same side within [`FAR`] supports. Of each the [`ASKED`] nearest are asked about.
    #[cold]
    fn nearest_in_gap(&self, x: Vec3, normal: Vec3, is_separated: impl Fn(u32) -> bool) -> Option<u32> {
        let first = |near: Vec<(f32, u32)>| {
            let mut near = nearest_first(near).into_iter().take(ASKED);
            near.find(|&index| !is_separated(index))
        };
        first(self.within_support(x)).or_else(|| first(self.far_of_same_side(x, normal)))
    }

    /// Points within a support radius, with their squared distances.
    fn within_support(&self, x: Vec3) -> Vec<(f32, u32)> {
        let mut found = Vec::new();
        for band in &self.bands {
            let reach = self.support_radius * band.width;
            band.grid.near(x, |entry| {
                let squared = entry.position.distance_squared(x);
                if squared < reach * reach {
                    found.push((squared, entry.index));
                }
            });
        }
        found
    }

    /// Points within [`FAR`] supports that face the same half space, with their squared distances.
    fn far_of_same_side(&self, x: Vec3, normal: Vec3) -> Vec<(f32, u32)> {
        let mut found = Vec::new();
        self.each_far(x, |squared, entry| {
            if entry.normal.dot(normal) > 0.0 {
                found.push((squared, entry.index));
            }
        });
        found
    }

    /// Calls `visit` with the squared distance of every point within [`FAR`] of its supports.
    fn each_far(&self, x: Vec3, mut visit: impl FnMut(f32, &Entry)) {
        for band in &self.bands {
            let reach = FAR * self.support_radius * band.width;
            band.grid.around(x, (FAR / 2.0) as i32, |entry| {
                let squared = entry.position.distance_squared(x);
                if squared <= reach * reach {
                    visit(squared, entry);
                }
            });
        }
    }

    /// The nearest of what is nearest in each band.
    fn nearest_by_band(&self, nearest: impl Fn(&Band) -> Nearest) -> Nearest {
        let found = self.bands.iter().map(nearest);
        found.fold(Nearest::NONE, Nearest::or)
    }

    /// The nearest point within a support radius, whatever its normal. Ties go to the lower index.
    fn nearest_of_any_normal(&self, x: Vec3) -> Option<u32> {
        self.nearest_by_band(|band| {
            let mut best = Nearest::within(self.support_radius * band.width);
            (band.grid).near(x, |entry| {
                best.offer(entry.position.distance_squared(x), entry.index)
            });
            best
        })
        .index()
    }
}

/// The nearest point that was offered: squared distance, index.
#[derive(Clone, Copy, Debug)]
struct Nearest(f32, u32);

impl Nearest {
    /// No point.
    const NONE: Nearest = Nearest(f32::INFINITY, u32::MAX);

    /// The nearer of two.
    #[inline]
    fn or(self, other: Nearest) -> Nearest {
        match other.index() {
            Some(index) if self.is_beaten_by(other.0, index) => other,
            _ => self,
        }
    }

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

/// Points by their squared distances, the nearest first. Ties go to the lower index.
fn nearest_first(mut points: Vec<(f32, u32)>) -> Vec<u32> {
    points.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    points.into_iter().map(|(_, index)| index).collect()
}

/// Finds functions at one place after another; the faster, the closer together places that follow each other lie.
#[derive(Clone, Debug)]
pub struct FunctionsInOrder<'a> {
    level: &'a Level,
    /// One for each band.
    memos: Vec<DiskMemo<'a>>,
    weights: Vec<f32>,
}

impl<'a> FunctionsInOrder<'a> {
    /// Of a level's functions.
    pub fn new(level: &'a Level) -> FunctionsInOrder<'a> {
        FunctionsInOrder {
            level,
            memos: level.bands.iter().map(|band| DiskMemo::new(&band.grid)).collect(),
            weights: Vec::new(),
        }
    }

    /// [`Level::functions_or_nearest_at`], bit by bit; of a place that no function covers, points that `is_separated` rejects are left out.
    pub fn functions_or_nearest_at(
        &mut self,
        x: Vec3,
        normal: Vec3,
        is_separated: impl Fn(u32) -> bool,
        out: &mut Vec<(u32, f32)>,
    ) {
        let start = out.len();
        let mut sum = 0.0;
        for (memo, band) in self.memos.iter_mut().zip(&self.level.bands) {
            let indices = memo.weights(x, normal, &mut self.weights);
            let say = band.say();
            for (&j, &w) in indices.iter().zip(&self.weights) {
                if w > 0.0 {
                    out.push((j, w * say));
                    sum += w * say;
                }
            }
        }
        for entry in &mut out[start..] {
            entry.1 /= sum;
        }
        if out.len() == start {
            let nearest = self.level.nearest_in_gap(x, normal, is_separated);
            out.extend(nearest.map(|index| (index, 1.0)));
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
    disks: &'a [WideDisks],
}

impl<'a> NearestPoint<'a> {
    /// Prepares the look-up, which the level keeps. The nearest point of a maximal disk set is within a disk radius.
    pub fn new(level: &'a Level) -> NearestPoint<'a> {
        NearestPoint {
            level,
            disks: level.disks(),
        }
    }

    /// The nearest point under the distance of equation 10 that faces the same way, if there is one within a
    /// support radius; else the nearest one within a support radius, whatever its normal. Ties go to the lower
    /// index.
    #[inline]
    pub fn at(&self, x: Vec3, normal: Vec3) -> Option<u32> {
        let mut best = Nearest::NONE;
        for disks in self.disks {
            let within = Nearest::within(disks.radius);
            best = best.or(self.nearer(disks.grid.covering(x), (x, normal), within));
        }
        self.found(best, (x, normal))
    }

    /// [`NearestPoint::at`] of several places, each a position and a normal, into `found`, as long. Faster than one by
    /// one: the table of cells and the cells are larger than caches, and no place waits for what another one loads.
    pub fn at_each(&self, places: &[(Vec3, Vec3)], found: &mut [Option<u32>]) {
        for (places, found) in places.chunks(TOGETHER).zip(found.chunks_mut(TOGETHER)) {
            let mut best = [Nearest::NONE; TOGETHER];
            for disks in self.disks {
                self.offer_each(disks, places, &mut best);
            }
            for ((found, &best), &place) in found.iter_mut().zip(&best).zip(places) {
                *found = self.found(best, place);
            }
        }
    }

    /// Offers each place the nearest of the disks that cover it; what is farther than their radius is found in another way.
    fn offer_each(
        &self,
        &WideDisks {
            radius,
            grid: ref disks,
        }: &WideDisks,
        places: &[(Vec3, Vec3)],
        best: &mut [Nearest; TOGETHER],
    ) {
        let mut numbers = [0; TOGETHER];
        let mut spans = [(0, 0); TOGETHER];
        let mut nearest = [Nearest::within(radius); TOGETHER];
        for (number, place) in numbers.iter_mut().zip(places) {
            *number = disks.number(place.0);
        }
        for (span, &number) in spans.iter_mut().zip(&numbers[..places.len()]) {
            *span = disks.span(number);
        }
        for ((nearest, &span), &place) in nearest.iter_mut().zip(&spans).zip(places) {
            *nearest = self.nearer(disks.points(span).take(1), place, *nearest);
        }
        for (((best, &nearest), &span), &place) in best.iter_mut().zip(&nearest).zip(&spans).zip(places) {
            *best = best.or(self.nearer(disks.points(span).skip(1), place, nearest));
        }
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
    /// at first. Where all that face the same way are separated, a far one gives way to what is close by.
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
        let unseparated = self.at_unseparated(x, normal, &is_separated);
        unseparated.unwrap_or_else(|| self.around_far(x, nearest, is_separated))
    }

    /// What stands for a place in place of `far`, the point nearest to it, which is separated: of those around it, whatever their normals, the nearest
    /// that `is_separated` does not reject, or the very nearest. Of a crevice that has no points all that says anything is close by, though a far wide
    /// point's disk may cover it. A point that is close itself stays.
    #[cold]
    fn around_far(&self, x: Vec3, far: u32, is_separated: impl Fn(u32) -> bool) -> u32 {
        let level = self.level;
        if level.positions[far as usize].distance(x) <= FAR * level.support_radius {
            return far;
        }
        let mut near = Vec::new();
        level.each_far(x, |squared, entry| near.push((squared, entry.index)));
        let near = nearest_first(near);
        let open = near.iter().take(ASKED).find(|&&index| !is_separated(index));
        *open.or(near.first()).unwrap_or(&far)
    }

    /// The nearest point that faces the same way and that `is_separated` does not reject: of those whose disks cover a place, else within
    /// their supports. Disks know of no walls, and those of the next room may be all that covers the strip along one.
    #[cold]
    fn at_unseparated(&self, x: Vec3, normal: Vec3, is_separated: &impl Fn(u32) -> bool) -> Option<u32> {
        let first = |near: Vec<Entry>| {
            let measured = |entry: Entry| {
                let squared = kernel::distance_squared(x - entry.position, entry.normal);
                (entry.normal.dot(normal) > FACING).then_some((squared, entry.index))
            };
            let near = nearest_first(near.into_iter().filter_map(measured).collect());
            near.into_iter().find(|&index| !is_separated(index))
        };
        let covering = (self.disks.iter()).flat_map(|disks| disks.grid.covering(x));
        first(covering.copied().collect()).or_else(|| {
            let mut near = Vec::new();
            for band in &self.level.bands {
                band.grid.near(x, |entry| near.push(*entry));
            }
            first(near)
        })
    }

    /// As [`NearestPoint::at`] for places that no disk covers.
    #[cold]
    fn beyond_disks(&self, x: Vec3, normal: Vec3) -> Option<u32> {
        let best = self.level.nearest_by_band(|band| {
            let mut best = Nearest::within(self.level.support_radius * band.width);
            (band.grid).near(x, |entry| {
                best = self.nearer(std::iter::once(entry), (x, normal), best)
            });
            best
        });
        (best.index()).or_else(|| self.level.nearest_of_any_normal(x))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::poisson::{Dart, Disks};
    use crate::random::Stream;
    use crate::test_random::{direction, directions};

    fn sphere_level(radius: f32) -> Level {
        let candidates = directions(2, 100_000);
        let mut disks = Disks::new(radius);
        let darts: Vec<Dart> = candidates.iter().map(|&x| Dart::plain(x, x)).collect();
        disks.throw(&darts, 0, |_| true);
        Level::new(disks.positions, disks.normals, radius, 2.0 * radius)
    }

    /// Truth: a wall at x = 0 on a floor, with the last point before it a twentieth of a radius away and the first behind it beyond its disk, so
    /// that the strip along the far side is covered from the near side alone.
    #[test]
    fn a_strip_that_only_the_next_room_covers_takes_the_nearest_point_of_its_own() {
        let positions = [-0.005, 0.13, 0.3].map(|x| Vec3::new(x, 0.0, 0.0)).to_vec();
        let level = Level::new(positions, vec![Vec3::Y; 3], 0.1, 0.2);
        let nearest = NearestPoint::new(&level);
        let place = (Vec3::new(0.02, 0.0, 0.0), Vec3::Y);
        let found = nearest.at(place.0, place.1).unwrap();
        assert_eq!(found, 0);
        let beyond = |point: u32| level.positions[point as usize].x < 0.0;
        assert_eq!(
            nearest.on_same_side(place, found, &[true, true, false], beyond),
            1
        );
    }

    /// Truth: a wall with points 10 cm apart beside a board that has none, and a far ground, 100 m wide, whose disk covers all of it.
    #[test]
    fn a_crevice_takes_what_is_close_and_not_the_far_ground_that_covers_it() {
        let mut positions: Vec<Vec3> = (0..4).map(|i| Vec3::new(0.0, 0.1 * i as f32, 0.0)).collect();
        let mut normals = vec![Vec3::X; 4];
        positions.push(Vec3::new(50.0, 0.0, 0.0));
        normals.push(Vec3::Y);
        let level = Level::widened(positions, normals, vec![0, 0, 0, 0, 10], 0.1, 0.2);
        let nearest = NearestPoint::new(&level);
        let place = (Vec3::new(0.3, 0.21, 0.0), Vec3::Y);
        let found = nearest.at(place.0, place.1).unwrap();
        assert_eq!(found, 4);
        let near_separated = [false, false, false, false, true];
        let of =
            |is_separated: fn(u32) -> bool| nearest.on_same_side(place, found, &near_separated, is_separated);
        assert_eq!(of(|_| false), 4, "nothing is between them");
        assert_eq!(of(|point| point == 4), 2, "the nearest on the wall");
        assert_eq!(
            of(|point| point == 4 || point == 2),
            3,
            "the next nearest, which it sees"
        );
        assert_eq!(of(|_| true), 2, "closed all around: the nearest");
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

    /// A plane with points 0.1 apart in the middle and, from 2 on, 0.4 apart.
    fn widened_level() -> Level {
        let mut s = Stream::new(21, 0, 0);
        let darts: Vec<Dart> = (0..400_000)
            .map(|_| Vec3::new(s.uniform() - 0.5, 0.0, s.uniform() - 0.5) * 10.0)
            .map(|x| Dart {
                widening: if x.abs().max_element() > 2.0 { 2 } else { 0 },
                ..Dart::plain(x, Vec3::Y)
            })
            .collect();
        let mut disks = Disks::new(0.1);
        disks.throw(&darts, 0, |_| true);
        Level::widened(disks.positions, disks.normals, disks.widenings, 0.1, 0.2)
    }

    #[test]
    fn wide_points_keep_their_own_distance_and_leave_no_gap() {
        let level = widened_level();
        let (narrow, wide) = (
            level.len() - level.widenings.iter().filter(|k| **k == 2).count(),
            84.0 / 16.0,
        );
        // 0.70 points per squared radius (Lagae and Dutré 2008), within the noise and the boundary's of so few.
        assert!((narrow as f32 / (0.7 * 1600.0) - 1.0).abs() < 0.1, "{narrow}");
        assert!(
            ((level.len() - narrow) as f32 / (0.7 * wide * 100.0) - 1.0).abs() < 0.15,
            "{}",
            level.len() - narrow
        );
        for i in 0..level.len() {
            for j in 0..i {
                let radius = level.disk_radius_of(i).min(level.disk_radius_of(j));
                assert!(level.positions[i].distance(level.positions[j]) >= radius * 0.999);
            }
        }
    }

    /// Truth: all points one by one.
    #[test]
    fn functions_and_nearest_points_of_a_widened_level_are_those_of_a_search_through_all() {
        let level = widened_level();
        let nearest = NearestPoint::new(&level);
        let mut memo = FunctionsInOrder::new(&level);
        let mut s = Stream::new(22, 0, 0);
        let places: Vec<(Vec3, Vec3)> = (0..2000)
            .map(|_| {
                (
                    Vec3::new(s.uniform() - 0.5, 0.0, s.uniform() - 0.5) * 9.6,
                    Vec3::Y,
                )
            })
            .collect();
        let mut found = vec![None; places.len()];
        nearest.at_each(&places, &mut found);
        let (mut row, mut in_order) = (Vec::new(), Vec::new());
        for (&(x, normal), &found) in places.iter().zip(&found) {
            let distances = |i: usize| level.positions[i].distance(x);
            let within = (0..level.len()).filter(|&i| distances(i) < level.disk_radius_of(i));
            let best = within.min_by(|&a, &b| distances(a).total_cmp(&distances(b)));
            assert!(found == nearest.at(x, normal));
            if let Some(best) = best {
                assert_eq!(found, Some(best as u32), "{x}");
            }
            row.clear();
            in_order.clear();
            level.functions_at(x, normal, &mut row);
            memo.functions_or_nearest_at(x, normal, |_| false, &mut in_order);
            assert_eq!(row, in_order);
            assert!((row.iter().map(|e| e.1).sum::<f32>() - 1.0).abs() < 1e-5);
            let reaching =
                (0..level.len()).filter(|&i| distances(i) < 2.0 * level.disk_radius_of(i) * 0.9999);
            assert!(reaching.clone().all(|i| row.iter().any(|e| e.0 == i as u32)));
            // Well inside, wide points from outside have no say.
            let wide: f32 = row
                .iter()
                .filter(|e| level.widenings[e.0 as usize] > 0)
                .map(|e| e.1)
                .sum();
            assert!(x.abs().max_element() > 1.9 || wide < 0.05, "{x}: {wide}");
        }
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
                memo.functions_or_nearest_at(x, normal, |_| false, &mut in_order);
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
