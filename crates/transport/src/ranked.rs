//! What a heap gives first: nodes of trees by how much their splitting matters.

use std::cmp::Ordering;

/// A node by its rank. Of equal ranks the lowest place is the greatest, so that what is split first depends on nothing else.
#[derive(Clone, Copy, Debug)]
pub struct Ranked<T> {
    /// How much it matters.
    pub rank: f64,
    /// Where it is; no two of a heap have the same rank and place.
    pub place: u32,
    /// The node.
    pub node: T,
}

impl<T> PartialEq for Ranked<T> {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl<T> Eq for Ranked<T> {}

impl<T> PartialOrd for Ranked<T> {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl<T> Ord for Ranked<T> {
    fn cmp(&self, other: &Self) -> Ordering {
        (self.rank.total_cmp(&other.rank)).then_with(|| other.place.cmp(&self.place))
    }
}
