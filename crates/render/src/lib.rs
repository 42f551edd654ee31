//! A scene to an image, without an asset.
//!
//! The references: [`path`] traces paths, [`brute`] casts a shadow ray per light. [`many_lights`] makes points of all
//! lights; [`lightcuts`] cluster those for each place, [`pixelcuts`] send their light to clusters of pixels.
//! [`lighting`] finds direct light at many places at once, which `relight_play` starts from. All share [`layers`].
#![forbid(unsafe_code)]
#![deny(clippy::print_stdout, clippy::print_stderr, clippy::dbg_macro)]

pub mod brute;
pub mod direct;
pub mod edges;
pub mod expose;
pub mod exposure;
pub mod layers;
pub mod lightcuts;
pub mod lighting;
pub mod many_lights;
pub mod path;
pub mod pixelcuts;
pub mod sampler;
pub mod sum;
#[cfg(test)]
mod test_scenes;
pub mod views;
pub mod watch;
