//! Scene to asset: where light meets points, which links it takes, and what is left out.
//!
//! The way of the light: [`points`] → [`senders`] → [`links`] → [`convert`] less what is [`left_out`], with [`cuts`] beside it.
//! [`bake()`] runs them all.
//!
//! From a scene to an asset:
//!
//! ```
//! use relight_bake::params::{BakeParams, Preset};
//! use relight_bake::{Request, Unwatched, bake};
//! use relight_scene::gltf::{ImportOptions, import};
//! use std::sync::Arc;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let file = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data/furnace_box.glb");
//! # let asset = std::env::temp_dir().join(format!("relight_bake_{}.relight", std::process::id()));
//! let scene = import(&file, &ImportOptions::default())?;
//! // Fewer points and rays than any preset has; `BakeParams::default()` is the preset `standard`.
//! let params = BakeParams {
//!     levels: 2,
//!     sender_levels: 1,
//!     coarse_radius: Some(0.5),
//!     rays: 64,
//!     ..BakeParams::preset(Preset::Draft)
//! };
//! let baked = bake(&Request::new(Arc::new(scene), &params), None, &Unwatched)?;
//! relight_format::write_file(&asset, &baked.asset)?;
//! assert_eq!(baked.asset.points.len(), 2);
//! # std::fs::remove_file(&asset)?;
//! # Ok(())
//! # }
//! ```
//!
//! [`Request`] has what else a bake may be told: the one sequence that it is for, or Lambert shading. With a
//! [`Ledger`](units::Ledger) a bake keeps its units of work and goes on from them, and [`bake_part`] makes some of them for
//! others to take.
#![forbid(unsafe_code)]
#![deny(clippy::print_stdout, clippy::print_stderr, clippy::dbg_macro)]

// The scenes of tests name this crate as the examples do that share them.
#[cfg(test)]
extern crate self as relight_bake;

mod bake;
pub mod convert;
pub mod cuts;
pub mod disk;
pub mod error;
pub mod left_out;
pub mod links;
pub mod memory;
pub mod omissions;
mod operator_sections;
pub mod params;
pub mod points;
mod portion;
mod progress;
mod report;
mod request;
pub mod senders;
pub mod settings;
#[cfg(test)]
mod test_scenes;
pub mod timed;
pub mod units;

pub use bake::bake;
pub use points::placing::{coarse_radius, point_counts};
pub use portion::{Portion, bake_part};
pub use progress::{Progress, Unwatched};
pub use request::{BakeStats, Baked, Request};
