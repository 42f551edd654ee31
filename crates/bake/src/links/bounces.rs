//! The flat bounce operator from the gathers of one receiver level.
//!
//! K_jk is the irradiance averaged over the cluster of
//! sender j per unit radiosity of sender k.

use rayon::prelude::*;
use relight_transport::sparse::{SparseMatrix, from_rows};

/// Share of a row's sum that may be dropped as small entries; the rest is scaled up so that the sum stays.
const DROPPED_SHARE: f32 = 0.05;

/// Averages rows of irradiance responses at points over the clusters of the bounce level, point by point, so that no two
/// of the rows, which are long, are needed at once.
pub struct BounceSums {
    /// Where each point belongs, and how much it counts there, if it does.
    places: Vec<Option<(u32, f32)>>,
    /// Per cluster the weighted sum of its points' rows, over all clusters; empty before its first point.
    sums: Vec<Vec<f64>>,
    /// Per cluster the sum of its points' weights.
    masses: Vec<f64>,
    added: usize,
}

impl BounceSums {
    /// For points that each belong to one of so many clusters and count there by a weight; `None`: those that don't count.
    pub fn new(places: Vec<Option<(u32, f32)>>, clusters: usize) -> BounceSums {
        BounceSums {
            places,
            sums: vec![Vec::new(); clusters],
            masses: vec![0.0; clusters],
            added: 0,
        }
    }

    /// How many points' rows were added.
    pub fn added(&self) -> usize {
        self.added
    }

    /// Adds the next point's row: (cluster, irradiance per unit radiosity).
    pub fn add(&mut self, row: &[(u32, f32)]) {
        let place = self.places[self.added];
        self.added += 1;
        let Some((cluster, weight)) = place else { return };
        let weight = f64::from(weight);
        let clusters = self.sums.len();
        let sum = &mut self.sums[cluster as usize];
        sum.resize(clusters, 0.0);
        for &(k, response) in row {
            sum[k as usize] += weight * f64::from(response);
        }
        self.masses[cluster as usize] += weight;
    }

    /// K: rows and columns are clusters. Clusters without a point have empty rows.
    pub fn operator(self) -> SparseMatrix {
        let clusters = self.sums.len();
        let rows = (self.sums.into_par_iter().zip(self.masses)).map(|(sums, mass)| {
            let positive = (0..).zip(&sums).filter(|e| *e.1 > 0.0);
            sparsified(positive.map(|(k, sum)| (k, (sum / mass) as f32)).collect())
        });
        from_rows(&rows.collect::<Vec<_>>(), clusters)
    }
}

fn sparsified(mut row: Vec<(u32, f32)>) -> Vec<(u32, f32)> {
    let sum: f32 = row.iter().map(|e| e.1).sum();
    row.sort_unstable_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
    let mut dropped = 0.0;
    let first = row
        .iter()
        .position(|e| {
            dropped += e.1;
            dropped > sum * DROPPED_SHARE
        })
        .unwrap_or(0);
    row.drain(..first);
    let kept: f32 = row.iter().map(|e| e.1).sum();
    // No row may give more than it gets: at most 1, whatever rounding made of it.
    let scale = if kept > 0.0 { sum.min(1.0) / kept } else { 0.0 };
    row.iter_mut().for_each(|e| e.1 *= scale);
    row.sort_unstable_by_key(|e| e.0);
    row
}
