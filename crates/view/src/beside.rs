//! Path tracing beside what the asset makes: passes of one sample add up, and how far the two are apart is told, and how much of
//! that is noise of path tracing.

use crate::wish::Wish;
use relight_play::scene::image::FloatImage;
use relight_play::scene::image::metrics::{bias, relmse};

/// Passes after which the reference is as good as it gets: some minutes.
pub const MOST_PASSES: u32 = 512;

/// How far the asset's picture is from path tracing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Apart {
    /// Samples a pixel of the reference.
    pub samples: u32,
    /// √relMSE of the mean of all passes against the asset's picture, less the noise of path tracing, 1: what a pixel differs by. The
    /// asset's picture has no noise to divide by.
    pub error: f64,
    /// √relMSE of that noise, 1; the error is known once it is well above this. `None` with one sample.
    pub noise: Option<f64>,
    /// Relative error of the asset's mean, 1.
    pub bias: f64,
}

/// The reference of one picture, as far as it is.
pub struct Reference {
    /// Of what picture.
    pub wish: Wish,
    /// The asset's.
    pub own: FloatImage,
    /// Sums of passes that are even and odd: what is noise the two don't share.
    sums: [Vec<[f64; 3]>; 2],
    /// Passes so far.
    pub passes: u32,
}

impl Reference {
    /// Nothing yet, beside a picture that the asset made.
    pub fn new(wish: &Wish, own: FloatImage) -> Reference {
        let nothing = vec![[0.0; 3]; own.pixels.len()];
        Reference {
            wish: wish.clone(),
            own,
            sums: [nothing.clone(), nothing],
            passes: 0,
        }
    }

    /// Adds a pass of one sample a pixel.
    pub fn add(&mut self, pass: &FloatImage) {
        let sums = &mut self.sums[self.passes as usize % 2];
        for (sum, pixel) in sums.iter_mut().zip(&pass.pixels) {
            for (sum, value) in sum.iter_mut().zip(pixel) {
                *sum += f64::from(*value);
            }
        }
        self.passes += 1;
    }

    fn image(&self, value: impl Fn(usize, usize) -> f64) -> FloatImage {
        let mut image = FloatImage::black(self.own.width, self.own.height);
        for (i, pixel) in image.pixels.iter_mut().enumerate() {
            *pixel = [0, 1, 2].map(|channel| value(i, channel) as f32);
        }
        image
    }

    /// The mean of all passes.
    pub fn mean(&self) -> FloatImage {
        let [a, b] = &self.sums;
        let passes = f64::from(self.passes.max(1));
        self.image(|i, c| (a[i][c] + b[i][c]) / passes)
    }

    /// How far the asset's picture is from the mean; `None` where a picture holds what is no number.
    pub fn apart(&self) -> Option<Apart> {
        let mean = self.mean();
        let (_, bias) = bias(&self.own, &mean).ok()?;
        let whole = relmse(&mean, &self.own).ok()?;
        // Variances of the two halves and of the mean of both are as one over their passes.
        let (second, all) = (f64::from(self.passes / 2), f64::from(self.passes));
        let first = all - second;
        let noise = (self.passes > 1).then(|| {
            let [a, b] = &self.sums;
            let a = self.image(|i, c| a[i][c] / first);
            let b = self.image(|i, c| b[i][c] / second);
            // Relative to the same picture.
            let spread = FloatImage {
                pixels: (self.own.pixels.iter().zip(a.pixels.iter().zip(&b.pixels)))
                    .map(|(own, (a, b))| [0, 1, 2].map(|c| own[c] + a[c] - b[c]))
                    .collect(),
                ..self.own.clone()
            };
            relmse(&spread, &self.own).map(|apart| apart * first * second / (all * all))
        });
        let noise = noise.transpose().ok()?;
        Some(Apart {
            samples: self.passes,
            error: (whole - noise.unwrap_or(0.0)).max(0.0).sqrt(),
            noise: noise.map(f64::sqrt),
            bias,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wish::Show;
    use relight_play::scene::image::FloatImage;

    fn wish() -> Wish {
        let show: Show = serde_json::from_str(
            r#"{ "id": 1, "width": 64, "height": 64, "by": "both",
                 "camera": { "position": [0, 0, 1], "look_at": [0, 0, 0], "up": [0, 1, 0], "vfov_deg": 40 } }"#,
        )
        .unwrap();
        show.wish(None).unwrap()
    }

    fn flat(value: impl Fn(usize) -> f32) -> FloatImage {
        let mut image = FloatImage::black(64, 64);
        for (i, pixel) in image.pixels.iter_mut().enumerate() {
            *pixel = [value(i); 3];
        }
        image
    }

    /// Truth: every pixel of path tracing is darker by 0.1 than the asset's 1.1. Relative to a flat picture of 1.1, relMSE divides by
    /// 1.01 · 1.1².
    /// Noise of ±0.5 with independent signs has variance 0.25, of a mean of n passes 0.25 / n.
    #[test]
    fn error_is_told_apart_from_noise() {
        let mut reference = Reference::new(&wish(), flat(|_| 1.1));
        let mut state = 7_u64;
        for pass in 1..=64_u32 {
            let signs: Vec<f32> = (0..64 * 64)
                .map(|_| {
                    state = state
                        .wrapping_mul(6364136223846793005)
                        .wrapping_add(1442695040888963407);
                    if state >> 63 == 0 { 0.5 } else { -0.5 }
                })
                .collect();
            reference.add(&flat(|i| 1.0 + signs[i]));
            let apart = reference.apart().unwrap();
            assert_eq!((apart.samples, apart.noise.is_none()), (pass, pass == 1));
        }
        let apart = reference.apart().unwrap();
        let (error, noise) = (0.1 / 1.1 / 1.01_f64.sqrt(), 0.5 / 8.0 / 1.1 / 1.01_f64.sqrt());
        // 4096 pixels know a variance to 2 %, the difference of two to some more; a thousandth of the pixels is left out.
        assert!(
            (apart.noise.unwrap() / noise - 1.0).abs() < 0.05,
            "{apart:?} {noise}"
        );
        assert!((apart.error / error - 1.0).abs() < 0.05, "{apart:?} {error}");
        assert!((apart.bias - 0.1).abs() < 0.01, "{apart:?}");
    }

    #[test]
    fn pictures_that_agree_but_for_noise_are_no_error() {
        let mut reference = Reference::new(&wish(), flat(|_| 1.0));
        for pass in 0..4 {
            reference.add(&flat(|i| if (i + pass) % 2 == 0 { 1.3 } else { 0.7 }));
        }
        assert_eq!(reference.apart().unwrap().error, 0.0);
    }
}
