//! How much a sequence of images flickers: absolute second differences in time of each pixel, over the pixel's mean.
//!
//! Light that comes and goes evenly has none, a lamp that glides along a wall has little, and what jumps from frame to frame and back
//! shows in full. Pixels that are dark in the mean are left out, since their flicker is relative to nothing.

use super::layers::FloatImage;
use super::metrics::grey;

/// Share of the sequence's mean below which a pixel is dark.
const DARK: f64 = 0.02;

/// Second difference of a pixel over its mean from which on light is not smooth: what 99 of 100 pixels of a film may have.
const SMOOTH: f64 = 0.005;

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
        let mut meter = FlickerMeter::new(&PixelMeans::of(&frames));
        frames.into_iter().for_each(|frame| meter.add(frame));
        meter.flicker()
    }

    /// The same of pixels alone whose light is smooth in `truth`, the same sequence of a reference: second differences of at most 0.5 % in
    /// all frames. Second, their share of the pixels that are lit. Noise of the reference makes it less.
    ///
    /// # Panics
    /// Frames are of different sizes.
    pub fn where_smooth(frames: Vec<Vec<f32>>, truth: &[Vec<f32>]) -> (Option<Flicker>, f64) {
        let of_truth = PixelMeans::of(truth).of_lit();
        let is_smooth = |pixel: usize| {
            let second = |k: &[Vec<f32>]| second_difference(k[0][pixel], k[1][pixel], k[2][pixel]);
            of_truth[pixel] > 0.0
                && truth
                    .windows(3)
                    .all(|three| second(three) <= SMOOTH * of_truth[pixel])
        };
        let mut meter = FlickerMeter::new(&PixelMeans::of(&frames));
        let (mut lit, mut smooth) = (0, 0);
        for (pixel, mean) in meter
            .means
            .iter_mut()
            .enumerate()
            .filter(|(_, mean)| **mean > 0.0)
        {
            lit += 1;
            match is_smooth(pixel) {
                true => smooth += 1,
                false => *mean = 0.0,
            }
        }
        frames.into_iter().for_each(|frame| meter.add(frame));
        (meter.flicker(), f64::from(smooth) / f64::from(lit.max(1)))
    }
}

/// Absolute.
fn second_difference(first: f32, second: f32, third: f32) -> f64 {
    (f64::from(first) - 2.0 * f64::from(second) + f64::from(third)).abs()
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
    /// Of frames that are all at hand.
    fn of(frames: &[Vec<f32>]) -> PixelMeans {
        let mut means = PixelMeans::default();
        frames.iter().for_each(|frame| means.add(frame));
        means
    }

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
                let second = second_difference(first[i], second[i], greys[i]);
                let steps = (second / mean / LEAST).max(1.0).log10() * PER_DECADE;
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
    /// Truth by hand: of 100 pixels half jump in the reference by 10 %; of those that don't, one does here.
    #[test]
    fn where_light_jumps_in_truth_it_may_jump() {
        let sequence = |jumps: &dyn Fn(usize) -> bool| -> Vec<Vec<f32>> {
            let at = |k: usize, pixel: usize| {
                if jumps(pixel) && k.is_multiple_of(2) {
                    1.1
                } else {
                    1.0
                }
            };
            (0..8)
                .map(|k| (0..100).map(|pixel| at(k, pixel)).collect())
                .collect()
        };
        let truth = sequence(&|pixel| pixel < 50);
        let (found, share) = Flicker::where_smooth(sequence(&|pixel| pixel < 40), &truth);
        assert_eq!((found.unwrap().p999, share), (0.0, 0.5));
        let (found, share) = Flicker::where_smooth(sequence(&|pixel| pixel < 51), &truth);
        let found = found.unwrap();
        assert!(
            (found.p99 / (0.2 / 1.05) - 1.0).abs() < 0.04 && found.median == 0.0,
            "{found:?}"
        );
        assert_eq!(share, 0.5);
    }
}
