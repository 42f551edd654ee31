//! The command line as a user runs it.
//!
//! Scenes are small and settings coarse, so that all of this takes seconds; how right the light is, other tests
//! measure.

mod bad_input;
mod bake;
mod check;
mod compare;
mod cuts;
mod cuts_indirect;
mod export;
mod far;
mod front_door;
mod general;
mod inspect;
mod kinds;
mod left_out;
mod limits;
mod loss;
mod materials;
mod moments;
mod pages;
mod play;
mod random;
mod report;
mod signals;
mod slurm;
mod stage;
mod units;
