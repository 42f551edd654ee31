//! Cuts: piecewise constant functions over the leaves of a light tree, their selection and their algebra.
//!
//! Source: Cheslack-Postava et al. 2008, section 3. A cut is a row of nodes from left to right that tile the leaves;
//! its value is the mean over each node.
//!
//! In a complete tree a node's place follows from the sizes of those before it, so a cut is stored as heights and
//! values, and merging compares the ends of the current nodes: of any number of nodes that share a leaf the deepest
//! lies within all others, and it ends where the first of them ends. That is the paper's traversal by postorder index
//! and leftmost leaf without its test for overlap, because nodes that end together are left together.

use crate::light_tree::Node;
use crate::ranked::Ranked;
use std::collections::BinaryHeap;

/// A cut through a complete binary tree: parallel arrays, nodes from left to right.
#[derive(Clone, Copy, Debug)]
pub struct Cut<'a> {
    /// Height of each node.
    pub heights: &'a [u8],
    /// Mean over each node.
    pub values: &'a [f32],
}

/// Every height that a tree can have.
static HEIGHTS: [u8; 32] = {
    let mut heights = [0; 32];
    let mut i = 0;
    while i < heights.len() {
        heights[i] = i as u8;
        i += 1;
    }
    heights
};

impl Cut<'static> {
    /// The cut of a site that sees nothing through a tree of this height (below 32): its root alone.
    pub fn nothing(height: u8) -> Cut<'static> {
        let height = usize::from(height);
        Cut {
            heights: &HEIGHTS[height..=height],
            values: &[0.0],
        }
    }
}

impl<'a> Cut<'a> {
    /// Its nodes, from left to right.
    pub fn nodes(self) -> impl Iterator<Item = (Node, f32)> + 'a {
        let mut end = 0u32;
        self.heights
            .iter()
            .zip(self.values)
            .map(move |(&height, &value)| {
                let index = end >> height;
                end += 1 << height;
                (Node { height, index }, value)
            })
    }
}

/// Cuts of many sites through one tree, one after another.
#[derive(Clone, Debug, Default)]
pub struct SiteCuts {
    /// Start of each site's nodes, and the end of the last: sites + 1 entries.
    pub offsets: Vec<u32>,
    /// Height of each node.
    pub heights: Vec<u8>,
    /// Mean over each node.
    pub values: Vec<f32>,
}

impl SiteCuts {
    /// Number of sites.
    pub fn sites(&self) -> usize {
        self.offsets.len().saturating_sub(1)
    }

    /// The cut of a site.
    ///
    /// # Panics
    /// `site` is not below [`SiteCuts::sites`].
    #[inline]
    pub fn cut(&self, site: usize) -> Cut<'_> {
        let range = self.offsets[site] as usize..self.offsets[site + 1] as usize;
        Cut {
            heights: &self.heights[range.clone()],
            values: &self.values[range],
        }
    }
}

/// Whether heights are those of a cut: the nodes start at multiples of their sizes and tile all 2^`tree_height`
/// leaves.
pub fn is_cut(heights: &[u8], tree_height: u8) -> bool {
    let mut end = 0u64;
    for &height in heights {
        if height > tree_height || !end.is_multiple_of(1u64 << height) {
            return false;
        }
        end += 1u64 << height;
        if end > 1u64 << tree_height {
            return false;
        }
    }
    end == 1u64 << tree_height
}

/// Place of one cut in a traversal.
#[derive(Clone, Copy, Debug, Default)]
struct Cursor {
    at: usize,
    end: u32,
}

/// Traverses any number of cuts at once and calls `visit` with each node of their merged cut and the value that every
/// cut has there. Whatever `visit` does with the values (sum, product, interpolation, products of many) is exact on
/// the cuts' own approximations. Nothing is allocated.
///
/// All cuts must be through the same tree; the traversal ends with the shortest. No cuts, no calls.
#[inline]
pub fn merge<const N: usize>(cuts: [Cut<'_>; N], mut visit: impl FnMut(Node, &[f32; N])) {
    let (mut cursors, mut values) = ([Cursor::default(); N], [0.0; N]);
    for j in 0..N {
        let (Some(&height), Some(&value)) = (cuts[j].heights.first(), cuts[j].values.first()) else {
            return;
        };
        cursors[j].end = 1 << height;
        values[j] = value;
    }
    let mut start = 0;
    while let Some(end) = cursors.iter().map(|c| c.end).min() {
        visit(node_between(start, end), &values);
        for j in 0..N {
            let cursor = &mut cursors[j];
            // Which cuts go on is as good as random: reading a node anew is cheaper than a branch guessed wrong.
            let ends = cursor.end == end;
            cursor.at += usize::from(ends);
            let (Some(&height), Some(&value)) =
                (cuts[j].heights.get(cursor.at), cuts[j].values.get(cursor.at))
            else {
                return;
            };
            cursor.end += u32::from(ends) << height;
            values[j] = value;
        }
        start = end;
    }
}

/// The node whose leaves are `start..end`, the size being a power of two.
#[inline]
fn node_between(start: u32, end: u32) -> Node {
    let height = (end - start).trailing_zeros();
    Node {
        height: height as u8,
        index: start >> height,
    }
}

/// Selects cuts through values at the leaves of one tree (equation 5); holds the tree's sums.
#[derive(Debug, Default)]
pub struct Selector {
    height: u8,
    /// By [`Node::slot`]: number, sum and sum of squares of the values that count. In f64: the variance is their
    /// difference, of which f32 leaves nothing where values are large and nearly alike (docs/notebook/stability.md).
    sums: Vec<[f64; 3]>,
    /// Nodes that may be split, by their errors.
    queue: BinaryHeap<Ranked<Node>>,
    nodes: Vec<Node>,
}

impl Selector {
    /// Appends a cut through `leaves` to `heights` and `values`: the node of largest error |C|·var is split until all
    /// are within `sigma`², or the cut has `most` nodes. Leaves that are NaN count for nothing: no node is split for
    /// them, and a node of nothing else has the value 0. Returns the number of leaves that count and the sum of their
    /// squared differences to the cut.
    ///
    /// # Panics
    /// The number of leaves is no power of two.
    pub fn select(
        &mut self,
        leaves: &[f32],
        sigma: f32,
        most: usize,
        heights: &mut Vec<u8>,
        values: &mut Vec<f32>,
    ) -> (f64, f64) {
        assert!(leaves.len().is_power_of_two());
        self.sum_up(leaves);
        let limit = f64::from(sigma * sigma);
        self.queue.clear();
        self.nodes.clear();
        let root = Node::root(self.height);
        self.offer(root, limit);
        while let Some(open) = self.queue.pop() {
            if self.nodes.len() + self.queue.len() + 2 > most {
                self.nodes.push(open.node);
                continue;
            }
            for child in open.node.children().into_iter().flatten() {
                self.offer(child, limit);
            }
        }
        self.nodes.sort_unstable_by_key(|node| node.first());
        let mut left = 0.0;
        for &node in &self.nodes {
            let [count, sum, _] = self.sums[node.slot(self.height)];
            heights.push(node.height);
            values.push(if count > 0.0 { (sum / count) as f32 } else { 0.0 });
            left += self.error(node);
        }
        (self.sums[1][0], left)
    }

    fn offer(&mut self, node: Node, limit: f64) {
        let error = self.error(node);
        if error > limit && node.height > 0 {
            self.queue.push(Ranked {
                rank: error,
                place: node.first(),
                node,
            });
        } else {
            self.nodes.push(node);
        }
    }

    /// |C|·var of a node: the sum of squared differences to its mean.
    fn error(&self, node: Node) -> f64 {
        let [count, sum, squares] = self.sums[node.slot(self.height)];
        if count > 0.0 {
            (squares - sum * sum / count).max(0.0)
        } else {
            0.0
        }
    }

    fn sum_up(&mut self, leaves: &[f32]) {
        let n = leaves.len();
        self.height = n.trailing_zeros() as u8;
        self.sums.resize(2 * n, [0.0; 3]);
        for (sum, &v) in self.sums[n..].iter_mut().zip(leaves) {
            let v = f64::from(v);
            *sum = if v.is_nan() { [0.0; 3] } else { [1.0, v, v * v] };
        }
        for slot in (1..n).rev() {
            let (a, b) = (self.sums[2 * slot], self.sums[2 * slot + 1]);
            self.sums[slot] = [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
        }
    }
}

#[cfg(test)]
mod tests;
