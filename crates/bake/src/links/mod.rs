//! How strongly senders light receivers: gathered by rays, refined level by level, chosen, fitted, and what further bounces
//! make of it.

pub mod bounces;
pub mod choice;
pub mod fitting;
pub mod gather;
pub mod lamps;
pub mod matching_pursuit;
pub mod operators;
pub mod refinement;
pub mod row;
pub mod solution;
pub mod test_lights;
