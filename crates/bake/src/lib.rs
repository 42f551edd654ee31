//! Scene to asset: where light meets points, which links it takes, and what is left out.
//!
//! The way of the light: [`candidates`] → [`points`] → [`gather`] → [`select`] within [`refine`] →
//! [`bounces`].
#![forbid(unsafe_code)]

pub mod bounces;
pub mod candidates;
pub mod error;
pub mod gather;
pub mod params;
pub mod points;
pub mod refine;
pub mod select;
pub mod transport;
