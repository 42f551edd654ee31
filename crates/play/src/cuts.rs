//! Light from many even directions, or from even samples of the surfaces, through visibility cuts (Cheslack-Postava et
//! al. 2008).
//!
//! Once per shot each fragment gets [`sites`], or, where those disagree, one of its [own](own_sites). Per frame an
//! [`illumination`] cut is chosen; [`shade`] merges it with the cuts of the sites and multiplies with the BRDF on the way.

pub mod cells;
#[cfg(test)]
mod environment_tests;
pub mod illumination;
pub mod lights;
pub mod node_view;
pub mod own_sites;
pub mod position_tree;
pub mod shade;
pub mod sites;
#[cfg(test)]
mod tests;
pub mod uneven;

pub use lights::{CutLights, SurfaceSamples, VisibilityCuts};
