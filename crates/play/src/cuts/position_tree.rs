//! Surface samples as the leaves of a light tree: where its nodes are, seen from a fragment.

use super::node_view::{NodeView, radii};
use glam::{DVec3, Vec3};
use relight_transport::light_tree::sums;
use std::f32::consts::{FRAC_1_PI, FRAC_PI_2};

/// A complete tree of places; arrays over nodes by [`relight_transport::light_tree::Node::slot`].
pub struct PositionTree {
    /// Height of the root.
    pub height: u8,
    /// Middle of each node, world space.
    pub middles: Vec<Vec3>,
    /// Mean squared distance of each node's leaves from its middle, m²; 0 for leaves.
    pub spreads: Vec<f32>,
    /// Radius of each node around its middle, metres: its leaves and their discs lie within.
    pub radii: Vec<f32>,
}

impl PositionTree {
    /// The tree over places (a power of two of them) that each stand for `area` (m²).
    pub fn new(leaves: &[Vec3], area: f32) -> PositionTree {
        let n = leaves.len();
        let count = |slot: usize| n as f64 / f64::from(slot.max(1).ilog2()).exp2();
        // In f64: squared distances are small differences of large numbers.
        let exact: Vec<DVec3> = leaves.iter().map(|p| p.as_dvec3()).collect();
        let squares = sums(&exact.iter().map(|p| p.length_squared()).collect::<Vec<f64>>());
        let exact = sums(&exact);
        let middle = |slot: usize| exact[slot] / count(slot);
        let middles: Vec<Vec3> = (0..2 * n).map(|slot| middle(slot).as_vec3()).collect();
        let spreads = (0..2 * n)
            .map(|slot| {
                if slot >= n {
                    return 0.0;
                }
                (squares[slot] / count(slot) - middle(slot).length_squared()).max(0.0) as f32
            })
            .collect();
        let radii = radii(leaves, (area * FRAC_1_PI).sqrt(), |slot, p| {
            middles[slot].distance(p)
        });
        PositionTree {
            height: n.trailing_zeros() as u8,
            middles,
            spreads,
            radii,
        }
    }

    /// A node from a place.
    #[inline]
    pub fn view(&self, slot: usize, from: Vec3) -> NodeView {
        view(self.middles[slot], self.spreads[slot], self.radii[slot], from)
    }
}

/// A node of the given middle, spread and radius (see [`PositionTree`]) from a place. Where it surrounds the place, its
/// radius is all that a hemisphere can be: π/2.
#[inline(always)]
pub fn view(middle: Vec3, spread: f32, radius: f32, from: Vec3) -> NodeView {
    let to = middle - from;
    let d2 = to.length_squared().max(f32::MIN_POSITIVE);
    let inverse = d2.sqrt().recip();
    NodeView {
        direction: to * inverse,
        // Leaves scattered by s across the line of sight: the mean of their directions is 1 − s²/(2d²) long, and 1
        // where they are far.
        length: (1.0 + spread / d2).sqrt().recip(),
        radius: (radius * inverse).min(FRAC_PI_2),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use relight_transport::random::Stream;

    /// Truth: sums over the leaves in f64.
    #[test]
    fn nodes_are_where_their_leaves_are() {
        let mut s = Stream::new(7, 0, 0);
        let leaves: Vec<Vec3> = (0..256)
            .map(|_| 100.0 + Vec3::new(s.uniform(), s.uniform(), 0.0))
            .collect();
        let tree = PositionTree::new(&leaves, 0.01);
        let from = Vec3::new(100.2, 100.1, 104.0);
        let root = tree.view(1, from);
        let directions = leaves.iter().map(|p| (*p - from).as_dvec3().normalize());
        let mean = directions.sum::<DVec3>() / 256.0;
        assert!(mean.normalize().distance(root.direction.as_dvec3()) < 0.01);
        assert!((mean.length() - f64::from(root.length)).abs() < 2e-3);
        let far = leaves
            .iter()
            .map(|p| p.distance(tree.middles[1]))
            .fold(0.0, f32::max);
        assert!((tree.radii[1] - far - (0.01 * FRAC_1_PI).sqrt()).abs() < 1e-4);
        // A leaf is where it is, and a place upon it sees it everywhere.
        let leaf = tree.view(256 + 9, leaves[9]);
        assert_eq!((leaf.length, leaf.radius), (1.0, FRAC_PI_2));
        assert!(leaf.direction.is_finite());
    }
}
