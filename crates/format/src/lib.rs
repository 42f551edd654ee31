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
//! An engine that only wants the operator reads points and links in a few lines; what it gets is validated, so rows
//! and columns need no further checks:
//!
//! ```no_run
//! use relight_format::{Limits, read_file};
//!
//! # fn main() -> Result<(), relight_format::FormatError> {
//! let asset = read_file("hall.relight", &Limits::default())?;
//! let positions: Vec<[f32; 3]> = asset.points.iter().flat_map(|level| level.positions.clone()).collect();
//! if let Some(t) = &asset.transfer {
//!     for (receiver, row) in t.row_offsets.windows(2).enumerate() {
//!         for link in row[0] as usize..row[1] as usize {
//!             println!("{:?} from sender {}: {:?}", positions[receiver], t.columns[link], t.vectors[link]);
//!         }
//!     }
//! }
//! # Ok(())
//! # }
//! ```
//!
//! What is quantised loses precision, within the bounds that [`codec`] states. A baker that corrects for the
//! loss asks [`quantised_level`], [`quantised_links`], [`quantised_vector`], [`quantised_weights`], [`shortened_links`],
//! [`quantised_light_tree`] and [`quantised_cuts`] what a reader will see.
#![forbid(unsafe_code)]

mod asset;
pub mod codec;
mod container;
mod content;
mod error;
mod file;
pub mod layout;
mod read;
mod section;
pub mod unit;
mod validate;

pub use asset::{
    AlphaMode, Asset, BounceLinks, Coding, Cuts, Estimates, Filter, Geometry, Instance, LeftOut, Level,
    LightSamples, LightTree, Links, Material, Mesh, Provenance, Senders, Separations, Solution, Stage,
    Texture, TextureRef, WeightRows, Wrap,
};
pub use codec::vector::{quantised_vector, shortened_vector};
pub use container::{Limits, SectionInfo};
pub use content::{Content, CutContent};
pub use error::{Fault, FormatError, Location, Result};
pub use file::{content_hash, write_asset, write_file};
pub use read::{Summary, read_asset, read_file, read_parts, read_summary, summarise};
pub use section::cuts::quantised_cuts;
pub use section::light_tree::quantised_light_tree;
pub use section::links::{quantised_links, shortened_links};
pub use section::points::quantised_level;
pub use section::weights::quantised_weights;
