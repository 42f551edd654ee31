//! Decoded textures and their lookup: wrap modes, nearest and bilinear filtering, sRGB to linear.
//!
//! Source: glTF 2.0 section 3.8 (samplers) and KHR_texture_transform (applied by [`TextureUse`]). Texel (0, 0)
//! is the top left one and texture coordinate (0, 0) its top left corner. sRGB texels are linearised before
//! they are filtered, as graphics hardware does. No mip maps: renderers average over pixels themselves.
//! Texels are kept as the 8 bits per channel that glTF asks for; 16-bit PNGs are rounded to 8.

use crate::image::{Image8, ImageError, Limits, decode_ldr};
use crate::material::{Texture, TextureUse, Wrap};
use glam::{Vec2, Vec3, Vec4};
use std::sync::LazyLock;

/// A texture in memory, ready for lookups.
#[derive(Clone, Debug)]
pub struct DecodedTexture {
    width: u32,
    height: u32,
    /// 1 grey, 2 grey and alpha, 3 RGB, 4 RGB and alpha.
    channels: u8,
    /// Row by row from the top, `channels` bytes a texel.
    texels: Vec<u8>,
    wrap: [Wrap; 2],
    nearest: bool,
}

/// What the colour channels of a texel mean; alpha is linear in either case.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColorSpace {
    /// Numbers as they are.
    Linear,
    /// Encoded by the transfer function of IEC 61966-2-1.
    Srgb,
}

/// Decodes texture number `index` of a scene.
///
/// # Errors
/// The bytes are no PNG, JPEG or WebP, are damaged, or the image is too large; the message names the
/// texture.
pub fn decode_texture(texture: &Texture, index: usize) -> Result<DecodedTexture, ImageError> {
    let name = format!("texture {index} ('{}')", texture.name);
    let Image8 { width, height, rgba8 } = decode_ldr(&name, &texture.encoded, &Limits::default())?;
    // Only what carries information: grey maps and opaque colours are the most.
    let is_grey = rgba8.iter().all(|&[r, g, b, _]| r == g && g == b);
    let is_opaque = rgba8.iter().all(|&[.., a]| a == 255);
    let (channels, texels) = match (is_grey, is_opaque) {
        (true, true) => (1, rgba8.iter().map(|texel| texel[0]).collect()),
        (true, false) => (2, rgba8.iter().flat_map(|&[grey, .., a]| [grey, a]).collect()),
        (false, true) => (3, rgba8.iter().flat_map(|&[r, g, b, _]| [r, g, b]).collect()),
        (false, false) => (4, rgba8.into_flattened()),
    };
    Ok(DecodedTexture {
        // The limits keep both sides far below 2³².
        width: width as u32,
        height: height as u32,
        channels,
        texels,
        wrap: texture.wrap,
        nearest: texture.nearest,
    })
}

/// Linear value of each of the 256 sRGB codes.
static LINEAR_FROM_SRGB: LazyLock<[f32; 256]> = LazyLock::new(|| {
    std::array::from_fn(|code| {
        let s = code as f64 / 255.0;
        let linear = if s <= 0.04045 {
            s / 12.92
        } else {
            ((s + 0.055) / 1.055).powf(2.4)
        };
        linear as f32
    })
});

/// Linear value of each of the 256 linear codes.
static LINEAR_FROM_UNORM: LazyLock<[f32; 256]> =
    LazyLock::new(|| std::array::from_fn(|code| code as f32 / 255.0));

impl DecodedTexture {
    /// Width and height in texels.
    pub fn size(&self) -> (u32, u32) {
        (self.width, self.height)
    }

    /// Whether any texel is other than opaque.
    pub fn has_alpha(&self) -> bool {
        matches!(self.channels, 2 | 4)
    }

    /// How coordinates beyond the image are brought back, across and down.
    pub(crate) fn wrap(&self) -> [Wrap; 2] {
        self.wrap
    }

    /// Whether lookups take the nearest texel and do not interpolate.
    pub(crate) fn is_nearest(&self) -> bool {
        self.nearest
    }

    /// Linear RGB of a texel of an sRGB texture.
    ///
    /// # Panics
    /// It lies outside the image.
    pub(crate) fn linear_texel(&self, x: usize, y: usize) -> Vec3 {
        let texel = match self.channels {
            1 => DecodedTexture::texel::<1>,
            2 => DecodedTexture::texel::<2>,
            3 => DecodedTexture::texel::<3>,
            _ => DecodedTexture::texel::<4>,
        };
        texel(self, x, y, &LINEAR_FROM_SRGB).truncate()
    }

    /// The value at texture coordinates `uv`: linear RGB and alpha, each in 0..=1. A grey texture has three
    /// equal channels; alpha is 1 where the texture has none. Coordinates that are not finite count as 0.
    pub fn sample(&self, uv: Vec2, space: ColorSpace) -> Vec4 {
        let u = reduce(uv.x, self.wrap[0]) * self.width as f32;
        let v = reduce(uv.y, self.wrap[1]) * self.height as f32;
        let table = match space {
            ColorSpace::Linear => &*LINEAR_FROM_UNORM,
            ColorSpace::Srgb => &*LINEAR_FROM_SRGB,
        };
        match self.channels {
            1 => self.filtered::<1>(u, v, table),
            2 => self.filtered::<2>(u, v, table),
            3 => self.filtered::<3>(u, v, table),
            // decode_texture makes 1 to 4 channels only.
            _ => self.filtered::<4>(u, v, table),
        }
    }

    /// The value at a place in texels, of a texture of so many channels.
    #[inline]
    fn filtered<const CHANNELS: usize>(&self, u: f32, v: f32, table: &[f32; 256]) -> Vec4 {
        let column = |x: i32| wrap_index(x, self.width, self.wrap[0]);
        let row = |y: i32| wrap_index(y, self.height, self.wrap[1]);
        let texel = |x: usize, y: usize| self.texel::<CHANNELS>(x, y, table);
        if self.nearest {
            return texel(column(floor(u) as i32), row(floor(v) as i32));
        }
        // Texel centres lie at half integers.
        let (x, y) = (u - 0.5, v - 0.5);
        let (x0, y0) = (floor(x), floor(y));
        let (fx, fy) = (x - x0, y - y0);
        let [left, right] = [x0 as i32, x0 as i32 + 1].map(column);
        let [upper, lower] = [y0 as i32, y0 as i32 + 1].map(row);
        let top = texel(left, upper) * (1.0 - fx) + texel(right, upper) * fx;
        let bottom = texel(left, lower) * (1.0 - fx) + texel(right, lower) * fx;
        top * (1.0 - fy) + bottom * fy
    }

    /// The value where `usage` looks the texture up for the mesh's coordinates `uv`.
    pub fn sample_at(&self, usage: &TextureUse, uv: Vec2, space: ColorSpace) -> Vec4 {
        self.sample(usage.texture_from_mesh.transform_point2(uv), space)
    }

    #[inline]
    fn texel<const CHANNELS: usize>(&self, x: usize, y: usize, table: &[f32; 256]) -> Vec4 {
        let at = (y * self.width as usize + x) * CHANNELS;
        let bytes = &self.texels[at..at + CHANNELS];
        let color = |i: usize| table[usize::from(bytes[i])];
        let alpha = |i: usize| f32::from(bytes[i]) / 255.0;
        match CHANNELS {
            1 => Vec3::splat(color(0)).extend(1.0),
            2 => Vec3::splat(color(0)).extend(alpha(1)),
            3 => Vec4::new(color(0), color(1), color(2), 1.0),
            _ => Vec4::new(color(0), color(1), color(2), alpha(3)),
        }
    }
}

/// [`f32::floor`], which is a call on processors that compilers must reckon with. What is larger than 2²³ is whole.
#[inline]
fn floor(x: f32) -> f32 {
    if x.abs() >= (1 << 23) as f32 {
        return x;
    }
    let truncated = x as i32 as f32;
    if truncated > x { truncated - 1.0 } else { truncated }
}

/// Brings a coordinate into one period of its wrap mode, so that large coordinates keep their fraction and
/// the texel index fits an integer.
fn reduce(coordinate: f32, wrap: Wrap) -> f32 {
    if !coordinate.is_finite() {
        return 0.0;
    }
    match wrap {
        Wrap::Repeat => coordinate - floor(coordinate),
        Wrap::Mirror => coordinate - 2.0 * floor(coordinate * 0.5),
        Wrap::Clamp => coordinate.clamp(0.0, 1.0),
    }
}

/// Index of the texel at `index`, which is at most one off the period that [`reduce`] leaves.
fn wrap_index(index: i32, size: u32, wrap: Wrap) -> usize {
    let size = size as i32;
    let wrapped = match wrap {
        Wrap::Repeat if index < 0 => index + size,
        Wrap::Repeat if index >= size => index - size,
        Wrap::Repeat => index,
        Wrap::Mirror => {
            let folded = index.rem_euclid(2 * size);
            folded.min(2 * size - 1 - folded)
        }
        Wrap::Clamp => index.clamp(0, size - 1),
    };
    wrapped as usize
}

/// PNG bytes of RGBA pixels.
#[cfg(test)]
pub(crate) fn png(width: u32, height: u32, pixels: &[[u8; 4]]) -> Vec<u8> {
    let mut encoded = std::io::Cursor::new(Vec::new());
    image::RgbaImage::from_raw(width, height, pixels.as_flattened().to_vec())
        .unwrap()
        .write_to(&mut encoded, image::ImageFormat::Png)
        .unwrap();
    encoded.into_inner()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Affine2;

    fn texture(width: u32, height: u32, pixels: &[[u8; 4]], wrap: Wrap, nearest: bool) -> DecodedTexture {
        let encoded = png(width, height, pixels);
        let texture = Texture {
            name: "test".into(),
            encoded,
            wrap: [wrap; 2],
            nearest,
        };
        decode_texture(&texture, 0).unwrap()
    }

    const BLACK: [u8; 4] = [0, 0, 0, 255];
    const WHITE: [u8; 4] = [255, 255, 255, 255];

    /// Truth: IEC 61966-2-1 at code 188 is 0.5029; bilinear weights by hand. Averaging before linearising
    /// would give 0.2140 in the middle of black and white.
    #[test]
    fn srgb_is_linearised_before_filtering() {
        let t = texture(2, 1, &[BLACK, WHITE], Wrap::Clamp, false);
        let middle = t.sample(Vec2::new(0.5, 0.5), ColorSpace::Srgb);
        assert!((middle.x - 0.5).abs() < 1e-6, "{middle}");
        let grey = texture(1, 1, &[[188, 188, 188, 51]], Wrap::Clamp, false);
        let value = grey.sample(Vec2::ZERO, ColorSpace::Srgb);
        assert!((value.x - 0.50289).abs() < 1e-5, "{value}");
        assert!((value.w - 0.2).abs() < 1e-6, "alpha is linear: {value}");
        assert!((grey.sample(Vec2::ZERO, ColorSpace::Linear).x - 188.0 / 255.0).abs() < 1e-6);
    }

    /// Truth: the definition of the three wrap modes on a texture of two texels, at texel centres.
    #[test]
    fn wrap_modes_tile_mirror_and_clamp() {
        let at = |wrap, u: f32| {
            let t = texture(2, 1, &[BLACK, WHITE], wrap, true);
            t.sample(Vec2::new(u, 0.5), ColorSpace::Linear).x
        };
        // Texel centres of three tiles: -0.75, -0.25 | 0.25, 0.75 | 1.25, 1.75.
        let row = |wrap| [-0.75, -0.25, 0.25, 0.75, 1.25, 1.75].map(|u| at(wrap, u));
        assert_eq!(row(Wrap::Repeat), [0.0, 1.0, 0.0, 1.0, 0.0, 1.0]);
        assert_eq!(row(Wrap::Mirror), [1.0, 0.0, 0.0, 1.0, 1.0, 0.0]);
        assert_eq!(row(Wrap::Clamp), [0.0, 0.0, 0.0, 1.0, 1.0, 1.0]);
    }

    /// A bilinear lookup across a tile's border mixes the last with the first texel when the texture
    /// repeats, and the last with itself otherwise.
    #[test]
    fn filtering_crosses_the_border_of_a_tile() {
        for (wrap, expected) in [(Wrap::Repeat, 0.5), (Wrap::Mirror, 1.0), (Wrap::Clamp, 1.0)] {
            let t = texture(2, 1, &[BLACK, WHITE], wrap, false);
            let value = t.sample(Vec2::new(1.0, 0.5), ColorSpace::Linear).x;
            assert!((value - expected).abs() < 1e-6, "{wrap:?}: {value}");
        }
    }

    /// Texel (0, 0) is at the top left: rows go down with v.
    #[test]
    fn row_zero_is_at_v_zero() {
        let t = texture(1, 2, &[WHITE, BLACK], Wrap::Repeat, false);
        assert_eq!(t.sample(Vec2::new(0.5, 0.25), ColorSpace::Linear).x, 1.0);
        assert_eq!(t.sample(Vec2::new(0.5, 0.75), ColorSpace::Linear).x, 0.0);
    }

    /// KHR_texture_transform maps the mesh's coordinates before the lookup.
    #[test]
    fn texture_transform_moves_the_lookup() {
        let t = texture(2, 1, &[BLACK, WHITE], Wrap::Repeat, true);
        let usage = TextureUse {
            texture: 0,
            uv_set: 0,
            texture_from_mesh: Affine2::from_translation(Vec2::new(0.5, 0.0)),
        };
        assert_eq!(
            t.sample_at(&usage, Vec2::new(0.25, 0.5), ColorSpace::Linear).x,
            1.0
        );
    }

    #[test]
    fn coordinates_of_any_size_stay_inside() {
        for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
            for nearest in [false, true] {
                let t = texture(2, 2, &[BLACK, WHITE, BLACK, WHITE], wrap, nearest);
                for c in [
                    f32::NAN,
                    f32::INFINITY,
                    1e30,
                    -1e30,
                    -1e-30,
                    1e-45,
                    -1.0,
                    1.0,
                    2.0,
                ] {
                    for other in [0.0, c] {
                        assert!(t.sample(Vec2::new(c, other), ColorSpace::Linear).is_finite());
                    }
                }
            }
        }
    }

    #[test]
    fn a_damaged_texture_is_named() {
        let texture = Texture {
            name: "bricks".into(),
            encoded: vec![1, 2, 3],
            wrap: [Wrap::Repeat; 2],
            nearest: false,
        };
        let message = decode_texture(&texture, 7).unwrap_err().to_string();
        assert!(message.contains("texture 7 ('bricks')"), "{message}");
    }
}
