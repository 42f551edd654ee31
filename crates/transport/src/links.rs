//! The sparse transfer operator: links of vector irradiance per unit radiosity, from senders to receivers.
//!
//! Source: Lehtinen et al. 2008, sections 3.1 and 4 (i = S e, one sender at a time, dark senders skipped).

use crate::pyramid::VectorIrradiance;
use glam::{Vec3, Vec3A};
use rayon::prelude::*;

/// Links in rows of receivers. Columns ascend within a row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Links {
    /// Number of receivers (rows).
    pub receivers: u32,
    /// Number of senders (columns).
    pub senders: u32,
    /// Start of each row, and the end of the last.
    pub row_offsets: Vec<u32>,
    /// Sender of each link.
    pub columns: Vec<u32>,
    /// Vector irradiance at the receiver per unit radiosity of the sender.
    pub vectors: Vec<Vec3>,
}

impl Links {
    /// Number of links.
    pub fn len(&self) -> usize {
        self.columns.len()
    }

    /// Whether there is no link.
    pub fn is_empty(&self) -> bool {
        self.columns.is_empty()
    }

    /// Sender and vector of each link of a receiver.
    pub fn row(&self, receiver: usize) -> impl Iterator<Item = (u32, Vec3)> + '_ {
        let range = self.row_offsets[receiver] as usize..self.row_offsets[receiver + 1] as usize;
        range.map(|k| (self.columns[k], self.vectors[k]))
    }

    /// The same product one receiver at a time: the plain form of [`SenderLinks::apply`], its check in tests.
    pub fn apply(&self, coefficients: &[Vec3]) -> Vec<VectorIrradiance> {
        (0..self.receivers as usize)
            .map(|i| {
                let mut sum = VectorIrradiance::default();
                for (j, vector) in self.row(i) {
                    sum.add(vector, Vec3A::from(coefficients[j as usize]));
                }
                sum
            })
            .collect()
    }
}

/// Receivers per block of [`SenderLinks`]. A block's sums (48 bytes each) stay in a 256 KiB cache, and its
/// rows fit 16 bits.
const BLOCK: usize = 4096;

/// A sender's coefficient below this fraction of the frame's largest is dark: what it would add to any
/// receiver is below a rounding error of the sum. Relative, because intensities span forty decades.
pub const DARK: f32 = 1e-7;

/// The same links sender by sender within blocks of receivers, so that blocks run in parallel and each skips
/// dark senders.
#[derive(Clone, Debug, Default)]
pub struct SenderLinks {
    receivers: usize,
    blocks: Vec<Block>,
}

#[derive(Clone, Debug, Default)]
struct Block {
    /// (sender, end of its links); links start at the previous end.
    senders: Vec<(u32, u32)>,
    /// Receiver within the block.
    rows: Vec<u16>,
    vectors: Vec<Vec3>,
}

impl SenderLinks {
    /// Sorts links by sender.
    pub fn new(links: &Links) -> SenderLinks {
        let receivers = links.receivers as usize;
        let blocks = (0..receivers.div_ceil(BLOCK))
            .into_par_iter()
            .map(|b| {
                let rows = b * BLOCK..((b + 1) * BLOCK).min(receivers);
                let mut sorted: Vec<(u32, u16, Vec3)> = rows
                    .clone()
                    .flat_map(|i| links.row(i).map(move |(j, v)| (j, (i - b * BLOCK) as u16, v)))
                    .collect();
                sorted.sort_unstable_by_key(|&(j, i, _)| (j, i));
                let mut senders: Vec<(u32, u32)> = Vec::new();
                for run in sorted.chunk_by(|a, b| a.0 == b.0) {
                    let start = senders.last().map_or(0, |s| s.1);
                    senders.push((run[0].0, start + run.len() as u32));
                }
                Block {
                    senders,
                    rows: sorted.iter().map(|l| l.1).collect(),
                    vectors: sorted.iter().map(|l| l.2).collect(),
                }
            })
            .collect();
        SenderLinks { receivers, blocks }
    }

    /// Coefficients of indirect vector irradiance, i = T e (receivers), from sender coefficients (radiosity).
    /// Also returns the number of links that were used.
    pub fn apply(&self, coefficients: &[Vec3]) -> (Vec<VectorIrradiance>, usize) {
        let brightest = coefficients
            .iter()
            .fold(0.0f32, |m, c| m.max(c.abs().max_element()));
        let dark = brightest * DARK;
        let mut out = vec![VectorIrradiance::default(); self.receivers];
        let used = out
            .par_chunks_mut(BLOCK)
            .zip(&self.blocks)
            .map(|(sums, block)| {
                let mut start = 0;
                let mut used = 0;
                for &(sender, end) in &block.senders {
                    let color = coefficients[sender as usize];
                    let range = start..end as usize;
                    start = end as usize;
                    if color.abs().max_element() <= dark {
                        continue;
                    }
                    used += range.len();
                    let color = Vec3A::from(color);
                    for (&row, &vector) in block.rows[range.clone()].iter().zip(&block.vectors[range]) {
                        sums[row as usize].add(vector, color);
                    }
                }
                used
            })
            .sum();
        (out, used)
    }
}
