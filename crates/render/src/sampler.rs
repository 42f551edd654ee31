//! Well-stratified random numbers for path tracing: Owen-scrambled Sobol pairs, keyed by (seed, pixel).
//!
//! Source: Burley, *Practical Hash-based Owen Scrambling*, JCGT 9(4), 2020: Sobol points in pairs of dimensions,
//! each pair with its own nested uniform shuffle of the sample index and its own scrambles ("padding"), so
//! any number of dimensions is well distributed two by two. The hash inside is the Laine–Karras permutation
//! with Vegdahl's constants. Numbers are functions of (seed, pixel, sample, dimension) alone.
//!
//! Every estimate with them is unbiased: each point by itself is uniform.

use relight_transport::random::mix;

/// The numbers of one sample of one pixel, handed out dimension after dimension.
#[derive(Clone, Debug)]
pub struct Sampler {
    key: u64,
    sample: u32,
    dimension: u32,
}

impl Sampler {
    /// The numbers of sample `sample` of pixel `pixel` under `seed`.
    pub fn new(seed: u64, pixel: u64, sample: u32) -> Sampler {
        Sampler {
            key: mix(mix(seed) ^ pixel),
            sample,
            dimension: 0,
        }
    }

    /// Two numbers in [0, 1), stratified together over the samples of the pixel.
    pub fn next_2d(&mut self) -> [f32; 2] {
        let hash = mix(self.key ^ u64::from(self.dimension));
        let more = mix(hash);
        self.dimension += 1;
        let index = nested_uniform_scramble(self.sample, hash as u32);
        let x = nested_uniform_scramble(index.reverse_bits(), (hash >> 32) as u32);
        let y = nested_uniform_scramble(sobol_1(index), more as u32);
        [to_unit(x), to_unit(y)]
    }

    /// A number in [0, 1), stratified over the samples of the pixel.
    pub fn next_1d(&mut self) -> f32 {
        self.next_2d()[0]
    }

    /// Three numbers in [0, 1): two stratified together and one by itself.
    pub fn next_3d(&mut self) -> [f32; 3] {
        let [a, b] = self.next_2d();
        [a, b, self.next_1d()]
    }
}

/// The second dimension of the Sobol sequence: its direction numbers are the rows of Pascal's triangle mod 2,
/// each the one before xored with itself shifted.
fn sobol_1(mut index: u32) -> u32 {
    let (mut direction, mut out) = (1u32 << 31, 0);
    while index != 0 {
        if index & 1 != 0 {
            out ^= direction;
        }
        index >>= 1;
        direction ^= direction >> 1;
    }
    out
}

/// Owen scrambling of a number read as binary fraction: a bit flips depending on all bits above it. On an
/// index it is a shuffle that keeps every aligned power-of-two block together.
fn nested_uniform_scramble(x: u32, seed: u32) -> u32 {
    let mut x = x.reverse_bits();
    x = x.wrapping_add(seed);
    x ^= x.wrapping_mul(0x6c50_b47c);
    x ^= x.wrapping_mul(0xb82f_1e52);
    x ^= x.wrapping_mul(0xc7af_e638);
    x ^= x.wrapping_mul(0x8d22_f6e6);
    x.reverse_bits()
}

/// The upper 24 bits as a fraction: what an f32 below 1 holds exactly.
fn to_unit(bits: u32) -> f32 {
    (bits >> 8) as f32 / (1u32 << 24) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Truth: 256 points of a (0, 8, 2)-net in base 2 put exactly one point into each of the 256 boxes of
    /// every shape 2^-k × 2^-(8-k) (Sobol 1967); Owen scrambling keeps that (Owen 1995).
    #[test]
    fn every_pair_of_dimensions_is_a_net() {
        for pixel in 0..5 {
            for skip in 0..4 {
                let points: Vec<[f32; 2]> = (0..256)
                    .map(|sample| {
                        let mut sampler = Sampler::new(9, pixel, sample);
                        for _ in 0..skip {
                            let _ = sampler.next_2d();
                        }
                        sampler.next_2d()
                    })
                    .collect();
                for k in 0..=8 {
                    let mut count = [0; 256];
                    for [x, y] in &points {
                        let column = (x * (1 << k) as f32) as usize;
                        let row = (y * (1 << (8 - k)) as f32) as usize;
                        count[(row << k) + column] += 1;
                    }
                    assert!(
                        count.iter().all(|&c| c == 1),
                        "pixel {pixel}, pair {skip}, shape {k}"
                    );
                }
            }
        }
    }

    /// Truth: independent uniform numbers have correlation 0 ± 1/√n; five standard errors.
    #[test]
    fn pairs_and_pixels_are_independent() {
        let n = 4096;
        let (mut pairs, mut pixels) = (0.0, 0.0);
        for pixel in 0..n {
            let mut sampler = Sampler::new(1, pixel, 3);
            let (a, b) = (sampler.next_2d(), sampler.next_2d());
            let c = Sampler::new(1, pixel + 1, 3).next_2d();
            pairs += f64::from((a[0] - 0.5) * (b[0] - 0.5)) * 12.0 / n as f64;
            pixels += f64::from((a[0] - 0.5) * (c[0] - 0.5)) * 12.0 / n as f64;
        }
        assert!(pairs.abs() < 0.08 && pixels.abs() < 0.08, "{pairs} {pixels}");
    }
}
