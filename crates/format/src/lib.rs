//! The relight asset file: what a bake writes and whoever relights reads.
//!
//! An [`Asset`] holds one static scene with everything needed to relight it: geometry, materials, textures, the points of
//! the meshless hierarchy and the sparse operators that carry light between them. This crate alone knows the file's bytes;
//! it knows no rendering, no glTF, no threads and no vector library. `SPEC.md`, beside this code, specifies every byte;
//! comments here cite its sections.
//!
//! # From a file to links
//!
//! [`read_file`] reads and checks all of an asset, [`read_parts`] some sections and what they refer to, [`read_summary`] the
//! table of contents and provenance of a file of any length. Every byte read is checked against checksums, [`Limits`] and
//! the rules of [`Asset::validate`], so rows and columns need no further checks. T in [`Asset::transfer`] gives vector
//! irradiance at the points of all levels, coarsest first, per unit radiosity of the senders, which are clusters of the
//! finest points ([`Senders`]):
//!
//! ```
//! use relight_format::{FormatError, Limits, layout::Kind, read_parts};
//!
//! # fn main() -> Result<(), FormatError> {
//! let file = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/fixtures/version_1.relight");
//! let asset = read_parts(file, &Limits::default(), &[Kind::LinksTransfer])?;
//! let positions: Vec<[f32; 3]> = asset.points.iter().flat_map(|level| level.positions.clone()).collect();
//! let links = asset.transfer.unwrap_or_default();
//! for (point, row) in links.row_offsets.windows(2).enumerate() {
//!     for link in row[0] as usize..row[1] as usize {
//!         let (sender, vector) = (links.columns[link], links.vectors[link]);
//!         println!("at {:?}: {vector:?} W/m² per W/m² of sender {sender}", positions[point]);
//!     }
//! }
//! assert_eq!((positions.len(), links.columns.len()), (5, 6));
//! # Ok(())
//! # }
//! ```
//!
//! # From an asset to a file
//!
//! [`write_file`] checks an asset and writes it whole or not at all. Equal assets give equal bytes. What is quantised loses
//! precision, within the bounds that [`codec`] states; a baker that corrects for the loss asks [`quantised_level`],
//! [`quantised_links`], [`quantised_vector`], [`quantised_weights`], [`quantised_light_tree`] and
//! [`quantised_cuts`] what a reader will see.
//!
//! ```
//! use relight_format::{Asset, Limits, read_asset, write_asset};
//!
//! # fn main() -> Result<(), relight_format::FormatError> {
//! let mut asset = Asset::default();
//! asset.provenance.tool_version = "example".to_string();
//! let bytes = write_asset(&asset)?;
//! assert_eq!(read_asset(&bytes, &Limits::default())?, asset);
//! # Ok(())
//! # }
//! ```
#![forbid(unsafe_code)]
#![deny(clippy::print_stdout, clippy::print_stderr, clippy::dbg_macro)]

mod asset;
pub mod codec;
mod container;
mod content;
mod disk;
mod error;
mod file;
pub mod layout;
mod read;
mod section;
pub mod unit;
mod validate;

pub use asset::{
    AlphaMode, Asset, BounceLinks, Coding, Cuts, Estimates, Filter, Geometry, Instance, LeftOut, Level,
    LightSamples, LightTree, Links, Material, MaterialExtensions, MaterialGlass, Mesh, Provenance, Senders,
    Separations, Solution, Stage, Texture, TextureRef, WeightRows, Wrap,
};
pub use container::{Limits, SectionInfo};
pub use content::{Content, CutContent};
pub use error::{Fault, FormatError, Location, Result};
pub use file::{content_hash, write_asset, write_file};
pub use read::{Summary, read_asset, read_file, read_parts, read_summary, summarise};
pub use section::cuts::quantised_cuts;
pub use section::light_tree::quantised_light_tree;
pub use section::links::{quantised_links, quantised_vector};
pub use section::points::quantised_level;
pub use section::weights::quantised_weights;
