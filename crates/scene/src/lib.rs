//! What light meets: surfaces and ray casting, materials and BRDFs, textures, lights, light sequences,
//! cameras, and images.
//!
//! The way of the light:
//!
//! 1. A [`sequence`] says which lights shine over time ([`light::LightTrack`], values that move: [`animated`]).
//!    [`light_set`] makes the lights of one frame, which can be sampled from a point or met by a ray; [`environment`] and
//!    [`sky`] are those from all around, which [`sky_patches`] takes to pieces.
//! 2. A [`scene`] comes from `gltf` (a feature) or, as implicit surfaces and isosurfaces, from [`surface_scene`]. Rays
//!    find its [`surface`]s: [`traced`] those of triangles, with [`rays`] underneath, [`implicit`] and [`isosurface`] the
//!    others, [`composite`] several as one.
//! 3. Where a ray arrives, a [`material`] (as [`material_edits`] left it) becomes a [`shading`] point, and [`bsdf`] says how
//!    much of the light from one direction leaves towards another.
//! 4. A [`camera`] looks, and [`mod@image`] keeps what it sees.
//!
//! What people write is JSON ([`json`]), described by [`schema`].
//!
//! # Example
//!
//! A lamp that moves is read, and shines on a point one metre below it:
//!
//! ```
//! use glam::Vec3;
//! use relight_scene::light_set::{LightSet, NoEmitters};
//! use relight_scene::sequence::parse_sequence;
//! use std::path::Path;
//!
//! let text = r#"{ "relight_sequence": 1, "frames": 11, "lights": [
//!   { "name": "lamp", "type": "point", "intensity": [4, 2, 1],
//!     "position": { "keys": [[0, [0, 1, 0]], [10, [4, 1, 0]]] } } ] }"#;
//! let sequence = parse_sequence(text, Path::new("."), "lamp.json")?;
//! let lights = LightSet::new(&NoEmitters, &sequence.lights, 5.0)?;
//! // Half way it stands at (2, 1, 0). Intensity over the square of the distance is irradiance.
//! let sample = lights.sample(0, Vec3::new(2.0, 0.0, 0.0), [0.5; 3]).expect("light");
//! assert_eq!((sample.direction, sample.distance), (Vec3::Y, 1.0));
//! assert_eq!(sample.radiance_over_pdf, Vec3::new(4.0, 2.0, 1.0));
//!
//! // A mistake is named with its path and place.
//! let error = parse_sequence(&text.replace("[4, 2, 1]", "[4, -2, 1]"), Path::new("."), "lamp.json").unwrap_err();
//! assert_eq!(
//!     error.to_string(),
//!     "lamp.json: lights[0].intensity[1]: expected a number from 0 to 1e30, found -2 (line 2, column 55)"
//! );
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![deny(unsafe_code)]
#![deny(clippy::print_stdout, clippy::print_stderr, clippy::dbg_macro)]

pub mod animated;
pub mod bsdf;
pub mod camera;
pub mod composite;
pub mod data_uri;
pub mod daylight;
pub mod environment;
pub mod environment_strata;
#[cfg(feature = "gltf")]
pub mod gltf;
pub mod image;
pub mod implicit;
pub mod isosurface;
pub mod json;
mod lfs;
pub mod light;
pub mod light_set;
pub mod light_state;
mod map_files;
pub mod maps;
pub mod material;
pub mod material_edits;
pub mod numbered;
mod perez;
pub mod photometry;
pub mod rays;
pub mod scene;
pub mod schema;
pub mod separation;
pub mod sequence;
pub mod shading;
pub mod sky;
pub mod sky_patches;
pub mod surface;
pub mod surface_nets;
pub mod surface_scene;
pub mod texture;
mod texture_range;
mod thin_film;
pub mod traced;
pub mod weather;
