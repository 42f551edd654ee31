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
use crate::sparse::Rows;
use glam::{Vec3, Vec3A};
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

    /// Number of points on all levels.
    pub fn total(&self) -> usize {
        self.starts[self.levels()] as usize
    }
}

/// For every point of every level the functions of the next coarser level that covers it (its parents).
/// Rows and columns are numbered over all levels; rows of level 0 are empty, all others sum to 1 unless no
/// coarser level covers the point at all.
pub fn fine_from_coarse(levels: &[Level]) -> Rows {
    let ranges = LevelRanges::new(levels.iter().map(Level::len));
    let level_of: Vec<u8> = (0..levels.len())
        .flat_map(|l| std::iter::repeat_n(l as u8, levels[l].len()))
        .collect();
    Rows::build(ranges.total(), ranges.total(), |i, row| {
        let level = level_of[i] as usize;
        let local = i - ranges.range(level).start;
        let (x, n) = (levels[level].positions[local], levels[level].normals[local]);
        for coarse in (0..level).rev() {
            let first = row.len();
            levels[coarse].functions_at(x, n, row);
            if row.len() > first {
                let offset = ranges.range(coarse).start as u32;
                row[first..].iter_mut().for_each(|entry| entry.0 += offset);
                break;
            }
        }
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

    /// RGB irradiance of a surface with unit normal `normal`; may be negative.
    #[inline(always)]
    pub fn irradiance(&self, normal: Vec3) -> Vec3 {
        Vec3::from(self.x * normal.x + self.y * normal.y + self.z * normal.z)
    }
}

/// Reconstructs values at all points from hierarchical coefficients, in place: afterwards `values[i]` is the
/// value at point i instead of its difference to the level above (equation 7 backwards).
pub fn push(values: &mut [VectorIrradiance], ranges: &LevelRanges, fine_from_coarse: &Rows) {
    for level in 1..ranges.levels() {
        let range = ranges.range(level);
        let (coarser, rest) = values.split_at_mut(range.start);
        let own = &mut rest[..range.len()];
        own.par_iter_mut()
            .with_min_len(1024)
            .enumerate()
            .for_each(|(local, value)| {
                for &(k, w) in fine_from_coarse.row(range.start + local) {
                    value.add_scaled(&coarser[k as usize], w);
                }
            });
    }
}

/// The sender side: pulls a function sampled at the finest points down to sender levels, coefficients being
/// local averages (pull-push of section 2.1), so that finer coefficients are differences to local averages.
#[derive(Clone, Debug)]
pub struct SenderPyramid {
    /// Sizes of the sender levels.
    pub ranges: LevelRanges,
    /// Averages on the finest sender level from values at the finest points; rows sum to 1.
    pub senders_from_points: Rows,
    /// For each sender level but the coarsest: that level's points from the functions of the level above
    /// (local indices).
    pub fine_from_coarse: Vec<Rows>,
    /// For each sender level but the finest: averages from the level below (local indices); rows sum to 1.
    pub coarse_from_fine: Vec<Rows>,
}

/// Rows of area-weighted averages: the transpose of `values_at`, entries times the mass of the place,
/// normalised. Also returns the mass of each function. Weighting by the partition of unity conserves power:
/// Σ_j mass_j f_j = Σ_p mass_p f_p.
fn averages(values_at: &Rows, masses: &[f32]) -> (Rows, Vec<f32>) {
    let mut pulled = values_at.transposed();
    let mut sums = Vec::with_capacity(pulled.rows());
    for j in 0..pulled.rows() {
        let row = pulled.offsets[j] as usize..pulled.offsets[j + 1] as usize;
        let row = &mut pulled.entries[row];
        row.iter_mut().for_each(|e| e.1 *= masses[e.0 as usize]);
        sums.push(row.iter().map(|e| f64::from(e.1)).sum::<f64>() as f32);
    }
    pulled.normalise();
    (pulled, sums)
}

impl SenderPyramid {
    /// `senders` are the sender levels, coarsest first; `senders_at_points` the finest sender level's
    /// functions at the finest points (rows: points); `areas` of those points.
    pub fn new(senders: &[Level], senders_at_points: &Rows, areas: &[f32]) -> SenderPyramid {
        let (senders_from_points, mut masses) = averages(senders_at_points, areas);
        let mut fine_from_coarse = Vec::new();
        let mut coarse_from_fine = Vec::new();
        for l in (1..senders.len()).rev() {
            let rows = senders[l - 1].covering(&senders[l].positions, &senders[l].normals);
            let (pull, coarse_masses) = averages(&rows, &masses);
            masses = coarse_masses;
            fine_from_coarse.insert(0, rows);
            coarse_from_fine.insert(0, pull);
        }
        let ranges = LevelRanges::new(senders.iter().map(Level::len));
        SenderPyramid {
            ranges,
            senders_from_points,
            fine_from_coarse,
            coarse_from_fine,
        }
    }

    /// Values on every sender level (averages), coarsest level first, from values at the finest points.
    pub fn pulled(&self, at_points: &[Vec3]) -> Vec<Vec<Vec3>> {
        let mut levels = vec![self.senders_from_points.apply(at_points)];
        for rows in self.coarse_from_fine.iter().rev() {
            levels.insert(0, rows.apply(&levels[0]));
        }
        levels
    }

    /// Sender coefficients over all sender levels from values at the finest points: averages on the coarsest
    /// level, differences to the level above on the others.
    pub fn coefficients(&self, at_points: &[Vec3]) -> Vec<Vec3> {
        let levels = self.pulled(at_points);
        let mut out = levels[0].clone();
        for l in 1..levels.len() {
            let coarse = self.fine_from_coarse[l - 1].apply(&levels[l - 1]);
            out.extend(levels[l].iter().zip(coarse).map(|(f, c)| *f - c));
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::poisson::Disks;
    use crate::random::Stream;

    fn levels(count: usize) -> Vec<Level> {
        let mut s = Stream::new(4, 0, 0);
        let candidates: Vec<Vec3> = (0..60_000)
            .map(|_| Vec3::new(s.uniform(), 0.0, s.uniform()))
            .collect();
        let normals = vec![Vec3::Y; candidates.len()];
        (0..count)
            .map(|l| {
                let radius = 0.2 / (1 << l) as f32;
                let mut disks = Disks::new(radius);
                disks.throw(&candidates, &normals, 0, |_| true);
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
        let rows = fine_from_coarse(&levels);
        let mut values = vec![VectorIrradiance::default(); ranges.total()];
        for value in &mut values[ranges.range(0)] {
            value.add(Vec3::new(0.0, 1.0, 0.0), Vec3A::new(1.0, 2.0, 3.0));
        }
        push(&mut values, &ranges, &rows);
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
    fn differences_to_the_level_above_give_the_values_back() {
        let levels = levels(3);
        let ranges = LevelRanges::new(levels.iter().map(Level::len));
        let rows = fine_from_coarse(&levels);
        let mut s = Stream::new(9, 0, 0);
        let wanted: Vec<f32> = (0..ranges.total()).map(|_| s.uniform()).collect();
        let mut values = vec![VectorIrradiance::default(); ranges.total()];
        for i in 0..ranges.total() {
            let predicted: f32 = rows.row(i).iter().map(|&(k, w)| w * wanted[k as usize]).sum();
            values[i].add(Vec3::Y, Vec3A::splat(wanted[i] - predicted));
        }
        push(&mut values, &ranges, &rows);
        for (value, wanted) in values.iter().zip(&wanted) {
            assert!((value.irradiance(Vec3::Y).x - wanted).abs() < 1e-5);
        }
    }

    #[test]
    fn pulling_conserves_power_and_constants() {
        let levels = levels(4);
        let finest = &levels[3];
        let senders = &levels[..3];
        let at_points = senders[2].covering(&finest.positions, &finest.normals);
        let areas = finest.areas();
        let pyramid = SenderPyramid::new(senders, &at_points, &areas);
        let constant = pyramid.coefficients(&vec![Vec3::ONE; finest.len()]);
        for (j, c) in constant.iter().enumerate() {
            let wanted = if pyramid.ranges.range(0).contains(&j) {
                1.0
            } else {
                0.0
            };
            assert!(
                (c.x - wanted).abs() < 1e-5,
                "a constant needs no finer coefficient: {j} {c}"
            );
        }
        // Power of an uneven function on the finest sender level, weighted by the functions' own masses.
        let mut s = Stream::new(10, 0, 0);
        let uneven: Vec<Vec3> = (0..finest.len()).map(|_| Vec3::splat(s.uniform())).collect();
        let mut masses = vec![0.0f64; senders[2].len()];
        for p in 0..finest.len() {
            for &(j, share) in at_points.row(p) {
                masses[j as usize] += f64::from(share * areas[p]);
            }
        }
        let pulled = pyramid.pulled(&uneven);
        let sent: f64 = pulled[2]
            .iter()
            .zip(&masses)
            .map(|(f, m)| f64::from(f.x) * m)
            .sum();
        let had: f64 = uneven.iter().zip(&areas).map(|(f, a)| f64::from(f.x * a)).sum();
        assert!((sent / had - 1.0).abs() < 1e-5, "{sent} against {had}");
    }
}
