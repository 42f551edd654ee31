//! The six images of a cube (EXT_lights_image_based), made an equirectangular map.
//!
//! **How images lie on the faces.** The order is OpenGL's: +X, −X, +Y, −Y, +Z, −Z. Of the images the extension says that they are
//! "flipped about the vertical axis", its readers turn them otherwise: Babylon.js, which wrote it, takes the lowest row first, in such lights
//! as in its own environment files, and others take them as OpenGL does. But the light carries its spherical harmonics, too: so all
//! three are tried, and another way than Babylon.js's is taken where its harmonics are the file's ([`Faces::lie`]).
//!
//! Source: OpenGL 4.6, section 8.13 (cube map faces); real spherical harmonics with positive signs as in Ramamoorthi and Hanrahan 2001
//! ("An Efficient Representation for Irradiance Environment Maps"), or with the signs of Condon and Shortley, which Babylon.js expects.

use crate::environment::direction_from_uv;
use crate::image::Image8;
use crate::light::EnvironmentMap;
use glam::{DQuat, DVec3, Quat, Vec3};
use rayon::prelude::*;

/// Widest map that is made, pixels: a pixel spans 0.7°, and the asset keeps a megabyte of it at most.
const MAX_WIDTH: usize = 512;
/// Narrowest one, so that between the middles of tiny faces there is something to interpolate.
const MIN_WIDTH: usize = 64;
/// Most samples of the faces along each side of a map's pixel. Faces of 2048 have sixteen texels there.
const MAX_SAMPLES: usize = 16;
/// Most blocks along a face's side of which harmonics are summed; they change little across one.
const BLOCKS: usize = 64;
/// How well another way than Babylon.js's must agree, and how much better: harmonics of real files are off by more than that, be it that they were
/// made of other levels or numbers, and then tell nothing.
const EXACT: f64 = 0.97;
const CLEARLY: f64 = 0.02;

/// How images lie on the faces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Lie {
    /// As OpenGL has them, but for the lowest row being first.
    FromBelow,
    /// As OpenGL has them, with left and right exchanged.
    Mirrored,
    /// As OpenGL has them.
    AsOpenGl,
}

impl Lie {
    /// For a note.
    pub fn name(self) -> &'static str {
        match self {
            Lie::FromBelow => "the lowest row of each image first",
            Lie::Mirrored => "left and right of each image exchanged",
            Lie::AsOpenGl => "images as OpenGL has them",
        }
    }

    /// From a place on a face as OpenGL counts, both 0 to 1, to the place on its image, or back.
    fn flipped(self, [s, t]: [f32; 2]) -> [f32; 2] {
        match self {
            Lie::FromBelow => [s, 1.0 - t],
            Lie::Mirrored => [1.0 - s, t],
            Lie::AsOpenGl => [s, t],
        }
    }
}

/// The face that a direction meets and where on it, both 0 to 1, as OpenGL counts.
fn place(d: Vec3) -> (usize, [f32; 2]) {
    let a = d.abs();
    let (face, s, t, most) = if a.x >= a.y && a.x >= a.z {
        let s = if d.x > 0.0 { -d.z } else { d.z };
        (usize::from(d.x <= 0.0), s, -d.y, a.x)
    } else if a.y >= a.z {
        let t = if d.y > 0.0 { d.z } else { -d.z };
        (2 + usize::from(d.y <= 0.0), d.x, t, a.y)
    } else {
        let s = if d.z > 0.0 { d.x } else { -d.x };
        (4 + usize::from(d.z <= 0.0), s, -d.y, a.z)
    };
    (face, [0.5 * (s / most + 1.0), 0.5 * (t / most + 1.0)])
}

/// The direction of a place on a face as OpenGL counts, not of unit length.
fn direction(face: usize, [s, t]: [f64; 2]) -> DVec3 {
    let (s, t) = (2.0 * s - 1.0, 2.0 * t - 1.0);
    match face {
        0 => DVec3::new(1.0, -t, -s),
        1 => DVec3::new(-1.0, -t, s),
        2 => DVec3::new(s, 1.0, t),
        3 => DVec3::new(s, -1.0, -t),
        4 => DVec3::new(s, -t, 1.0),
        _ => DVec3::new(-s, -t, -1.0),
    }
}

/// What an image's numbers mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    /// Colours of sRGB.
    Plain,
    /// Colours to the power 2.2, as Babylon.js writes and reads them, over alpha.
    Rgbd,
}

impl Encoding {
    /// Radiance of all colours of 8 bits, before the division.
    fn curve(self) -> [f32; 256] {
        std::array::from_fn(|i| {
            let x = i as f32 / 255.0;
            match self {
                Encoding::Rgbd => x.powf(2.2),
                Encoding::Plain if x <= 0.04045 => x / 12.92,
                Encoding::Plain => ((x + 0.055) / 1.055).powf(2.4),
            }
        })
    }
}

/// The six images, square and of one size.
pub(super) struct Faces {
    side: usize,
    images: Vec<(Image8, Encoding, [f32; 256])>,
}

impl Faces {
    /// Six images, which must be square and of one size.
    ///
    /// # Errors
    /// The index of an image that isn't, and what is wrong with it.
    pub fn new(images: Vec<(Image8, Encoding)>) -> Result<Faces, (usize, String)> {
        let side = images.first().map_or(0, |(image, _)| image.width);
        for (i, (image, _)) in images.iter().enumerate() {
            if (image.width, image.height) != (side, side) || side == 0 {
                let message = format!(
                    "has {} × {} pixels, where all six faces must be square and of one size ({side} × {side}, as the first is wide)",
                    image.width, image.height
                );
                return Err((i, message));
            }
        }
        if images.len() != 6 {
            return Err((images.len(), "there must be six faces".into()));
        }
        let images = images
            .into_iter()
            .map(|(image, encoding)| (image, encoding, encoding.curve()));
        Ok(Faces {
            side,
            images: images.collect(),
        })
    }

    /// Pixels along a side.
    pub fn side(&self) -> usize {
        self.side
    }

    /// How many texels would be divided by 0.
    pub fn zero_divisors(&self) -> u64 {
        let rgbd = self.images.iter().filter(|(_, e, _)| *e == Encoding::Rgbd);
        let zeros = rgbd.map(|(image, ..)| image.rgba8.iter().filter(|texel| texel[3] == 0).count() as u64);
        zeros.sum()
    }

    fn texel(&self, face: usize, x: usize, y: usize) -> Vec3 {
        let (image, encoding, curve) = &self.images[face];
        let [r, g, b, a] = image.rgba8[y * self.side + x];
        let color = Vec3::new(curve[r as usize], curve[g as usize], curve[b as usize]);
        match encoding {
            Encoding::Plain => color,
            // 0 stands for more than can be said; 1/255 is the most.
            Encoding::Rgbd => color * (255.0 / f32::from(a.max(1))),
        }
    }

    /// Radiance in a direction, bilinear within the face.
    fn radiance(&self, lie: Lie, d: Vec3) -> Vec3 {
        let (face, at) = place(d);
        let [x, y] = lie
            .flipped(at)
            .map(|c| (c * self.side as f32 - 0.5).clamp(0.0, (self.side - 1) as f32));
        let (x0, y0) = (x as usize, y as usize);
        let (x1, y1) = ((x0 + 1).min(self.side - 1), (y0 + 1).min(self.side - 1));
        let (fx, fy) = (x - x0 as f32, y - y0 as f32);
        let row = |y| self.texel(face, x0, y) * (1.0 - fx) + self.texel(face, x1, y) * fx;
        row(y0) * (1.0 - fy) + row(y1) * fy
    }

    /// The map of what comes from all directions of the world, with the cube turned by a rotation: each pixel the mean over itself.
    pub fn unfolded(&self, lie: Lie, world_from_cube: DQuat) -> EnvironmentMap {
        let width = (4 * self.side).clamp(MIN_WIDTH, MAX_WIDTH);
        let height = width / 2;
        let samples = (4 * self.side / width + 1).clamp(2, MAX_SAMPLES);
        let cube_from_world: Quat = world_from_cube.inverse().as_quat();
        let pixel = |i: usize| {
            let (mut sum, mut weights) = (Vec3::ZERO, 0.0);
            for k in 0..samples * samples {
                let inside = |n: usize| (n as f32 + 0.5) / samples as f32;
                let u = ((i % width) as f32 + inside(k % samples)) / width as f32;
                let v = ((i / width) as f32 + inside(k / samples)) / height as f32;
                // Rows at the poles are narrow.
                let weight = (v * std::f32::consts::PI).sin();
                sum += self.radiance(lie, cube_from_world * direction_from_uv([u, v])) * weight;
                weights += weight;
            }
            sum / weights
        };
        EnvironmentMap {
            width,
            height,
            pixels: (0..width * height).into_par_iter().map(pixel).collect(),
        }
    }

    /// Means over blocks of each image, row by row, and how many blocks are along a side.
    fn blocks(&self) -> (usize, Vec<Vec<DVec3>>) {
        let count = self.side.min(BLOCKS);
        let edge = |i: usize| i * self.side / count;
        let block = |face: usize, i: usize| {
            let (columns, rows) = (
                edge(i % count)..edge(i % count + 1),
                edge(i / count)..edge(i / count + 1),
            );
            let texels = (columns.len() * rows.len()) as f64;
            let sum: DVec3 = (rows.flat_map(|y| columns.clone().map(move |x| (x, y))))
                .map(|(x, y)| self.texel(face, x, y).as_dvec3())
                .sum();
            sum / texels
        };
        let face = |face| {
            (0..count * count)
                .into_par_iter()
                .map(|i| block(face, i))
                .collect()
        };
        (count, (0..6).map(face).collect())
    }

    /// The way that agrees with the light's nine coefficients, and how well: 1 for the very ones, but for their scale; `None`, and Babylon.js's way,
    /// where they are no help.
    pub fn lie(&self, coefficients: Option<&[DVec3; 9]>) -> (Lie, Option<f64>) {
        let Some(given) = coefficients else {
            return (Lie::FromBelow, None);
        };
        let (count, blocks) = self.blocks();
        let agreement = |lie| {
            let found = projected(count, &blocks, lie);
            // As good as even light: any way is right.
            let contrast = found[1..].iter().map(|c| c.length_squared()).sum::<f64>().sqrt();
            if contrast <= 1e-3 * found[0].length() {
                return None;
            }
            // Of radiance, or of irradiance.
            let variants = [found, irradiance(&found)].into_iter();
            let cosines = variants.flat_map(|c| [cosine(&c, given), cosine(&alternating(&c), given)]);
            Some(cosines.fold(f64::NAN, f64::max)).filter(|cosine| cosine.is_finite())
        };
        let (mut best, mut most) = (Lie::FromBelow, agreement(Lie::FromBelow));
        for lie in [Lie::Mirrored, Lie::AsOpenGl] {
            let found = agreement(lie);
            if let (Some(found), Some(before)) = (found, most)
                && found > EXACT.max(before + CLEARLY)
            {
                (best, most) = (lie, Some(found));
            }
        }
        (best, most)
    }
}

/// Real spherical harmonics up to l = 2 of a unit direction: 1, y, z, x, xy, yz, 3z² − 1, xz, x² − y², with positive signs.
fn harmonics(d: DVec3) -> [f64; 9] {
    let [x, y, z] = d.to_array();
    [
        0.282_095,
        0.488_603 * y,
        0.488_603 * z,
        0.488_603 * x,
        1.092_548 * x * y,
        1.092_548 * y * z,
        0.315_392 * (3.0 * z * z - 1.0),
        1.092_548 * x * z,
        0.546_274 * (x * x - y * y),
    ]
}

/// Harmonics of the radiance, of the blocks' means.
fn projected(count: usize, blocks: &[Vec<DVec3>], lie: Lie) -> [DVec3; 9] {
    let mut sums = [DVec3::ZERO; 9];
    for (face, means) in blocks.iter().enumerate() {
        for (i, mean) in means.iter().enumerate() {
            let middle = |n: usize| (n as f32 + 0.5) / count as f32;
            let at = lie.flipped([middle(i % count), middle(i / count)]);
            let d = direction(face, at.map(f64::from));
            // A block's share of the face's area 4, seen from the middle.
            let angle = 4.0 / (count * count) as f64 / d.length().powi(3);
            for (sum, y) in sums.iter_mut().zip(harmonics(d.normalize())) {
                *sum += *mean * (y * angle);
            }
        }
    }
    sums
}

/// The same with the signs of Condon and Shortley: −1 where m is odd.
fn alternating(c: &[DVec3; 9]) -> [DVec3; 9] {
    std::array::from_fn(|i| if [1, 3, 5, 7].contains(&i) { -c[i] } else { c[i] })
}

/// Harmonics of the irradiance, up to a scale (Ramamoorthi and Hanrahan, equation 8).
fn irradiance(radiance: &[DVec3; 9]) -> [DVec3; 9] {
    std::array::from_fn(|i| radiance[i] * [1.0, 2.0 / 3.0, 0.25][usize::from(i > 0) + usize::from(i > 3)])
}

/// Of all but the mean, in all channels; NaN where one has none.
fn cosine(a: &[DVec3; 9], b: &[DVec3; 9]) -> f64 {
    let dot =
        |a: &[DVec3; 9], b: &[DVec3; 9]| (a[1..].iter().zip(&b[1..])).map(|(a, b)| a.dot(*b)).sum::<f64>();
    dot(a, b) / (dot(a, a) * dot(b, b)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Radiance of a direction, by which faces, their corners and their orientation can be told apart; from 0.2 to 0.8.
    fn sky(d: DVec3) -> DVec3 {
        let d = d.normalize();
        0.5 + 0.2 * d + 0.1 * DVec3::new(d.y * d.z, d.x * d.y, d.z * d.x)
    }

    /// Faces of a sky, painted as a reader is told to take them.
    fn painted(side: usize, lie: Lie, sky: impl Fn(DVec3) -> DVec3) -> Faces {
        let face = |face| {
            let texel = |i: usize| {
                let middle = |n: usize| (n as f32 + 0.5) / side as f32;
                let at = lie.flipped([middle(i % side), middle(i / side)]);
                let color = sky(direction(face, at.map(f64::from)));
                // D of a half, so that the division counts.
                let [r, g, b] = (color * 0.5)
                    .to_array()
                    .map(|x| (x.powf(1.0 / 2.2) * 255.0).round() as u8);
                [r, g, b, 128]
            };
            let image = Image8 {
                width: side,
                height: side,
                rgba8: (0..side * side).map(texel).collect(),
            };
            (image, Encoding::Rgbd)
        };
        Faces::new((0..6).map(face).collect()).unwrap()
    }

    /// The sky's own coefficients: by a closed form, since it is made of harmonics.
    fn coefficients() -> [DVec3; 9] {
        let c = |constant: f64, value: f64| value / constant;
        let (one, two) = (0.488_603, 1.092_548);
        let mut all = [DVec3::ZERO; 9];
        all[0] = DVec3::splat(c(0.282_095, 0.5));
        all[1] = DVec3::Y * c(one, 0.2);
        all[2] = DVec3::Z * c(one, 0.2);
        all[3] = DVec3::X * c(one, 0.2);
        all[4] = DVec3::Y * c(two, 0.1);
        all[5] = DVec3::X * c(two, 0.1);
        all[7] = DVec3::Z * c(two, 0.1);
        all
    }

    #[test]
    fn places_and_directions_are_inverse() {
        for face in 0..6 {
            for at in [[0.1, 0.2], [0.5, 0.5], [0.93, 0.6]] {
                let (found, there) = place(direction(face, at).as_vec3());
                assert_eq!(found, face);
                assert!((there[0] - at[0] as f32).abs() < 1e-6 && (there[1] - at[1] as f32).abs() < 1e-6);
            }
        }
    }

    /// Truth: the sky itself in each pixel's direction, turned or not; the tolerance is a step of 8 bits at D = 0.5 and half a texel at
    /// faces' edges.
    #[test]
    fn each_direction_of_the_map_shows_the_sky_however_the_faces_lie() {
        let given = coefficients();
        for lie in [Lie::FromBelow, Lie::Mirrored, Lie::AsOpenGl] {
            let faces = painted(64, lie, sky);
            // With the signs of either convention, and attenuated as irradiance has them.
            for given in [given, alternating(&given), irradiance(&given).map(|c| 3.0 * c)] {
                let (found, agreement) = faces.lie(Some(&given));
                assert_eq!(found, lie);
                assert!(agreement.unwrap() > 0.995, "{lie:?}: {agreement:?}");
            }
            for turn in [
                DQuat::IDENTITY,
                DQuat::from_xyzw(0.1, 0.7, -0.2, 0.65).normalize(),
            ] {
                let map = faces.unfolded(lie, turn);
                assert_eq!((map.width, map.height), (256, 128));
                for (i, pixel) in map.pixels.iter().enumerate() {
                    let uv = [(i % 256) as f32 + 0.5, (i / 256) as f32 + 0.5];
                    let d = direction_from_uv([uv[0] / 256.0, uv[1] / 128.0]).as_dvec3();
                    let truth = sky(turn.inverse() * d).as_vec3();
                    assert!(
                        (*pixel - truth).abs().max_element() < 0.02,
                        "{lie:?} {i}: {pixel} for {truth}"
                    );
                }
            }
        }
    }

    /// Truth: irradiance by the coefficients (Ramamoorthi and Hanrahan, equation 10) and by a sum over the map's pixels.
    #[test]
    fn irradiance_of_the_map_is_that_of_the_coefficients() {
        let map = painted(32, Lie::FromBelow, sky).unfolded(Lie::FromBelow, DQuat::IDENTITY);
        for normal in [
            DVec3::X,
            DVec3::NEG_Y,
            DVec3::new(1.0, 2.0, -2.0) / 3.0,
            DVec3::new(-0.6, 0.0, 0.8),
        ] {
            let mut sum = DVec3::ZERO;
            for (i, pixel) in map.pixels.iter().enumerate() {
                let v = ((i / map.width) as f64 + 0.5) / map.height as f64;
                let u = ((i % map.width) as f32 + 0.5) / map.width as f32;
                let d = direction_from_uv([u, v as f32]).as_dvec3();
                let angle = 2.0 * std::f64::consts::PI.powi(2) * (v * std::f64::consts::PI).sin()
                    / map.pixels.len() as f64;
                sum += pixel.as_dvec3() * (d.dot(normal).max(0.0) * angle);
            }
            let pi = std::f64::consts::PI;
            let terms = harmonics(normal).into_iter().zip(coefficients()).enumerate();
            let truth: DVec3 = terms
                .map(|(i, (y, c))| {
                    c * y * [pi, 2.0 * pi / 3.0, pi / 4.0][usize::from(i > 0) + usize::from(i > 3)]
                })
                .sum();
            assert!(
                (sum - truth).abs().max_element() < 0.01 * truth.max_element(),
                "{normal}: {sum} for {truth}"
            );
        }
    }

    /// Harmonics that fit no way, as in files whose writer took other numbers, choose nothing.
    #[test]
    fn wrong_coefficients_choose_nothing() {
        let faces = painted(16, Lie::AsOpenGl, sky);
        let mut wrong = coefficients();
        wrong[6] = DVec3::splat(0.3);
        wrong[8] = DVec3::splat(-0.3);
        let (found, agreement) = faces.lie(Some(&wrong));
        assert_eq!(found, Lie::FromBelow);
        assert!(agreement.unwrap() < EXACT);
        assert_eq!(faces.lie(Some(&[DVec3::ZERO; 9])), (Lie::FromBelow, None));
        assert_eq!(faces.lie(None), (Lie::FromBelow, None));
    }

    #[test]
    fn faces_that_fit_no_cube_are_refused_and_even_light_lies_any_way() {
        let image = |w: usize, h: usize| {
            let rgba8 = vec![[128, 128, 128, 0]; w * h];
            (
                Image8 {
                    width: w,
                    height: h,
                    rgba8,
                },
                Encoding::Rgbd,
            )
        };
        let six =
            |odd: (Image8, Encoding)| (0..6).map(move |i| if i == 3 { odd.clone() } else { image(4, 4) });
        assert_eq!(Faces::new(vec![image(4, 4); 5]).err().unwrap().0, 5);
        for odd in [image(4, 3), image(2, 2), image(0, 0)] {
            let (face, message) = Faces::new(six(odd).collect()).err().unwrap();
            assert!(face == 3 && message.contains("square"), "{message}");
        }
        let even = Faces::new(vec![image(1, 1); 6]).unwrap();
        assert_eq!(even.lie(Some(&coefficients())), (Lie::FromBelow, None));
        // A divisor of 0 is the least that there is.
        assert_eq!(even.zero_divisors(), 6);
        let map = even.unfolded(Lie::FromBelow, DQuat::IDENTITY);
        let truth = (128.0f32 / 255.0).powf(2.2) * 255.0;
        assert!(map.pixels.iter().all(|p| (p.x / truth - 1.0).abs() < 1e-4));
    }
}
