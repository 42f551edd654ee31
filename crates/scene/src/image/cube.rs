//! Environment maps on the faces of a cube, made equirectangular: the vertical cross of `.hdr` files (the back below, upside
//! down), the horizontal cross, and the faces of OpenEXR's attribute `envmap` one below the other.
//!
//! A cross's middle face becomes the middle of the map. Source for OpenEXR's faces: "Technical Introduction to OpenEXR",
//! environment maps: +X, −X, +Y, −Y, +Z, −Z from the top, and a map's middle looks along +Z.

use super::error::{ImageError, Limits};
use super::layers::FloatImage;

/// How a cube's faces lie in an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Faces {
    /// Three columns, four rows.
    VerticalCross,
    /// Four columns, three rows.
    HorizontalCross,
    /// One column, six rows.
    Column,
}

/// The cross that an image shows, if it is one: its sides are as 3 to 4, and its corners hold nothing.
///
/// # Errors
/// The image is a row or column of six faces whose order nothing says.
pub(super) fn cross(file: &str, image: &FloatImage) -> Result<Option<Faces>, ImageError> {
    let (w, h) = (image.width, image.height);
    let Some(&nothing) = image.pixels.first() else {
        return Ok(None);
    };
    let faces = match () {
        () if w % 3 == 0 && w / 3 * 4 == h => Faces::VerticalCross,
        () if h % 3 == 0 && h / 3 * 4 == w => Faces::HorizontalCross,
        () if w == 6 * h || h == 6 * w => {
            let what = format!(
                "{w} × {h} pixels are six faces of a cube in an order that nothing says; \
                 convert the map to latitude and longitude"
            );
            return Err(ImageError::unsupported(file, what));
        }
        () => return Ok(None),
    };
    let side = w.min(h) / 3;
    let cells = faces.cells();
    let unused = |x: usize, y: usize| !cells.contains(&(x / side, y / side));
    // The first pixel lies in a corner of either cross.
    let uniform = (0..h).all(|y| (0..w).all(|x| !unused(x, y) || image.pixels[y * w + x] == nothing));
    Ok(uniform.then_some(faces))
}

impl Faces {
    /// Column and row of the front, right, left, top, bottom and back faces.
    fn cells(self) -> [(usize, usize); 6] {
        match self {
            Faces::VerticalCross => [(1, 1), (2, 1), (0, 1), (1, 0), (1, 2), (1, 3)],
            Faces::HorizontalCross => [(1, 1), (2, 1), (0, 1), (1, 0), (1, 2), (3, 1)],
            // +Z, −X, +X, +Y, −Y, −Z.
            Faces::Column => [(0, 4), (0, 1), (0, 0), (0, 2), (0, 3), (0, 5)],
        }
    }

    /// The face (as in [`Faces::cells`]) that a direction leads to, and where on it, from −1 to 1 to the right and down;
    /// `front`, `right` and `up` of the direction.
    fn place(self, [f, r, u]: [f64; 3]) -> (usize, f64, f64) {
        let most = f.abs().max(r.abs()).max(u.abs());
        let column = self == Faces::Column;
        if u.abs() == most {
            // OpenEXR turns both by half a turn: x is to the right, and −X is on the right of +Z.
            let turn = if column { -1.0 } else { 1.0 };
            return match u > 0.0 {
                true => (3, turn * r / most, turn * f / most),
                false => (4, turn * r / most, -turn * f / most),
            };
        }
        match () {
            () if f == most => (0, r / most, -u / most),
            () if r == most => (1, -f / most, -u / most),
            () if -r == most => (2, f / most, -u / most),
            // Below the bottom face the back stands on its head.
            () if self == Faces::VerticalCross => (5, r / most, u / most),
            () => (5, -r / most, -u / most),
        }
    }
}

/// The map of latitude and longitude that a cube holds: four faces wide, two high, bilinear on the faces.
///
/// # Errors
/// The image holds no six square faces, or the map would be over the limits.
pub(super) fn unfolded(
    file: &str,
    image: &FloatImage,
    faces: Faces,
    limits: &Limits,
) -> Result<FloatImage, ImageError> {
    let (columns, rows) = match faces {
        Faces::VerticalCross => (3, 4),
        Faces::HorizontalCross => (4, 3),
        Faces::Column => (1, 6),
    };
    let side = image.width / columns;
    if side == 0 || side * columns != image.width || side * rows != image.height {
        let what = format!(
            "{} × {} pixels hold no {columns} × {rows} square faces of a cube; write the map again",
            image.width, image.height
        );
        return Err(ImageError::invalid(file, what));
    }
    let (width, height) = (4 * side, 2 * side);
    limits.check(file, width as u64, height as u64, 12)?;
    let mut map = FloatImage::black(width, height);
    for (i, pixel) in map.pixels.iter_mut().enumerate() {
        let longitude =
            ((i % width) as f64 + 0.5) / width as f64 * std::f64::consts::TAU - std::f64::consts::PI;
        let latitude = (0.5 - ((i / width) as f64 + 0.5) / height as f64) * std::f64::consts::PI;
        let level = latitude.cos();
        let (face, x, y) = faces.place([level * longitude.cos(), level * longitude.sin(), latitude.sin()]);
        let (column, row) = faces.cells()[face];
        // OpenEXR's faces end at their outer pixels' middles, others' at their edges.
        let coordinate = |along: f64| match faces {
            Faces::Column => (along + 1.0) / 2.0 * (side - 1) as f64,
            _ => ((along + 1.0) / 2.0 * side as f64 - 0.5).clamp(0.0, (side - 1) as f64),
        };
        let (x, y) = (coordinate(x), coordinate(y));
        let (x0, y0) = ((x as usize).min(side - 1), (y as usize).min(side - 1));
        let (x1, y1) = ((x0 + 1).min(side - 1), (y0 + 1).min(side - 1));
        let (fx, fy) = ((x - x0 as f64) as f32, (y - y0 as f64) as f32);
        let at = |x: usize, y: usize| image.pixels[(row * side + y) * image.width + column * side + x];
        // A weight of 0 must not make NaN of an infinite texel.
        let mix = |a: f32, b: f32, t: f32| if t == 0.0 { a } else { a * (1.0 - t) + b * t };
        let [a, b, c, d] = [at(x0, y0), at(x1, y0), at(x0, y1), at(x1, y1)];
        *pixel = std::array::from_fn(|k| mix(mix(a[k], b[k], fx), mix(c[k], d[k], fx), fy));
    }
    Ok(map)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Colour of a direction, by which a face and its orientation can be told: its front, right and up.
    fn color(d: [f64; 3]) -> [f32; 3] {
        let length = d.iter().map(|x| x * x).sum::<f64>().sqrt();
        d.map(|x| (x / length + 1.0) as f32)
    }

    /// A cube whose faces are painted by hand with the direction that each pixel looks to; `corner` elsewhere.
    fn painted(faces: Faces, side: usize, corner: f32) -> FloatImage {
        let (columns, rows) = match faces {
            Faces::VerticalCross => (3, 4),
            Faces::HorizontalCross => (4, 3),
            Faces::Column => (1, 6),
        };
        let mut image = FloatImage::black(columns * side, rows * side);
        image.pixels.fill([corner; 3]);
        for (face, (column, row)) in faces.cells().into_iter().enumerate() {
            for i in 0..side * side {
                let along = |p: usize| match faces {
                    Faces::Column => p as f64 / (side - 1) as f64 * 2.0 - 1.0,
                    _ => (p as f64 + 0.5) / side as f64 * 2.0 - 1.0,
                };
                let (x, y) = (along(i % side), along(i / side));
                // Walking over the cross: what lies right of, below and behind the front face. OpenEXR's own table
                // (ImfEnvmap) for its faces, with front +Z, right −X and up +Y.
                let d = match (faces, face) {
                    (_, 0) => [1.0, x, -y],
                    (_, 1) => [-x, 1.0, -y],
                    (_, 2) => [x, -1.0, -y],
                    (Faces::Column, 3) => [-y, -x, 1.0],
                    (Faces::Column, 4) => [y, -x, -1.0],
                    (_, 3) => [y, x, 1.0],
                    (_, 4) => [-y, x, -1.0],
                    (Faces::VerticalCross, _) => [-1.0, x, y],
                    _ => [-1.0, -x, -y],
                };
                let at = (row * side + i / side) * image.width + column * side + i % side;
                image.pixels[at] = color(d);
            }
        }
        image
    }

    /// Truth: the direction that each pixel of a map of latitude and longitude looks to.
    #[test]
    fn every_direction_finds_its_place_on_the_cube() {
        for faces in [Faces::VerticalCross, Faces::HorizontalCross, Faces::Column] {
            let side = 32;
            let image = painted(faces, side, 0.0);
            if faces != Faces::Column {
                assert_eq!(cross("t", &image).unwrap(), Some(faces));
            }
            let map = unfolded("t", &image, faces, &Limits::default()).unwrap();
            assert_eq!((map.width, map.height), (128, 64));
            for (i, pixel) in map.pixels.iter().enumerate() {
                let longitude =
                    ((i % 128) as f64 + 0.5) / 128.0 * std::f64::consts::TAU - std::f64::consts::PI;
                let latitude =
                    std::f64::consts::FRAC_PI_2 - ((i / 128) as f64 + 0.5) / 64.0 * std::f64::consts::PI;
                let truth = color([
                    latitude.cos() * longitude.cos(),
                    latitude.cos() * longitude.sin(),
                    latitude.sin(),
                ]);
                // Half a texel at a face's edge, where the cross ends.
                for k in 0..3 {
                    assert!(
                        (pixel[k] - truth[k]).abs() < 0.04,
                        "{faces:?} {i}: {pixel:?} for {truth:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn what_is_no_cross_stays_and_rows_of_faces_are_refused() {
        assert_eq!(cross("t", &FloatImage::black(8, 4)).unwrap(), None);
        // A map of sides 4 to 3 with something in its corners.
        let mut image = painted(Faces::HorizontalCross, 4, 0.0);
        image.pixels[1] = [1.0; 3];
        assert_eq!(cross("t", &image).unwrap(), None);
        assert!(cross("t", &FloatImage::black(24, 4)).is_err());
        assert!(unfolded("t", &FloatImage::black(4, 20), Faces::Column, &Limits::default()).is_err());
    }
}
