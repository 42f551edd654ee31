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
mod node;
#[cfg(test)]
mod tests;

pub use build::{BuildSettings, build};
pub use node::{ClusterEmission, ClusterNode, Envelope, LightClusters, Root};
