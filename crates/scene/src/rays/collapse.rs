//! From a binary hierarchy to eight-wide nodes and four-triangle leaves, at the least expected cost.
//!
//! Ylitie, Karras and Laine (HPG 2017), section 3.1: C(n, i) is the least surface-area cost of representing the subtree
//! of n by at most i eight-wide subtrees. Bottom-up,
//!   C(n, 1) = min(leaf, node + D(n, 8)),  C(n, i) = min(D(n, i), C(n, i − 1)),
//!   D(n, j) = min over 0 < k < j of C(left, k) + C(right, j − k).
//! The choices are then followed from the root. Deviation: a leaf holds at most one block. Linear time, 64 bytes per
//! binary node.

use obvhs::bvh2::Bvh2;

use super::kept::{Bounds, Kept};
use super::layout::{BLOCK_WIDTH, Block, LEAF_BIT, MAX_BUILT_DEPTH, NODE_WIDTH, Node};

/// Cost of testing a block of triangles, relative to a node: an estimate: four triangles take about as many operations as
/// eight boxes, but no ordering of children.
const BLOCK_COST: f32 = 0.6;

/// The least cost of a subtree as at most `i + 1` wide subtrees, and how to get it.
#[derive(Clone, Copy)]
struct Choice {
    bounds: Bounds,
    /// Triangles below, saturating at `BLOCK_WIDTH + 1`.
    triangles: usize,
    cost: [f32; NODE_WIDTH - 1],
    /// Roots given to the left child when `i + 1` are shared out; 0: as good with one root less (or a leaf, for one).
    left_share: [u8; NODE_WIDTH - 1],
    /// The same for the eight children of a node of its own; 0: a leaf.
    left_children: u8,
}

/// Collapses `binary`, whose primitives index `kept`. Node 0 is the root.
pub(super) fn collapse(binary: &Bvh2, kept: &[Kept]) -> (Vec<Node>, Vec<Block>) {
    let choices = choose(binary, kept);
    let mut wide = Wide {
        kept,
        nodes: Vec::new(),
        blocks: Vec::new(),
    };
    // (subtree, parent's slot, depth); the order makes node memory depth-first.
    let mut tasks = vec![(0u32, None, 0usize)];
    while let Some((subtree, parent, depth)) = tasks.pop() {
        let choice = &choices[subtree as usize];
        let node = &binary.nodes[subtree as usize];
        // A root that is a leaf still gets a node, so that traversal starts at a node in any case.
        let as_leaf = choice.left_children == 0 && parent.is_some();
        if node.is_leaf() || choice.left_children == 0 || depth >= MAX_BUILT_DEPTH {
            let mut below = primitives_below(binary, subtree);
            if as_leaf && below.len() <= BLOCK_WIDTH {
                wide.add_leaf(&below, parent);
            } else {
                wide.add_evenly(&mut below, parent);
            }
            continue;
        }
        let index = wide.add_node(parent);
        let mut children = Vec::with_capacity(NODE_WIDTH);
        let left = choice.left_children as usize;
        share_out(binary, &choices, node.first_index, left, &mut children);
        share_out(
            binary,
            &choices,
            node.first_index + 1,
            NODE_WIDTH - left,
            &mut children,
        );
        for (lane, &child) in children.iter().enumerate().rev() {
            wide.set_box(index, lane, choices[child as usize].bounds);
            tasks.push((child, Some((index, lane)), depth + 1));
        }
    }
    (wide.nodes, wide.blocks)
}

/// The dynamic programme, bottom-up.
fn choose(binary: &Bvh2, kept: &[Kept]) -> Vec<Choice> {
    let unset = Choice {
        bounds: Bounds::EMPTY,
        triangles: 0,
        cost: [0.0; NODE_WIDTH - 1],
        left_share: [0; NODE_WIDTH - 1],
        left_children: 0,
    };
    let mut choices = vec![unset; binary.nodes.len()];
    for index in children_first(binary) {
        let node = &binary.nodes[index as usize];
        let mut choice = unset;
        if node.is_leaf() {
            for primitive in leaf_primitives(binary, index) {
                choice.bounds = choice.bounds.union(kept[*primitive as usize].bounds);
            }
            choice.triangles = (node.prim_count as usize).min(BLOCK_WIDTH + 1);
            choice.cost = [choice.bounds.half_area() * BLOCK_COST; NODE_WIDTH - 1];
            choices[index as usize] = choice;
            continue;
        }
        let left = choices[node.first_index as usize];
        let right = choices[node.first_index as usize + 1];
        choice.bounds = left.bounds.union(right.bounds);
        choice.triangles = (left.triangles + right.triangles).min(BLOCK_WIDTH + 1);
        let area = choice.bounds.half_area();
        let distribute = |roots: usize| {
            let mut best = (f32::INFINITY, 1);
            for k in 1..roots {
                // More than seven roots on one side are never needed: a single child takes at most seven.
                let cost = left.cost[k - 1] + right.cost[roots - k - 1];
                if cost < best.0 {
                    best = (cost, k as u8);
                }
            }
            best
        };
        let (children, left_children) = distribute(NODE_WIDTH);
        choice.cost[0] = children + area;
        choice.left_children = left_children;
        if choice.triangles <= BLOCK_WIDTH && area * BLOCK_COST <= choice.cost[0] {
            choice.cost[0] = area * BLOCK_COST;
            choice.left_children = 0;
        }
        for roots in 2..NODE_WIDTH {
            let (cost, share) = distribute(roots);
            let fewer = choice.cost[roots - 2];
            (choice.cost[roots - 1], choice.left_share[roots - 1]) =
                if cost < fewer { (cost, share) } else { (fewer, 0) };
        }
        choices[index as usize] = choice;
    }
    choices
}

/// The subtrees that represent `subtree` with at most `roots` roots. Recursion ends after seven levels.
fn share_out(binary: &Bvh2, choices: &[Choice], subtree: u32, roots: usize, out: &mut Vec<u32>) {
    let choice = &choices[subtree as usize];
    let mut roots = roots;
    while roots > 1 && choice.left_share[roots - 1] == 0 {
        roots -= 1;
    }
    if roots == 1 {
        out.push(subtree);
        return;
    }
    let left = choice.left_share[roots - 1] as usize;
    let first = binary.nodes[subtree as usize].first_index;
    share_out(binary, choices, first, left, out);
    share_out(binary, choices, first + 1, roots - left, out);
}

/// All nodes, each after its children.
fn children_first(binary: &Bvh2) -> Vec<u32> {
    let mut order = Vec::with_capacity(binary.nodes.len());
    let mut open = vec![0u32];
    while let Some(index) = open.pop() {
        order.push(index);
        let node = &binary.nodes[index as usize];
        if !node.is_leaf() {
            open.extend([node.first_index, node.first_index + 1]);
        }
    }
    order.reverse();
    order
}

/// The primitives of a leaf, as indices into the kept triangles.
fn leaf_primitives(binary: &Bvh2, leaf: u32) -> &[u32] {
    let node = &binary.nodes[leaf as usize];
    &binary.primitive_indices[node.first_index as usize..][..node.prim_count as usize]
}

/// All primitives of a subtree.
fn primitives_below(binary: &Bvh2, subtree: u32) -> Vec<u32> {
    let mut below = Vec::new();
    let mut open = vec![subtree];
    while let Some(index) = open.pop() {
        let node = &binary.nodes[index as usize];
        if node.is_leaf() {
            below.extend_from_slice(leaf_primitives(binary, index));
        } else {
            open.extend([node.first_index + 1, node.first_index]);
        }
    }
    below
}

/// The wide tree as it grows.
struct Wide<'a> {
    kept: &'a [Kept],
    nodes: Vec<Node>,
    blocks: Vec<Block>,
}

/// A child slot: node and lane.
type Slot = Option<(usize, usize)>;

impl Wide<'_> {
    fn link(&mut self, parent: Slot, child: u32) {
        if let Some((node, lane)) = parent {
            self.nodes[node].children[lane] = child;
        }
    }

    fn set_box(&mut self, node: usize, lane: usize, bounds: Bounds) {
        for axis in 0..3 {
            self.nodes[node].planes[2 * axis][lane] = bounds.low[axis];
            self.nodes[node].planes[2 * axis + 1][lane] = bounds.high[axis];
        }
    }

    fn add_node(&mut self, parent: Slot) -> usize {
        let index = self.nodes.len();
        self.link(parent, index as u32);
        self.nodes.push(Node::empty());
        index
    }

    /// A leaf of at most one block. The triangles stand in the order of the input.
    fn add_leaf(&mut self, primitives: &[u32], parent: Slot) {
        self.link(parent, LEAF_BIT | self.blocks.len() as u32);
        let mut block = Block::empty();
        let mut primitives = primitives.to_vec();
        primitives.sort_unstable();
        for (lane, &primitive) in primitives.iter().enumerate() {
            let kept = &self.kept[primitive as usize];
            block.triangles[lane] = kept.triangle;
            for (vertex, position) in kept.vertices.iter().enumerate() {
                for axis in 0..3 {
                    block.vertices[vertex][axis][lane] = position[axis];
                }
            }
        }
        self.blocks.push(block);
    }

    /// A node over `primitives`, shared out evenly by their order: the depth is logarithmic whatever the input.
    fn add_evenly(&mut self, primitives: &mut [u32], parent: Slot) {
        let index = self.add_node(parent);
        let share = primitives.len().div_ceil(NODE_WIDTH).max(BLOCK_WIDTH);
        for (lane, part) in primitives.chunks_mut(share).enumerate() {
            let bounds = part
                .iter()
                .fold(Bounds::EMPTY, |all, &p| all.union(self.kept[p as usize].bounds));
            self.set_box(index, lane, bounds);
            let slot = Some((index, lane));
            if part.len() <= BLOCK_WIDTH {
                self.add_leaf(part, slot)
            } else {
                self.add_evenly(part, slot)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use obvhs::aabb::Aabb;
    use obvhs::bvh2::node::Bvh2Node;

    use super::super::layout::{NO_TRIANGLE, STACK_SIZE};
    use super::*;

    /// A chain, the worst hierarchy there is: every inner node has a leaf and the rest of the chain as children.
    fn chain(length: u32) -> (Bvh2, Vec<Kept>) {
        let kept: Vec<Kept> = (0..length)
            .map(|triangle| {
                let low = Vec3::splat(1.0 / (1.0 + triangle as f32));
                let vertices = [low, low + Vec3::X, low + Vec3::Y];
                Kept {
                    triangle,
                    vertices,
                    bounds: Bounds {
                        low,
                        high: low + Vec3::ONE,
                    },
                }
            })
            .collect();
        let mut nodes = vec![];
        for triangle in 0..length - 1 {
            // The rest of the chain comes as the second child; node 0 is the root.
            nodes.push(Bvh2Node::new(Aabb::default(), 0, 2 * triangle + 1));
            nodes.push(Bvh2Node::new(Aabb::default(), 1, triangle));
        }
        nodes.push(Bvh2Node::new(Aabb::default(), 1, length - 1));
        (
            Bvh2 {
                nodes,
                primitive_indices: (0..length).collect(),
                ..Bvh2::default()
            },
            kept,
        )
    }

    /// Each triangle stands in one leaf, in the boxes above it, and no path overflows the traversal's stack.
    #[test]
    fn a_chain_of_any_length_becomes_a_tree_that_fits_the_stack() {
        for length in [2, 9, 100, 1000, 20_000] {
            let (binary, kept) = chain(length);
            let (nodes, blocks) = collapse(&binary, &kept);
            let mut seen = vec![0; length as usize];
            let everything = Bounds {
                low: Vec3::NEG_INFINITY,
                high: Vec3::INFINITY,
            };
            let mut open = vec![(0u32, everything, 0)];
            let mut deepest = 0;
            while let Some((child, bounds, depth)) = open.pop() {
                if child & LEAF_BIT != 0 {
                    for triangle in blocks[(child & !LEAF_BIT) as usize].triangles {
                        if triangle != NO_TRIANGLE {
                            seen[triangle as usize] += 1;
                            assert_eq!(bounds.union(kept[triangle as usize].bounds), bounds);
                        }
                    }
                    continue;
                }
                deepest = deepest.max(depth + 1);
                let node = &nodes[child as usize];
                for lane in 0..NODE_WIDTH {
                    let plane = |index: usize| node.planes[index][lane];
                    let low = Vec3::new(plane(0), plane(2), plane(4));
                    let high = Vec3::new(plane(1), plane(3), plane(5));
                    if low.x <= high.x {
                        let inner = Bounds { low, high };
                        assert_eq!(bounds.union(inner), bounds, "a child's box sticks out");
                        open.push((node.children[lane], inner, depth + 1));
                    }
                }
            }
            assert!(seen.iter().all(|&count| count == 1));
            assert!((NODE_WIDTH - 1) * deepest < STACK_SIZE, "{deepest} levels");
            assert!(
                length < 1000 || deepest > MAX_BUILT_DEPTH,
                "the chain is too short to prove anything"
            );
        }
    }
}
