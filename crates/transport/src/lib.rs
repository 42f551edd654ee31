//! The mathematics that bake and play share, over plain arrays: a meshless hierarchical basis on surface
//! points, the sparse transfer operator, the bounce operator and its solver, and sampling.
//!
//! This crate knows no scene, no file and no clock. Operators and matrices read destination from source:
//! `fine_from_coarse` takes values at coarse points to fine ones.
#![forbid(unsafe_code)]
#![deny(clippy::print_stdout, clippy::print_stderr, clippy::dbg_macro)]

pub mod basis;
pub mod bounce;
pub mod cuts;
pub mod grid;
pub mod kernel;
pub mod krylov;
pub mod light_bounds;
pub mod light_clusters;
pub mod light_tree;
pub mod links;
pub mod pixel_scatter;
pub mod pixel_tree;
pub mod point_light;
pub mod poisson;
pub mod pyramid;
pub mod random;
pub mod sampling;
pub mod senders;
pub mod sh;
pub mod sight;
pub mod sparse;
pub mod spectrum;
pub mod tensor;
