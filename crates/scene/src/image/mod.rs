//! Images: the float images that rendering makes, the files they are read from and written to, and the measures
//! that compare them.
//!
//! - [`exr_write`], [`exr_read`]: OpenEXR, all layers of a frame in one part.
//! - [`environment`]: Radiance `.hdr` and OpenEXR as environment maps.
//! - [`ldr`]: 8-bit PNG and JPEG (textures) and PNG writing; [`preview`]: tone mapped previews and contact sheets.
//! - [`colormap`]: false-colour error maps.
//! - [`metrics`], [`flip`]: how far an image is from its reference.
//!
//! Conventions: linear Rec. 709, `f32`, row 0 is the top, row after row, pixel after pixel, channels side by side.
//! Every reader works under [`Limits`] and returns a typed [`ImageError`]; every writer replaces its target
//! atomically ([`write_atomically`]).

pub mod atomic;
pub mod colormap;
pub mod environment;
pub mod error;
pub mod exr_header;
pub mod exr_read;
pub mod exr_write;
pub mod flip;
pub mod ldr;
pub mod metrics;
pub mod preview;

pub use atomic::{write_atomically, write_atomically_with};
pub use colormap::error_map;
pub use environment::{EnvironmentMap, decode_environment, decode_hdr, read_environment, read_hdr};
pub use error::{ImageError, Limits};
pub use exr_header::ExrHeader;
pub use exr_read::{decode_exr, read_exr};
pub use exr_write::{ExrWarning, encode_exr, write_exr};
pub use ldr::{Image8, decode_ldr, write_png};
pub use preview::{contact_sheet, display_encoded, tone_mapped};

/// The layer that OpenEXR files hold as plain `R`, `G`, `B`.
pub const BEAUTY: &str = "beauty";

/// A linear RGB image.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FloatImage {
    /// Columns.
    pub width: usize,
    /// Rows; row 0 is the top.
    pub height: usize,
    /// `width · height` pixels, row after row, linear Rec. 709 RGB.
    pub pixels: Vec<[f32; 3]>,
}

impl FloatImage {
    /// A black image.
    pub fn black(width: usize, height: usize) -> Self {
        Self {
            width,
            height,
            pixels: vec![[0.0; 3]; width * height],
        }
    }
}

/// One named quantity over all pixels, such as `indirect` or `depth`.
#[derive(Clone, Debug, PartialEq)]
pub struct Layer {
    /// What it is: [`BEAUTY`], `direct`, `light.sun`, `normal`, ….
    pub name: String,
    /// Values per pixel: 1 or 3.
    pub channels: usize,
    /// `width · height · channels` values, the channels of a pixel side by side.
    pub data: Vec<f32>,
}

/// All layers of one frame, in the order in which they were added; all of one size.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Layers {
    /// Columns.
    pub width: usize,
    /// Rows; row 0 is the top.
    pub height: usize,
    /// The layers; names are unique.
    pub layers: Vec<Layer>,
}

impl Layers {
    /// No layers yet.
    pub fn new(width: usize, height: usize) -> Self {
        Self {
            width,
            height,
            layers: Vec::new(),
        }
    }

    /// A frame that holds `image` as its only layer, named `name`.
    pub fn from_image(name: &str, image: &FloatImage) -> Self {
        let mut layers = Self::new(image.width, image.height);
        layers.push_rgb(name, &image.pixels);
        layers
    }

    /// Adds a layer of three channels; `pixels` holds `width · height` of them.
    pub fn push_rgb(&mut self, name: &str, pixels: &[[f32; 3]]) {
        self.layers.push(Layer {
            name: name.into(),
            channels: 3,
            data: pixels.as_flattened().to_vec(),
        });
    }

    /// Adds a layer of one channel; `values` holds `width · height` of them.
    pub fn push_scalar(&mut self, name: &str, values: &[f32]) {
        self.layers.push(Layer {
            name: name.into(),
            channels: 1,
            data: values.to_vec(),
        });
    }

    /// The layer of that name.
    pub fn layer(&self, name: &str) -> Option<&Layer> {
        self.layers.iter().find(|layer| layer.name == name)
    }

    /// The layer of that name as an RGB image; a single channel becomes grey.
    pub fn rgb(&self, name: &str) -> Option<FloatImage> {
        let layer = self.layer(name)?;
        let pixels = match layer.channels {
            3 => layer.data.as_chunks::<3>().0.to_vec(),
            _ => layer.data.iter().map(|&v| [v; 3]).collect(),
        };
        Some(FloatImage {
            width: self.width,
            height: self.height,
            pixels,
        })
    }
}

#[cfg(test)]
mod exr_tests;
