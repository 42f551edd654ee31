//! Light from many even directions through visibility cuts (Cheslack-Postava et al. 2008).
//!
//! Per frame an [`illumination`] cut is chosen; [`shade`] merges it with the cuts of each fragment's [`sites`] and
//! multiplies with the BRDF on the way.

pub mod illumination;
pub mod shade;
pub mod sites;
#[cfg(test)]
mod tests;

use glam::Vec3;
use relight_transport::cuts::SiteCuts;
use relight_transport::light_tree::{Node, sums};

/// Visibility of an environment, as the asset has it.
pub struct VisibilityCuts {
    /// The cut of each finest point.
    pub cuts: SiteCuts,
    /// The tree.
    pub tree: DirectionTree,
    /// Which leaf each part of the sphere belongs to.
    pub cells: illumination::Cells,
}

impl VisibilityCuts {
    /// Cuts through the tree whose leaves look into `directions` (unit; a power of two of them).
    pub fn new(cuts: SiteCuts, directions: Vec<Vec3>) -> VisibilityCuts {
        let cells = illumination::Cells::new(&directions);
        VisibilityCuts {
            cuts,
            tree: DirectionTree::new(&directions),
            cells,
        }
    }
}

/// A complete tree of directions; arrays over nodes by [`Node::slot`].
pub struct DirectionTree {
    /// Height of the root.
    pub height: u8,
    /// Unit mean direction of each node.
    pub directions: Vec<Vec3>,
    /// Length of the mean of the node's directions: a cosine with the mean is the mean of its leaves' cosines.
    pub lengths: Vec<f32>,
    /// Angular radius of each node around it, radians: its leaves and their cells lie within.
    pub radii: Vec<f32>,
}

impl DirectionTree {
    fn new(leaves: &[Vec3]) -> DirectionTree {
        let n = leaves.len();
        let height = n.trailing_zeros() as u8;
        let all = sums(leaves);
        let directions: Vec<Vec3> = all.iter().map(|d| d.normalize_or(Vec3::Y)).collect();
        let lengths = (0..all.len())
            .map(|slot| all[slot].length() * (slot.max(1).ilog2() as f32).exp2() / n as f32)
            .collect();
        // A leaf is a disc of 4π/n steradians.
        let leaf = 2.0 / (n as f32).sqrt();
        let mut radii = vec![leaf; 2 * n];
        for (h, start) in (1..=height).map(|h| (h, 1usize << (height - h))) {
            for slot in start..2 * start {
                let index = (slot - start) as u32;
                let node = Node { height: h, index };
                let below = &leaves[node.first() as usize..node.end() as usize];
                // atan2 of the chord, because the arc cosine of f32 loses small angles.
                let angle = |d: &Vec3| {
                    directions[slot]
                        .cross(*d)
                        .length()
                        .atan2(directions[slot].dot(*d))
                };
                radii[slot] = below.iter().map(angle).fold(0.0, f32::max) + leaf;
            }
        }
        DirectionTree {
            height,
            directions,
            lengths,
            radii,
        }
    }

    /// Number of leaves.
    pub fn leaves(&self) -> usize {
        1 << self.height
    }
}
