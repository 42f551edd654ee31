//! Scene to asset: where light meets points, which links it takes, and what is left out.
//!
//! The way of the light: [`points`] → [`senders`] → [`links`] → [`convert`] less what is [`left_out`], with [`cuts`] beside it.
//! [`bake()`] runs them all.
#![forbid(unsafe_code)]
#![deny(clippy::print_stdout, clippy::print_stderr, clippy::dbg_macro)]

mod bake;
pub mod convert;
pub mod cuts;
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
pub mod radiosity;
mod report;
mod request;
pub mod senders;
pub mod settings;
pub mod timed;
pub mod units;

pub use bake::bake;
pub use points::placing::{coarse_radius, point_counts};
pub use portion::{Portion, bake_part};
pub use progress::{Progress, Unwatched};
pub use request::{BakeStats, Baked, Request};
