//! How a bake judges itself: path-traced probes, relit through the player, never pixels that anyone plays.

pub mod check;
pub mod lit;
pub mod traced;
pub mod viewpoints;
