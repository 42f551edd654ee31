//! Images: the float images that rendering makes, the files they are read from and written to, and the measures
//! that compare them.
//!
//! - [`layers`]: one image, and all layers of a frame.
//! - [`exr_write`], [`exr_read`]: OpenEXR, all layers of a frame in one part.
//! - [`environment`]: Radiance `.hdr` and OpenEXR as environment maps.
//! - [`ldr`]: 8-bit PNG and JPEG (textures) and PNG writing; [`preview`]: tone mapped previews and contact sheets.
//! - [`movie`]: animated WebP and GIF.
//! - [`colormap`]: false-colour error maps.
//! - [`metrics`], [`flip`]: how far an image is from its reference; [`flicker`]: how steady a sequence is.
//!
//! Conventions: linear Rec. 709, `f32`, row 0 is the top, row after row, pixel after pixel, channels side by side.
//! Every reader works under [`Limits`] and returns a typed [`ImageError`]; every writer replaces its target
//! atomically ([`write_atomically`]).

pub mod atomic;
pub mod colormap;
pub mod cryptomatte;
mod cube;
pub mod environment;
pub mod error;
pub mod exr_camera;
pub mod exr_header;
pub mod exr_read;
mod exr_space;
pub mod exr_write;
pub mod flicker;
pub mod flip;
pub mod layers;
pub mod ldr;
pub mod metrics;
pub mod movie;
pub mod preview;

pub use atomic::{write_atomically, write_atomically_with};
pub use colormap::error_map;
pub use environment::{EnvironmentMap, decode_environment, decode_hdr, read_environment, read_hdr};
pub use error::{ImageError, Limits};
pub use exr_camera::ExrCamera;
pub use exr_header::ExrHeader;
pub use exr_read::{decode_exr, read_exr};
pub use exr_write::{ExrWarning, encode_exr, write_exr};
pub use layers::{ALPHA, BEAUTY, DEPTH, FloatImage, Layer, Layers, RAY_DEPTH, light_layer_names};
pub use ldr::{Image8, decode_ldr, encode_png, write_png};
pub use preview::{contact_sheet, display_encoded, tone_mapped};

#[cfg(test)]
mod exr_tests;
