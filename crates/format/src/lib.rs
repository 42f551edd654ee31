//! The relight asset file: container, typed sections, codecs and validation.
//!
//! An asset holds everything that `play` needs to relight one static scene: geometry, materials, textures, the
//! points of the meshless hierarchy and the sparse transfer operators. This crate alone knows its bytes; it
//! knows no rendering, no glTF, no threads and no vector library. `SPEC.md`, beside this code, specifies every
//! byte; comments here cite its sections.
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
//!
//! What is quantised loses precision, within the bounds that [`codec`] states. A baker that corrects for the
//! loss asks [`quantised_level`], [`quantised_links`], [`quantised_vector`] and [`quantised_bounce`] what a
//! reader will see.
#![forbid(unsafe_code)]

mod asset;
pub mod codec;
mod container;
mod error;
mod file;
pub mod layout;
mod section;
mod validate;

pub use asset::{
    AlphaMode, Asset, BounceLinks, Estimates, Filter, Geometry, Instance, LeftOut, Level, Links, Material,
    Mesh, Provenance, Stage, Texture, TextureRef, Wrap,
};
pub use codec::vector::quantised_vector;
pub use container::{Limits, SectionInfo};
pub use error::{Fault, FormatError, Place, Result};
pub use file::{
    Summary, content_hash, read_asset, read_file, read_summary, summarise, write_asset, write_file,
};
pub use section::bounce::quantised_bounce;
pub use section::links::quantised_links;
pub use section::points::quantised_level;
