//! Scene to asset: where light meets points, which links it takes, and what is left out.
//!
//! The way of the light: [`points`] → [`senders`] → [`links`] → [`convert`] less what is [`left_out`], with [`cuts`] beside it.
//! [`bake()`] runs them all.
#![forbid(unsafe_code)]
#![deny(clippy::print_stdout, clippy::print_stderr, clippy::dbg_macro)]

pub mod bake;
pub mod convert;
pub mod cuts;
pub mod error;
pub mod left_out;
pub mod links;
pub mod memory;
pub mod omissions;
pub mod params;
pub mod points;
pub mod radiosity;
pub mod senders;
pub mod settings;
pub mod timed;
pub mod units;

pub use bake::{
    BakeStats, Baked, Portion, Progress, Request, bake, bake_in_units, bake_part, coarse_radius, point_counts,
};
