//! What each node of the light tree sends, and the cut through it for a frame.
//!
//! Source: Cheslack-Postava et al. 2008, section 3.2: first every node's error is brought under a threshold, then the
//! brightest nodes are split until the cut has its largest size.
//!
//! Deviation: shading reads light from the tree at the merged node, not from the cut's own, coarser node: the look-up is
//! the same, and where visibility made the nodes small, light is as fine. The cut only says where light wants small
//! nodes.

use glam::{DVec3, Vec3};
use rayon::prelude::*;
use relight_scene::environment::{direction_from_uv, luminance};
use relight_transport::cuts::Cut;
use relight_transport::grid::PointGrid;
use relight_transport::light_tree::{Node, sums};
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// Error of one node, as a share of the frame's light, that refinement by error goes on for: √(|C|·var L). Together with
/// visibility cuts of σ = 2 a node's product is then off by at most a thousandth of all light (equation 8).
const ERROR: f64 = 5e-4;

/// How far below the root the coarsest nodes of an illumination cut lie: at 1/32 of the sphere, a cone of 20° around
/// their middle.
const COARSEST: u8 = 5;

/// Which direction each small part of the sphere is nearest to: columns of longitude, rows of latitude.
pub struct Cells {
    width: usize,
    height: usize,
    leaf: Vec<u32>,
}

/// Parts of the table for each direction, at least: light that changes within a direction's cell is averaged over them.
const PARTS: usize = 16;

impl Cells {
    /// Finds the nearest of `directions` (unit) for every part.
    pub fn new(directions: &[Vec3]) -> Cells {
        let height = ((PARTS * directions.len()) as f64 / 2.0).sqrt().ceil() as usize;
        let width = 2 * height;
        // Cells of even directions reach at most some 1.3 times the radius of a disc of their size.
        let reach = 3.0 / (directions.len() as f32).sqrt();
        let grid = PointGrid::new(directions, directions, reach);
        let leaf = (0..width * height)
            .into_par_iter()
            .with_min_len(1024)
            .map(|i| {
                let d = part_direction(i, width, height);
                let mut best = (f32::NEG_INFINITY, u32::MAX);
                grid.near(d, |entry| {
                    let near = entry.position.dot(d);
                    if near > best.0 || (near == best.0 && entry.index < best.1) {
                        best = (near, entry.index);
                    }
                });
                best.1
            })
            .collect();
        Cells { width, height, leaf }
    }

    /// Flux on a perpendicular surface (W/m²) that comes from the cell of each of `leaves` directions, when
    /// `radiance(direction)` comes from everywhere.
    pub fn flux(&self, leaves: usize, radiance: impl Fn(Vec3) -> Vec3 + Sync) -> Vec<Vec3> {
        let rows: Vec<Vec<Vec3>> = (0..self.height)
            .into_par_iter()
            .map(|y| {
                let angle = part_angle(y, self.width, self.height);
                (0..self.width)
                    .map(|x| {
                        let direction = part_direction(y * self.width + x, self.width, self.height);
                        radiance(direction) * angle
                    })
                    .collect()
            })
            .collect();
        let mut flux = vec![DVec3::ZERO; leaves];
        for (&leaf, part) in self.leaf.iter().zip(rows.iter().flatten()) {
            if let Some(sum) = flux.get_mut(leaf as usize) {
                *sum += part.as_dvec3();
            }
        }
        flux.into_iter().map(|f| f.as_vec3()).collect()
    }
}

fn part_direction(i: usize, width: usize, height: usize) -> Vec3 {
    let (x, y) = (i % width, i / width);
    direction_from_uv([(x as f32 + 0.5) / width as f32, (y as f32 + 0.5) / height as f32])
}

/// Solid angle of a part in row `y`.
fn part_angle(y: usize, width: usize, height: usize) -> f32 {
    let polar = |y: usize| (std::f64::consts::PI * y as f64 / height as f64).cos();
    (2.0 * std::f64::consts::PI / width as f64 * (polar(y) - polar(y + 1))) as f32
}

/// Light in the nodes of a tree, and a cut through it.
pub struct Illumination {
    /// Flux on a perpendicular surface from each node, RGB, W/m², by [`Node::slot`]: where its cuts hold more than
    /// visibility, without that.
    pub flux: Vec<Vec3>,
    /// Heights of the cut's nodes from left to right.
    pub heights: Vec<u8>,
    /// As many zeros: merging wants values.
    zeros: Vec<f32>,
}

impl Illumination {
    /// Its cut for merging, with values that mean nothing.
    pub fn as_cut(&self) -> Cut<'_> {
        Cut {
            heights: &self.heights,
            values: &self.zeros,
        }
    }

    /// Sums up the flux of the leaves (a power of two of them) and chooses a cut of at most `most` nodes (more only where the coarsest allowed
    /// nodes are more).
    pub fn new(leaves: &[Vec3], most: usize) -> Illumination {
        let height = leaves.len().trailing_zeros() as u8;
        let flux = sums(leaves);
        let bright: Vec<f64> = leaves.iter().map(|&f| f64::from(luminance(f))).collect();
        let squares = sums(&bright.iter().map(|b| b * b).collect::<Vec<f64>>());
        let bright = sums(&bright);
        let limit = (ERROR * bright[1]).powi(2);
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
            heights: nodes.iter().map(|node| node.height).collect(),
            zeros: vec![0.0; nodes.len()],
        }
    }
}

/// A node by what it is to be split for.
struct Open {
    key: f64,
    node: Node,
}

impl PartialEq for Open {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Open {}

impl PartialOrd for Open {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Open {
    fn cmp(&self, other: &Self) -> Ordering {
        (self.key.total_cmp(&other.key)).then_with(|| other.node.first().cmp(&self.node.first()))
    }
}

/// Splits the node of largest `key` until there are `most`, or none has a key.
fn refined(nodes: Vec<Node>, most: usize, key: impl Fn(Node) -> Option<f64>) -> Vec<Node> {
    let mut done = Vec::new();
    let mut open = BinaryHeap::new();
    let offer = |node: Node, open: &mut BinaryHeap<Open>, done: &mut Vec<Node>| match key(node) {
        Some(key) if node.height > 0 => open.push(Open { key, node }),
        _ => done.push(node),
    };
    for node in nodes {
        offer(node, &mut open, &mut done);
    }
    while done.len() + open.len() < most {
        let Some(Open { node, .. }) = open.pop() else {
            break;
        };
        for child in node.children().into_iter().flatten() {
            offer(child, &mut open, &mut done);
        }
    }
    done.extend(open.into_iter().map(|o| o.node));
    done
}
