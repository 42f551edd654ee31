//! Hashed grids over oriented points, for finding all points within a fixed radius.
//!
//! The meshless paper stores each level in an R-tree (section 2.1); all supports of a level have one radius,
//! so a grid answers the same query with eight look-ups and no traversal.

use crate::kernel::{self, SQUASH};
use crate::random::mix;
use glam::{IVec3, Vec3};
use std::hash::Hasher;

/// A point as the grid keeps it.
#[derive(Clone, Copy, Debug)]
#[repr(align(32))]
pub struct Entry {
    /// Position, world space.
    pub position: Vec3,
    /// Unit normal.
    pub normal: Vec3,
    /// Index of the point in the arrays the grid was built from.
    pub index: u32,
}

/// Points as grids keep them, numbered as they come.
pub fn entries(positions: &[Vec3], normals: &[Vec3]) -> Vec<Entry> {
    (0..)
        .zip(positions.iter().zip(normals))
        .map(|(index, (&position, &normal))| Entry {
            position,
            normal,
            index,
        })
        .collect()
}

/// Cells along one edge of a block, as a power of two. Rays that leave neighbouring receivers in the same direction end in the
/// same block, which is one place in memory; hashed one by one, their cells would lie anywhere.
const BLOCK_BITS: i32 = 2;

/// Cells of a block.
const BLOCK: usize = 1 << (3 * BLOCK_BITS);

/// Which points are in each cell, cells sorted by block, and a hash table of blocks.
#[derive(Clone, Debug)]
struct Cells {
    /// Open-addressing table of (block key, first cell); empty where the cell is [`EMPTY`].
    table: Vec<(u64, u32)>,
    /// Where each cell's entries begin and, at the next cell, end.
    starts: Vec<u32>,
    /// The cells' points. As numbers: a point is in some ten cells of a [`DiskGrid`], and memory that is read is what look-ups
    /// wait for.
    entries: Vec<u32>,
    points: Vec<Entry>,
}

/// No block.
const EMPTY: u32 = u32::MAX;

/// A coordinate's bits in a key.
const MASK: u64 = (1 << 21) - 1;

/// Packs the coordinates of a cell or a block, 21 bits each. Those 2²¹ apart share a key: their points are found and then
/// rejected by distance.
#[inline]
pub fn key_of(cell: IVec3) -> u64 {
    (cell.x as u64 & MASK) | ((cell.y as u64 & MASK) << 21) | ((cell.z as u64 & MASK) << 42)
}

/// A cell that has a key: that with coordinates from 0 to 2²¹ − 1.
#[inline]
pub fn cell_of(key: u64) -> IVec3 {
    IVec3::new(
        (key & MASK) as i32,
        (key >> 21 & MASK) as i32,
        (key >> 42 & MASK) as i32,
    )
}

/// Hashes of [`key_of`]: the keys are short, and tables of cells are asked a hundred million times.
#[derive(Clone, Default)]
pub struct CellHasher(u64);

impl Hasher for CellHasher {
    fn finish(&self) -> u64 {
        self.0
    }
    fn write(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.0 = mix(self.0 ^ u64::from(byte));
        }
    }
    fn write_u64(&mut self, key: u64) {
        self.0 = mix(key);
    }
}

/// The cell of edge 1 that holds a place; the last one beyond what integers hold. Without [`f32::floor`], which is a call on
/// processors that compilers must reckon with.
#[inline]
pub(crate) fn cell_at(x: Vec3) -> IVec3 {
    let truncated = x.as_ivec3();
    truncated.wrapping_sub(IVec3::from(truncated.as_vec3().cmpgt(x)))
}

/// Key of a cell's block, and the cell's number in it.
#[inline]
fn block_of(cell: IVec3) -> (u64, u32) {
    let inside = cell & ((1 << BLOCK_BITS) - 1);
    let number = inside.x | inside.y << BLOCK_BITS | inside.z << (2 * BLOCK_BITS);
    (key_of(cell >> BLOCK_BITS), number as u32)
}

#[inline]
fn slot_of(key: u64, mask: usize) -> usize {
    // Fibonacci hashing: the high bits of the product depend on all bits of the key.
    (key.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 32) as usize & mask
}

impl Cells {
    /// From pairs of cell and place in `points`; a point may be in several cells.
    fn new(placed: impl Iterator<Item = (IVec3, u32)>, points: Vec<Entry>) -> Cells {
        // Block, cell in it, point.
        let mut placed: Vec<(u64, u32, u32)> = placed
            .map(|(cell, point)| {
                let (block, inside) = block_of(cell);
                (block, inside, point)
            })
            .collect();
        placed.sort_unstable();
        let blocks = || placed.chunk_by(|a, b| a.0 == b.0);
        let size = (2 * blocks().count()).next_power_of_two().max(2);
        let mut table = vec![(0u64, EMPTY); size];
        let mut starts = Vec::new();
        let mut end = 0;
        for block in blocks() {
            let key = block[0].0;
            let mut slot = slot_of(key, size - 1);
            while table[slot].1 != EMPTY {
                slot = (slot + 1) & (size - 1);
            }
            table[slot] = (key, starts.len() as u32);
            let mut counts = [0; BLOCK];
            block.iter().for_each(|entry| counts[entry.1 as usize] += 1);
            for count in counts {
                starts.push(end);
                end += count;
            }
        }
        starts.push(end);
        Cells {
            table,
            starts,
            entries: placed.iter().map(|entry| entry.2).collect(),
            points,
        }
    }

    /// What is in a cell.
    #[inline]
    fn at(&self, cell: IVec3) -> impl ExactSizeIterator<Item = &Entry> {
        self.points(self.span(self.number(cell)))
    }

    /// Number of a cell, [`EMPTY`] where its whole block is empty.
    #[inline]
    fn number(&self, cell: IVec3) -> u32 {
        let (key, inside) = block_of(cell);
        let mask = self.table.len() - 1;
        let mut slot = slot_of(key, mask);
        loop {
            let (found, first) = self.table[slot];
            if first == EMPTY {
                return EMPTY;
            }
            if found == key {
                return first + inside;
            }
            slot = (slot + 1) & mask;
        }
    }

    /// Which entries are in a cell of known number: from, to.
    #[inline]
    fn span(&self, number: u32) -> (u32, u32) {
        match self.starts.get(number as usize..) {
            Some(&[first, end, ..]) => (first, end),
            _ => (0, 0),
        }
    }

    /// Points of a span.
    #[inline]
    fn points(&self, (first, end): (u32, u32)) -> impl ExactSizeIterator<Item = &Entry> {
        let entries = &self.entries[first as usize..end as usize];
        entries.iter().map(|&i| &self.points[i as usize])
    }
}

/// Points in cells of twice the query radius: a ball meets at most 2×2×2 of them.
#[derive(Clone, Debug)]
pub struct PointGrid {
    inverse_cell: f32,
    cells: Cells,
}

impl PointGrid {
    /// A grid for queries of at most `radius`.
    pub fn new(positions: &[Vec3], normals: &[Vec3], radius: f32) -> PointGrid {
        PointGrid::of(entries(positions, normals), radius)
    }

    /// A grid of these points for queries of at most `radius`.
    pub fn of(points: Vec<Entry>, radius: f32) -> PointGrid {
        let inverse_cell = 0.5 / radius;
        let cells: Vec<IVec3> = (points.iter())
            .map(|entry| cell_at(entry.position * inverse_cell))
            .collect();
        PointGrid {
            inverse_cell,
            cells: Cells::new(cells.into_iter().zip(0..), points),
        }
    }

    /// Calls `visit` for every point within the radius of `x`, and for some beyond it, in an order that
    /// depends on the points and `x` alone.
    #[inline]
    pub fn near(&self, x: Vec3, mut visit: impl FnMut(&Entry)) {
        self.near_half_cell(self.half_cell(x), &mut visit);
    }

    /// The cell, as wide as the radius, that holds `x`.
    #[inline]
    fn half_cell(&self, x: Vec3) -> IVec3 {
        cell_at(x * (2.0 * self.inverse_cell))
    }

    /// [`PointGrid::near`] of all places in a cell as wide as the radius.
    #[inline]
    fn near_half_cell(&self, half_cell: IVec3, mut visit: impl FnMut(&Entry)) {
        // Places that no integer holds are clamped to the last cell.
        let base = half_cell.wrapping_sub(IVec3::ONE) >> 1;
        for corner in 0..8 {
            let cell = base + IVec3::new(corner & 1, (corner >> 1) & 1, corner >> 2);
            self.cells.at(cell).for_each(&mut visit);
        }
    }

    /// Calls `visit` for every point within `cells` cells of twice the radius around that of `x`, and so for all nearer
    /// than that many.
    pub fn around(&self, x: Vec3, cells: i32, mut visit: impl FnMut(&Entry)) {
        let middle = cell_at(x * self.inverse_cell);
        for dz in -cells..=cells {
            for dy in -cells..=cells {
                for dx in -cells..=cells {
                    let cell = middle + IVec3::new(dx, dy, dz);
                    self.cells.at(cell).for_each(&mut visit);
                }
            }
        }
    }
}

/// Whether the disk of a point, as flat as equation 10 makes it, may reach into a cell. In units of its radius, which is
/// the cell's width: `offset` from the point to the cell's middle.
fn may_reach(offset: Vec3, normal: Vec3) -> bool {
    // Half an edge, grown a little for rounding.
    let half = Vec3::splat(0.5 + 1e-3);
    let beyond = (offset.abs() - half).max(Vec3::ZERO);
    beyond.length_squared() <= 1.0
        && offset.dot(normal).abs() <= half.dot(normal.abs()) + 1.0 / (1.0 + SQUASH)
}

/// What [`PointGrid::near`] finds, kept for the places that follow: for each cell as wide as the radius the points whose
/// disks reach into it, in the same order. Places that follow each other lie close together, and share one look-up
/// and a third of the points.
#[derive(Clone, Debug)]
pub struct DiskMemo<'a> {
    grid: &'a PointGrid,
    /// (cell key, first entry, end entry) where the key's hash says; a cell that comes later takes the place of another.
    table: Vec<(u64, u32, u32)>,
    entries: EntryColumns,
}

/// Entries, each component in an array of its own: a loop over them is worked off several at a time.
#[derive(Clone, Debug, Default)]
struct EntryColumns {
    position: [Vec<f32>; 3],
    normal: [Vec<f32>; 3],
    index: Vec<u32>,
}

/// Cells that a [`DiskMemo`] remembers: more than a few rows of an image cross.
const REMEMBERED: usize = 4096;

/// Entries after which a [`DiskMemo`] starts anew: 2 MB, what a core has of fast memory.
const MOST_REMEMBERED: usize = 1 << 16;

impl<'a> DiskMemo<'a> {
    /// Remembers nothing yet.
    pub fn new(grid: &'a PointGrid) -> DiskMemo<'a> {
        DiskMemo {
            grid,
            table: vec![(u64::MAX, 0, 0); REMEMBERED],
            entries: EntryColumns::default(),
        }
    }

    /// Weights of equation 8 at a place, of all points whose disks (of the grid's radius) cover it and some others whose
    /// weight is zero, and their indices.
    pub fn weights(&mut self, x: Vec3, normal: Vec3, weights: &mut Vec<f32>) -> &[u32] {
        let cell = self.grid.half_cell(x);
        let key = key_of(cell);
        let slot = slot_of(key, REMEMBERED - 1);
        if self.table[slot].0 != key {
            self.table[slot] = self.remember(cell, key);
        }
        let (_, first, end) = self.table[slot];
        let range = first as usize..end as usize;
        let inverse = 2.0 * self.grid.inverse_cell;
        let [px, py, pz] = self.entries.position.each_ref().map(|p| &p[range.clone()]);
        let [nx, ny, nz] = self.entries.normal.each_ref().map(|n| &n[range.clone()]);
        weights.clear();
        weights.extend((0..px.len()).map(|i| {
            let own = Vec3::new(nx[i], ny[i], nz[i]);
            kernel::weight(x - Vec3::new(px[i], py[i], pz[i]), own, inverse, own.dot(normal))
        }));
        &self.entries.index[range]
    }

    #[cold]
    fn remember(&mut self, cell: IVec3, key: u64) -> (u64, u32, u32) {
        if self.entries.index.len() > MOST_REMEMBERED {
            self.entries = EntryColumns::default();
            self.table.fill((u64::MAX, 0, 0));
        }
        let scale = 2.0 * self.grid.inverse_cell;
        let first = self.entries.index.len() as u32;
        self.grid.near_half_cell(cell, |entry| {
            if may_reach(cell.as_vec3() + 0.5 - entry.position * scale, entry.normal) {
                self.entries.push(entry);
            }
        });
        (key, first, self.entries.index.len() as u32)
    }
}

impl EntryColumns {
    fn push(&mut self, entry: &Entry) {
        for axis in 0..3 {
            self.position[axis].push(entry.position[axis]);
            self.normal[axis].push(entry.normal[axis]);
        }
        self.index.push(entry.index);
    }
}

/// Points in all cells that their disks touch: one look-up finds every point whose disk covers a place. Takes
/// some ten times the memory of a [`PointGrid`], and half the time: of its eight cells half are empty, in no order
/// that a processor could guess.
#[derive(Clone, Debug)]
pub struct DiskGrid {
    inverse_cell: f32,
    cells: Cells,
}

impl DiskGrid {
    /// A grid over disks of `radius`, as flat as equation 10 makes them.
    pub fn of(points: Vec<Entry>, radius: f32) -> DiskGrid {
        let inverse_cell = 1.0 / radius;
        let mut placed = Vec::new();
        for (i, Entry { position, normal, .. }) in points.iter().enumerate() {
            let p = *position * inverse_cell;
            let (low, high) = (cell_at(p - 1.0), cell_at(p + 1.0));
            for z in low.z..=high.z {
                for y in low.y..=high.y {
                    for x in low.x..=high.x {
                        let cell = IVec3::new(x, y, z);
                        if may_reach(cell.as_vec3() + 0.5 - p, *normal) {
                            placed.push((cell, i as u32));
                        }
                    }
                }
            }
        }
        DiskGrid {
            inverse_cell,
            cells: Cells::new(placed.into_iter(), points),
        }
    }

    /// Every point whose disk covers `x`, and some others.
    #[inline]
    pub fn covering(&self, x: Vec3) -> impl ExactSizeIterator<Item = &Entry> {
        self.cells.at(self.cell(x))
    }

    /// Number of the cell that holds `x`. With [`DiskGrid::span`] and [`DiskGrid::points`] this is [`DiskGrid::covering`] in
    /// steps: memory answers many questions at a time as long as none waits for the answer of another.
    #[inline]
    pub fn number(&self, x: Vec3) -> u32 {
        self.cells.number(self.cell(x))
    }

    /// Where the points of the cell of a [`DiskGrid::number`] are listed: from, to.
    #[inline]
    pub fn span(&self, number: u32) -> (u32, u32) {
        self.cells.span(number)
    }

    /// Points of a [`DiskGrid::span`].
    #[inline]
    pub fn points(&self, span: (u32, u32)) -> impl ExactSizeIterator<Item = &Entry> {
        self.cells.points(span)
    }

    #[inline]
    fn cell(&self, x: Vec3) -> IVec3 {
        cell_at(x * self.inverse_cell)
    }
}

/// Order of points along a Morton curve through their bounds: neighbours in space become neighbours in
/// memory and in the file. Ties keep their order.
pub fn morton_order(positions: &[Vec3]) -> Vec<u32> {
    let (min, max) = positions
        .iter()
        .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(lo, hi), &p| {
            (lo.min(p), hi.max(p))
        });
    // 21 bits per axis fill 63; cubic cells keep the curve's steps isotropic.
    let scale = ((1 << 21) - 1) as f32 / (max - min).max_element().max(f32::MIN_POSITIVE);
    let spread = |v: u64| {
        let mut v = v & 0x1f_ffff;
        v = (v | (v << 32)) & 0x001f_0000_0000_ffff;
        v = (v | (v << 16)) & 0x001f_0000_ff00_00ff;
        v = (v | (v << 8)) & 0x100f_00f0_0f00_f00f;
        v = (v | (v << 4)) & 0x10c3_0c30_c30c_30c3;
        (v | (v << 2)) & 0x1249_2492_4924_9249
    };
    let mut keyed: Vec<(u64, u32)> = positions
        .iter()
        .enumerate()
        .map(|(i, &p)| {
            let q = ((p - min) * scale).max(Vec3::ZERO);
            let code = spread(q.x as u64) | (spread(q.y as u64) << 1) | (spread(q.z as u64) << 2);
            (code, i as u32)
        })
        .collect();
    keyed.sort_unstable();
    keyed.into_iter().map(|(_, i)| i).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    #[test]
    fn every_point_within_the_radius_is_found_once() {
        let mut s = Stream::new(5, 0, 0);
        let positions: Vec<Vec3> = (0..3000)
            .map(|_| Vec3::new(s.uniform(), s.uniform(), s.uniform()) * 4.0 - 2.0)
            .collect();
        let normals = vec![Vec3::Z; positions.len()];
        let radius = 0.3;
        let grid = PointGrid::new(&positions, &normals, radius);
        for _ in 0..200 {
            let x = Vec3::new(s.uniform(), s.uniform(), s.uniform()) * 5.0 - 2.5;
            let mut found = Vec::new();
            grid.near(x, |e| {
                if (e.position - x).length() < radius {
                    found.push(e.index);
                }
            });
            found.sort_unstable();
            let brute: Vec<u32> = (0..positions.len() as u32)
                .filter(|&i| (positions[i as usize] - x).length() < radius)
                .collect();
            assert_eq!(found, brute);
        }
    }

    #[test]
    fn every_disk_that_covers_a_place_is_found_in_its_cell() {
        let mut s = Stream::new(6, 0, 0);
        let mut vector = || Vec3::new(s.uniform(), s.uniform(), s.uniform()) * 2.0 - 1.0;
        let positions: Vec<Vec3> = (0..3000).map(|_| vector()).collect();
        let normals: Vec<Vec3> = (0..3000).map(|_| vector().normalize_or(Vec3::Y)).collect();
        let radius = 0.3;
        let grid = DiskGrid::of(entries(&positions, &normals), radius);
        let mut found = 0;
        for _ in 0..500 {
            let x = vector() * 1.2;
            let listed: Vec<u32> = grid.covering(x).map(|e| e.index).collect();
            for i in 0..positions.len() {
                let squared = kernel::distance_squared(x - positions[i], normals[i]);
                if squared <= radius * radius {
                    found += 1;
                    assert!(listed.contains(&(i as u32)));
                }
            }
        }
        assert!(found > 1000, "{found}");
    }
}
