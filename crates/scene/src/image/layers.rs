//! One image, and all layers of a frame.

use super::error::ImageError;
use std::collections::HashSet;

/// The layer that OpenEXR files hold as plain `R`, `G`, `B`.
pub const BEAUTY: &str = "beauty";
/// The layer of the share of each pixel that shows scene, not background: OpenEXR's `A`.
pub const ALPHA: &str = "A";
/// The layer of the distance from the camera's plane, metres: `depth.Z`.
pub const DEPTH: &str = "depth";
/// The layer of the distance along the ray, metres.
pub const RAY_DEPTH: &str = "depth.ray";

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
    /// Values per pixel: 1, 3 or 4.
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

    /// Adds a layer of four channels that are no colour, such as identifiers; `pixels` holds `width · height` of them.
    pub fn push_raw(&mut self, name: &str, pixels: &[[f32; 4]]) {
        self.layers.push(Layer {
            name: name.into(),
            channels: 4,
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

    /// The layers' names in words, with commas.
    pub fn names(&self) -> String {
        let names: Vec<&str> = self.layers.iter().map(|layer| layer.name.as_str()).collect();
        names.join(", ")
    }

    /// The layer of that name, else the only one that means the same: other programs put the name of a view layer before
    /// a pass's (`ViewLayer.DiffDir`) and call the beauty `Combined` or `rgba`.
    pub fn find(&self, name: &str) -> Option<&Layer> {
        let named = self.layer(name);
        named.or_else(|| {
            let mut alike = self.layers.iter().filter(|layer| pass(&layer.name) == pass(name));
            alike.next().filter(|_| alike.next().is_none())
        })
    }

    /// The layer of that name as an RGB image; a single channel becomes grey.
    pub fn rgb(&self, name: &str) -> Option<FloatImage> {
        let layer = self.layer(name)?;
        let pixels = match layer.channels {
            3 => layer.data.as_chunks::<3>().0.to_vec(),
            4 => (layer.data.as_chunks::<4>().0.iter())
                .map(|&[r, g, b, _]| [r, g, b])
                .collect(),
            _ => layer.data.iter().map(|&v| [v; 3]).collect(),
        };
        Some(FloatImage {
            width: self.width,
            height: self.height,
            pixels,
        })
    }
}

/// What a layer holds, in relight's word for it where there is one: the part of its name behind the view layer's. Lights'
/// layers keep their whole name.
fn pass(name: &str) -> String {
    if name.starts_with("light.") {
        return name.to_owned();
    }
    let last = name.rsplit('.').next().unwrap_or(name).to_lowercase();
    let word = match last.as_str() {
        "combined" | "rgba" | "rgb" | "composite" | "color" => BEAUTY,
        "emit" => "emission",
        "n" => "normal",
        "z" => "depth",
        _ => return last,
    };
    word.to_owned()
}

/// Longest name of a light, bytes: OpenEXR's names have at most 255, of which `light.` and `.R` take 8.
const LONGEST_LIGHT: usize = 247;

/// The names that lights have in their layers' names, `light.NAME`: their own where they can. Dots and slashes, by which programs divide
/// layers' names, backslashes and control characters, line ends among them, become `_`; longer names are cut; and where another has
/// that name, they are numbered. All differ if `names` do.
pub fn light_layer_names(names: &[&str]) -> Vec<String> {
    let breaks = |c: char| matches!(c, '.' | '/' | '\\') || c.is_control();
    let fits = |name: &str| name.len() <= LONGEST_LIGHT && !name.contains(breaks);
    let mut taken: HashSet<String> = names.iter().filter(|n| fits(n)).map(|&n| n.to_owned()).collect();
    let name = |&name: &&str| {
        if fits(name) {
            return name.to_owned();
        }
        let clean = name.replace(breaks, "_");
        let cut = |ending: &str| {
            let end = clean.floor_char_boundary(LONGEST_LIGHT - ending.len());
            format!("{}{ending}", &clean[..end])
        };
        let endings = (1u64..).map(|number| format!("~{number}"));
        let mut candidates = std::iter::once(String::new()).chain(endings).map(|e| cut(&e));
        // There are more numbers than names.
        let free = candidates.find(|name| taken.insert(name.clone()));
        free.unwrap_or_default()
    };
    names.iter().map(name).collect()
}

/// Checks that two images can be compared.
pub(crate) fn check_pair(test: &FloatImage, reference: &FloatImage) -> Result<(), ImageError> {
    for (what, image) in [("test image", test), ("reference image", reference)] {
        let FloatImage {
            width,
            height,
            pixels,
        } = image;
        if pixels.is_empty() || width.checked_mul(*height) != Some(pixels.len()) {
            let detail = format!("{width} × {height} pixels in an array of {}", pixels.len());
            return Err(ImageError::invalid(what, detail));
        }
        let bad = pixels.as_flattened().iter().filter(|v| !v.is_finite()).count();
        if bad > 0 {
            let detail =
                format!("{bad} values are NaN or infinite; no error measure is meaningful with them");
            return Err(ImageError::invalid(what, detail));
        }
    }
    if (test.width, test.height) != (reference.width, reference.height) {
        let detail = format!(
            "{} × {} pixels, but the reference has {} × {}; render both at one size",
            test.width, test.height, reference.width, reference.height
        );
        return Err(ImageError::invalid("test image", detail));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_names_of_lights_are_cut_and_stay_different() {
        let long = "x".repeat(300);
        let wide = "\u{1f4a1}".repeat(80);
        let other = format!("{long}y");
        let cut = "x".repeat(247);
        let names = ["lamp", "key left", &long, &other, &wide, "a\0b", "a_b", &cut];
        let layers = light_layer_names(&names);
        assert_eq!(layers[..2], ["lamp", "key left"]);
        assert_eq!(
            (layers[2].as_str(), layers[7].as_str()),
            (&*format!("{}~1", "x".repeat(245)), &*cut)
        );
        assert_eq!(layers[3], format!("{}~2", "x".repeat(245)));
        assert_eq!(layers[4], "\u{1f4a1}".repeat(61));
        assert_eq!(layers[5..7], ["a_b~1", "a_b"]);
        assert_eq!(layers.iter().collect::<HashSet<_>>().len(), names.len());
        assert!(layers.iter().all(|name| name.len() <= LONGEST_LIGHT));
    }

    #[test]
    fn what_divides_names_of_layers_is_no_part_of_a_lights() {
        let names = [
            "key.left",
            "key/left",
            "key_left",
            "a\nb",
            "up\\down",
            "Über lamp",
        ];
        let layers = light_layer_names(&names);
        assert_eq!(
            layers,
            [
                "key_left~1",
                "key_left~2",
                "key_left",
                "a_b",
                "up_down",
                "Über lamp"
            ]
        );
    }
}
