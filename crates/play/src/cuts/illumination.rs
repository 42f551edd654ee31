//! What each node of the light tree sends, and the cut through it for a frame.
//!
//! Source: Cheslack-Postava et al. 2008, section 3.2: first every node's error is brought under a threshold, then the
//! brightest nodes are split until the cut has its largest size.
//!
//! Deviations: shading reads light from the tree at the merged node, not from the cut's own, coarser node: the look-up is
//! the same, and where visibility made the nodes small, light is as fine. The cut only says where light wants small
//! nodes. And the light of a node comes from the mean of its leaves' directions weighted by what they send, not from its
//! middle: a lamp in a corner of a node lights from there.

use super::lights::{CutLights, Directions};
use super::node_view::NodeView;
use super::uneven::UnevenCells;
use crate::frame::settings::ILLUMINATION_ERROR;
use glam::{Vec3, Vec4};
use relight_scene::environment::luminance;
use relight_transport::cuts::Cut;
use relight_transport::light_tree::{Node, sums};
use relight_transport::ranked::Ranked;
use std::collections::BinaryHeap;

/// How far below the root the coarsest nodes of an illumination cut lie: at 1/32 of the sphere, a cone of 20° around
/// their middle.
const COARSEST: u8 = 5;

/// Light in the nodes of a tree, and a cut through it.
pub struct Illumination {
    /// Flux on a perpendicular surface from each node, RGB, W/m², by [`Node::slot`]: where its cuts hold more than
    /// visibility, without that.
    pub flux: Vec<Vec3>,
    /// Where the light of directions' nodes comes from, by [`Node::slot`]; empty for surface samples.
    pub views: Vec<NodeView>,
    /// Heights of the cut's nodes from left to right.
    pub heights: Vec<u8>,
    /// As many zeros: merging wants values.
    zeros: Vec<f32>,
    /// Cells of directions across which the light is uneven, if any are to be asked part by part.
    pub uneven: UnevenCells,
}

impl Illumination {
    /// Its cut for merging, with values that mean nothing.
    pub fn as_cut(&self) -> Cut<'_> {
        Cut {
            heights: &self.heights,
            values: &self.zeros,
        }
    }

    /// Light of directions from the flux of all `parts` of their cells ([`super::cells::Cells::parts`]), with the cells across which it is uneven.
    pub fn of_parts(directions: &Directions, parts: &[Vec3], most: usize) -> Illumination {
        let flux = directions.cells.flux(parts);
        Illumination {
            uneven: UnevenCells::new(directions, parts, &flux),
            ..Illumination::of_directions(directions, &flux, most)
        }
    }

    /// Light of directions from the flux of each.
    pub fn of_directions(directions: &Directions, flux: &[Vec3], most: usize) -> Illumination {
        Illumination::chosen(flux, lit_views(directions, flux), most)
    }

    /// Light of surface samples from the flux of each ([`super::lights::SurfaceSamples::flux`]).
    pub fn of_samples(flux: &[Vec3], most: usize) -> Illumination {
        Illumination::chosen(flux, Vec::new(), most)
    }

    /// Where the light of the node in `slot` comes from, as it is seen from a place.
    #[inline]
    pub fn view(&self, lights: &CutLights, slot: usize, from: Vec3) -> NodeView {
        match lights {
            CutLights::Directions(_) => self.views[slot],
            CutLights::Surface(samples) => samples.tree.view(slot, from),
        }
    }

    /// Sums up the flux of the leaves (a power of two of them) and chooses a cut of at most `most` nodes (more only where the coarsest allowed
    /// nodes are more).
    fn chosen(leaves: &[Vec3], views: Vec<NodeView>, most: usize) -> Illumination {
        let height = leaves.len().trailing_zeros() as u8;
        let flux = sums(leaves);
        let bright: Vec<f64> = leaves.iter().map(|&f| f64::from(luminance(f))).collect();
        let squares = sums(&bright.iter().map(|b| b * b).collect::<Vec<f64>>());
        let bright = sums(&bright);
        let limit = (ILLUMINATION_ERROR * bright[1]).powi(2);
        let error = |node: Node| {
            let slot = node.slot(height);
            (squares[slot] - bright[slot] * bright[slot] / f64::from(node.len())).max(0.0)
        };
        let intensity = |node: Node| bright[node.slot(height)];

        let coarsest = height.saturating_sub(COARSEST);
        let nodes = (0..1u32 << (height - coarsest))
            .map(|index| Node {
                height: coarsest,
                index,
            })
            .collect();
        let within = |node: Node| (error(node) > limit).then(|| error(node));
        let nodes = refined(nodes, most, within);
        let lit = |node: Node| (intensity(node) > 0.0).then(|| intensity(node));
        let mut nodes = refined(nodes, most, lit);
        nodes.sort_unstable_by_key(|node| node.first());
        Illumination {
            flux,
            views,
            heights: nodes.iter().map(|node| node.height).collect(),
            zeros: vec![0.0; nodes.len()],
            uneven: UnevenCells::default(),
        }
    }
}

/// Views of directions' nodes with their light, instead of their leaves, in the mean: what is matt and sees all of a node
/// then reflects just what its leaves send.
fn lit_views(directions: &Directions, flux: &[Vec3]) -> Vec<NodeView> {
    let even = &directions.tree.views;
    let weighted = |(flux, leaf): (&Vec3, &NodeView)| {
        let weight = luminance(*flux);
        (leaf.direction * weight).extend(weight)
    };
    let sums = sums(
        &flux
            .iter()
            .zip(&even[flux.len()..])
            .map(weighted)
            .collect::<Vec<Vec4>>(),
    );
    (sums.iter().zip(even))
        .map(|(sum, even)| {
            let mean = sum.truncate() / sum.w;
            let length = mean.length();
            if !(length > 0.0 && length.is_finite()) {
                return *even;
            }
            NodeView {
                direction: mean / length,
                length,
                // A bound around the middle is near enough for where light is split: wider or narrower ones were no better.
                radius: even.radius,
            }
        })
        .collect()
}

/// Splits the node of largest `key` until there are `most`, or none has a key.
fn refined(nodes: Vec<Node>, most: usize, key: impl Fn(Node) -> Option<f64>) -> Vec<Node> {
    let mut done = Vec::new();
    let mut open = BinaryHeap::new();
    let offer = |node: Node, open: &mut BinaryHeap<Ranked<Node>>, done: &mut Vec<Node>| match key(node) {
        Some(rank) if node.height > 0 => open.push(Ranked {
            rank,
            place: node.first(),
            node,
        }),
        _ => done.push(node),
    };
    for node in nodes {
        offer(node, &mut open, &mut done);
    }
    while done.len() + open.len() < most {
        let Some(Ranked { node, .. }) = open.pop() else {
            break;
        };
        for child in node.children().into_iter().flatten() {
            offer(child, &mut open, &mut done);
        }
    }
    done.extend(open.into_iter().map(|o| o.node));
    done
}
