//! Cuts of a pixel tree for one light.

use super::build::{PixelNode, PixelTree};
use crate::point_light::{Emission, PointLight};
use crate::random::Stream;
use crate::ranked::Ranked;
use glam::{Mat3, Vec3};
use std::collections::BinaryHeap;

/// How a cut is chosen.
#[derive(Clone, Copy, Debug)]
pub struct CutLimits {
    /// Nodes of the random cut, the paper's k.
    pub clusters: u32,
    /// Nodes are refined where the light varies by more than this share of the mean incident light.
    pub threshold: f32,
    /// Most nodes after refinement.
    pub most: u32,
}

/// A light as cuts see it: in a tree's space, its intensity relative to the mean incident light.
#[derive(Clone, Copy, Debug)]
pub struct CutLight {
    emission: Emission,
    position: Vec3,
    /// Two directions at right angles to the axis, and the axis.
    frame: Mat3,
    strength: f32,
}

impl CutLight {
    /// `strength` is the light's intensity over the mean incident light, m² (1 for directional lights).
    pub fn new(light: &PointLight, rotation: Mat3, strength: f32) -> CutLight {
        let axis = if light.emission == Emission::Omni {
            Vec3::Z
        } else {
            rotation * light.axis
        };
        let (u, v) = axis.any_orthonormal_pair();
        CutLight {
            emission: light.emission,
            position: rotation * light.position,
            frame: Mat3::from_cols(u, v, axis),
            strength,
        }
    }

    /// How much the unoccluded light may vary among the positions of a node, relative to the mean incident light: 0..1.
    pub fn variation(&self, node: &PixelNode) -> f32 {
        if self.emission == Emission::Directional {
            return 0.0;
        }
        let center = 0.5 * (node.low + node.high) - self.position;
        let half = 0.5 * (node.high - node.low);
        let near = (center.abs() - half).max(Vec3::ZERO).length_squared();
        let far = (center.abs() + half).length_squared();
        let (most, least) = match self.emission {
            Emission::Omni => (1.0, 1.0),
            _ => {
                let (least, most) = self.cosines(center, half);
                let most = self.emission.towards(most);
                match self.emission {
                    // Only its most is known.
                    Emission::Measured { .. } => (most, 0.0),
                    _ => (most, self.emission.towards(least)),
                }
            }
        };
        // Where nothing is sent, nothing is sent however near.
        let reaching = |share: f32, squared: f32| {
            if share > 0.0 && self.strength > 0.0 {
                (self.strength * share / squared).min(1.0)
            } else {
                0.0
            }
        };
        reaching(most, near) - reaching(least, far)
    }

    /// Smallest and largest cosine with the axis in a box around `center`, seen from the light: Walter et al. 2005,
    /// equation 4, for the box around the box along the light's own axes.
    pub(super) fn cosines(&self, center: Vec3, half: Vec3) -> (f32, f32) {
        let along = |axis: Vec3| (axis.dot(center), axis.abs().dot(half));
        let (x, y, z) = (
            along(self.frame.x_axis),
            along(self.frame.y_axis),
            along(self.frame.z_axis),
        );
        let least = |(c, h): (f32, f32)| (c.abs() - h).max(0.0).powi(2);
        let most = |(c, h): (f32, f32)| (c.abs() + h).powi(2);
        let (beside_least, beside_most) = (least(x) + least(y), most(x) + most(y));
        let cosine = |z: f32, beside: f32| {
            let length = (beside + z * z).sqrt();
            if length > 0.0 { z / length } else { z.signum() }
        };
        let (low, high) = (z.0 - z.1, z.0 + z.1);
        let lowest = cosine(low, if low >= 0.0 { beside_most } else { beside_least });
        let highest = cosine(high, if high >= 0.0 { beside_least } else { beside_most });
        (lowest, highest)
    }
}

/// Puts a cut for `light` into `cut`: nodes of the tree in order, every pixel below exactly one of them.
pub fn choose_cut(
    tree: &PixelTree,
    light: &CutLight,
    limits: &CutLimits,
    stream: &mut Stream,
    cut: &mut Vec<u32>,
) {
    cut.clear();
    if tree.nodes.is_empty() {
        return;
    }
    random_cut(tree, limits.clusters.max(1), stream, cut);
    if light.emission != Emission::Directional {
        let random = std::mem::take(cut);
        if !refined(tree, light, limits, &random, cut) {
            refined_by_heap(tree, light, limits, &random, cut);
        }
    }
}

fn random_cut(tree: &PixelTree, clusters: u32, stream: &mut Stream, cut: &mut Vec<u32>) {
    let mut open = vec![(0u32, clusters.min(tree.nodes[0].leaves()) - 1)];
    while let Some((at, picks)) = open.pop() {
        if picks == 0 {
            cut.push(at);
            continue;
        }
        let node = &tree.nodes[at as usize];
        let (left, right) = (at + 1, at + node.skip);
        let [l, r] = [left, right].map(|child| &tree.nodes[child as usize]);
        let picks = picks - 1;
        let share = f64::from(l.end - l.first) / f64::from(node.end - node.first);
        let wanted = (f64::from(picks) * share + f64::from(stream.uniform())) as u32;
        // As many picks as would leave every leaf by itself are all that a child has use for.
        let (room_left, room_right) = (l.leaves() - 1, r.leaves() - 1);
        let to_left = wanted.clamp(picks.saturating_sub(room_right), picks.min(room_left));
        open.push((right, picks - to_left));
        open.push((left, to_left));
    }
}

/// Refines all that varies too much, in order. False where that would be more than the limit.
fn refined(
    tree: &PixelTree,
    light: &CutLight,
    limits: &CutLimits,
    random: &[u32],
    cut: &mut Vec<u32>,
) -> bool {
    let mut open = Vec::new();
    for &root in random {
        open.push(root);
        while let Some(at) = open.pop() {
            let node = &tree.nodes[at as usize];
            if node.skip > 0 && light.variation(node) > limits.threshold {
                open.push(at + node.skip);
                open.push(at + 1);
            } else {
                cut.push(at);
                if cut.len() > limits.most.max(limits.clusters) as usize {
                    return false;
                }
            }
        }
    }
    true
}

/// Refines what varies most, until the limit.
fn refined_by_heap(
    tree: &PixelTree,
    light: &CutLight,
    limits: &CutLimits,
    random: &[u32],
    cut: &mut Vec<u32>,
) {
    cut.clear();
    let mut heap = BinaryHeap::new();
    let enter = |heap: &mut BinaryHeap<Ranked<()>>, cut: &mut Vec<u32>, at: u32| {
        let node = &tree.nodes[at as usize];
        let variation = light.variation(node);
        if node.skip > 0 && variation > limits.threshold {
            heap.push(Ranked {
                rank: variation.into(),
                place: at,
                node: (),
            });
        } else {
            cut.push(at);
        }
    };
    for &at in random {
        enter(&mut heap, cut, at);
    }
    let most = limits.most.max(limits.clusters) as usize;
    while cut.len() + heap.len() < most {
        let Some(Ranked { place: at, .. }) = heap.pop() else {
            break;
        };
        enter(&mut heap, cut, at + 1);
        enter(&mut heap, cut, at + tree.nodes[at as usize].skip);
    }
    cut.extend(heap.into_iter().map(|candidate| candidate.place));
    cut.sort_unstable();
}
