//! Asset and lights to images.
#![forbid(unsafe_code)]

pub mod reconstruct;
pub mod transfer;
