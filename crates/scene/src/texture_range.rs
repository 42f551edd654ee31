//! The darkest and the brightest luminance of a texture within a box of texture coordinates.

use crate::environment::luminance;
use crate::material::Wrap;
use crate::texture::DecodedTexture;
use glam::{DVec2, Vec3};
use std::ops::RangeInclusive;

/// Texels by which boxes are widened: coordinates are rounded before they are looked up.
const MARGIN: f64 = 0.01;

/// Cells along an axis that a lookup asks at most, or a few more.
const CELLS: usize = 4;

/// Least and most luminance of a texture times a colour, for boxes of any size in a bounded number of steps.
pub(crate) struct TextureRange<'a> {
    texture: &'a DecodedTexture,
    /// RGB factor on the texels.
    factor: Vec3,
    /// From level to level half as wide and high; the first has a cell for four texels.
    levels: Vec<Level>,
}

struct Level {
    width: usize,
    cells: Vec<[f32; 2]>,
}

impl<'a> TextureRange<'a> {
    /// Of an sRGB texture.
    pub fn new(texture: &'a DecodedTexture, factor: Vec3) -> TextureRange<'a> {
        let mut range = TextureRange {
            texture,
            factor,
            levels: Vec::new(),
        };
        let (mut width, mut height) = range.size();
        while width > 1 || height > 1 {
            let (columns, rows) = (width.div_ceil(2), height.div_ceil(2));
            let cell = |i: usize| {
                let (x, y) = (2 * (i % columns), 2 * (i / columns));
                range.among(
                    range.levels.len(),
                    x..=(x + 1).min(width - 1),
                    y..=(y + 1).min(height - 1),
                )
            };
            let cells = (0..columns * rows).map(cell).collect();
            range.levels.push(Level {
                width: columns,
                cells,
            });
            (width, height) = (columns, rows);
        }
        range
    }

    fn size(&self) -> (usize, usize) {
        let (width, height) = self.texture.size();
        (width as usize, height as usize)
    }

    /// Least and most luminance of lookups with coordinates from `low` to `high`.
    pub fn within(&self, low: DVec2, high: DVec2) -> [f32; 2] {
        let (width, height) = self.size();
        let axis = |k: usize, size: usize| {
            let texels = |at: f64| at * size as f64 - if self.texture.is_nearest() { 0.0 } else { 0.5 };
            let more = if self.texture.is_nearest() { 0.0 } else { 1.0 };
            let first = (texels(low[k]) - MARGIN).floor();
            let last = (texels(high[k]) + MARGIN).floor() + more;
            wrapped(first, last, size, self.texture.wrap()[k])
        };
        let (columns, rows) = (axis(0, width), axis(1, height));
        let mut all: Option<[f32; 2]> = None;
        for x in columns.iter().flatten() {
            for y in rows.iter().flatten() {
                let longest = (x.end() - x.start()).max(y.end() - y.start()) + 1;
                let level = (longest / CELLS)
                    .checked_ilog2()
                    .map_or(0, |log| log as usize + 1);
                let level = level.min(self.levels.len());
                let at = |r: &RangeInclusive<usize>| (r.start() >> level)..=(r.end() >> level);
                let part = self.among(level, at(x), at(y));
                all = Some(all.map_or(part, |all| both(all, part)));
            }
        }
        all.unwrap_or([0.0; 2])
    }

    /// Among cells of a level; level 0 are the texels.
    fn among(&self, level: usize, columns: RangeInclusive<usize>, rows: RangeInclusive<usize>) -> [f32; 2] {
        let mut all = [f32::INFINITY, 0.0];
        for y in rows {
            for x in columns.clone() {
                let cell = match level.checked_sub(1) {
                    None => [luminance(self.factor * self.texture.linear_texel(x, y)); 2],
                    Some(k) => self.levels[k].cells[y * self.levels[k].width + x],
                };
                all = both(all, cell);
            }
        }
        all
    }
}

fn both(a: [f32; 2], b: [f32; 2]) -> [f32; 2] {
    [a[0].min(b[0]), a[1].max(b[1])]
}

/// The texels of a row that those from `first` to `last` are, wherever these lie: one run, or two.
fn wrapped(first: f64, last: f64, size: usize, wrap: Wrap) -> [Option<RangeInclusive<usize>>; 2] {
    let (whole, width) = (0..=size - 1, size as f64);
    if !(first.is_finite() && last.is_finite()) {
        return [Some(whole), None];
    }
    let clamped = |at: f64| at.clamp(0.0, width - 1.0) as usize;
    let long = last - first >= width - 1.0;
    match wrap {
        Wrap::Clamp => [Some(clamped(first)..=clamped(last)), None],
        _ if long => [Some(whole), None],
        Wrap::Repeat => {
            let (first, last) = (first.rem_euclid(width) as usize, last.rem_euclid(width) as usize);
            if first <= last {
                [Some(first..=last), None]
            } else {
                [Some(first..=size - 1), Some(0..=last)]
            }
        }
        Wrap::Mirror => {
            let fold = |at: f64| {
                let at = at.rem_euclid(2.0 * width);
                clamped(at.min(2.0 * width - 1.0 - at))
            };
            let (a, b) = (fold(first), fold(last));
            let (low, high) = (a.min(b), a.max(b));
            let turn = |at: f64| (at / width).floor();
            if turn(first) == turn(last) {
                [Some(low..=high), None]
            } else if turn(last).rem_euclid(2.0) == 0.0 {
                // Around a place where the image begins.
                [Some(0..=high), None]
            } else {
                [Some(low..=size - 1), None]
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::Texture;
    use crate::texture::{ColorSpace, decode_texture, png};
    use glam::Vec2;

    /// Truth: lookups at many places within a box lie within its range, which is no wider than a few texels around
    /// allow: equal ends where the texture is plain there.
    #[test]
    fn lookups_within_a_box_are_within_its_range() {
        let (width, height) = (13, 6);
        let pixels: Vec<[u8; 4]> = (0..width * height)
            .map(|i| {
                if i == 30 {
                    [255, 200, 90, 255]
                } else {
                    [(i % 3) as u8; 4]
                }
            })
            .collect();
        for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
            for nearest in [false, true] {
                let texture = Texture {
                    name: String::new(),
                    encoded: png(width, height, &pixels),
                    wrap: [wrap; 2],
                    nearest,
                };
                let texture = decode_texture(&texture, 0).unwrap();
                let factor = Vec3::new(1.0, 2.0, 0.5);
                let range = TextureRange::new(&texture, factor);
                for i in 0..2000u32 {
                    let number = |k: u32| f64::from((i * 7 + k).wrapping_mul(2_654_435_769)) / 2f64.powi(32);
                    let low = DVec2::new(number(0), number(1)) * 6.0 - 3.0;
                    let size = DVec2::new(number(2), number(3)).powf(4.0);
                    let [least, most] = range.within(low, low + size);
                    for j in 0..16 {
                        let at = low + size * DVec2::new(f64::from(j % 4) / 3.0, f64::from(j / 4) / 3.0);
                        let texel = texture.sample(Vec2::new(at.x as f32, at.y as f32), ColorSpace::Srgb);
                        let value = luminance(factor * texel.truncate());
                        let slack = 1e-5 * most;
                        assert!(
                            (least - slack..=most + slack).contains(&value),
                            "{value} {least} {most}"
                        );
                    }
                }
                assert!(
                    range.within(DVec2::ZERO, DVec2::ONE)[1] > 1.0,
                    "the bright texel is found"
                );
                let [least, most] = range.within(DVec2::new(0.7, 0.8), DVec2::new(0.72, 0.82));
                assert!(most < 1e-2 && least >= 0.0, "far from it, it is not");
            }
        }
    }
}
