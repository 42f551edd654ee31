//! Asset and lights to images.
//!
//! The way of the light: direct light ([`relight_render::lighting`]) of points and pixels, [`transfer`] of what the points reflect to
//! all others, [`reconstruct`]ion at the fragments of a [`shot`] and [`reflections`] in its glossy ones; [`frame`] runs them
//! in order. [`edited`] changes materials. Images that need no asset are `relight_render`'s.
#![forbid(unsafe_code)]
#![deny(clippy::print_stdout, clippy::print_stderr, clippy::dbg_macro)]

pub mod convert;
pub mod cuts;
mod edges;
pub mod edited;
pub mod frame;
pub mod load;
pub mod reconstruct;
pub mod reflections;
pub mod shot;
mod snap;
#[cfg(test)]
#[allow(dead_code, reason = "shared with `relight_render`, whose tests use all of it")]
#[path = "../../render/src/test_scenes.rs"]
mod test_scenes;
pub mod transfer;
pub mod views;
