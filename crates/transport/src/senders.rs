//! The sender side of the operators: a hierarchy of clusters of finest points, each sending the weighted
//! mean of its points' radiosity.
//!
//! Source: Lehtinen et al. 2008, section 2.1 (pull-push), section 5.2 (senders and receivers may want
//! different bases) and appendix A. Sender j of level l belongs to point j of receiver level l; it sends for the
//! finest points nearest to that point.
//!
//! Deviation: senders are disjoint, where the paper's overlap, and "nearest" minds what the points see
//! ([`PILOTS`] places in open space; the visibility term of Cheslack-Postava et al. 2008, equation 11).
//! Overlapping functions mix lit places with dark ones behind a column or an edge. Receivers that look at the
//! lit ones see just those, so that the mixture made them too dark by a fifth (docs/notebook/transfer.md).

use crate::basis::by_width;
use crate::grid::{Entry, PointGrid};
use crate::kernel::{distance_squared, width};
use crate::pyramid::LevelRanges;
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Number of places in open space whose visibility makes a point's signature: the bits of a `u128`.
pub const PILOTS: usize = 128;

/// Clusters of finest points on several levels, coarsest first.
#[derive(Clone, Debug, PartialEq)]
pub struct SenderTree {
    /// Sender levels in the numbering over all senders.
    pub ranges: LevelRanges,
    /// For each finest point its cluster on the finest sender level (local index).
    pub leaf_of_point: Vec<u32>,
    /// For each sender level but the coarsest: each cluster's parent on the level above (local indices).
    pub parents: Vec<Vec<u32>>,
    /// For each sender its weight as a share of its parent's; 1 on the coarsest level.
    pub shares: Vec<f32>,
    /// For each finest point how much it counts in its clusters; see [`weight`].
    pub importance: Vec<u8>,
    /// For each finest point its weight in its cluster's mean; the weights of a cluster sum to 1.
    weights: Vec<f32>,
    /// Finest points sorted by leaf.
    points: Vec<u32>,
    /// Start of each leaf's points in `points`, and the end of the last.
    leaf_starts: Vec<u32>,
    /// For each sender level but the finest: children (local indices) sorted by parent, and where they start.
    children: Vec<(Vec<u32>, Vec<u32>)>,
}

fn sorted_by(keys: &[u32], count: usize) -> (Vec<u32>, Vec<u32>) {
    let mut starts = vec![0u32; count + 1];
    for &key in keys {
        starts[key as usize + 1] += 1;
    }
    for i in 1..starts.len() {
        starts[i] += starts[i - 1];
    }
    let mut next = starts.clone();
    let mut items = vec![0u32; keys.len()];
    for (i, &key) in keys.iter().enumerate() {
        items[next[key as usize] as usize] = i as u32;
        next[key as usize] += 1;
    }
    (items, starts)
}

impl SenderTree {
    /// A tree from assignments. `counts`: clusters per sender level; `leaf_of_point` and `parents` as the
    /// fields. Points stand for equal areas: a maximal Poisson-disk set is even.
    pub fn new(
        counts: &[usize],
        leaf_of_point: Vec<u32>,
        parents: Vec<Vec<u32>>,
        importance: Vec<u8>,
    ) -> SenderTree {
        // In f64: weights span five decades and clusters may have millions of points, whose small weights an f32 sum
        // would lose (docs/notebook/stability.md).
        let importances: Vec<f64> = importance.iter().map(|&i| f64::from(weight(i))).collect();
        let ranges = LevelRanges::new(counts.iter().copied());
        let (points, leaf_starts) = sorted_by(&leaf_of_point, counts[counts.len() - 1]);
        let mut masses: Vec<Vec<f64>> = vec![vec![0.0; counts[counts.len() - 1]]];
        for (&leaf, importance) in leaf_of_point.iter().zip(&importances) {
            masses[0][leaf as usize] += importance;
        }
        let weights = leaf_of_point
            .iter()
            .zip(&importances)
            .map(|(&leaf, importance)| (importance / masses[0][leaf as usize]) as f32)
            .collect();
        for l in (0..parents.len()).rev() {
            let mut coarse = vec![0.0f64; counts[l]];
            for (child, &parent) in parents[l].iter().enumerate() {
                coarse[parent as usize] += masses[0][child];
            }
            masses.insert(0, coarse);
        }
        let mut shares = vec![1.0; counts[0]];
        for l in 1..counts.len() {
            shares.extend(parents[l - 1].iter().zip(&masses[l]).map(|(&parent, mass)| {
                let whole = masses[l - 1][parent as usize];
                if whole > 0.0 { (mass / whole) as f32 } else { 0.0 }
            }));
        }
        let children = (0..parents.len())
            .map(|l| sorted_by(&parents[l], counts[l]))
            .collect();
        SenderTree {
            ranges,
            leaf_of_point,
            parents,
            shares,
            importance,
            weights,
            points,
            leaf_starts,
            children,
        }
    }

    /// Number of sender levels.
    pub fn levels(&self) -> usize {
        self.ranges.levels()
    }

    /// Children (local indices on level + 1) of a cluster (local index on `level`).
    pub fn children(&self, level: usize, cluster: usize) -> &[u32] {
        let (items, starts) = &self.children[level];
        &items[starts[cluster] as usize..starts[cluster + 1] as usize]
    }

    /// Children of a sender, ascending; senders numbered over all levels.
    pub fn children_of(&self, sender: u32) -> impl ExactSizeIterator<Item = u32> + Clone + '_ {
        let level = self.ranges.level_of(sender as usize);
        let children = match level + 1 < self.levels() {
            true => self.children(level, sender as usize - self.ranges.range(level).start),
            false => &[],
        };
        let first = self.ranges.range(level).end as u32;
        children.iter().map(move |child| first + child)
    }

    /// A sender's parent, `None` of the coarsest; senders numbered over all levels.
    pub fn parent_of(&self, sender: u32) -> Option<u32> {
        let level = self.ranges.level_of(sender as usize);
        let above = level.checked_sub(1)?;
        let parent = self.parents[above][sender as usize - self.ranges.range(level).start];
        Some(self.ranges.range(above).start as u32 + parent)
    }

    /// For each finest point its cluster on `level` (local index).
    pub fn cluster_of_point(&self, level: usize) -> Vec<u32> {
        let mut of = self.leaf_of_point.clone();
        for l in (level..self.levels() - 1).rev() {
            of.iter_mut().for_each(|c| *c = self.parents[l][*c as usize]);
        }
        of
    }

    /// For each finest point its cluster on `level` (local index) and its weight in that cluster's mean.
    pub fn point_weights(&self, level: usize) -> Vec<(u32, f64)> {
        let leaves = self.leaf_of_point.iter().zip(&self.weights);
        leaves
            .map(|(&leaf, &weight)| {
                (level + 1..self.levels())
                    .rev()
                    .fold((leaf, f64::from(weight)), |(cluster, weight), l| {
                        let share = self.shares[self.ranges.range(l).start + cluster as usize];
                        (self.parents[l - 1][cluster as usize], weight * f64::from(share))
                    })
            })
            .collect()
    }

    /// Mean of values at the finest points over each cluster, level by level, coarsest first. Clusters
    /// without points get zero.
    pub fn pulled(&self, at_points: &[Vec3]) -> Vec<Vec<Vec3>> {
        let leaves: Vec<DVec3> = (0..self.leaf_starts.len() - 1)
            .into_par_iter()
            .with_min_len(256)
            .map(|leaf| {
                let own = &self.points[self.leaf_starts[leaf] as usize..self.leaf_starts[leaf + 1] as usize];
                own.iter()
                    .map(|&p| at_points[p as usize].as_dvec3() * f64::from(self.weights[p as usize]))
                    .sum()
            })
            .collect();
        let mut levels = vec![leaves];
        for l in (0..self.parents.len()).rev() {
            let shares = &self.shares[self.ranges.range(l + 1)];
            let mut coarse = vec![DVec3::ZERO; self.ranges.range(l).len()];
            for (child, &parent) in self.parents[l].iter().enumerate() {
                coarse[parent as usize] += levels[0][child] * f64::from(shares[child]);
            }
            levels.insert(0, coarse);
        }
        let rounded = |level: Vec<DVec3>| level.into_iter().map(|v| v.as_vec3()).collect();
        levels.into_iter().map(rounded).collect()
    }

    /// Sums over each cluster of what its finest points have, of all levels one after the other.
    pub fn sums(&self, of_point: impl Fn(usize) -> f32) -> Vec<f32> {
        let mut sums = vec![0.0; self.ranges.total()];
        let leaves = self.ranges.range(self.levels() - 1);
        for (point, &leaf) in self.leaf_of_point.iter().enumerate() {
            sums[leaves.start + leaf as usize] += of_point(point);
        }
        for l in (0..self.parents.len()).rev() {
            let (above, own) = (self.ranges.range(l), self.ranges.range(l + 1));
            for (child, &parent) in own.zip(&self.parents[l]) {
                sums[above.start + parent as usize] += sums[child];
            }
        }
        sums
    }

    /// Sender coefficients from pulled values: means on the coarsest level, differences to the parent's mean
    /// on the others.
    pub fn coefficients(&self, pulled: &[Vec<Vec3>]) -> Vec<Vec3> {
        let mut out = pulled[0].clone();
        for l in 1..pulled.len() {
            let parents = &self.parents[l - 1];
            out.extend(
                pulled[l]
                    .iter()
                    .zip(parents)
                    .map(|(f, &parent)| *f - pulled[l - 1][parent as usize]),
            );
        }
        out
    }
}

/// A place with what a signature says of it.
#[derive(Clone, Copy, Debug)]
pub struct Signed {
    /// World space.
    pub position: Vec3,
    /// Unit normal.
    pub normal: Vec3,
    /// By how much its point's radii are wider than its level's, as a power of two.
    pub widening: u8,
    /// Which pilots see the place.
    pub signature: u128,
}

/// Weight of a finest point in its cluster's mean. The square spreads a byte over five decades. Weights are
/// relative; constants are kept by any.
pub fn weight(importance: u8) -> f32 {
    let root = f32::from(importance) + 1.0;
    root * root
}

/// How many seed distances a complete disagreement of signatures counts for.
pub const VISIBILITY_WEIGHT: f32 = 16.0;

/// For each place the nearest seed: by distance in units of `spacing` and by disagreement of signatures, among
/// seeds that face the same way if there are any near.
pub fn nearest_seeds(places: &[Signed], seeds: &[Signed], spacing: f32) -> Vec<u32> {
    let weight = VISIBILITY_WEIGHT;
    let positions: Vec<Vec3> = seeds.iter().map(|s| s.position).collect();
    let normals: Vec<Vec3> = seeds.iter().map(|s| s.normal).collect();
    let widenings: Vec<u8> = seeds.iter().map(|s| s.widening).collect();
    // Seeds are at most a spacing from any place; what sees the same may be a few of them away.
    let grids: Vec<PointGrid> = by_width(&positions, &normals, &widenings)
        .into_iter()
        .map(|(width, points)| PointGrid::of(points, 3.0 * spacing * width))
        .collect();
    places
        .par_iter()
        .with_min_len(256)
        .map(|place| {
            let mut best = (f32::INFINITY, u32::MAX);
            let mut offer = |entry: &Entry| {
                let offset = place.position - entry.position;
                let seed = &seeds[entry.index as usize];
                // Of what is coarse and what is fine the finer one says how far is far.
                let spacing = spacing * width(seed.widening.min(place.widening));
                let squared = distance_squared(offset, entry.normal) / (spacing * spacing);
                let cosine = entry.normal.dot(place.normal);
                // Facing away costs like disagreeing entirely.
                let facing = weight * (1.0 - cosine).min(1.0);
                let differing = (place.signature ^ seed.signature).count_ones();
                let unlike = weight * differing as f32 / PILOTS as f32;
                let cost = squared + facing * facing + unlike * unlike;
                if (cost, entry.index) < best {
                    best = (cost, entry.index);
                }
            };
            grids
                .iter()
                .for_each(|grid| grid.near(place.position, &mut offer));
            if best.1 == u32::MAX {
                // Nothing near: the nearest of all, so that no light is lost.
                for (i, seed) in seeds.iter().enumerate() {
                    let cost = seed.position.distance_squared(place.position);
                    if (cost, i as u32) < best {
                        best = (cost, i as u32);
                    }
                }
            }
            best.1
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Truth: two clusters, of which the first has two and the second one.
    #[test]
    fn children_and_ancestors_are_numbered_over_all_levels() {
        let tree = SenderTree::new(
            &[1, 2, 3],
            vec![0, 1, 2],
            vec![vec![0, 0], vec![0, 1, 0]],
            vec![0; 3],
        );
        let children = |sender| tree.children_of(sender).collect::<Vec<_>>();
        assert_eq!(
            [children(0), children(1), children(2)],
            [vec![1, 2], vec![3, 5], vec![4]]
        );
        assert_eq!(children(5), []);
        let parent_of = |&sender: &u32| tree.parent_of(sender);
        let ancestors = |sender| std::iter::successors(parent_of(&sender), parent_of).collect::<Vec<_>>();
        assert_eq!(
            [ancestors(0), ancestors(2), ancestors(4)],
            [vec![], vec![0], vec![2, 0]]
        );
    }

    /// A few important points before a million unimportant ones: what an f32 sum would drop one by one. Truth: a mean
    /// of ones is one; the small weights are 1/(w n + m) each. Tolerance: the rounding of the stored weights.
    #[test]
    fn the_mean_of_a_cluster_of_a_million_points_keeps_constants_and_counts_every_point() {
        let (few, many) = (400usize, 1_000_000usize);
        let importance: Vec<u8> = (0..few + many).map(|p| if p < few { 255 } else { 0 }).collect();
        let tree = SenderTree::new(&[1], vec![0; few + many], Vec::new(), importance);
        let ones = tree.pulled(&vec![Vec3::ONE; few + many]);
        assert!((ones[0][0].x - 1.0).abs() < 1e-6, "{}", ones[0][0]);
        let small: Vec<Vec3> = (0..few + many)
            .map(|p| if p < few { Vec3::ZERO } else { Vec3::ONE })
            .collect();
        let exact = many as f64 / (f64::from(weight(255)) * few as f64 + many as f64);
        let found = f64::from(tree.pulled(&small)[0][0].x);
        assert!((found / exact - 1.0).abs() < 1e-6, "{found} {exact}");
    }
}
