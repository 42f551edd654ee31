//! The hierarchy of levels: pushing values from coarse to fine and pulling them back.
//!
//! Source: Lehtinen et al. 2008, section 2.1 (equations 4 to 7, pull-push).
//!
//! Deviation: each level's approximation F_l is the plain Shepard approximation (equation 1) of the level's
//! own values, and a coefficient is the difference to the level above, α_i = f_i − F_{l−1}(p_i), equation 7
//! with that F. The paper sums the contributions of all coarser levels at every place (equation 5); here a
//! level is resampled at the points of the next one. With all coefficients kept both give the values at the
//! points back exactly. The resampled form makes flattening (section 4.1) part of the reconstruction and
//! costs the parents on one level instead of on all of them.

use crate::basis::Level;
use crate::sparse::{SparseMatrix, build, row};
use glam::{Mat3, Vec3, Vec3A};
use rayon::prelude::*;
use std::ops::Range;

/// Which points of a numbering over all levels belong to which level, coarsest first.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LevelRanges {
    starts: Vec<u32>,
}

impl LevelRanges {
    /// Ranges for levels with the given numbers of points.
    pub fn new(counts: impl IntoIterator<Item = usize>) -> LevelRanges {
        let mut starts = vec![0];
        let mut sum = 0;
        for count in counts {
            sum += count as u32;
            starts.push(sum);
        }
        LevelRanges { starts }
    }

    /// Number of levels.
    pub fn levels(&self) -> usize {
        self.starts.len() - 1
    }

    /// Indices of level `l`.
    pub fn range(&self, l: usize) -> Range<usize> {
        self.starts[l] as usize..self.starts[l + 1] as usize
    }

    /// The level that has an index; 0 where none has.
    pub fn level_of(&self, index: usize) -> usize {
        (0..self.levels())
            .find(|&l| index < self.range(l).end)
            .unwrap_or(0)
    }

    /// Number of points on all levels.
    pub fn total(&self) -> usize {
        self.starts[self.levels()] as usize
    }
}

/// Support radius over disk radius of the functions that push values down. The paper widens supports from
/// 1.5 to 2.5 towards the finest level for a smooth display (section 2.3); what is only pushed on to finer
/// points is smoothed there again. Little more than the 1 that covers a maximal disk set leaves fewest links and
/// least error where there is detail, some more parents where there is none (docs/notebook/transfer.md).
pub const PUSH_SUPPORT: f32 = 1.3;

/// For every point of every level the functions of the next coarser level that covers it (its parents).
/// Rows and columns are numbered over all levels; rows of level 0 are empty, all others sum to 1 unless no
/// coarser level covers the point at all.
///
/// Parents that a surface separates from the point are none: the light of one room says nothing about the next.
/// `is_separated` tells, of a point and a point of a coarser level, both numbered over all levels.
pub fn fine_from_coarse(levels: &[Level], is_separated: impl Fn(u32, u32) -> bool + Sync) -> SparseMatrix {
    let ranges = LevelRanges::new(levels.iter().map(Level::len));
    let level_of: Vec<u8> = (0..levels.len())
        .flat_map(|l| std::iter::repeat_n(l as u8, levels[l].len()))
        .collect();
    let pushing: Vec<Level> = levels[..levels.len().saturating_sub(1)]
        .iter()
        .map(|l| l.with_support(l.disk_radius * PUSH_SUPPORT))
        .collect();
    build(ranges.total(), ranges.total(), |i, row| {
        let level = level_of[i] as usize;
        let local = i - ranges.range(level).start;
        let (x, n) = (levels[level].positions[local], levels[level].normals[local]);
        for coarse in (0..level).rev() {
            let first = row.len();
            let offset = ranges.range(coarse).start as u32;
            pushing[coarse].functions_among(x, n, |parent| !is_separated(i as u32, offset + parent), row);
            if row.len() > first {
                if let Some(same) = same_point(&levels[level], local, &levels[coarse], &row[first..]) {
                    row.truncate(first);
                    row.push((same, 1.0));
                }
                row[first..].iter_mut().for_each(|entry| entry.0 += offset);
                break;
            }
        }
    })
}

/// Part of a disk's radius within which two points of different levels are one: places are stored to a 256th of it, and others of a level are
/// a whole radius apart.
const SAME: f32 = 1.0 / 64.0;

/// The point of the coarser level that a wide one is itself, among its parents there: no finer ones lie around it, and it keeps its value.
fn same_point(level: &Level, point: usize, coarse: &Level, parents: &[(u32, f32)]) -> Option<u32> {
    if level.widenings.get(point).is_none_or(|&k| k == 0) {
        return None;
    }
    let radius = level.disk_radius_of(point);
    let near = (SAME * radius) * (SAME * radius);
    let position = level.positions[point];
    (parents.iter().map(|parent| parent.0)).find(|&parent| {
        let parent = parent as usize;
        coarse.positions[parent].distance_squared(position) < near
            && coarse.disk_radius_of(parent) > 0.75 * radius
            && coarse.disk_radius_of(parent) < 1.5 * radius
    })
}

/// Vector irradiance of three colour channels: component along each axis as RGB. Its dot product with a unit
/// normal is the irradiance of a surface facing that way.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct VectorIrradiance {
    /// RGB of the x component.
    pub x: Vec3A,
    /// RGB of the y component.
    pub y: Vec3A,
    /// RGB of the z component.
    pub z: Vec3A,
}

impl VectorIrradiance {
    /// Adds `color` arriving along `vector`.
    #[inline(always)]
    pub fn add(&mut self, vector: Vec3, color: Vec3A) {
        self.x += color * vector.x;
        self.y += color * vector.y;
        self.z += color * vector.z;
    }

    /// Adds `other` times `weight`.
    #[inline(always)]
    pub fn add_scaled(&mut self, other: &VectorIrradiance, weight: f32) {
        self.x += other.x * weight;
        self.y += other.y * weight;
        self.z += other.z * weight;
    }

    /// Adds `other`, carried along the surface from a place with normal `from` to one with normal `to`, times
    /// `weight`.
    #[inline]
    pub fn add_carried(&mut self, other: &VectorIrradiance, from: Vec3, to: Vec3, weight: f32) {
        if from.dot(to) > FLAT {
            return self.add_scaled(other, weight);
        }
        let m = carry(from, to) * weight;
        self.x += other.x * m.x_axis.x + other.y * m.y_axis.x + other.z * m.z_axis.x;
        self.y += other.x * m.x_axis.y + other.y * m.y_axis.y + other.z * m.z_axis.y;
        self.z += other.x * m.x_axis.z + other.y * m.y_axis.z + other.z * m.z_axis.z;
    }

    /// RGB irradiance of a surface with unit normal `normal`; may be negative.
    #[inline(always)]
    pub fn irradiance(&self, normal: Vec3) -> Vec3 {
        Vec3::from(self.x * normal.x + self.y * normal.y + self.z * normal.z)
    }
}

/// Cosine between normals above which carrying changes nothing: 0.08°.
pub(crate) const FLAT: f32 = 1.0 - 1e-6;

/// Takes vector irradiance from a place with unit normal `from` to a neighbour's with unit normal `to`.
///
/// Vector irradiance holds what arrives above its own surface's horizon only. Dotted with the normal of a
/// neighbour that faces elsewhere it is always too small, because light from below the one horizon and above
/// the other is missing. So E is turned round with the surface, which leaves n·E as it was and is right for even
/// light, and gains along `to` what the tilt towards or away from E's part along the surface changes: x = `to`·E
/// less its share of n·E, times cos α for α between the normals, so that far tilts, where light from below the new
/// horizon would count as negative, fade out. For light from one direction the answer is off by
/// (1 − cos α)(n·E − x), against x when it is only turned: folds, columns and arches keep their shading
/// (docs/notebook/transfer.md). It is the first-order rotation gradient of Ward and Heckbert 1992 with the light's own
/// colour.
///
/// Source of the rotation: Möller and Hughes 1999, without the trigonometry. Opposite vectors, which no basis
/// function connects, are taken to each other by a half turn about some axis.
#[inline]
pub fn carry(from: Vec3, to: Vec3) -> Mat3 {
    let cosine = from.dot(to);
    if cosine < -0.9999 {
        let axis = from.any_orthonormal_vector();
        return Mat3::from_cols(axis * axis.x, axis * axis.y, axis * axis.z) * 2.0 - Mat3::IDENTITY;
    }
    let v = from.cross(to);
    let k = 1.0 / (1.0 + cosine);
    let turned = Mat3::from_cols(
        Vec3::new(v.x * v.x * k + cosine, v.y * v.x * k + v.z, v.z * v.x * k - v.y),
        Vec3::new(v.x * v.y * k - v.z, v.y * v.y * k + cosine, v.z * v.y * k + v.x),
        Vec3::new(v.x * v.z * k + v.y, v.y * v.z * k - v.x, v.z * v.z * k + cosine),
    );
    let tilt = (to - from * cosine) * cosine.max(0.0);
    turned + Mat3::from_cols(to * tilt.x, to * tilt.y, to * tilt.z)
}

/// What takes of vector irradiance at a place with unit normal `from` what `direction` takes of it once it is carried to a
/// place with unit normal `to`.
#[inline]
pub fn carried_back(direction: Vec3, to: Vec3, from: Vec3) -> Vec3 {
    if from.dot(to) > FLAT {
        return direction;
    }
    carry(from, to).transpose() * direction
}

/// Reconstructs values at all points from hierarchical coefficients, in place: afterwards `values[i]` is the
/// value at point i instead of its difference to the level above (equation 7 backwards).
///
/// Linear: differences lose their small links, and where they then take more away than there is, irradiance is left below zero. To
/// lift it would depend on the light, so that lamps apart would not sum to both together, and what it mends is a part in a
/// thousand (docs/notebook/transfer.md, "Light adds up").
pub fn push(
    values: &mut [VectorIrradiance],
    normals: &[Vec3],
    ranges: &LevelRanges,
    fine_from_coarse: &SparseMatrix,
) {
    for level in 1..ranges.levels() {
        let range = ranges.range(level);
        let (coarser, rest) = values.split_at_mut(range.start);
        let own = &mut rest[..range.len()];
        own.par_iter_mut()
            .with_min_len(1024)
            .enumerate()
            .for_each(|(local, value)| {
                let normal = normals[range.start + local];
                let mut around = VectorIrradiance::default();
                for (k, w) in row(fine_from_coarse, range.start + local) {
                    around.add_carried(&coarser[k as usize], normals[k as usize], normal, w);
                }
                value.add_scaled(&around, 1.0);
            });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::poisson::{Dart, Disks};
    use crate::random::Stream;

    fn levels(count: usize) -> Vec<Level> {
        let mut s = Stream::new(4, 0, 0);
        let darts: Vec<Dart> = (0..60_000)
            .map(|_| Dart::plain(Vec3::new(s.uniform(), 0.0, s.uniform()), Vec3::Y))
            .collect();
        (0..count)
            .map(|l| {
                let radius = 0.2 / (1 << l) as f32;
                let mut disks = Disks::new(radius);
                disks.throw(&darts, 0, |_| true);
                Level::new(
                    disks.positions,
                    disks.normals,
                    radius,
                    radius * (1.5 + l as f32 * 0.3),
                )
            })
            .collect()
    }

    #[test]
    fn constants_pass_through_every_level_unchanged() {
        let levels = levels(4);
        let ranges = LevelRanges::new(levels.iter().map(Level::len));
        let rows = fine_from_coarse(&levels, |_, _| false);
        let mut values = vec![VectorIrradiance::default(); ranges.total()];
        for value in &mut values[ranges.range(0)] {
            value.add(Vec3::new(0.0, 1.0, 0.0), Vec3A::new(1.0, 2.0, 3.0));
        }
        push(&mut values, &vec![Vec3::Y; ranges.total()], &ranges, &rows);
        for value in &values {
            // Rounding of some twenty products per level.
            assert!(
                (value.irradiance(Vec3::Y) - Vec3::new(1.0, 2.0, 3.0))
                    .abs()
                    .max_element()
                    < 1e-5
            );
        }
    }

    #[test]
    fn even_light_is_carried_round_with_the_surface_and_a_lamp_is_seen_under_its_own_angle() {
        let mut s = Stream::new(5, 0, 0);
        let mut unit = || {
            let v = Vec3::new(s.uniform() - 0.5, s.uniform() - 0.5, s.uniform() - 0.5);
            v.normalize_or(Vec3::Y)
        };
        for _ in 0..1000 {
            let (from, to, lamp) = (unit(), unit(), unit());
            let m = carry(from, to);
            // Even light: irradiance 1 along the normal, whatever the normal. Rounding where the normals are
            // nearly opposite is that of 1/(1 + cos), at most 1e4.
            assert!((m * from - to).length() < 2e-3);
            let (cosine, above) = (from.dot(to), from.dot(lamp));
            if cosine > 0.0 && above > 0.0 && to.dot(lamp) > 0.0 {
                let tilted = to.dot(lamp) - cosine * above;
                let error = to.dot(m * lamp) - to.dot(lamp);
                assert!((error - (1.0 - cosine) * (above - tilted)).abs() < 1e-5);
            }
        }
    }

    #[test]
    fn differences_to_the_level_above_give_the_values_back() {
        let levels = levels(3);
        let ranges = LevelRanges::new(levels.iter().map(Level::len));
        let rows = fine_from_coarse(&levels, |_, _| false);
        let mut s = Stream::new(9, 0, 0);
        let wanted: Vec<f32> = (0..ranges.total()).map(|_| s.uniform()).collect();
        let mut values = vec![VectorIrradiance::default(); ranges.total()];
        for i in 0..ranges.total() {
            let predicted: f32 = row(&rows, i).map(|(k, w)| w * wanted[k as usize]).sum();
            values[i].add(Vec3::Y, Vec3A::splat(wanted[i] - predicted));
        }
        push(&mut values, &vec![Vec3::Y; ranges.total()], &ranges, &rows);
        for (value, wanted) in values.iter().zip(&wanted) {
            assert!((value.irradiance(Vec3::Y).x - wanted).abs() < 1e-5);
        }
    }
}
