//! A receiver's row while its links are chosen, and what both ways of choosing share.

use crate::links::fitting::{Answers, TrialLights, fit};
use crate::links::gather::RowScratch;
use crate::links::matching_pursuit::PursuitScratch;
use glam::{Vec3, Vec3A};
use relight_transport::senders::SenderTree;

/// A receiver's row before selection.
#[derive(Clone, Copy, Debug)]
pub struct Row<'a> {
    /// The senders.
    pub tree: &'a SenderTree,
    /// Lights that the row is fitted to.
    pub trials: &'a TrialLights,
    /// What it answers to them.
    pub answers: &'a Answers,
    /// Positions of the senders of the coarsest level.
    pub coarse_positions: &'a [Vec3],
    /// Responses of the clusters, all levels.
    pub gathered: &'a RowScratch,
    /// Link coefficients that the receiver's parents predict.
    pub predicted: &'a RowScratch,
    /// The receiver's normal.
    pub normal: Vec3A,
    /// Strength below which a link is dropped.
    pub threshold: f32,
}

/// How much of the part of a link along the surface counts: the sine of 20°, a strong normal map's tilt.
const TANGENT_WEIGHT: f32 = 0.35;

impl Row<'_> {
    /// What a link can do to the irradiance of a surface whose shading normal lies near the receiver's.
    pub(super) fn strength(&self, vector: Vec3A) -> f32 {
        let along = vector.dot(self.normal);
        along.abs() + TANGENT_WEIGHT * (vector - self.normal * along).length()
    }

    /// The square of [`Row::strength`], with its two parts added up as squares.
    pub(super) fn strength_squared(&self, vector: Vec3A) -> f32 {
        let along = vector.dot(self.normal);
        let rest = vector - self.normal * along;
        along * along + TANGENT_WEIGHT * TANGENT_WEIGHT * rest.length_squared()
    }

    /// Senders of the coarsest level that are gathered or predicted, ascending.
    pub(super) fn coarse_senders(&self) -> Vec<u32> {
        let mut senders: Vec<u32> = self.touched_on(0).collect();
        senders.sort_unstable();
        senders.dedup();
        senders
    }

    /// Senders of a level that are gathered or predicted, each once or twice.
    fn touched_on(&self, level: usize) -> impl Iterator<Item = u32> {
        let range = self.tree.ranges.range(level);
        let both = self.gathered.touched.iter().chain(&self.predicted.touched);
        both.copied().filter(move |&j| range.contains(&(j as usize)))
    }
}

/// Room to select in, for one thread.
#[derive(Debug)]
pub struct SelectScratch {
    /// Per sender: its response as the parents' rows have it.
    pub(super) predicted: Vec<Vec3A>,
    /// Per sender: its response as stored, less the predicted one.
    pub(super) stored: Vec<Vec3A>,
    /// Families to look at, by their parent, on each sender level.
    pub(super) families: Vec<Vec<u32>>,
    /// Whether a cluster is in one of `families`.
    pub(super) is_open: Vec<bool>,
    /// Whether a child of the family at hand is kept.
    pub(super) kept: Vec<bool>,
    /// What pursuit works in.
    pub(super) pursuit: PursuitScratch,
}

impl SelectScratch {
    /// Room for the senders of `tree`.
    pub fn new(tree: &SenderTree) -> SelectScratch {
        let senders = tree.ranges.total();
        SelectScratch {
            predicted: vec![Vec3A::ZERO; senders],
            stored: vec![Vec3A::ZERO; senders],
            families: vec![Vec::new(); tree.levels()],
            is_open: vec![false; senders],
            kept: Vec::new(),
            pursuit: PursuitScratch::default(),
        }
    }
}

/// Fits the links of the coarsest sender level, the first `coarse_kept`, to what the row answers to trial lights, less what
/// its parents and the others answer.
pub(super) fn correct(
    row: &Row,
    coarse_kept: usize,
    quantised: &impl Fn(Vec3) -> Vec3,
    links: &mut [(u32, Vec3)],
) {
    if coarse_kept == 0 {
        return;
    }
    let coefficients = &row.trials.coefficients;
    let mut missing = *row.answers;
    for &j in &row.predicted.touched {
        missing.add(-row.predicted.sum[j as usize], &coefficients[j as usize]);
    }
    for &(j, vector) in links.iter() {
        missing.add(-Vec3A::from(vector), &coefficients[j as usize]);
    }
    let fitted = &mut links[..coarse_kept];
    let whole = |sender: u32| row.strength(row.gathered.sum[sender as usize]);
    fit(fitted, whole, row.trials, &missing);
    fitted.iter_mut().for_each(|link| link.1 = quantised(link.1));
}

/// Lists, level by level, the clusters with a child or a further descendant that is gathered or predicted.
pub(super) fn open_families(row: &Row, room: &mut SelectScratch) {
    let tree = row.tree;
    for level in (1..tree.levels()).rev() {
        let start = tree.ranges.range(level).start as u32;
        let above = tree.ranges.range(level - 1).start as u32;
        let (upper, lower) = room.families.split_at_mut(level);
        for j in row.touched_on(level).chain(lower[0].iter().copied()) {
            let parent = above + tree.parents[level - 1][(j - start) as usize];
            if !room.is_open[parent as usize] {
                room.is_open[parent as usize] = true;
                upper[level - 1].push(parent);
            }
        }
    }
}

/// Responses of a cluster's children, from its own, in `predicted`: their shares of what their coefficients don't account for.
pub(super) fn predict_children(row: &Row, level: usize, family: u32, predicted: &mut [Vec3A]) {
    let tree = row.tree;
    let parent = family as usize;
    let fine = tree.ranges.range(level + 1).start;
    let children = tree.children(level, parent - tree.ranges.range(level).start);
    let senders = || children.iter().map(|&c| fine + c as usize);
    let coefficients: Vec3A = senders().map(|j| row.predicted.sum[j]).sum();
    let spread = predicted[parent] - coefficients;
    for j in senders() {
        predicted[j] = spread * tree.shares[j] + row.predicted.sum[j];
    }
}
