//! How a bake judges itself: path-traced probes, relit through the player, never pixels that anyone plays.
//!
//! [`viewpoints`] says where they look, [`lights`] under which light, [`traced`] makes their references and compares, [`expected`] is
//! what an asset says of its errors. [`check()`] does all of it at the end of a bake.
#![forbid(unsafe_code)]
#![deny(clippy::print_stdout, clippy::print_stderr, clippy::dbg_macro)]

mod check;
pub mod error;
pub mod expected;
pub mod lights;
pub mod traced;
pub mod viewpoints;

pub use check::check;
pub use error::ProbeError;
pub use expected::{Expected, Verdict};
