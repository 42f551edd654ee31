//! Asset and lights to images.
//!
//! The way of the light: direct [`lighting`] of points and pixels, [`transfer`] of what the points reflect to
//! all others, [`reconstruct`]ion at the fragments of a [`shot`] and [`reflections`] in its glossy ones; [`frame`] runs them in order. Beside it stand
//! the references: [`path`] traces paths, [`brute`] casts a shadow ray per light; [`many_lights`]
//! makes points of all lights, and [`pixelcuts`] sends their light to clusters of pixels. [`edited`] changes materials.
#![forbid(unsafe_code)]

pub mod brute;
pub mod convert;
pub mod cuts;
mod direct;
mod edges;
pub mod edited;
pub mod frame;
pub mod layers;
pub mod lightcuts;
pub mod lighting;
pub mod load;
pub mod many_lights;
pub mod path;
pub mod pixelcuts;
pub mod reconstruct;
pub mod reflections;
pub mod sampler;
pub mod shot;
mod snap;
mod sum;
pub mod transfer;
pub mod views;
