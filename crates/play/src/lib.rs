//! Asset and lights to images.
#![forbid(unsafe_code)]

pub mod brute;
mod direct;
pub mod layers;
pub mod path;
pub mod reconstruct;
pub mod sampler;
pub mod transfer;
