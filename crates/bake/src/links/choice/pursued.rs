//! Links of a row by pursuit.

use crate::links::fitting::Answers;
use crate::links::matching_pursuit::{Choice, Family, NO_FAMILY, Residual, Weights, pursue};
use crate::links::row::{Row, SelectScratch, correct, open_families, predict_children};
use crate::links::test_lights::{AT_PILOTS, TEST_LIGHTS, TestLights};
use glam::{Vec3, Vec3A};

/// What links are chosen by.
#[derive(Clone, Copy, Debug)]
pub struct PursuitGoal<'a> {
    /// The lights.
    pub test_lights: &'a TestLights,
    /// What the rows of the receiver's parents answer.
    pub predicted: &'a Answers<TEST_LIGHTS>,
    /// Squared error that a link takes away at least (see [`crate::links::matching_pursuit`]).
    pub gain: f32,
}

/// Part of the root of the gain that a cluster's response must deviate by for its link to be looked at.
const LEAST_DEVIATION: f32 = 0.1;

/// The links of a row to keep, by ascending sender, as [`select`](super::select) does; by pursuit.
pub fn select_by_pursuit(
    row: &Row,
    light: &PursuitGoal,
    quantised: impl Fn(Vec3) -> Vec3,
    room: &mut SelectScratch,
) -> Vec<(u32, Vec3)> {
    let mut missing = answered_by_gather(row, light.test_lights);
    let weights = Weights::of(&missing);
    missing.subtract(light.predicted);
    find_choices(row, LEAST_DEVIATION * light.gain.sqrt(), room);
    let residual = Residual {
        test_lights: light.test_lights,
        missing: &missing,
        weights: &weights,
        gain: light.gain,
    };
    let strength_squared = |v| row.strength_squared(v);
    let mut links = Vec::new();
    pursue(&residual, strength_squared, &mut room.pursuit, &mut links);
    links.iter_mut().for_each(|link| link.1 = quantised(link.1));
    links.sort_unstable_by_key(|link| link.0);
    let coarse = row.tree.ranges.range(0).len() as u32;
    let coarse_kept = links.partition_point(|link| link.0 < coarse);
    correct(row, coarse_kept, &quantised, &mut links);
    links.retain(|link| link.1 != Vec3::ZERO);
    links
}

/// What the gather of `row` answers: its clusters' means, and lamps as much brighter as what rays met in the trial light of their
/// group is than those.
fn answered_by_gather(row: &Row, test_lights: &TestLights) -> Answers<TEST_LIGHTS> {
    let leaves = row.tree.ranges.range(row.tree.levels() - 1);
    let mut answers = Answers::default();
    let mut of_clusters: Answers = Answers::default();
    for &j in &row.gathered.touched {
        if let Some(leaf) = (j as usize).checked_sub(leaves.start) {
            let vector = row.gathered.sum[j as usize];
            answers.add(vector, &test_lights.leaf_means[leaf]);
            of_clusters.add(vector, &row.trials.leaf_means[leaf]);
        }
    }
    let brighter = row.answers.gains_over(&of_clusters);
    let mut factors = [1.0; TEST_LIGHTS];
    for (factor, &group) in factors[1..=AT_PILOTS].iter_mut().zip(&row.trials.group_of_pilot) {
        *factor = brighter[group];
    }
    answers.scale(&factors);
    answers
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
            predict_children(row, level, parent, &mut room.predicted);
            let parent = parent as usize;
            let senders = || (tree.children(level, parent - above).iter()).map(|&c| fine + c as usize);
            let lacked = gathered.sum[parent] - room.predicted[parent];
            let mut family = Family::default();
            for j in senders() {
                let share = tree.shares[j];
                let deviation = gathered.sum[j] - room.predicted[j] - lacked * share;
                family.squares += share * share;
                family.deviation += deviation * share;
                offer(j as u32, pursuit.families.len() as u32, share, deviation);
            }
            pursuit.families.push(family);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::links::fitting::{TRIALS, TrialLights};
    use crate::links::gather::RowScratch;
    use relight_transport::senders::{PILOTS, SenderTree};

    /// Where a ray's own point is lit twice as much as its cluster's mean by all lamps of a group, the answer to each is.
    #[test]
    fn lamps_are_answered_as_much_brighter_than_clusters_as_their_group_is() {
        let leaves = (0..40).map(|p| p / 10).collect();
        let tree = SenderTree::new(&[2, 4], leaves, vec![vec![0, 0, 1, 1]], vec![9; 40]);
        let test_lights = TestLights::from_radiosity(&tree, |g, p| 1.0 + ((g * p) % 7) as f32);
        let trials = TrialLights::from_radiosity(&tree, (0..40).map(|_| [1.0; TRIALS]));
        let mut gathered = RowScratch::new(6);
        let vector = Vec3A::new(0.1, 0.4, 0.0);
        gathered.add(3, vector);
        gathered.add(0, vector);
        let mut of_rays: Answers = Answers::default();
        of_rays.add(vector, &std::array::from_fn(|g| if g == 1 { 2.0 } else { 1.0 }));
        let trials = TrialLights {
            group_of_pilot: (0..PILOTS).map(|k| 1 + k % 2).collect(),
            ..trials
        };
        let row = Row {
            tree: &tree,
            trials: &trials,
            answers: &of_rays,
            coarse_positions: &[],
            gathered: &gathered,
            predicted: &RowScratch::new(6),
            normal: Vec3A::Y,
            threshold: 0.0,
        };
        let answers = answered_by_gather(&row, &test_lights);
        for g in 0..TEST_LIGHTS {
            let is_brighter = (1..=AT_PILOTS).contains(&g) && (g - 1) % 2 == 0;
            let factor = if is_brighter { 2.0 } else { 1.0 };
            let wanted = vector * (test_lights.leaf_means[1][g] * factor);
            assert!((answers.at(g) - wanted).length() < 1e-5, "{g}");
        }
    }
}
