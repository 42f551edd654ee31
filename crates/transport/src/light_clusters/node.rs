//! What the trees are made of.

use crate::point_light::{Emission, PointLight};
use crate::random::Stream;
use glam::{DVec3, Vec3};

/// Stage of the random numbers that draw representatives of lights that stand still.
const STAGE: u32 = 0x4c44;
/// The type of spot lights in [`ClusterNode::kind`].
const SPOT: u32 = 2;

/// No child: the node is a light.
pub(super) const LEAF: u32 = u32::MAX;
/// Bits of [`ClusterNode::kind`] below the type: the spot lights' envelope.
pub(super) const ENVELOPE_BITS: u32 = 30;

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
    pub(super) tan_quarter: f32,
    /// The light that stands for all, an index into the lights of [`build`](super::build()).
    pub representative: u32,
    /// Where the two children are, side by side.
    pub(super) children: u32,
    /// Type in the upper two bits, below them the envelope of spot lights.
    pub(super) kind: u32,
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
    pub(super) fn of(scale: f32, offset: f32) -> Envelope {
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

    pub(super) fn around(self, other: Envelope) -> Envelope {
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
    pub(super) envelopes: Vec<Envelope>,
}

impl LightClusters {
    /// Children of a node; `None` of a light.
    #[inline]
    pub fn children(&self, node: u32) -> Option<[u32; 2]> {
        let first = self.nodes[node as usize].children;
        (first != LEAF).then(|| [first, first + 1])
    }

    /// Number of lights below a node.
    pub fn lights(&self, node: u32) -> usize {
        let mut open = vec![node];
        let mut lights = 0;
        while let Some(node) = open.pop() {
            match self.children(node) {
                Some(children) => open.extend(children),
                None => lights += 1,
            }
        }
        lights
    }

    /// How the lights of a node shine.
    #[inline]
    pub fn emission(&self, node: u32) -> ClusterEmission {
        let kind = self.nodes[node as usize].kind;
        match kind >> ENVELOPE_BITS {
            0 => ClusterEmission::Omni,
            1 => ClusterEmission::Oriented,
            SPOT => ClusterEmission::Spot(self.envelopes[(kind & ((1 << ENVELOPE_BITS) - 1)) as usize]),
            _ => ClusterEmission::Directional,
        }
    }

    /// The same tree over the same lights with other intensities, one each: for lights that stand still. Clusters are those that the lights
    /// had when the tree was built; representatives are drawn anew, by the same random numbers for the same `seed`, so that few change
    /// where intensities hardly do.
    ///
    /// # Panics
    /// `intensities` are not one per light.
    #[must_use]
    pub fn lit_by(&self, intensities: &[Vec3], seed: u64) -> LightClusters {
        let mut lit = self.clone();
        let mut sums = vec![DVec3::ZERO; self.nodes.len()];
        // Children come after their parents.
        for at in (0..self.nodes.len()).rev() {
            match self.children(at as u32) {
                None => sums[at] = intensities[self.nodes[at].representative as usize].as_dvec3(),
                Some([a, b]) => {
                    let [ia, ib] = [a, b].map(|child| sums[child as usize].element_sum());
                    let random = f64::from(Stream::new(seed, STAGE, at as u64).uniform());
                    let elder = if random * (ia + ib) < ia { a } else { b };
                    sums[at] = sums[a as usize] + sums[b as usize];
                    lit.nodes[at].representative = lit.nodes[elder as usize].representative;
                }
            }
            lit.nodes[at].intensity = sums[at].as_vec3();
        }
        lit
    }

    /// Adds trees over lights whose numbers start at `first_light` here, as `group`.
    pub fn append(&mut self, trees: &LightClusters, first_light: u32, group: u32) {
        let (first_node, first_envelope) = (self.nodes.len() as u32, self.envelopes.len() as u32);
        self.nodes.extend(trees.nodes.iter().map(|node| ClusterNode {
            representative: node.representative + first_light,
            children: match node.children {
                LEAF => LEAF,
                children => children + first_node,
            },
            kind: match node.kind >> ENVELOPE_BITS {
                SPOT => node.kind + first_envelope,
                _ => node.kind,
            },
            ..*node
        }));
        self.envelopes.extend(&trees.envelopes);
        let roots = trees.roots.iter().map(|root| Root {
            node: root.node + first_node,
            group,
        });
        self.roots.extend(roots);
    }

    /// Memory of the trees in bytes.
    pub fn bytes(&self) -> usize {
        self.nodes.len() * size_of::<ClusterNode>() + self.envelopes.len() * size_of::<Envelope>()
    }
}

/// Types as [`ClusterNode::kind`] has them.
pub(super) fn type_of(light: &PointLight) -> u32 {
    match light.emission {
        Emission::Omni => 0,
        // Bounded by what it would be without extent.
        Emission::Oriented | Emission::Patch(_) => 1,
        // Measured lights shine at most as spots without a rim.
        Emission::Spot { .. } | Emission::Measured { .. } => SPOT,
        Emission::Directional => 3,
    }
}
