//! How far an error may be from what was measured: the standard error of relMSE for the noise of the reference, and for what a
//! setting's own random numbers change in it.
//!
//! A reference is the mean of two independent halves. Against one of them an image errs a little more than against the other, pixel by
//! pixel by chance alone: with d the difference of a pixel's two squared errors, summed over tiles whose noise is independent, the
//! standard error of the mean of both is half the root of the sum of squares of d, over the pixels.

use relight_scene::image::FloatImage;
use relight_scene::image::metrics::{RELMSE_EPSILON, RELMSE_TRIMMED};

/// Pixels along each side of a tile: light that a path finds is spread over no more.
const TILE: usize = 4;

/// Standard error of the relMSE of an image against the mean of two halves of a reference; 0 of images of other sizes.
pub fn of_reference(image: &FloatImage, halves: [&FloatImage; 2]) -> f64 {
    let count = image.pixels.len();
    if count == 0 || halves.iter().any(|half| half.pixels.len() != count) {
        return 0.0;
    }
    let grey = |pixel: &[f32; 3]| pixel.iter().map(|v| f64::from(*v)).sum::<f64>() / 3.0;
    let reference = |i: usize| 0.5 * (grey(&halves[0].pixels[i]) + grey(&halves[1].pixels[i]));
    let mean = (0..count).map(reference).sum::<f64>() / count as f64;
    let floor = RELMSE_EPSILON * mean * mean;
    let square = |half: &FloatImage, i: usize| {
        let of = |k: usize| (f64::from(image.pixels[i][k]) - f64::from(half.pixels[i][k])).powi(2);
        (of(0) + of(1) + of(2)) / 3.0
    };
    let mut apart: Vec<f64> = (0..count)
        .map(|i| {
            let d = square(halves[0], i) - square(halves[1], i);
            if d == 0.0 {
                0.0
            } else {
                d / (reference(i).powi(2) + floor)
            }
        })
        .collect();
    // As relMSE, without what is worst.
    let trimmed = (count as f64 * RELMSE_TRIMMED) as usize;
    let mut sizes: Vec<f64> = apart.iter().map(|d| d.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    let most = sizes[count - 1 - trimmed.min(count - 1)];
    apart.iter_mut().filter(|d| d.abs() > most).for_each(|d| *d = 0.0);
    let across = image.width.div_ceil(TILE);
    let mut tiles = vec![0.0; across * image.height.div_ceil(TILE)];
    for (i, d) in apart.into_iter().enumerate() {
        tiles[i / image.width / TILE * across + i % image.width / TILE] += d;
    }
    0.5 * tiles.iter().map(|sum| sum * sum).sum::<f64>().sqrt() / count as f64
}

/// Standard error of the mean of values, which fewer than two don't tell.
pub fn of_mean(values: &[f64]) -> Option<f64> {
    let count = values.len() as f64;
    if values.len() < 2 {
        return None;
    }
    let mean = values.iter().sum::<f64>() / count;
    let squares = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>();
    Some((squares / (count - 1.0) / count).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use relight_scene::image::metrics::relmse;

    const SIDE: usize = 40;

    /// Even numbers from 0 to 1, enough of chance for a test.
    struct Numbers(u64);

    impl Numbers {
        fn next(&mut self) -> f64 {
            self.0 = self
                .0
                .wrapping_mul(6364136223846793005)
                .wrapping_add(1442695040888963407);
            (self.0 >> 11) as f64 / (1u64 << 53) as f64
        }

        /// An image of a level, off by noise of a standard deviation.
        fn image(&mut self, level: f64, noise: f64) -> FloatImage {
            let mut one = || (level + noise * 12f64.sqrt() * (self.next() - 0.5)) as f32;
            FloatImage {
                width: SIDE,
                height: SIDE,
                pixels: (0..SIDE * SIDE).map(|_| [one(); 3]).collect(),
            }
        }
    }

    /// Truth: how far estimates are from each other over many references, the reference's own error taken off each.
    #[test]
    fn the_doubt_is_the_spread_over_references() {
        let mut numbers = Numbers(7);
        // As in reports that ranked what was alike: the error is of the size of the reference's own.
        let image = numbers.image(1.02, 0.0);
        let (mut errors, mut doubts) = (Vec::new(), Vec::new());
        for _ in 0..200 {
            let halves = [numbers.image(1.0, 0.03), numbers.image(1.0, 0.03)];
            let mean = FloatImage {
                pixels: (halves[0].pixels.iter().zip(&halves[1].pixels))
                    .map(|(a, b)| [0, 1, 2].map(|k| 0.5 * (a[k] + b[k])))
                    .collect(),
                ..halves[0]
            };
            let own = relmse(&halves[0], &halves[1]).unwrap() / 4.0;
            errors.push(relmse(&image, &mean).unwrap() - own);
            doubts.push(of_reference(&image, [&halves[0], &halves[1]]));
        }
        let spread = of_mean(&errors).unwrap() * (errors.len() as f64).sqrt();
        let doubt = doubts.iter().sum::<f64>() / doubts.len() as f64;
        assert!((0.7..1.5).contains(&(doubt / spread)), "{doubt} {spread}");
        let mean = errors.iter().sum::<f64>() / errors.len() as f64;
        assert!((mean.sqrt() - 0.02).abs() < 0.002, "{mean}");
    }

    #[test]
    fn of_nothing_there_is_no_doubt_to_tell() {
        assert_eq!(of_mean(&[1.0]), None);
        assert_eq!(of_mean(&[1.0, 3.0]), Some(1.0));
        let image = Numbers(1).image(1.0, 0.1);
        assert_eq!(of_reference(&image, [&image, &image]), 0.0);
        assert_eq!(of_reference(&image, [&FloatImage::default(), &image]), 0.0);
    }
}
