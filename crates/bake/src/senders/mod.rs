//! Which points send light together, and how much each counts.

pub mod clusters;
pub mod importance;
