//! Decisions of a seed: SplitMix64 (Steele, Lea and Flood 2014), a stream for each thing that is decided, so that one more
//! decision about lamps leaves the furniture where it was.

use glam::{DVec3, dvec3};

/// A stream of random numbers.
pub struct Dice(u64);

impl Dice {
    /// The stream of a seed for one thing.
    pub fn new(seed: u64, thing: &str) -> Dice {
        // FNV-1a keeps streams of different things apart.
        let name = (thing.bytes()).fold(0xcbf2_9ce4_8422_2325u64, |h, b| {
            (h ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3)
        });
        let mut dice = Dice(seed ^ name);
        // Neighbouring seeds are neighbouring states until they were mixed once.
        dice.0 = dice.next();
        dice
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// In [0, 1).
    pub fn uniform(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// In [a, b).
    pub fn between(&mut self, a: f64, b: f64) -> f64 {
        a + (b - a) * self.uniform()
    }

    /// From a to b, both above 0, each doubling as likely as another. Three digits, which no machine's `powf` changes.
    pub fn log_between(&mut self, a: f64, b: f64) -> f64 {
        rounded(a * (b / a).powf(self.uniform()))
    }

    /// From a to b, both included, each doubling as likely as another; a is at least 1.
    pub fn count(&mut self, a: usize, b: usize) -> usize {
        (self.log_between(a as f64, b as f64 + 0.99) as usize).clamp(a, b)
    }

    /// True in this share of the cases.
    pub fn chance(&mut self, share: f64) -> bool {
        self.uniform() < share
    }

    /// One of some, all as likely.
    pub fn one_of<T: Copy>(&mut self, of: &[T]) -> T {
        of[(self.next() % of.len() as u64) as usize]
    }

    /// A colour of reflectance: 0.02 to 0.95 in each channel.
    pub fn albedo(&mut self) -> [f64; 3] {
        let tone = self.between(ALBEDO[0], ALBEDO[1]);
        let tint = self.between(0.0, 0.6);
        [0, 1, 2].map(|_| (tone * (1.0 + tint * self.between(-1.0, 1.0))).clamp(ALBEDO[0], ALBEDO[1]))
    }

    /// A direction, all as likely. Without sines, which differ between machines in the last bit.
    pub fn direction(&mut self) -> DVec3 {
        loop {
            let p = dvec3(
                self.between(-1.0, 1.0),
                self.between(-1.0, 1.0),
                self.between(-1.0, 1.0),
            );
            if (0.01..1.0).contains(&p.length_squared()) {
                return p.normalize();
            }
        }
    }
}

/// Least and greatest reflectance: black cloth and fresh snow.
pub const ALBEDO: [f64; 2] = [0.02, 0.95];

/// Three significant digits.
pub fn rounded(x: f64) -> f64 {
    format!("{x:.2e}").parse().unwrap_or(x)
}
