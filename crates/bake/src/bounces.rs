//! The flat bounce operator from the gathers of one receiver level.
//!
//! Source: design of relight, section 6 (bounces). K_jk is the irradiance averaged over sender j's function
//! per unit radiosity of sender k.

use rayon::prelude::*;
use relight_transport::sparse::Rows;

/// Share of a row's sum that may be dropped as small entries; the rest is scaled up so that the sum stays.
const DROPPED_SHARE: f32 = 0.05;

/// Averages the point rows of irradiance responses (`responses[p]`: (sender, response)) over the functions
/// of the bounce level: `functions_at_points` has those functions' values at the points (rows: points),
/// `areas` the points' areas. Rows and columns of the result: functions of the bounce level.
pub fn bounce_operator(responses: &[Vec<(u32, f32)>], functions_at_points: &Rows, areas: &[f32]) -> Rows {
    let size = functions_at_points.columns as usize;
    let points_of = functions_at_points.transposed();
    let rows: Vec<Vec<(u32, f32)>> = (0..size)
        .into_par_iter()
        .map_init(
            || vec![0.0f64; size],
            |dense, j| {
                let mut mass = 0.0f64;
                for &(p, share) in points_of.row(j) {
                    let weight = f64::from(share * areas[p as usize]);
                    mass += weight;
                    for &(k, response) in &responses[p as usize] {
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
