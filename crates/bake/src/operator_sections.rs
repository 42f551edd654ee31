//! Operators as sections of the file.

use crate::links::solution::Solution;
use crate::points::separation::Separations;
use glam::Vec3;
use relight_format as format;
use relight_transport::links::Links;
use relight_transport::senders::SenderTree;
use relight_transport::sparse::{SparseMatrix, row_sums};

/// T.
pub(crate) fn transfer(links: &Links) -> format::Links {
    format::Links {
        receivers: links.receivers,
        senders: links.senders,
        row_offsets: links.row_offsets.clone(),
        columns: links.columns.clone(),
        vectors: links.vectors.iter().map(Vec3::to_array).collect(),
    }
}

/// The clusters.
pub(crate) fn sender_tree(tree: &SenderTree) -> format::Senders {
    format::Senders {
        counts: (0..tree.levels())
            .map(|l| tree.ranges.range(l).len() as u32)
            .collect(),
        leaf_of_point: tree.leaf_of_point.clone(),
        importance: tree.importance.clone(),
        parents: tree.parents.clone(),
    }
}

/// The pairs of points that surfaces separate; `None` where there are none.
pub(crate) fn separations(separations: &Separations) -> Option<format::Separations> {
    let near: Vec<u32> = (0u32..)
        .zip(&separations.near)
        .filter(|near| *near.1)
        .map(|near| near.0)
        .collect();
    (!(near.is_empty() && separations.pairs.is_empty())).then(|| format::Separations {
        pairs: separations.pairs.clone(),
        near,
    })
}

/// K.
pub(crate) fn bounce(level: usize, matrix: &SparseMatrix) -> format::BounceLinks {
    format::BounceLinks {
        level: level as u32,
        matrix: weight_rows(matrix, 1.0),
    }
}

/// S.
pub(crate) fn solution(solution: &Solution) -> format::Solution {
    format::Solution {
        level: solution.level as u32,
        channels: solution
            .channels
            .iter()
            .map(|channel| weight_rows(channel, f64::MAX))
            .collect(),
    }
}

/// `most`: what no row may exceed, whatever rounding made of it.
fn weight_rows(matrix: &SparseMatrix, most: f64) -> format::WeightRows {
    format::WeightRows {
        rows: matrix.rows() as u32,
        row_offsets: matrix.indptr().raw_storage().to_vec(),
        columns: matrix.indices().to_vec(),
        weights: matrix.data().to_vec(),
        row_sums: row_sums(matrix).map(|sum| sum.min(most) as f32).collect(),
    }
}
