//! The transfer operator as matrices: irradiance at the finest points from their radiosity, in factors and as one.
//!
//! A frame never forms these: it pulls, multiplies and pushes in place ([`crate::senders`], [`crate::links`],
//! [`crate::pyramid`]). They are for other tools, and for tests of what a frame does:
//!
//! A = N H T Q, with Q the pull, T the links, H the push and N the dot product with the normals. The format's specification
//! (`crates/format/SPEC.md`, 8.1) has an equation for each.

use crate::links::SenderLinks;
use crate::pyramid::{FLAT, LevelRanges, carry};
use crate::senders::SenderTree;
use crate::sparse::{SparseMatrix, build, from_rows, row};
use glam::{Mat3, Vec3};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Factors of the transfer operator. A vector's component c (0 to 2, world space) of element i is row or column 3 i + c.
#[derive(Clone, Debug, PartialEq)]
pub struct Factors {
    /// Q, senders × finest points: coefficients of senders from radiosity.
    pub pull: SparseMatrix,
    /// T, 3 · receivers × senders: differences of vector irradiance.
    pub transfer: SparseMatrix,
    /// H, 3 · finest points × 3 · receivers: vector irradiance from differences.
    pub push: SparseMatrix,
    /// N, finest points × 3 · finest points: irradiance from vector irradiance.
    pub normals: SparseMatrix,
}

impl Factors {
    /// The factors of one operator. `normals`: of all points; `fine_from_coarse` as
    /// [`crate::pyramid::fine_from_coarse`] makes it.
    pub fn new(
        senders: &SenderTree,
        links: &SenderLinks,
        normals: &[Vec3],
        ranges: &LevelRanges,
        fine_from_coarse: &SparseMatrix,
    ) -> Factors {
        let finest = ranges.range(ranges.levels() - 1);
        let count = 3 * finest.len();
        let blocks: Vec<[Vec<(u32, f32)>; 3]> = (finest.clone())
            .into_par_iter()
            .with_min_len(64)
            .map(|i| pushed_to(i as u32, normals, fine_from_coarse))
            .collect();
        Factors {
            pull: pull(senders),
            transfer: from_rows(&links.component_rows(), senders.shares.len()),
            push: from_rows(blocks.as_flattened(), 3 * ranges.total()),
            normals: build(finest.len(), count, |p, row| {
                let normal = normals[finest.start + p].to_array();
                row.extend((3 * p as u32..).zip(normal));
            }),
        }
    }

    /// A, finest points × finest points: irradiance from radiosity, one bounce. Products in f64. Nearly dense, since
    /// every point sees coarse senders of nearly all points: 20 bytes an entry, and as much time as entries times the clusters
    /// that a cluster has beside it.
    pub fn flattened(&self) -> SparseMatrix {
        let wide = |matrix: &SparseMatrix| matrix.map(|weight| f64::from(*weight));
        // From the left: no product in between has as many rows as all receivers.
        let of_receivers = &wide(&self.normals) * &wide(&self.push);
        let of_senders = &of_receivers * &wide(&self.transfer);
        (&of_senders * &wide(&self.pull)).map(|weight| *weight as f32)
    }
}

/// Q: a row of the coarsest level has its points' weights in the mean; one of another level those less the weights in the
/// parent's mean, of all points of the parent.
fn pull(senders: &SenderTree) -> SparseMatrix {
    let points = senders.leaf_of_point.len();
    let mut rows = vec![Vec::new(); senders.shares.len()];
    for level in 0..senders.levels() {
        let of_level = senders.point_weights(level);
        let first = senders.ranges.range(level).start;
        if level == 0 {
            for (p, &(cluster, weight)) in of_level.iter().enumerate() {
                rows[cluster as usize].push((p as u32, weight as f32));
            }
            continue;
        }
        for (p, &(parent, in_parent)) in senders.point_weights(level - 1).iter().enumerate() {
            let (own, weight) = of_level[p];
            for &child in senders.children(level - 1, parent as usize) {
                let in_child = if child == own { weight } else { 0.0 };
                rows[first + child as usize].push((p as u32, (in_child - in_parent) as f32));
            }
        }
    }
    from_rows(&rows, points)
}

/// The three rows of H for the point `i`: what reaches it from itself, its parents, theirs, and so on.
fn pushed_to(i: u32, normals: &[Vec3], fine_from_coarse: &SparseMatrix) -> [Vec<(u32, f32)>; 3] {
    let normal = |k: u32| normals[k as usize];
    let mut waiting = BTreeMap::from([(i, Mat3::IDENTITY)]);
    let mut rows = <[Vec<(u32, f32)>; 3]>::default();
    // Parents come before their children in the numbering: what is last has got all that it gets.
    while let Some((k, to_point)) = waiting.pop_last() {
        for (component, out) in rows.iter_mut().enumerate() {
            let of_row = (0..3).map(|column| (3 * k + column as u32, to_point.col(column)[component]));
            out.extend(of_row.filter(|entry| entry.1 != 0.0));
        }
        for (parent, weight) in row(fine_from_coarse, k as usize) {
            let (from, to) = (normal(parent), normal(k));
            let carried = match from.dot(to) > FLAT {
                true => to_point * weight,
                false => to_point * (carry(from, to) * weight),
            };
            *waiting.entry(parent).or_insert(Mat3::ZERO) += carried;
        }
    }
    rows
}
