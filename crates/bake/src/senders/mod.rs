//! Which points send light together, and how much each counts.

pub mod importance;
