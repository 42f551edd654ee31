//! The command line as a user runs it.
//!
//! Scenes are small and settings coarse, so that all of this takes seconds; how right the light is, other tests
//! measure.

mod bad_input;
mod bake;
mod check;
// As view is tested with.
#[allow(dead_code)]
#[path = "../../crates/view/tests/chromium/mod.rs"]
mod chromium;
mod compare;
mod compositing;
mod cuts;
mod cuts_indirect;
mod daylight;
mod export;
mod far;
mod front_door;
mod general;
mod image_lights;
mod inspect;
mod kinds;
mod lamps;
mod left_out;
mod lightmap;
mod lightmap_in_three;
mod limits;
mod loss;
mod materials;
mod mix;
mod moments;
mod movie;
mod options;
mod pages;
mod panes;
mod play;
mod random;
mod report;
mod report_page;
mod shell;
mod signals;
mod skies;
mod slurm;
mod stage;
mod sudden;
mod units;
mod variants;
