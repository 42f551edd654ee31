//! Eight numbers at a time: plain arrays, one operation after another, which the compiler turns into vector registers of
//! whatever width it may use.

use std::ops::{Add, Div, Mul, Sub};

/// Numbers that are computed together.
pub(super) const LANES: usize = 8;

#[derive(Clone, Copy)]
pub(super) struct Lanes(pub [f32; LANES]);

impl Lanes {
    #[inline(always)]
    pub fn splat(value: f32) -> Lanes {
        Lanes([value; LANES])
    }

    /// The `chunk`-th numbers of a column, filled up with zeros behind its end.
    #[inline(always)]
    pub fn of(column: &[f32], chunk: usize) -> Lanes {
        let (whole, rest) = column.as_chunks::<LANES>();
        match whole.get(chunk) {
            Some(&lanes) => Lanes(lanes),
            None => {
                let mut lanes = [0.0; LANES];
                lanes[..rest.len()].copy_from_slice(rest);
                Lanes(lanes)
            }
        }
    }

    #[inline(always)]
    fn map(self, f: impl Fn(f32) -> f32) -> Lanes {
        let mut out = self.0;
        for value in &mut out {
            *value = f(*value);
        }
        Lanes(out)
    }

    #[inline(always)]
    fn zip(self, other: Lanes, f: impl Fn(f32, f32) -> f32) -> Lanes {
        let mut out = self.0;
        for lane in 0..LANES {
            out[lane] = f(out[lane], other.0[lane]);
        }
        Lanes(out)
    }

    #[inline(always)]
    pub fn sqrt(self) -> Lanes {
        self.map(f32::sqrt)
    }

    // Comparisons instead of f32::max and min, whose care for NaN costs instructions.
    #[inline(always)]
    pub fn at_least(self, floor: f32) -> Lanes {
        self.map(|v| if v > floor { v } else { floor })
    }

    #[inline(always)]
    pub fn at_most(self, ceiling: f32) -> Lanes {
        self.map(|v| if v < ceiling { v } else { ceiling })
    }

    #[inline(always)]
    pub fn min(self, other: Lanes) -> Lanes {
        self.zip(other, |a, b| if a < b { a } else { b })
    }

    /// Itself where `condition` exceeds `floor`, zero elsewhere.
    #[inline(always)]
    pub fn where_above(self, condition: Lanes, floor: f32) -> Lanes {
        self.zip(condition, |value, c| if c > floor { value } else { 0.0 })
    }

    /// Itself where `condition` is below `ceiling`, zero elsewhere.
    #[inline(always)]
    pub fn where_below(self, condition: Lanes, ceiling: f32) -> Lanes {
        self.zip(condition, |value, c| if c < ceiling { value } else { 0.0 })
    }

    #[inline(always)]
    pub fn sum(self) -> f32 {
        self.0.iter().sum()
    }
}

impl Add for Lanes {
    type Output = Lanes;
    #[inline(always)]
    fn add(self, other: Lanes) -> Lanes {
        self.zip(other, |a, b| a + b)
    }
}

impl Sub for Lanes {
    type Output = Lanes;
    #[inline(always)]
    fn sub(self, other: Lanes) -> Lanes {
        self.zip(other, |a, b| a - b)
    }
}

impl Mul for Lanes {
    type Output = Lanes;
    #[inline(always)]
    fn mul(self, other: Lanes) -> Lanes {
        self.zip(other, |a, b| a * b)
    }
}

impl Mul<f32> for Lanes {
    type Output = Lanes;
    #[inline(always)]
    fn mul(self, factor: f32) -> Lanes {
        self.map(|v| v * factor)
    }
}

impl Div for Lanes {
    type Output = Lanes;
    #[inline(always)]
    fn div(self, other: Lanes) -> Lanes {
        self.zip(other, |a, b| a / b)
    }
}
