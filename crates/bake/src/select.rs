//! Which links of a receiver are kept, and what becomes of the others.
//!
//! Source: Lehtinen et al. 2008, section 3.2, figure 5 and appendix A: by magnitude on the coarsest sender
//! level, by variation among neighbours on the finer ones.
//!
//! Deviations. Magnitudes are tested as ρ·‖T‖, ρ the sender's reflectance, because links carry geometry only.
//! A link must also exceed one sample of its standard error, the difference of its two half gathers. What is
//! dropped on the coarsest sender level is given to the nearest kept sender, so that a row's response to
//! constant radiosity, which is that of its coarsest-level senders alone, is kept.

use crate::gather::RowScratch;
use glam::{Vec3, Vec3A};
use relight_transport::pyramid::LevelRanges;

/// What selection needs to know of the senders.
pub struct SenderTraits {
    /// Sender levels in the numbering over all senders.
    pub ranges: LevelRanges,
    /// Largest channel of each sender's reflectance.
    pub reflectance: Vec<f32>,
    /// Positions of the senders of level 0.
    pub coarse_positions: Vec<Vec3>,
}

/// Thresholds of one receiver level.
#[derive(Clone, Copy, Debug)]
pub struct Thresholds {
    /// On ρ·‖T‖.
    pub link: f32,
    /// On the length of the sum of dropped links of a row that keeps none on the coarsest sender level.
    pub row: f32,
}

/// Multiples of the half gathers' difference (one sample of the standard error) below which a link is noise.
const STANDARD_ERRORS: f32 = 1.0;

/// The links of a row to keep, by ascending sender. `row` holds equation 17: gathered minus reconstructed
/// from the parents' stored links. `quantised` is what the file makes of a vector.
pub fn select(
    row: &RowScratch,
    senders: &SenderTraits,
    thresholds: Thresholds,
    quantised: impl Fn(Vec3) -> Vec3,
) -> Vec<(u32, Vec3)> {
    let coarse = senders.ranges.range(0).end as u32;
    let significant = |j: u32| {
        let length = row.sum[j as usize].length();
        length * senders.reflectance[j as usize] > thresholds.link
            && length > STANDARD_ERRORS * row.difference[j as usize].length()
    };
    let mut kept: Vec<(u32, Vec3A)> = row
        .touched
        .iter()
        .filter(|&&j| significant(j))
        .map(|&j| (j, row.sum[j as usize]))
        .collect();
    kept.sort_unstable_by_key(|link| link.0);
    give_dropped_to_nearest(row, senders, thresholds, coarse, &mut kept);
    let mut links: Vec<(u32, Vec3)> = kept
        .into_iter()
        .map(|(j, vector)| (j, quantised(Vec3::from(vector))))
        .collect();
    links.retain(|link| link.1 != Vec3::ZERO);
    links
}

fn give_dropped_to_nearest(
    row: &RowScratch,
    senders: &SenderTraits,
    thresholds: Thresholds,
    coarse: u32,
    kept: &mut Vec<(u32, Vec3A)>,
) {
    let kept_coarse = kept.partition_point(|link| link.0 < coarse);
    let mut dropped: Vec<u32> = row
        .touched
        .iter()
        .copied()
        .filter(|&j| {
            j < coarse
                && kept[..kept_coarse]
                    .binary_search_by_key(&j, |link| link.0)
                    .is_err()
        })
        .collect();
    dropped.sort_unstable();
    if kept_coarse == 0 {
        let sum: Vec3A = dropped.iter().map(|&j| row.sum[j as usize]).sum();
        if sum.length() > thresholds.row {
            let strongest = dropped
                .iter()
                .copied()
                .max_by(|&a, &b| {
                    let along = |j: u32| row.sum[j as usize].dot(sum);
                    along(a).total_cmp(&along(b)).then(b.cmp(&a))
                })
                .unwrap_or(0);
            kept.insert(0, (strongest, sum));
        }
        return;
    }
    for j in dropped {
        let distance = |k: u32| {
            senders.coarse_positions[k as usize].distance_squared(senders.coarse_positions[j as usize])
        };
        let nearest = (0..kept_coarse).min_by(|&a, &b| distance(kept[a].0).total_cmp(&distance(kept[b].0)));
        if let Some(slot) = nearest {
            kept[slot].1 += row.sum[j as usize];
        }
    }
}
