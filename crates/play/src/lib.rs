//! An asset and lights to images: the player of relight as a library.
//!
//! ```
//! use relight_play::scene::animated::Animated;
//! use relight_play::scene::light::{LightKind, LightTrack};
//! use relight_play::{FrameSettings, Player, ShotSettings, glam::Vec3};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! // relight bake data/cornell.glb --preset draft --levels 2 --sender-levels 1 --coarse-radius 0.2
//! let player = Player::open("tests/cornell.relight")?;
//! let lamp = LightTrack {
//!     name: "lamp".into(),
//!     kind: LightKind::Point {
//!         position: Animated::Constant(Vec3::new(0.2, 0.4, 0.1)),
//!         intensity: Animated::Constant(Vec3::ONE),
//!     },
//! };
//! let lights = player.lights(&[lamp])?;
//! let camera = player.scene().cameras[0].at(0.0);
//! let size = ShotSettings { width: 32, height: 18, ..ShotSettings::default() };
//! let shot = player.shot(&camera, &size)?;
//! let frame = player.frame(&shot, &lights, 0.0, &FrameSettings::default())?;
//! let indirect = frame.layers.rgb("indirect").ok_or("no such layer")?;
//! assert_eq!(indirect.pixels.len(), 32 * 18);
//! assert!(indirect.pixels.iter().any(|pixel| pixel[1] > 0.0));
//! println!("{}", frame.choice);
//! # Ok(())
//! # }
//! ```
//!
//! # From a file to pixels
//!
//! 1. [`Player::open`] reads an asset, checks it, and prepares its scene and operators ([`open`], [`prepared`]).
//! 2. [`Player::lights`] prepares lights over time: tables of environments and emissive surfaces, once for all frames
//!    ([`lights`]).
//! 3. [`Player::shot`] finds what a camera sees: primary rays, grouped into fragments, with the functions of the finest points
//!    at each, what glossy lobes see, and the sites of visibility cuts ([`shot`], [`reconstruct`], [`reflections`], [`cuts`]).
//!    Once, while the camera stands still.
//! 4. [`Player::frame`] lights it: direct light of points and fragments, [`transfer`] of what the points reflect to all others, and
//!    what of that each fragment shows. The stages are files of [`frame`]; a pixel's indirect light is made in
//!    `frame/indirect.rs`.
//! 5. The [`Frame`] has its layers by name, what it took by stage, and how its light was made and why ([`Choice`]).
//!
//! [`frame::lightmap`] lights the [`texels`] of a map of the whole scene instead of a camera's pixels.
//! [`daylight`] keeps the images of a sky's patches, and adds them up to frames of any sky.
//!
//! Any number of shots and lights share a player. Moving lights take another time, or other [`Lights`]; a moving camera another
//! shot ([`ShotSettings::moving`]). [`Player::edit_materials`] changes materials: a shot of before is refused until it is
//! [refreshed](Player::refresh) or made again. [`Player::frame_watched`] tells how far it is and stops when asked to
//! ([`render::watch::Watch`]); a coarse frame first is a shot of fewer pixels. [`Integrator`] lists all ways to make light, those that need
//! no asset included; images of scenes without one are [`relight_render`]'s.
//!
//! Nothing here prints, holds globals or knows a clock but to measure stages. Radiance is in W/(m² sr), linear RGB; lengths are in
//! metres; the math is [`glam`]'s, in world space, y up.
#![forbid(unsafe_code)]
#![deny(clippy::print_stdout, clippy::print_stderr, clippy::dbg_macro)]

pub mod camera;
mod cell_reflectances;
pub mod choice;
mod convert;
pub mod cuts;
pub mod daylight;
pub mod edited;
mod edition;
pub mod frame;
mod gloss;
mod glossy_ends;
pub mod header;
pub mod kept;
pub mod lights;
mod lit;
pub mod mattes;
pub mod near;
pub mod open;
pub mod player;
pub mod prepared;
pub mod reconstruct;
pub mod reflections;
mod separated;
mod shadow_edges;
pub mod shot;
mod snap;
mod spread;
mod still;
#[cfg(test)]
#[allow(dead_code, reason = "shared with `relight_render`, whose tests use all of it")]
#[path = "../../render/src/test_scenes.rs"]
mod test_scenes;
pub mod texels;
pub mod transfer;
mod transferred;
mod virtual_points;

pub use choice::{Choice, Integrator, Tracer};
pub use daylight::DaylightLayers;
pub use frame::settings::FrameSettings;
pub use lights::Lights;
pub use player::{Frame, Player};
pub use prepared::PreparedScene;
pub use shot::{CutSites, Shot, ShotSettings};
pub use transfer::LevelPart;

pub use glam;
pub use relight_render as render;
pub use relight_scene as scene;
