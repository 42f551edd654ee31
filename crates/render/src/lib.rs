//! A scene to an image, without an asset.
//!
//! ```
//! use glam::{Affine3A, Vec3};
//! use relight_render::layers::RenderSize;
//! use relight_render::path;
//! use relight_render::picture::Picture;
//! use relight_scene::animated::Animated;
//! use relight_scene::camera::Camera;
//! use relight_scene::light::{LightKind, LightTrack};
//! use relight_scene::light_set::{LightSet, NoEmitters};
//! use relight_scene::material::Material;
//! use relight_scene::scene::{Instance, Mesh, Scene};
//! use relight_scene::traced::{Shading, TracedScene};
//! use std::sync::Arc;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! // A floor that reflects half of the light of a lamp 1 m above it.
//! let corner = |x: f32, z: f32| Vec3::new(x, 0.0, z);
//! let floor = Mesh {
//!     positions: vec![corner(-2.0, 2.0), corner(2.0, 2.0), corner(2.0, -2.0), corner(-2.0, -2.0)],
//!     triangles: vec![[0, 1, 2], [0, 2, 3]],
//!     ..Mesh::default()
//! };
//! let half = Material { base_color: Vec3::splat(0.5).extend(1.0), metallic: 0.0, ..Material::default() };
//! let scene = Scene {
//!     meshes: vec![floor],
//!     instances: vec![Instance { mesh: 0, world_from_mesh: Affine3A::IDENTITY }],
//!     materials: vec![half],
//!     ..Scene::default()
//! };
//! let scene = TracedScene::new(Arc::new(scene), Shading::Lambert)?;
//! let lamp = LightTrack {
//!     name: "lamp".into(),
//!     kind: LightKind::Point {
//!         position: Animated::Constant(Vec3::Y),
//!         intensity: Animated::Constant(Vec3::ONE),
//!     },
//! };
//! let lights = LightSet::new(&NoEmitters, std::slice::from_ref(&lamp), 0.0)?;
//! // A narrow view straight down at the place below the lamp.
//! let camera = Camera::looking(Vec3::Y * 0.5, Vec3::NEG_Y, Vec3::Z, 0.01);
//! let picture = Picture::new(&scene, &lights, &camera, RenderSize { width: 4, height: 4 });
//! let image = path::render(&picture, None)?;
//! // Irradiance 1 W/m², times albedo over pi.
//! let found = image.rgb("beauty").ok_or("no beauty")?.pixels[5][0];
//! assert!((found - 0.5 / std::f32::consts::PI).abs() < 1e-3, "{found}");
//! # Ok(())
//! # }
//! ```
//!
//! All render a [`picture`]. The references: [`path`] traces paths, [`brute`] casts a shadow ray per light. [`many_lights`] makes points of all
//! lights; [`lightcuts`] cluster those for each place, [`pixelcuts`] send their light to clusters of pixels.
//! [`mod@expose`] finds what a camera sees, [`texels`] does what texels of a lightmap do; [`lighting`] and [`irradiance`] find direct light at many places at once, from which `relight_play` starts;
//! [`edges`] makes its shadows' edges smooth, [`refine`] light with extent as clean as is wanted. All share [`layers`], and [`watch`] for progress and an early end.
//!
//! Radiance is in W/(m² sr), linear RGB; lengths are in metres, world space. Images depend on scene, lights, settings and seed, not on
//! the number of threads.
#![forbid(unsafe_code)]
#![deny(clippy::print_stdout, clippy::print_stderr, clippy::dbg_macro)]

pub mod brute;
pub mod direct;
pub mod edges;
pub mod expose;
pub mod exposure;
mod fragments;
mod guide;
pub mod irradiance;
mod lamp;
pub mod layers;
pub mod lightcuts;
pub mod lighting;
pub mod many_lights;
pub mod path;
pub mod picture;
mod pieces;
pub mod pixelcuts;
mod place;
mod rare;
pub mod refine;
pub mod sampler;
pub mod samples;
mod slender;
pub mod sum;
#[cfg(test)]
mod test_images;
#[cfg(test)]
mod test_scenes;
pub mod texels;
pub mod views;
pub mod watch;
