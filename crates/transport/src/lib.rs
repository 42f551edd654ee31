//! The mathematics that bake and play share, over plain arrays. No scene, no file and no clock.
//!
//! Light transport is linear: irradiance at surface points is a matrix times their radiosity. Here are its parts, from points to
//! matrix:
//!
//! - a meshless hierarchical basis on points: [`poisson`] disks, functions of a level ([`basis`], [`kernel`], [`grid`]), levels
//!   that push values to finer ones ([`pyramid`]);
//! - clusters of points that send light ([`senders`]), links from them to points ([`links`]), the whole as matrices
//!   ([`factors`], [`sparse`]);
//! - further bounces: an operator between clusters, solved ([`bounce`], [`krylov`], [`spectrum`]);
//! - trees and cuts: of directions and surface samples ([`light_tree`], [`cuts`]), of lights without extent ([`point_light`],
//!   [`light_clusters`], [`light_bounds`], [`sight`]), of pixels ([`pixel_tree`], [`pixel_scatter`]);
//! - spherical harmonics ([`sh`]), directions to sample ([`sampling`]) and random numbers ([`random`]).
//!
//! Operators read destination from source: `fine_from_coarse` takes values at coarse points to fine ones. Sums have a fixed
//! order, so that results depend on no thread; sparse matrices are `sprs`'s.
//!
//! ```
//! use glam::Vec3;
//! use relight_transport::{bounce::solve, sparse::from_rows};
//!
//! // Two plates that see half of each other, and darkness else; the first sends 1 of its own.
//! let operator = from_rows(&[vec![(1, 0.5)], vec![(0, 0.5)]], 2);
//! let (emitted, albedo) = ([Vec3::ONE, Vec3::ZERO], [Vec3::splat(0.8); 2]);
//! let (irradiance, solved) = solve(&operator, &emitted, &albedo, None);
//!
//! // E₁ = 0.4 E₂ and E₂ = 0.5 + 0.4 E₁.
//! let second = 0.5 / (1.0 - 0.4 * 0.4);
//! assert!(solved.converged);
//! // The solver stops at 1 % of the brightest.
//! assert!((irradiance[1].x - second).abs() < 0.01 * second);
//! assert!((irradiance[0].x - 0.4 * second).abs() < 0.01 * second);
//! ```
#![forbid(unsafe_code)]
#![deny(clippy::print_stdout, clippy::print_stderr, clippy::dbg_macro)]

pub mod basis;
pub mod bounce;
pub mod cuts;
pub mod factors;
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
pub mod ranked;
pub mod sampling;
pub mod senders;
pub mod sh;
pub mod sight;
pub mod sparse;
pub mod spectrum;
#[cfg(test)]
mod test_random;
