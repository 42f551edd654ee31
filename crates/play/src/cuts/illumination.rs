//! What each node of the light tree sends, and the cut through it for a frame.
//!
//! Source: Cheslack-Postava et al. 2008, section 3.2: first every node's error is brought under a threshold, then the
//! brightest nodes are split until the cut has its largest size.
//!
//! Deviations: shading reads light from the tree at the merged node, not from the cut's own, coarser node: the look-up is
//! the same, and where visibility made the nodes small, light is as fine. The cut only says where light wants small
//! nodes. And the light of a node comes from the mean of its leaves' directions weighted by what they send, not from its
//! middle: a lamp in a corner of a node lights from there.

use super::uneven::UnevenCells;
use super::{Directions, Lights, NodeView};
use glam::{DVec3, Vec3, Vec4};
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
    /// Parts in order of their directions, and where each direction's start; one more than there are directions.
    parts: Vec<u32>,
    starts: Vec<u32>,
    /// Solid angle of a part in each row.
    angles: Vec<f32>,
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
        let leaf: Vec<u32> = (0..width * height)
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
        let mut starts = vec![0u32; directions.len() + 1];
        for &leaf in &leaf {
            starts[leaf as usize + 1] += 1;
        }
        for i in 0..directions.len() {
            starts[i + 1] += starts[i];
        }
        let mut next = starts.clone();
        let mut parts = vec![0u32; leaf.len()];
        for (part, &leaf) in (0..).zip(&leaf) {
            parts[next[leaf as usize] as usize] = part;
            next[leaf as usize] += 1;
        }
        Cells {
            width,
            height,
            leaf,
            parts,
            starts,
            angles: (0..height).map(|y| part_angle(y, width, height)).collect(),
        }
    }

    /// Flux on a perpendicular surface (W/m²) of each part, when `radiance(direction)` comes from everywhere.
    pub fn parts(&self, radiance: impl Fn(Vec3) -> Vec3 + Sync) -> Vec<Vec3> {
        let mut parts = vec![Vec3::ZERO; self.width * self.height];
        (parts.par_chunks_mut(self.width).enumerate()).for_each(|(y, row)| {
            let first = y * self.width;
            let angle = self.angles[y];
            for (part, flux) in (first..).zip(row) {
                *flux = radiance(part_direction(part, self.width, self.height)) * angle;
            }
        });
        parts
    }

    /// Flux that comes from the cell of each direction, from that of its parts.
    pub fn flux(&self, parts: &[Vec3]) -> Vec<Vec3> {
        (0..self.starts.len() - 1)
            .into_par_iter()
            .with_min_len(1024)
            .map(|leaf| {
                let sum: DVec3 = self
                    .parts_of(leaf as u32)
                    .iter()
                    .map(|&p| parts[p as usize].as_dvec3())
                    .sum();
                sum.as_vec3()
            })
            .collect()
    }

    /// The parts of a direction's cell, rising.
    pub fn parts_of(&self, leaf: u32) -> &[u32] {
        &self.parts[self.starts[leaf as usize] as usize..self.starts[leaf as usize + 1] as usize]
    }

    /// Unit direction to the middle of a part.
    pub fn direction(&self, part: u32) -> Vec3 {
        part_direction(part as usize, self.width, self.height)
    }

    /// Solid angle of a part.
    pub fn angle(&self, part: u32) -> f32 {
        self.angles[part as usize / self.width]
    }

    /// The directions next to one, and itself; rising.
    pub fn around(&self, leaf: u32) -> Vec<u32> {
        let mut near = vec![leaf];
        for &part in self.parts_of(leaf) {
            let (x, y) = (part as usize % self.width, part as usize / self.width);
            for dy in [-1i32, 0, 1] {
                for dx in [self.width - 1, 0, 1] {
                    let y = (y as i32 + dy).clamp(0, self.height as i32 - 1) as usize;
                    near.push(self.leaf[y * self.width + (x + dx) % self.width]);
                }
            }
        }
        near.sort_unstable();
        near.dedup();
        near
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

    /// Light of directions from the flux of all `parts` of their cells ([`Cells::parts`]), with the cells across which it is uneven.
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

    /// Light of surface samples from the flux of each ([`super::SurfaceSamples::flux`]).
    pub fn of_samples(flux: &[Vec3], most: usize) -> Illumination {
        Illumination::chosen(flux, Vec::new(), most)
    }

    /// Where the light of the node in `slot` comes from, as it is seen from a place.
    #[inline]
    pub fn view(&self, lights: &Lights, slot: usize, from: Vec3) -> NodeView {
        match lights {
            Lights::Directions(_) => self.views[slot],
            Lights::Surface(samples) => samples.tree.view(slot, from),
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
