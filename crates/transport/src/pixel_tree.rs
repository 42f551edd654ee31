//! A tree over what the pixels of an image see, and cuts of it for single lights: the pixel tree of pixelcuts.
//!
//! Source: Khungurn et al., *Pixelcuts: Scalable Approximate Illumination from Many Point Lights*, section 3 ("Pixel
//! tree", "Choosing a cut"): a kd-tree whose nodes split the longest side of their box in half; a random cut of k nodes,
//! in which a node is refined in proportion to its pixels; refinement of what the light's geometry term varies in.
//!
//! **Deviations.** Nodes split by normals as well as by positions, or a corner's two walls would share light that only
//! one of them sees. Instead of k single picks, a node's picks are shared out between its children in proportion to
//! their pixels and rounded at random, which has the same mean, visits every node once and is in order. The geometry
//! term is weighed by the light's intensity and relative to the mean incident light (printed: absolute, 0.01, without
//! intensity). Its largest cosine is that of Walter et al. 2005, equation 4, since it is not at a box's corners. Where a
//! light alone would give more than the mean incident light its excess counts as no variation: distances are clamped.
//!
//! Costs: O(n log n) to build, 44 bytes a node and 4 a pixel; a cut of k nodes visits at most 2k.

mod build;
mod cut;
#[cfg(test)]
mod tests;

pub use build::{PixelNode, PixelTree, TreePixel};
pub use cut::{CutLight, CutLimits, choose_cut};
