//! Plots as pixels: plotters draws lines and circles, letters are ours, so that no font is needed.

use plotters::prelude::DrawingBackend;
use plotters_backend::text_anchor::{HPos, VPos};
use plotters_backend::{
    BackendColor, BackendCoord, BackendStyle, BackendTextStyle, DrawingErrorKind, FontTransform,
};
use relight_scene::image::Image8;
use std::convert::Infallible;

/// Pixels of a plot per unit of its drawing, so that lines are smooth to look at and letters large enough.
pub const SCALE: u32 = 2;
/// Columns and rows of a letter, and columns to the next.
const LETTER: (i32, i32) = (5, 7);
const ADVANCE: i32 = 6;
/// Pixels of a dot of a letter.
const DOT: i32 = SCALE as i32;

/// A picture that plotters draws on, `SCALE` times as large as the drawing.
pub struct Bitmap<'a>(pub &'a mut Image8);

impl Bitmap<'_> {
    fn blend(&mut self, (x, y): (i32, i32), color: BackendColor) {
        let image = &mut *self.0;
        let inside = x >= 0 && y >= 0 && (x as usize) < image.width && (y as usize) < image.height;
        if !inside {
            return;
        }
        let (r, g, b) = color.rgb;
        let pixel = &mut image.rgba8[y as usize * image.width + x as usize];
        for (old, new) in pixel.iter_mut().zip([r, g, b]) {
            *old = (f64::from(*old) + (f64::from(new) - f64::from(*old)) * color.alpha).round() as u8;
        }
    }
}

/// A white picture for a drawing of this size.
pub fn white(size: (u32, u32)) -> Image8 {
    let (width, height) = ((size.0 * SCALE) as usize, (size.1 * SCALE) as usize);
    Image8 {
        width,
        height,
        rgba8: vec![[255; 4]; width * height],
    }
}

impl DrawingBackend for Bitmap<'_> {
    type ErrorType = Infallible;

    fn get_size(&self) -> (u32, u32) {
        (self.0.width as u32, self.0.height as u32)
    }

    fn ensure_prepared(&mut self) -> Result<(), DrawingErrorKind<Infallible>> {
        Ok(())
    }

    fn present(&mut self) -> Result<(), DrawingErrorKind<Infallible>> {
        Ok(())
    }

    fn draw_pixel(
        &mut self,
        point: BackendCoord,
        color: BackendColor,
    ) -> Result<(), DrawingErrorKind<Infallible>> {
        self.blend(point, color);
        Ok(())
    }

    fn draw_text<S: BackendTextStyle>(
        &mut self,
        text: &str,
        style: &S,
        (x, y): BackendCoord,
    ) -> Result<(), DrawingErrorKind<Infallible>> {
        let (width, height) = (extent(text), LETTER.1 * DOT);
        let anchor = style.anchor();
        let left = match anchor.h_pos {
            HPos::Left => 0,
            HPos::Center => -width / 2,
            HPos::Right => -width,
        };
        let top = match anchor.v_pos {
            VPos::Top => 0,
            VPos::Center => -height / 2,
            VPos::Bottom => -height,
        };
        let color = style.color();
        for (i, letter) in text.chars().enumerate() {
            let rows = GLYPHS.iter().find(|g| g.0 == letter).map_or([0; 7], |g| g.1);
            for (row, bits) in (0..).zip(rows) {
                for column in (0..LETTER.0).filter(|c| bits >> (LETTER.0 - 1 - c) & 1 != 0) {
                    for dot in 0..DOT * DOT {
                        let along = left + (i as i32 * ADVANCE + column) * DOT + dot % DOT;
                        let (dx, dy) = style.transform().transform(along, top + row * DOT + dot / DOT);
                        self.blend((x + dx, y + dy), color);
                    }
                }
            }
        }
        Ok(())
    }

    fn estimate_text_size<S: BackendTextStyle>(
        &self,
        text: &str,
        style: &S,
    ) -> Result<(u32, u32), DrawingErrorKind<Infallible>> {
        let (width, height) = (extent(text) as u32, (LETTER.1 * DOT) as u32);
        Ok(match style.transform() {
            FontTransform::None | FontTransform::Rotate180 => (width, height),
            FontTransform::Rotate90 | FontTransform::Rotate270 => (height, width),
        })
    }

    fn draw_path<S: BackendStyle, I: IntoIterator<Item = BackendCoord>>(
        &mut self,
        path: I,
        style: &S,
    ) -> Result<(), DrawingErrorKind<Infallible>> {
        // Lines as wide as their style says, piece by piece: plotters' own path fills polygons between them.
        let mut last = None;
        for point in path {
            if let Some(last) = last {
                self.draw_line(last, point, style)?;
            }
            last = Some(point);
        }
        Ok(())
    }
}

fn extent(text: &str) -> i32 {
    (text.chars().count() as i32 * ADVANCE - 1).max(0) * DOT
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
    use plotters::prelude::*;

    /// Truth: counted by hand. An l has 10 dots of 2 × 2 pixels, and stands where it is put.
    #[test]
    fn letters_are_drawn_where_they_are_put() {
        let mut image = white((20, 20));
        let root = Bitmap(&mut image).into_drawing_area();
        let style = ("sans-serif", 10).into_font().color(&BLACK);
        root.draw_text("l", &style, (4, 6)).unwrap();
        drop(root);
        let dark: Vec<usize> = (0..image.rgba8.len())
            .filter(|&i| image.rgba8[i][0] == 0)
            .collect();
        assert_eq!(dark.len(), 4 * 10);
        let rows: Vec<usize> = dark.iter().map(|i| i / image.width).collect();
        assert_eq!((rows.iter().min(), rows.iter().max()), (Some(&6), Some(&19)));
    }

    #[test]
    fn every_letter_of_our_labels_is_there() {
        for text in [
            "relative error (root of relMSE)",
            "ms a frame",
            "seconds of bake",
            "MB",
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
