//! How much a sequence of images flickers: absolute second differences in time of each pixel, over the pixel's mean.
//!
//! Light that comes and goes evenly has none, a lamp that glides along a wall has little, and what jumps from frame to frame and back
//! shows in full. Pixels that are dark in the mean are left out, since their flicker is relative to nothing.

use super::layers::FloatImage;
use super::metrics::grey;

/// Share of the sequence's mean below which a pixel is dark.
const DARK: f64 = 0.02;

/// Steps of the histogram for a factor of ten: percentiles are off by at most 2 %.
const PER_DECADE: f64 = 64.0;
/// Decades of the histogram, from 10⁻⁸ on.
const LEAST: f64 = 1e-8;
const DECADES: usize = 12;

/// Percentiles over pixels and frames of the absolute second difference over the pixel's mean.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flicker {
    /// Half are below.
    pub median: f64,
    /// 99 % are.
    pub p99: f64,
    /// 99.9 % are.
    pub p999: f64,
}

impl Flicker {
    /// Of frames that are all at hand, each as [`greys`]; `None` with fewer than three, or if all are dark.
    ///
    /// # Panics
    /// Frames are of different sizes.
    pub fn of(frames: Vec<Vec<f32>>) -> Option<Flicker> {
        let mut means = PixelMeans::default();
        frames.iter().for_each(|frame| means.add(frame));
        let mut meter = FlickerMeter::new(&means);
        frames.into_iter().for_each(|frame| meter.add(frame));
        meter.flicker()
    }
}

/// What pixels' differences are relative to: first pass over a sequence.
#[derive(Clone, Debug, Default)]
pub struct PixelMeans {
    sums: Vec<f64>,
    frames: usize,
}

/// Mean over RGB of each pixel.
pub fn greys(image: &FloatImage) -> Vec<f32> {
    image.pixels.iter().map(|pixel| grey(pixel) as f32).collect()
}

impl PixelMeans {
    /// Adds a frame's [`greys`].
    ///
    /// # Panics
    /// Frames are of different sizes.
    pub fn add(&mut self, greys: &[f32]) {
        if self.frames == 0 {
            self.sums = vec![0.0; greys.len()];
        }
        assert_eq!(self.sums.len(), greys.len(), "frames are of one size");
        (self.sums.iter_mut().zip(greys)).for_each(|(sum, &grey)| *sum += f64::from(grey));
        self.frames += 1;
    }

    /// Each pixel's mean; 0 where it is dark.
    fn of_lit(&self) -> Vec<f64> {
        let of_all = self.sums.iter().sum::<f64>() / self.sums.len().max(1) as f64;
        let of_lit = |&sum: &f64| {
            if sum > DARK * of_all {
                sum / self.frames as f64
            } else {
                0.0
            }
        };
        self.sums.iter().map(of_lit).collect()
    }
}

/// Second pass: frames in order.
#[derive(Clone, Debug)]
pub struct FlickerMeter {
    means: Vec<f64>,
    /// The two frames before.
    before: [Vec<f32>; 2],
    counts: Vec<u64>,
}

impl FlickerMeter {
    /// Of a sequence with these means.
    pub fn new(means: &PixelMeans) -> FlickerMeter {
        FlickerMeter {
            means: means.of_lit(),
            before: [Vec::new(), Vec::new()],
            counts: vec![0; DECADES * PER_DECADE as usize + 1],
        }
    }

    /// Adds the next frame's [`greys`], or what of them is to be looked at.
    pub fn add(&mut self, greys: Vec<f32>) {
        let [first, second] = &self.before;
        if !first.is_empty() {
            for (i, &mean) in self.means.iter().enumerate().filter(|(_, mean)| **mean > 0.0) {
                let second = f64::from(first[i]) - 2.0 * f64::from(second[i]) + f64::from(greys[i]);
                let steps = (second.abs() / mean / LEAST).max(1.0).log10() * PER_DECADE;
                let last = self.counts.len() - 1;
                self.counts[(steps as usize).min(last)] += 1;
            }
        }
        self.before.swap(0, 1);
        self.before[1] = greys;
    }

    /// What was found; `None` with fewer than three frames, or if all are dark.
    pub fn flicker(&self) -> Option<Flicker> {
        let all: u64 = self.counts.iter().sum();
        let percentile = |share: f64| {
            let mut left = (share * all as f64).ceil() as u64;
            let reached = |&count: &u64| {
                left = left.saturating_sub(count);
                left == 0
            };
            let step = self.counts.iter().position(reached).unwrap_or(0);
            match step {
                0 => 0.0,
                step => LEAST * 10f64.powf((step as f64 + 0.5) / PER_DECADE),
            }
        };
        (all > 0).then(|| Flicker {
            median: percentile(0.5),
            p99: percentile(0.99),
            p999: percentile(0.999),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_that_rises_evenly_does_not_flicker() {
        let frames: Vec<Vec<f32>> = (0..8).map(|k| vec![1.0 + k as f32; 100]).collect();
        assert_eq!(Flicker::of(frames).map(|found| found.p999), Some(0.0));
    }

    /// Truth by hand: 95 pixels stand still, 5 are 1.1 and 0.9 in turns: second differences of 0.4 over a mean of 1. A dark pixel
    /// that jumps counts for nothing.
    #[test]
    fn a_pixel_that_jumps_shows_by_how_much() {
        let frames: Vec<Vec<f32>> = (0..8)
            .map(|k| {
                let jumping = if k % 2 == 0 { 1.1 } else { 0.9 };
                let mut frame = vec![1.0; 95];
                frame.extend([jumping; 5]);
                frame.push(if k % 2 == 0 { 0.01 } else { 0.0 });
                frame
            })
            .collect();
        assert!(Flicker::of(frames[..2].to_vec()).is_none());
        let found = Flicker::of(frames).unwrap();
        assert_eq!(found.median, 0.0);
        // A step of the histogram.
        assert!((found.p99 / 0.4 - 1.0).abs() < 0.04, "{found:?}");
        assert!(Flicker::of(vec![vec![0.0; 4]; 5]).is_none());
    }
}
