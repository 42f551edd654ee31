//! Plots as pixels: lines and circles by how much of each pixel they cover, letters of our own, so that no font is needed.

use super::shape::{Anchor, Color};
use relight_scene::image::Image8;

/// Pixels of a plot per unit of its drawing, so that lines are smooth to look at and letters large enough.
pub const SCALE: u32 = 2;
/// Columns and rows of a letter, and columns to the next.
const LETTER: (i32, i32) = (5, 7);
const ADVANCE: i32 = 6;
/// Pixels of a dot of a letter.
const DOT: i32 = SCALE as i32;
/// Width of a ring, pixels.
const RING: f64 = 3.0;

/// A picture that is drawn on, `SCALE` times as large as the drawing.
pub struct Bitmap<'a>(pub &'a mut Image8);

/// A white picture for a drawing of this size.
pub fn white(size: (u32, u32)) -> Image8 {
    let (width, height) = ((size.0 * SCALE) as usize, (size.1 * SCALE) as usize);
    Image8 {
        width,
        height,
        rgba8: vec![[255; 4]; width * height],
    }
}

impl Bitmap<'_> {
    fn blend(&mut self, (x, y): (i32, i32), color: Color, cover: f64) {
        let image = &mut *self.0;
        let inside = x >= 0 && y >= 0 && (x as usize) < image.width && (y as usize) < image.height;
        if !inside || cover <= 0.0 {
            return;
        }
        let pixel = &mut image.rgba8[y as usize * image.width + x as usize];
        for (old, new) in pixel.iter_mut().zip(color) {
            *old = (f64::from(*old) + (f64::from(new) - f64::from(*old)) * cover).round() as u8;
        }
    }

    /// Colours what is nearer than 0 to a shape, whose edge is where `distance` is 0.
    fn fill(&mut self, low: [f64; 2], high: [f64; 2], color: Color, distance: impl Fn([f64; 2]) -> f64) {
        let from = low.map(|v| (v - 1.0).floor() as i32);
        let to = high.map(|v| (v + 1.0).ceil() as i32);
        for y in from[1].max(0)..=to[1].min(self.0.height as i32) {
            for x in from[0].max(0)..=to[0].min(self.0.width as i32) {
                let middle = [f64::from(x) + 0.5, f64::from(y) + 0.5];
                self.blend((x, y), color, (0.5 - distance(middle)).clamp(0.0, 1.0));
            }
        }
    }

    /// A line between two pixels' places.
    pub fn line(&mut self, from: [f64; 2], to: [f64; 2], width: f64, color: Color) {
        let along = [to[0] - from[0], to[1] - from[1]];
        let length = (along[0] * along[0] + along[1] * along[1]).max(1e-12);
        let (low, high) = (
            [0, 1].map(|i| from[i].min(to[i]) - width),
            [0, 1].map(|i| from[i].max(to[i]) + width),
        );
        self.fill(low, high, color, |p| {
            let by = [p[0] - from[0], p[1] - from[1]];
            let t = ((by[0] * along[0] + by[1] * along[1]) / length).clamp(0.0, 1.0);
            (by[0] - t * along[0]).hypot(by[1] - t * along[1]) - 0.5 * width
        });
    }

    /// A disk or a ring.
    pub fn dot(&mut self, at: [f64; 2], radius: f64, filled: bool, color: Color) {
        self.fill(
            at.map(|v| v - radius - RING),
            at.map(|v| v + radius + RING),
            color,
            |p| {
                let r = (p[0] - at[0]).hypot(p[1] - at[1]);
                match filled {
                    true => r - radius - 0.5 * RING,
                    false => (r - radius).abs() - 0.5 * RING,
                }
            },
        );
    }

    /// Letters on a base line; those that [`GLYPHS`] lacks stay empty.
    pub fn text(&mut self, at: [f64; 2], text: &str, anchor: Anchor, upwards: bool, color: Color) {
        let width = (text.chars().count() as i32 * ADVANCE - 1).max(0) * DOT;
        let left = match anchor {
            Anchor::Start => 0,
            Anchor::Middle => -width / 2,
            Anchor::End => -width,
        };
        let top = -LETTER.1 * DOT;
        let at = at.map(|v| v.round() as i32);
        for (i, letter) in text.chars().enumerate() {
            let rows = GLYPHS.iter().find(|g| g.0 == letter).map_or([0; 7], |g| g.1);
            for (row, bits) in (0..).zip(rows) {
                for column in (0..LETTER.0).filter(|c| bits >> (LETTER.0 - 1 - c) & 1 != 0) {
                    for dot in 0..DOT * DOT {
                        let along = left + (i as i32 * ADVANCE + column) * DOT + dot % DOT;
                        let down = top + row * DOT + dot / DOT;
                        let place = match upwards {
                            true => (at[0] + down, at[1] - along),
                            false => (at[0] + along, at[1] + down),
                        };
                        self.blend(place, color, 1.0);
                    }
                }
            }
        }
    }
}

/// Letters that plots use: the rows of each from the top, the leftmost column in the highest of five bits.
const GLYPHS: [(char, [u8; 7]); 50] = [
    ('%', [25, 26, 2, 4, 8, 11, 19]),
    ('\'', [4, 4, 8, 0, 0, 0, 0]),
    ('(', [2, 4, 8, 8, 8, 4, 2]),
    (')', [8, 4, 2, 2, 2, 4, 8]),
    ('+', [0, 4, 4, 31, 4, 4, 0]),
    (',', [0, 0, 0, 0, 12, 4, 8]),
    ('-', [0, 0, 0, 31, 0, 0, 0]),
    ('.', [0, 0, 0, 0, 0, 12, 12]),
    ('/', [1, 1, 2, 4, 8, 16, 16]),
    ('0', [14, 17, 19, 21, 25, 17, 14]),
    ('1', [4, 12, 4, 4, 4, 4, 14]),
    ('2', [14, 17, 1, 6, 8, 16, 31]),
    ('3', [30, 1, 1, 14, 1, 1, 30]),
    ('4', [2, 6, 10, 18, 31, 2, 2]),
    ('5', [31, 16, 30, 1, 1, 17, 14]),
    ('6', [6, 8, 16, 30, 17, 17, 14]),
    ('7', [31, 1, 2, 4, 8, 8, 8]),
    ('8', [14, 17, 17, 14, 17, 17, 14]),
    ('9', [14, 17, 17, 15, 1, 2, 12]),
    (':', [0, 12, 12, 0, 12, 12, 0]),
    ('B', [30, 17, 17, 30, 17, 17, 30]),
    ('E', [31, 16, 16, 30, 16, 16, 31]),
    ('M', [17, 27, 21, 21, 17, 17, 17]),
    ('S', [15, 16, 16, 14, 1, 1, 30]),
    ('a', [0, 0, 14, 1, 15, 17, 15]),
    ('b', [16, 16, 30, 17, 17, 17, 30]),
    ('c', [0, 0, 15, 16, 16, 16, 15]),
    ('d', [1, 1, 15, 17, 17, 17, 15]),
    ('e', [0, 0, 14, 17, 31, 16, 14]),
    ('f', [6, 8, 30, 8, 8, 8, 8]),
    ('g', [0, 15, 17, 17, 15, 1, 14]),
    ('h', [16, 16, 30, 17, 17, 17, 17]),
    ('i', [4, 0, 12, 4, 4, 4, 14]),
    ('j', [2, 0, 6, 2, 2, 18, 12]),
    ('k', [16, 16, 18, 20, 24, 20, 18]),
    ('l', [12, 4, 4, 4, 4, 4, 14]),
    ('m', [0, 0, 26, 21, 21, 21, 21]),
    ('n', [0, 0, 30, 17, 17, 17, 17]),
    ('o', [0, 0, 14, 17, 17, 17, 14]),
    ('p', [0, 30, 17, 17, 30, 16, 16]),
    ('q', [0, 15, 17, 17, 15, 1, 1]),
    ('r', [0, 0, 22, 24, 16, 16, 16]),
    ('s', [0, 0, 15, 16, 14, 1, 30]),
    ('t', [8, 8, 30, 8, 8, 8, 6]),
    ('u', [0, 0, 17, 17, 17, 17, 15]),
    ('v', [0, 0, 17, 17, 17, 10, 4]),
    ('w', [0, 0, 21, 21, 21, 21, 10]),
    ('x', [0, 0, 17, 10, 4, 10, 17]),
    ('y', [0, 17, 17, 10, 4, 8, 16]),
    ('z', [0, 0, 31, 2, 4, 8, 31]),
];

#[cfg(test)]
mod tests {
    use super::*;

    fn dark(image: &Image8) -> usize {
        image.rgba8.iter().filter(|p| p[0] == 0).count()
    }

    /// Truth: counted by hand. An l has 10 dots of 2 × 2 pixels, and stands on the line where it is put.
    #[test]
    fn letters_are_drawn_where_they_are_put() {
        for upwards in [false, true] {
            let mut image = white((20, 20));
            Bitmap(&mut image).text([20.0, 20.0], "l", Anchor::Start, upwards, [0; 3]);
            assert_eq!(dark(&image), 4 * 10);
            let places: Vec<(usize, usize)> = (0..image.rgba8.len())
                .filter(|&i| image.rgba8[i][0] == 0)
                .map(|i| (i % image.width, i / image.width))
                .collect();
            let rows = places.iter().map(|p| if upwards { p.0 } else { p.1 });
            assert_eq!((rows.clone().min(), rows.max()), (Some(6), Some(19)));
        }
    }

    /// Truth: the areas of a disk and of a rectangle.
    #[test]
    fn shapes_cover_their_area() {
        let covered = |draw: &dyn Fn(&mut Bitmap)| {
            let mut image = white((40, 40));
            draw(&mut Bitmap(&mut image));
            image
                .rgba8
                .iter()
                .map(|p| 1.0 - f64::from(p[0]) / 255.0)
                .sum::<f64>()
        };
        let disk = covered(&|b| b.dot([40.0, 40.0], 10.0, true, [0; 3]));
        let area = std::f64::consts::PI * (10.0 + 0.5 * RING).powi(2);
        assert!((disk / area - 1.0).abs() < 0.02, "{disk} {area}");
        let line = covered(&|b| b.line([10.0, 10.0], [70.0, 40.0], 4.0, [0; 3]));
        let area = 4.0 * 60f64.hypot(30.0) + std::f64::consts::PI * 4.0;
        assert!((line / area - 1.0).abs() < 0.03, "{line} {area}");
    }

    #[test]
    fn every_letter_of_our_labels_is_there() {
        for text in [
            "relative error (root of relMSE)",
            "milliseconds a frame",
            "seconds of bake",
            "size of the asset, MB",
            "0123456789. %",
            "reference's own error",
            "auto",
            "brute",
            "cuts",
            "lightcuts",
            "path",
            "pixelcuts",
            "transfer",
        ] {
            for letter in text.chars().filter(|c| *c != ' ') {
                assert!(GLYPHS.iter().any(|g| g.0 == letter), "{letter:?} of {text:?}");
            }
        }
    }
}
