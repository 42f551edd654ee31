//! Visibility cuts: many lights, and which of them each finest point sees.

pub mod light_samples;
pub mod sections;
pub mod surface_lights;
pub mod visibility;
