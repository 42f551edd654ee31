//! Scene to asset: where light meets points, which links it takes, and what is left out.
//!
//! The way of the light: [`candidates`] → [`points`] → [`gather`] → [`select`] within [`refine`] →
//! [`bounces`], [`solution`] → [`convert`] less what is [`left_out`]. [`bake()`] runs them all.
#![forbid(unsafe_code)]
#![deny(clippy::print_stdout, clippy::print_stderr, clippy::dbg_macro)]

pub mod bake;
pub mod bounces;
pub mod candidates;
pub mod convert;
pub mod coverage;
pub mod cut_sections;
pub mod error;
pub mod gather;
pub mod importance;
pub mod lamps;
pub mod left_out;
pub mod light_samples;
pub mod omissions;
pub mod params;
pub mod parted;
pub mod points;
pub mod pursuit;
pub mod radiosity;
pub mod refine;
pub mod seen;
pub mod select;
pub mod settings;
pub mod solution;
pub mod surface_lights;
pub mod timed;
pub mod transport;
pub mod trials;
pub mod units;
pub mod viewpoint;
pub mod visibility;

pub use bake::{
    BakeStats, Baked, Portion, Progress, Request, bake, bake_in_units, bake_part, coarse_radius, point_counts,
};
