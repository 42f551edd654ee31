//! Links of a row by pursuit.

use super::{Row, SelectScratch, correct, open_families};
use crate::lamps::{LAMPS, Lamps};
use crate::pursuit::{Choice, Family, Lacking, NO_FAMILY, Weights, pursue};
use crate::trials::Answers;
use glam::{Vec3, Vec3A};

/// What links are chosen by.
#[derive(Clone, Copy, Debug)]
pub struct InLamplight<'a> {
    /// The lights.
    pub lamps: &'a Lamps,
    /// What the rows of the receiver's parents answer.
    pub predicted: &'a Answers<LAMPS>,
    /// Squared error that a link takes away at least (see [`crate::pursuit`]).
    pub gain: f32,
}

/// Part of the root of the gain that a cluster's response must deviate by for its link to be looked at.
const LEAST_DEVIATION: f32 = 0.1;

/// The links of a row to keep, by ascending sender, as [`select`](super::select) does; by pursuit.
pub fn select_by_pursuit(
    row: &Row,
    light: &InLamplight,
    quantised: impl Fn(Vec3) -> Vec3,
    room: &mut SelectScratch,
) -> Vec<(u32, Vec3)> {
    let mut missing = light.lamps.answered_by_gather(row);
    let weights = Weights::of(&missing);
    missing.subtract(light.predicted);
    find_choices(row, LEAST_DEVIATION * light.gain.sqrt(), room);
    let lacking = Lacking {
        lamps: light.lamps,
        missing: &missing,
        weights: &weights,
        gain: light.gain,
    };
    let strength_squared = |v| row.strength_squared(v);
    let mut links = Vec::new();
    pursue(&lacking, strength_squared, &mut room.pursuit, &mut links);
    links.iter_mut().for_each(|link| link.1 = quantised(link.1));
    links.sort_unstable_by_key(|link| link.0);
    let coarse = row.tree.ranges.range(0).len() as u32;
    let coarse_kept = links.partition_point(|link| link.0 < coarse);
    correct(row, coarse_kept, &quantised, &mut links);
    links.retain(|link| link.1 != Vec3::ZERO);
    links
}

/// Lists the senders whose response differs from what is predicted, and from their share of what their parent's does, by more than
/// `least`.
fn find_choices(row: &Row, least: f32, room: &mut SelectScratch) {
    let Row {
        tree,
        gathered,
        predicted,
        ..
    } = *row;
    open_families(row, room);
    let pursuit = &mut room.pursuit;
    pursuit.choices.clear();
    pursuit.families.clear();
    let mut offer = |sender: u32, family: u32, share: f32, deviation: Vec3A| {
        if row.strength(deviation) > least {
            pursuit.choices.push(Choice {
                sender,
                family,
                share,
                deviation,
            });
        }
    };
    for j in row.coarse_senders() {
        room.predicted[j as usize] = predicted.sum[j as usize];
        offer(
            j,
            NO_FAMILY,
            1.0,
            gathered.sum[j as usize] - predicted.sum[j as usize],
        );
    }
    for level in 0..tree.levels().saturating_sub(1) {
        let above = tree.ranges.range(level).start;
        let fine = tree.ranges.range(level + 1).start;
        for parent in room.families[level].drain(..) {
            room.is_open[parent as usize] = false;
            let parent = parent as usize;
            let senders = || (tree.children(level, parent - above).iter()).map(|&c| fine + c as usize);
            let coefficients: Vec3A = senders().map(|j| predicted.sum[j]).sum();
            let spread = room.predicted[parent] - coefficients;
            let lacked = gathered.sum[parent] - room.predicted[parent];
            let mut family = Family::default();
            for j in senders() {
                let share = tree.shares[j];
                room.predicted[j] = spread * share + predicted.sum[j];
                let deviation = gathered.sum[j] - room.predicted[j] - lacked * share;
                family.squares += share * share;
                family.deviation += deviation * share;
                offer(j as u32, pursuit.families.len() as u32, share, deviation);
            }
            pursuit.families.push(family);
        }
    }
}
