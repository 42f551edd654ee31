//! Where light is known: candidates, Poisson-disk sets of them, what walls separate, what viewers see.

pub mod candidates;
pub mod coverage;
pub mod known_lamps;
pub mod openness;
pub mod particles;
pub mod placing;
pub mod poisson;
pub mod reflectances;
pub mod relevance;
pub mod seen;
pub mod separation;
pub mod viewpoints;
