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

    /// Sender and vector of each link of a receiver, senders ascending; empty beyond the last receiver.
    pub fn of_receiver(&self, receiver: usize) -> Vec<(u32, Vec3)> {
        let Some(block) = self.blocks.get(receiver / BLOCK) else {
            return Vec::new();
        };
        // Within a block, which has no more than `BLOCK` rows.
        let row = (receiver % BLOCK) as u16;
        let mut found = Vec::new();
        let mut start = 0;
        for &(sender, end) in &block.senders {
            if let Ok(at) = block.rows[start..end as usize].binary_search(&row) {
                found.push((sender, block.vectors[start + at]));
            }
            start = end as usize;
        }
        found
    }

    /// T, one row per receiver: senders and vectors of its links, senders ascending.
    pub fn rows(&self) -> Vec<Vec<(u32, Vec3)>> {
        let mut rows = vec![Vec::new(); self.receivers];
        for (block, rows) in self.blocks.iter().zip(rows.chunks_mut(BLOCK)) {
            let mut start = 0;
            for &(sender, end) in &block.senders {
                for link in start as usize..end as usize {
                    rows[usize::from(block.rows[link])].push((sender, block.vectors[link]));
                }
                start = end;
            }
        }
        rows
    }

    /// T, three rows per receiver: (sender, component x, y or z), senders ascending.
    pub fn component_rows(&self) -> Vec<Vec<(u32, f32)>> {
        let component =
            |row: &[(u32, Vec3)], axis: usize| row.iter().map(|link| (link.0, link.1[axis])).collect();
        let of_row = |row: Vec<(u32, Vec3)>| [0, 1, 2].map(|axis| component(&row, axis));
        self.rows().into_iter().flat_map(of_row).collect()
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    fn random_links(receivers: u32, senders: u32, per_row: u32) -> Links {
        let mut s = Stream::new(21, 0, 0);
        let mut links = Links {
            receivers,
            senders,
            row_offsets: vec![0],
            ..Links::default()
        };
        for _ in 0..receivers {
            let mut columns: Vec<u32> = (0..per_row)
                .map(|_| (s.uniform() * senders as f32) as u32)
                .collect();
            columns.sort_unstable();
            columns.dedup();
            for column in columns {
                links.columns.push(column);
                links
                    .vectors
                    .push(Vec3::new(s.uniform(), s.uniform(), s.uniform()) - 0.5);
            }
            links.row_offsets.push(links.columns.len() as u32);
        }
        links
    }

    #[test]
    fn links_of_a_receiver_are_its_row() {
        let links = random_links(9000, 300, 12);
        let sorted = SenderLinks::new(&links);
        let rows = sorted.rows();
        for receiver in [0, 1, BLOCK - 1, BLOCK, 8999] {
            let row: Vec<(u32, Vec3)> = links.row(receiver).collect();
            assert!(!row.is_empty());
            assert_eq!(rows[receiver], row, "receiver {receiver}");
            assert_eq!(sorted.of_receiver(receiver), row, "receiver {receiver}");
        }
        assert_eq!(sorted.of_receiver(9000), []);
        assert_eq!(sorted.of_receiver(90_000), []);
    }

    #[test]
    fn sender_by_sender_gives_what_a_dense_product_gives() {
        let links = random_links(9000, 300, 12);
        let mut s = Stream::new(22, 0, 0);
        let light: Vec<Vec3> = (0..300)
            .map(|j| {
                if j % 3 == 0 {
                    Vec3::ZERO
                } else {
                    Vec3::new(s.uniform(), s.uniform(), 1e-3)
                }
            })
            .collect();
        let (fast, used) = SenderLinks::new(&links).apply(&light);
        let lit = links.columns.iter().filter(|&&j| j % 3 != 0).count();
        assert_eq!(used, lit, "dark senders are skipped, all others used");
        for i in 0..9000 {
            let mut dense = glam::DVec3::ZERO;
            let n = Vec3::new(0.6, 0.0, 0.8);
            for (j, v) in links.row(i) {
                dense += light[j as usize].as_dvec3() * f64::from(v.dot(n));
            }
            // Twelve products of numbers below 1 in single precision.
            assert!((fast[i].irradiance(n).as_dvec3() - dense).abs().max_element() < 1e-5);
        }
        assert_eq!(fast, links.apply(&light), "the same sums in the same order");
    }

    #[test]
    fn intensities_of_forty_decades_scale_the_result_and_change_no_decision() {
        let links = random_links(500, 50, 8);
        let mut s = Stream::new(23, 0, 0);
        let light: Vec<Vec3> = (0..50).map(|_| Vec3::splat(s.uniform().powi(8))).collect();
        let sender_links = SenderLinks::new(&links);
        let (unit, used) = sender_links.apply(&light);
        for exponent in [-60, 60] {
            let scale = 2f32.powi(exponent);
            let scaled: Vec<Vec3> = light.iter().map(|c| *c * scale).collect();
            let (out, used_scaled) = sender_links.apply(&scaled);
            assert_eq!(used, used_scaled);
            for (a, b) in unit.iter().zip(&out) {
                assert_eq!(a.x * scale, b.x, "a power of two changes no digit");
            }
        }
    }
}
