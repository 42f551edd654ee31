//! A tree over emissive surfaces, through which one is drawn in about the proportion of what it sends to a place.
//!
//! Source: Conty Estévez and Kulla 2018, sections 4 and 5, as a tree of one sample (no splitting); the traversal and the
//! trail of bits from the root to each leaf follow Pharr et al., *Physically Based Rendering*, 4th ed., 12.6.3. Drawing and
//! asking for a probability take time in proportion to the tree's depth.

use super::emission_bounds::{Emission, EmissionBounds};
use super::shape::ReferencePoint;
use glam::DVec3;

/// Buckets along an axis among which a node's best split is sought.
const BUCKETS: usize = 12;

/// Below so many levels a node is split into equal halves, so that no trail is longer than its 64 bits: 2³¹ leaves are 31
/// levels of halves.
const BALANCED_BELOW: u32 = 32;

/// A binary tree with a leaf for each surface that emits.
#[derive(Clone, Debug, Default)]
pub(super) struct EmissiveTree {
    /// Depth first: a node's first child follows it.
    nodes: Vec<Node>,
    /// For each leaf which way it goes from the root: the lowest bit first, set for second children.
    trails: Vec<u64>,
}

#[derive(Clone, Copy, Debug)]
struct Node {
    bounds: EmissionBounds,
    next: Next,
}

#[derive(Clone, Copy, Debug)]
enum Next {
    /// Index of the second child.
    Second(u32),
    /// Number of the leaf.
    Leaf(u32),
}

impl EmissiveTree {
    /// Leaf `i` is `surfaces[i]`; powers are above zero and finite. Fewer than 2³¹.
    pub fn new(surfaces: &[Emission]) -> EmissiveTree {
        let mut tree = EmissiveTree {
            nodes: Vec::with_capacity((2 * surfaces.len()).saturating_sub(1)),
            trails: vec![0; surfaces.len()],
        };
        let all = surfaces.iter().map(|surface| surface.power).sum();
        let mut order: Vec<u32> = (0..surfaces.len() as u32).collect();
        if !order.is_empty() {
            tree.build(surfaces, &mut order, all, 0, 0);
        }
        tree
    }

    fn build(&mut self, surfaces: &[Emission], order: &mut [u32], all: f64, trail: u64, depth: u32) {
        let of = |i: &u32| surfaces[*i as usize];
        let union = |order: &[u32]| (order.iter().map(of)).reduce(|a, b| a.union(&b));
        let Some(whole) = union(order) else { return };
        let bounds = EmissionBounds::new(&whole, all);
        if let &mut [leaf] = order {
            self.trails[leaf as usize] = trail;
            let next = Next::Leaf(leaf);
            self.nodes.push(Node { bounds, next });
            return;
        }
        let middle = if depth < BALANCED_BELOW {
            split(surfaces, order, &whole)
        } else {
            order.len() / 2
        };
        let (first, second) = order.split_at_mut(middle);
        let node = self.nodes.len();
        let next = Next::Second(0);
        self.nodes.push(Node { bounds, next });
        self.build(surfaces, first, all, trail, depth + 1);
        self.nodes[node].next = Next::Second(self.nodes.len() as u32);
        self.build(surfaces, second, all, trail | 1 << depth, depth + 1);
    }

    /// Draws a leaf for a place by a random number in [0, 1), with the probability that it is drawn by. `None` where nothing
    /// arrives, or where what was drawn sends nothing.
    pub fn sample(&self, at: &ReferencePoint, random: f32) -> Option<(usize, f64)> {
        let (mut node, mut random, mut probability) = (0, f64::from(random), 1.0);
        let root = self.nodes.first()?;
        if let Next::Leaf(leaf) = root.next {
            return (root.bounds.importance(at) > 0.0).then_some((leaf as usize, 1.0));
        }
        loop {
            match self.nodes[node].next {
                Next::Leaf(leaf) => return Some((leaf as usize, probability)),
                Next::Second(second) => {
                    let first = self.share_of_first(node, second as usize, at)?;
                    // The number is used again: what is left of it is as even as before.
                    if random < first {
                        (node, random) = (node + 1, random / first);
                        probability *= first;
                    } else {
                        (node, random) = (second as usize, (random - first) / (1.0 - first));
                        probability *= 1.0 - first;
                    }
                    random = random.min(1.0 - f64::EPSILON);
                }
            }
        }
    }

    /// Probability with which [`EmissiveTree::sample`] draws a leaf for a place.
    pub fn probability(&self, leaf: usize, at: &ReferencePoint) -> f64 {
        let (mut node, mut trail, mut probability) = (0, self.trails[leaf], 1.0);
        if self.nodes.len() == 1 {
            return f64::from(u8::from(self.nodes[0].bounds.importance(at) > 0.0));
        }
        while let Next::Second(second) = self.nodes[node].next {
            let Some(first) = self.share_of_first(node, second as usize, at) else {
                return 0.0;
            };
            if trail & 1 == 0 {
                node += 1;
                probability *= first;
            } else {
                node = second as usize;
                probability *= 1.0 - first;
            }
            trail >>= 1;
        }
        probability
    }

    /// Probability of a node's first child; `None` where neither sends anything.
    fn share_of_first(&self, node: usize, second: usize, at: &ReferencePoint) -> Option<f64> {
        let first = self.nodes[node + 1].bounds.importance(at);
        let both = first + self.nodes[second].bounds.importance(at);
        (both > 0.0).then(|| first / both)
    }
}

/// Brings the surfaces of a node's first child to the front of `order`; how many these are, neither none nor all.
fn split(surfaces: &[Emission], order: &mut [u32], whole: &Emission) -> usize {
    let center = |i: u32| surfaces[i as usize].center();
    let (low, high) = order.iter().fold(
        (DVec3::INFINITY, DVec3::NEG_INFINITY),
        |(low, high): (DVec3, DVec3), &i| (low.min(center(i)), high.max(center(i))),
    );
    let size = whole.high - whole.low;
    let mut best = (f64::INFINITY, 0, 0);
    for axis in 0..3 {
        let span = high[axis] - low[axis];
        if span.is_nan() || span <= 0.0 {
            continue;
        }
        let mut buckets: [Option<Emission>; BUCKETS] = [None; BUCKETS];
        for &i in order.iter() {
            let surface = &surfaces[i as usize];
            let bucket = &mut buckets[bucket_of(center(i)[axis], low[axis], span)];
            *bucket = Some(bucket.map_or(*surface, |sum| sum.union(surface)));
        }
        // Thin nodes are split along their length.
        let regular = size.max_element() / size[axis];
        let join = |sum: &mut Option<Emission>, part: &Option<Emission>| {
            *sum = match (*sum, part) {
                (Some(a), Some(b)) => Some(a.union(b)),
                (a, b) => a.or(*b),
            };
            Some(sum.map_or(0.0, |sum| sum.cost()))
        };
        let below: Vec<f64> = buckets.iter().scan(None, join).collect();
        let mut above: Vec<f64> = buckets.iter().rev().scan(None, join).collect();
        above.reverse();
        for cut in 1..BUCKETS {
            let cost = (below[cut - 1] + above[cut]) * regular;
            if cost < best.0 {
                best = (cost, axis, cut);
            }
        }
    }
    let (cost, axis, cut) = best;
    if cost.is_finite() {
        let span = high[axis] - low[axis];
        let is_first = |&i: &u32| bucket_of(center(i)[axis], low[axis], span) < cut;
        // Stable, so that the tree has one form.
        let (first, second): (Vec<u32>, Vec<u32>) = order.iter().partition(|&i| is_first(i));
        let middle = first.len();
        if middle > 0 && !second.is_empty() {
            order[..middle].copy_from_slice(&first);
            order[middle..].copy_from_slice(&second);
            return middle;
        }
    }
    order.len() / 2
}

fn bucket_of(place: f64, low: f64, span: f64) -> usize {
    (((place - low) / span * BUCKETS as f64) as usize).min(BUCKETS - 1)
}
