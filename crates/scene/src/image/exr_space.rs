//! Where an OpenEXR file's pixels are and what its colours mean, for readers that want Rec. 709 over the display window.
//!
//! Sources: "Technical Introduction to OpenEXR" (windows, chromaticities), SMPTE RP 177 (primaries to matrix), Bradford's
//! cone responses as in Lam, "Metamerism and Colour Constancy" (1985), for another white point.

use super::error::ImageError;
use super::exr_header::REC_709;
use exr::math::Vec2;
use exr::meta::attribute::{Chromaticities, IntegerBounds};
use glam::{DMat3, DVec3};

/// Chromaticities that differ by less are those of Rec. 709 in other digits.
const SAME: f32 = 2e-4;

/// The matrix from a file's linear RGB to Rec. 709's; `None` where they are the same, as without the attribute.
///
/// # Errors
/// The chromaticities span no colours.
pub(super) fn rec_709_from(file: &str, from: Option<Chromaticities>) -> Result<Option<DMat3>, ImageError> {
    let Some(from) = from else { return Ok(None) };
    let list = |c: &Chromaticities| [c.red, c.green, c.blue, c.white];
    let same = |(a, b): (&Vec2<f32>, &Vec2<f32>)| (a.0 - b.0).abs() < SAME && (a.1 - b.1).abs() < SAME;
    if list(&from).iter().zip(&list(&REC_709)).all(same) {
        return Ok(None);
    }
    let matrix = (xyz_from_rgb(&REC_709).zip(xyz_from_rgb(&from))).map(|(to_xyz, from_xyz)| {
        let adapted = adaptation(white(&from), white(&REC_709));
        to_xyz.inverse() * adapted * from_xyz
    });
    match matrix {
        Some(matrix) if matrix.is_finite() => Ok(Some(matrix)),
        _ => Err(ImageError::invalid(
            file,
            format!("its attribute chromaticities spans no colours ({from:?}); write the image again"),
        )),
    }
}

/// A chromaticity as XYZ of luminance 1.
fn xyz(c: Vec2<f32>) -> DVec3 {
    let (x, y) = (f64::from(c.0), f64::from(c.1));
    DVec3::new(x, y, 1.0 - x - y) / y
}

fn white(c: &Chromaticities) -> DVec3 {
    xyz(c.white)
}

/// The matrix whose columns add up to the white point.
fn xyz_from_rgb(c: &Chromaticities) -> Option<DMat3> {
    let primary = |c: Vec2<f32>| {
        let (x, y) = (f64::from(c.0), f64::from(c.1));
        DVec3::new(x, y, 1.0 - x - y)
    };
    let primaries = DMat3::from_cols(primary(c.red), primary(c.green), primary(c.blue));
    // A millionth of the smallest gamut in use.
    if !primaries.is_finite() || primaries.determinant().abs() < 1e-8 || c.white.1 == 0.0 {
        return None;
    }
    let scale = primaries.inverse() * white(c);
    Some(primaries * DMat3::from_diagonal(scale))
}

/// Bradford adaptation from one white to another.
fn adaptation(from: DVec3, to: DVec3) -> DMat3 {
    let cone = DMat3::from_cols_array(&[
        0.8951, -0.7502, 0.0389, 0.2664, 1.7135, -0.0685, -0.1614, 0.0367, 1.0296,
    ]);
    cone.inverse() * DMat3::from_diagonal((cone * to) / (cone * from)) * cone
}

/// Where the pixels of a part lie in its display window.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Placement {
    /// Columns and rows of the part's data.
    pub size: (usize, usize),
    /// Of its first pixel, from the first one of the display window.
    pub at: (i64, i64),
    /// Columns and rows of the display window.
    pub window: (usize, usize),
}

impl Placement {
    pub fn new(size: Vec2<usize>, position: Vec2<i32>, window: IntegerBounds) -> Placement {
        let from = |a: i32, b: i32| i64::from(a) - i64::from(b);
        Placement {
            size: (size.0, size.1),
            at: (
                from(position.0, window.position.0),
                from(position.1, window.position.1),
            ),
            window: (window.size.0, window.size.1),
        }
    }

    /// Whether any pixel of the part is in the display window.
    pub fn is_seen(&self) -> bool {
        let overlaps = |at: i64, size: usize, window: usize| at < window as i64 && at + size as i64 > 0;
        overlaps(self.at.0, self.size.0, self.window.0) && overlaps(self.at.1, self.size.1, self.window.1)
    }

    /// Values of the display window, `channels` a pixel: the part's, 0 where it has none.
    pub fn placed(&self, values: Vec<f32>, channels: usize) -> Vec<f32> {
        if self.at == (0, 0) && self.size == self.window {
            return values;
        }
        let mut placed = vec![0.0; self.window.0 * self.window.1 * channels];
        let first = self.at.0.clamp(0, self.window.0 as i64);
        let end = (self.at.0 + self.size.0 as i64).clamp(first, self.window.0 as i64);
        for (row, values) in values.chunks_exact((self.size.0 * channels).max(1)).enumerate() {
            let y = self.at.1 + row as i64;
            if (0..self.window.1 as i64).contains(&y) && first < end {
                let to = (y as usize * self.window.0 + first as usize) * channels;
                let from = (first - self.at.0) as usize * channels;
                let count = (end - first) as usize * channels;
                placed[to..to + count].copy_from_slice(&values[from..from + count]);
            }
        }
        placed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ACES AP0 (SMPTE ST 2065-1).
    const AP0: Chromaticities = Chromaticities {
        red: Vec2(0.7347, 0.2653),
        green: Vec2(0.0, 1.0),
        blue: Vec2(0.0001, -0.077),
        white: Vec2(0.32168, 0.33767),
    };

    /// Truth: the matrix from AP0 to Rec. 709 with Bradford adaptation that the ACES transforms publish (4 digits).
    #[test]
    fn aces_colours_become_rec_709() {
        let matrix = rec_709_from("t", Some(AP0)).unwrap().unwrap();
        let published = DMat3::from_cols_array(&[
            2.5217, -0.2765, -0.0154, -1.1341, 1.3727, -0.1530, -0.3876, -0.0962, 1.1684,
        ]);
        assert!(matrix.abs_diff_eq(published, 1e-3), "{matrix}");
        // White stays white.
        assert!((matrix * DVec3::ONE).abs_diff_eq(DVec3::ONE, 1e-5));
        assert_eq!(rec_709_from("t", Some(REC_709)).unwrap(), None);
        let flat = Chromaticities {
            green: AP0.red,
            ..AP0
        };
        assert!(rec_709_from("t", Some(flat)).is_err());
    }

    /// Truth: by hand.
    #[test]
    fn data_windows_are_placed_and_cropped() {
        let place = |at, size, window| Placement { size, at, window };
        let values: Vec<f32> = vec![1.0, 2.0, 3.0, 4.0];
        let within = place((1, 0), (2, 2), (4, 3)).placed(values.clone(), 1);
        assert_eq!(within, [0., 1., 2., 0., 0., 3., 4., 0., 0., 0., 0., 0.]);
        let beyond = place((-1, -1), (2, 2), (2, 1)).placed(values.clone(), 1);
        assert_eq!(beyond, [4., 0.]);
        assert!(!place((5, 0), (2, 2), (4, 3)).is_seen());
        assert_eq!(place((5, 0), (2, 2), (1, 1)).placed(values, 1), [0.]);
    }
}
