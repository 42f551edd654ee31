//! Trees over lights without extent, whose nodes stand for all lights below them.
//!
//! Source: Walter et al. 2005 (lightcuts), section 3, "Building the light tree" and "Similarity metric". One binary tree
//! per group and type of light (omni, oriented, spot, directional); the roots together are the first cut. A node keeps
//! the sum of its lights' intensities, a box around their positions (of directional lights: around the unit vectors
//! towards them), a cone around their axes, and a representative, drawn with a chance in proportion to intensity from
//! those of its two children: a cluster's estimate is unbiased, and its shadow ray serves one child, too.
//!
//! Building is bottom-up by the paper's metric I (α² + c² (1 − cos β)²), with α the box's diagonal, β the cone's half
//! angle, and c the scene's diagonal for lights with an axis and a place, otherwise 0. Deviation: not the best pair of
//! all is joined, but all pairs at once that are each other's best partners. The metric never falls when a cluster
//! grows, so the tree is the same but for ties (as in Walter et al. 2008, "Fast Agglomerative Clustering for
//! Rendering"). Where there are many lights, partners are sought in a window along a Morton curve first (Meister and
//! Bittner 2018, "Parallel Locally-Ordered Clustering"), until few clusters are left for the exact search.
//!
//! Lights without intensity are left out. 64 bytes per node, 128 per light; building takes some 300 per light more for
//! a while.

mod build;
mod cone;
#[cfg(test)]
mod tests;

use crate::point_light::{Emission, PointLight};
use glam::Vec3;

pub use build::{BuildSettings, build};

/// No child: the node is a light.
const LEAF: u32 = u32::MAX;
/// Bits of [`ClusterNode::kind`] below the type: the spot lights' envelope.
const ENVELOPE_BITS: u32 = 30;

/// A cluster of lights of one type, or one light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClusterNode {
    /// Lower corner of the box around the lights, world space, metres; of directional lights around the unit vectors
    /// towards them.
    pub low: Vec3,
    /// Upper corner.
    pub high: Vec3,
    /// Sum of the lights' intensities, as [`PointLight::intensity`].
    pub intensity: Vec3,
    /// Unit axis of the cone around the lights' axes; of omni and directional lights without meaning.
    pub axis: Vec3,
    /// Tangent of half the cone's half angle: small ones keep their digits.
    tan_quarter: f32,
    /// The light that stands for all, an index into the lights of [`build`].
    pub representative: u32,
    /// Where the two children are, side by side.
    children: u32,
    /// Type in the upper two bits, below them the envelope of spot lights.
    kind: u32,
}

impl ClusterNode {
    /// Sine and cosine of the half angle of the cone around the axes.
    #[inline]
    pub fn half_angle(&self) -> (f32, f32) {
        let square = self.tan_quarter * self.tan_quarter;
        let scale = 1.0 / (1.0 + square);
        (2.0 * self.tan_quarter * scale, (1.0 - square) * scale)
    }
}

/// How the lights of a cluster shine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ClusterEmission {
    /// Alike in all directions.
    Omni,
    /// With the cosine about axes within the cone.
    Oriented,
    /// Within cones about axes within the cone, none wider than this.
    Spot(Envelope),
    /// From infinitely far.
    Directional,
}

/// The cone that holds the beams of several spot lights, were their axes one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Envelope {
    /// Cosine at which light begins.
    pub outer: f32,
    /// Cosine from which on it is full.
    pub inner: f32,
}

impl Envelope {
    fn of(scale: f32, offset: f32) -> Envelope {
        // (cos · scale + offset) is 0 at the outer and 1 at the inner angle. A rim of no width may have any scale; a
        // beam that is alike everywhere (scale 0) holds all cosines.
        if scale > 0.0 {
            Envelope {
                outer: -offset / scale,
                inner: (1.0 - offset) / scale,
            }
        } else {
            Envelope {
                outer: -1.0,
                inner: -1.0,
            }
        }
    }

    fn around(self, other: Envelope) -> Envelope {
        Envelope {
            outer: self.outer.min(other.outer),
            inner: self.inner.min(other.inner),
        }
    }

    /// Most of the intensity that leaves at the cosine `cos` to the axis. The rim's value rises with the cosine between
    /// the two angles, later for each light than for the envelope.
    pub fn towards(self, cos: f32) -> f32 {
        if cos >= self.inner {
            return 1.0;
        }
        let share = ((cos - self.outer) / (self.inner - self.outer)).clamp(0.0, 1.0);
        share * share
    }
}

/// A tree's root, part of the first cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Root {
    /// Index into [`LightClusters::nodes`].
    pub node: u32,
    /// Its lights' group.
    pub group: u32,
}

/// Trees over all lights.
#[derive(Clone, Debug, Default)]
pub struct LightClusters {
    /// All nodes; siblings side by side.
    pub nodes: Vec<ClusterNode>,
    /// One per group and type that has lights, by group, then by type.
    pub roots: Vec<Root>,
    envelopes: Vec<Envelope>,
}

impl LightClusters {
    /// Children of a node; `None` of a light.
    #[inline]
    pub fn children(&self, node: u32) -> Option<[u32; 2]> {
        let first = self.nodes[node as usize].children;
        (first != LEAF).then(|| [first, first + 1])
    }

    /// How the lights of a node shine.
    #[inline]
    pub fn emission(&self, node: u32) -> ClusterEmission {
        let kind = self.nodes[node as usize].kind;
        match kind >> ENVELOPE_BITS {
            0 => ClusterEmission::Omni,
            1 => ClusterEmission::Oriented,
            2 => ClusterEmission::Spot(self.envelopes[(kind & ((1 << ENVELOPE_BITS) - 1)) as usize]),
            _ => ClusterEmission::Directional,
        }
    }

    /// Memory of the trees in bytes.
    pub fn bytes(&self) -> usize {
        self.nodes.len() * size_of::<ClusterNode>() + self.envelopes.len() * size_of::<Envelope>()
    }
}

/// Types as [`ClusterNode::kind`] has them.
fn type_of(light: &PointLight) -> u32 {
    match light.emission {
        Emission::Omni => 0,
        Emission::Oriented => 1,
        Emission::Spot { .. } => 2,
        Emission::Directional => 3,
    }
}
