//! Asset and lights to images.
//!
//! The way of the light: direct light ([`relight_render::lighting`]) of points and pixels, [`transfer`] of what the points reflect to
//! all others, [`reconstruct`]ion at the fragments of a [`shot`] and [`reflections`] in its glossy ones; [`frame`] runs them
//! in order. [`player`] is the door to all of it. Images that need no asset are `relight_render`'s.
#![forbid(unsafe_code)]
#![deny(clippy::print_stdout, clippy::print_stderr, clippy::dbg_macro)]

pub mod camera;
pub mod choice;
mod convert;
pub mod cuts;
pub mod edited;
pub mod frame;
pub mod kept;
pub mod lights;
pub mod open;
pub mod player;
pub mod prepared;
pub mod reconstruct;
pub mod reflections;
pub mod shot;
mod snap;
#[cfg(test)]
#[allow(dead_code, reason = "shared with `relight_render`, whose tests use all of it")]
#[path = "../../render/src/test_scenes.rs"]
mod test_scenes;
pub mod transfer;

pub use choice::{Choice, Integrator, Tracer};
pub use frame::settings::FrameSettings;
pub use lights::Lights;
pub use player::{Frame, Player};
pub use prepared::PreparedScene;
pub use shot::{CutSites, Shot, ShotSettings};

pub use glam;
pub use relight_render as render;
pub use relight_scene as scene;
