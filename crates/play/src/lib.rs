//! Asset and lights to images.
//!
//! The way of the light: [`direct`] light meets points and pixels, [`transfer`] carries what the points
//! reflect to all others, [`reconstruct`] brings it to the pixels of a [`shot`]; [`frame`] runs them in order.
#![forbid(unsafe_code)]

pub mod convert;
pub mod direct;
pub mod frame;
pub mod load;
pub mod reconstruct;
pub mod shot;
pub mod transfer;
