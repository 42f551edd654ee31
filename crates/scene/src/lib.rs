//! What light meets: surfaces and ray casting, materials and BRDFs, textures, lights, light sequences,
//! cameras, and images.
//!
//! The rooms, in the order in which light passes them: [`sequence`] says which [`light`]s shine at a frame;
//! their light meets [`surface`]s, found by [`rays`] over the triangles of a [`scene`], where a [`material`]
//! reflects it; a [`camera`] sees it and an image keeps it.
#![deny(unsafe_code)]
#![deny(clippy::print_stdout, clippy::print_stderr, clippy::dbg_macro)]

pub mod animated;
pub mod bsdf;
pub mod camera;
pub mod composite;
pub mod environment;
pub mod environment_strata;
#[cfg(feature = "gltf")]
pub mod gltf;
pub mod image;
pub mod implicit;
pub mod isosurface;
pub mod json;
pub mod light;
pub mod light_set;
pub mod material;
pub mod material_edits;
pub mod rays;
pub mod scene;
pub mod schema;
pub mod separation;
pub mod sequence;
pub mod shading;
pub mod sky;
pub mod surface;
pub mod surface_nets;
pub mod surface_scene;
pub mod texture;
pub mod traced;
