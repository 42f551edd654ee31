//! How nodes of a light tree look from a place.

use glam::Vec3;
use relight_transport::light_tree::Node;

/// A node as a fragment sees it.
#[derive(Clone, Copy, Debug, Default)]
pub struct NodeView {
    /// Unit direction to its middle.
    pub direction: Vec3,
    /// Length of the mean of the directions to its leaves: by so much the mean of their cosines is smaller than the
    /// cosine of their mean.
    pub length: f32,
    /// Angular radius around `direction`, radians.
    pub radius: f32,
}

/// By [`Node::slot`] the largest `distance(slot, leaf)` of a node's leaves, and the radius `leaf` of those.
pub(super) fn radii(leaves: &[Vec3], leaf: f32, distance: impl Fn(usize, Vec3) -> f32) -> Vec<f32> {
    let n = leaves.len();
    let height = n.trailing_zeros() as u8;
    let mut radii = vec![leaf; 2 * n];
    for (h, start) in (1..=height).map(|h| (h, 1usize << (height - h))) {
        for slot in start..2 * start {
            let index = (slot - start) as u32;
            let node = Node { height: h, index };
            let below = &leaves[node.first() as usize..node.end() as usize];
            radii[slot] = below.iter().map(|&d| distance(slot, d)).fold(0.0, f32::max) + leaf;
        }
    }
    radii
}
