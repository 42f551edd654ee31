//! The flat bounce operator from the gathers of one receiver level.
//!
//! Source: design of relight, section 6 (bounces). K_jk is the irradiance averaged over the cluster of
//! sender j per unit radiosity of sender k.

use rayon::prelude::*;
use relight_transport::sparse::Rows;

/// Share of a row's sum that may be dropped as small entries; the rest is scaled up so that the sum stays.
const DROPPED_SHARE: f32 = 0.05;

/// Averages the point rows of irradiance responses (`responses[p]`: (cluster, response)) over the clusters of
/// the bounce level: `cluster_of_receiver[p]` says where point p belongs, and `weights[p]` how much it counts
/// there. Rows and columns of the result:
/// clusters. Clusters without a receiver have empty rows.
pub fn bounce_operator(
    responses: &[Vec<(u32, f32)>],
    cluster_of_receiver: &[u32],
    weights: &[f32],
    clusters: usize,
) -> Rows {
    let mut receivers_of = vec![Vec::new(); clusters];
    for (p, &cluster) in cluster_of_receiver.iter().enumerate() {
        receivers_of[cluster as usize].push(p);
    }
    let rows: Vec<Vec<(u32, f32)>> = receivers_of
        .into_par_iter()
        .map_init(
            || vec![0.0f64; clusters],
            |dense, receivers| {
                let mass: f64 = receivers.iter().map(|&p| f64::from(weights[p])).sum();
                for p in receivers {
                    let weight = f64::from(weights[p]);
                    for &(k, response) in &responses[p] {
                        dense[k as usize] += weight * f64::from(response);
                    }
                }
                let row: Vec<(u32, f32)> = dense
                    .iter()
                    .enumerate()
                    .filter(|e| *e.1 > 0.0)
                    .map(|(k, sum)| (k as u32, (sum / mass) as f32))
                    .collect();
                dense.fill(0.0);
                sparsified(row)
            },
        )
        .collect();
    let size = clusters;
    let mut operator = Rows {
        columns: size as u32,
        offsets: vec![0],
        entries: Vec::new(),
    };
    for row in rows {
        operator.entries.extend(row);
        operator.offsets.push(operator.entries.len() as u32);
    }
    operator
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
