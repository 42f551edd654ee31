//! What measured lamps send where: photometric files of IES LM-63, 1986 to 2019.
//!
//! Source: LM-63, and EXT_lights_ies for how the angles lie in space: the direction in which both angles are zero is a lamp's `aim`,
//! and planes are counted from a second direction, `zero`. Of type C (most lamps) vertical angles go from the aim (the nadir of a ceiling
//! lamp) to its opposite, and horizontal angles turn counter-clockwise around what points against the aim, from `zero`. Of type A and B (headlamps and
//! floodlights) both are angles about the aim, the vertical one positive towards `zero`, the horizontal one clockwise as the lamp looks; A turns
//! about the vertical axis first, B about the horizontal one.
//!
//! Between angles candela are interpolated linearly, beyond the measured vertical ones there is no light. A lamp measured on a part of its
//! horizontal angles is symmetric: one angle (all around), 0 to 90, 0 to 180, 90 to 270, and for A and B from 0.
//!
//! Lamps whose light depends on their tilt (TILT) are darkened or brightened by it: [`Photometry::tilted`].
//!
//! What is not used: labels, lumens of the lamp, and the luminaire's size.

mod error;
mod numbers;
mod tilt;

pub use error::PhotometryError;
pub(crate) use numbers::text;
pub use tilt::{read_beside, with_tilt};

use crate::lfs::{LFS_ADVICE, is_lfs_pointer};
use glam::DVec3;
use numbers::{MAX_VALUES, Numbers, words};
use std::f64::consts::PI;
use std::path::Path;
use tilt::Tilt;

/// Most bytes of a file: measurements take some ten thousand.
pub const MAX_BYTES: u64 = 4 << 20;
/// Largest candela, as of other lights (W/sr).
const MAX_CANDELA: f64 = 1e15;
/// Steps of the vertical and the horizontal angle over which lumens are summed.
const STEPS: (u32, u32) = (720, 144);

/// How the angles of a file lie in space.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Type {
    A,
    B,
    C,
}

/// Luminous intensity in all directions.
#[derive(Clone, Debug, PartialEq)]
pub struct Photometry {
    kind: Type,
    /// Degrees, rising.
    vertical: Vec<f64>,
    /// Degrees, rising.
    horizontal: Vec<f64>,
    /// Candela, a row of vertical angles for each horizontal one; finite, not negative.
    candela: Vec<f64>,
    /// Lumens over all directions.
    lumens: f64,
    /// Factors on all candela of a tilted lamp.
    tilt: Option<Tilt>,
}

/// Nothing shines.
impl Default for Photometry {
    fn default() -> Photometry {
        Photometry {
            kind: Type::C,
            vertical: vec![0.0],
            horizontal: vec![0.0],
            candela: vec![0.0],
            lumens: 0.0,
            tilt: None,
        }
    }
}

/// The axes of a lamp, unit vectors in world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LampAxes {
    aim: DVec3,
    zero: DVec3,
    /// Perpendicular to both, to the right of a lamp that looks along its aim with `zero` up.
    right: DVec3,
}

impl LampAxes {
    /// `zero` need not be perpendicular to the aim. `None` where `aim` is zero or not finite.
    pub fn new(aim: DVec3, zero: DVec3) -> Option<LampAxes> {
        let aim = aim.try_normalize()?;
        let across = zero.try_normalize().map(|zero| zero - aim * zero.dot(aim));
        // Along the aim it says nothing.
        let zero = across.filter(|across| across.length() > 1e-6);
        let zero = zero.unwrap_or_else(|| aim.any_orthonormal_vector()).normalize();
        Some(LampAxes {
            aim,
            zero,
            right: aim.cross(zero),
        })
    }

    /// Unit: the way the lamp points.
    pub fn aim(&self) -> DVec3 {
        self.aim
    }
}

impl Photometry {
    /// Reads a file; its text as UTF-8 or Latin-1.
    ///
    /// # Errors
    /// It cannot be read or is too large.
    pub fn text_of(path: &Path) -> Result<String, PhotometryError> {
        let fail = |error: std::io::Error| {
            PhotometryError::Read(format!("{}: cannot be read: {error}", path.display()))
        };
        let size = std::fs::metadata(path).map_err(fail)?.len();
        if size > MAX_BYTES {
            return Err(PhotometryError::Read(format!(
                "{}: has {size} bytes; photometric files of up to {MAX_BYTES} are read",
                path.display()
            )));
        }
        let bytes = std::fs::read(path).map_err(fail)?;
        if is_lfs_pointer(&bytes) {
            return Err(PhotometryError::Read(format!(
                "{}: this {LFS_ADVICE}",
                path.display()
            )));
        }
        Ok(text(&bytes))
    }

    /// Reads the text of a file.
    ///
    /// # Errors
    /// See [`PhotometryError`].
    pub fn parse(text: &str) -> Result<Photometry, PhotometryError> {
        let mut lines = (1..).zip(text.lines());
        let tilt = lines.by_ref().find_map(|(_, line)| tilt::value(line));
        let tilt = tilt.ok_or(PhotometryError::NoTilt)?;
        let mut numbers = Numbers {
            words: words(lines),
            line: 0,
        };
        let read = Photometry::numbers(tilt, &mut numbers);
        read.map_err(|error| numbers.placed(error))
    }

    fn numbers<'a>(
        tilt: &str,
        numbers: &mut Numbers<impl Iterator<Item = (usize, &'a str)>>,
    ) -> Result<Photometry, PhotometryError> {
        let tilt = if tilt.eq_ignore_ascii_case("INCLUDE") {
            Some(Tilt::parse(numbers)?)
        } else if tilt.eq_ignore_ascii_case("NONE") {
            None
        } else {
            return Err(PhotometryError::TiltFile {
                name: tilt.to_owned(),
                message: "other files can't be read here".into(),
            });
        };
        for what in ["the number of lamps", "the lumens of a lamp"] {
            numbers.next(what)?;
        }
        let multiplier = numbers.factor("the candela multiplier")?;
        let verticals = numbers.count("the number of vertical angles")?;
        let horizontals = numbers.count("the number of horizontal angles")?;
        if verticals.saturating_mul(horizontals) > MAX_VALUES {
            return Err(PhotometryError::Wrong {
                what: "the number of angles, vertical times horizontal,",
                found: verticals as f64 * horizontals as f64,
                expected: "at most 1048576 are read",
            });
        }
        let types = "1 is type C, 2 type B and 3 type A";
        let kind = match numbers.one_of("the photometric type", &[1.0, 2.0, 3.0], types)? as u8 {
            1 => Type::C,
            2 => Type::B,
            _ => Type::A,
        };
        for what in [
            "the unit of length",
            "the luminaire's width",
            "the luminaire's length",
            "the luminaire's height",
        ] {
            numbers.next(what)?;
        }
        let ballast = numbers.factor("the ballast factor")?;
        // Of 1986 and 1991 the ballast-lamp photometric factor, later 1.
        let lamp = numbers.factor("the ballast-lamp factor")?;
        numbers.next("the input watts")?;
        let vertical = numbers.angles(verticals, "a vertical angle")?;
        check_vertical(kind, &vertical)?;
        let horizontal = numbers.angles(horizontals, "a horizontal angle")?;
        check_horizontal(kind, &horizontal)?;
        let mut photometry = Photometry {
            kind,
            candela: Vec::new(),
            vertical,
            horizontal,
            lumens: 0.0,
            tilt,
        };
        let factor = multiplier * ballast * lamp;
        for _ in 0..verticals * horizontals {
            let value = numbers.next("the last candela value")?;
            let candela = value * factor;
            if !(value >= 0.0 && candela <= MAX_CANDELA) {
                return Err(PhotometryError::Wrong {
                    what: "a candela value",
                    found: value,
                    expected: "none is below 0, nor above 1e15 with its factors",
                });
            }
            photometry.candela.push(candela);
        }
        photometry.lumens = photometry.summed();
        Ok(photometry)
    }

    /// Factor on all candela of a lamp that points along a unit vector of world space (up is +Y): 1 but for files with TILT.
    pub fn tilted(&self, aim: DVec3) -> f64 {
        self.tilt.as_ref().map_or(1.0, |tilt| tilt.factor(aim))
    }

    /// Whether the file has factors for tilted lamps.
    pub fn has_tilt(&self) -> bool {
        self.tilt.is_some()
    }

    /// Candela into a unit direction that leaves a lamp, but for [`Photometry::tilted`].
    pub fn candela(&self, axes: &LampAxes, direction: DVec3) -> f64 {
        let [along, up, right] = [axes.aim, axes.zero, axes.right].map(|axis| axis.dot(direction));
        let arc_sine = |sine: f64| sine.clamp(-1.0, 1.0).asin();
        let (vertical, horizontal) = match self.kind {
            // Accurate also along the aim, where the arc cosine is not.
            Type::C => (up.hypot(right).atan2(along), (-right).atan2(up)),
            Type::B => (up.atan2(along), arc_sine(right)),
            Type::A => (arc_sine(up), right.atan2(along)),
        };
        self.at(vertical.to_degrees(), horizontal.to_degrees())
    }

    /// Lumens over all directions.
    pub fn lumens(&self) -> f64 {
        self.lumens
    }

    /// The largest candela.
    pub fn peak(&self) -> f64 {
        self.candela.iter().fold(0.0, |most, &value| most.max(value))
    }

    /// Degrees off the aim beyond which there is no light, of type C; `None`: it may leave in any direction.
    pub fn reach(&self) -> Option<f64> {
        let columns = self.vertical.len();
        let lit = |i: usize| {
            self.candela
                .iter()
                .skip(i)
                .step_by(columns)
                .any(|&candela| candela > 0.0)
        };
        let last = (0..columns).rev().find(|&i| lit(i))?;
        // Interpolated up to the next angle.
        (self.kind == Type::C).then(|| self.vertical[(last + 1).min(columns - 1)])
    }

    /// At angles in degrees, from −180 to 180.
    fn at(&self, vertical: f64, horizontal: f64) -> f64 {
        let of_c = self.kind == Type::C;
        // Lamps of type A and B that were measured on one side.
        let vertical = match !of_c && self.vertical[0] >= 0.0 {
            true => vertical.abs(),
            false => vertical,
        };
        let Some(v) = between(&self.vertical, vertical) else {
            return 0.0;
        };
        let (count, first) = (self.horizontal.len(), self.horizontal[0]);
        let last = self.horizontal[count - 1];
        let mut turned = None;
        let horizontal = if count == 1 {
            first
        } else if !of_c {
            if first >= 0.0 {
                horizontal.abs()
            } else {
                horizontal
            }
        } else {
            let round = horizontal.rem_euclid(360.0);
            match last {
                90.0 => round.min(360.0 - round).min((180.0 - round).abs()),
                180.0 => round.min(360.0 - round),
                270.0 if first == 90.0 => {
                    // The other half mirrored at the plane of 90 and 270.
                    if round < 90.0 {
                        180.0 - round
                    } else if round > 270.0 {
                        540.0 - round
                    } else {
                        round
                    }
                }
                _ => {
                    if round > last {
                        // Between the last plane and the first.
                        turned = Some((count - 1, 0, (round - last) / (360.0 - last)));
                    }
                    round
                }
            }
        };
        let Some((i, j, share)) = turned.or_else(|| between(&self.horizontal, horizontal)) else {
            return 0.0;
        };
        let row = |i: usize| {
            let of = |k: usize| self.candela[i * self.vertical.len() + k];
            of(v.0) * (1.0 - v.2) + of(v.1) * v.2
        };
        row(i) * (1.0 - share) + row(j) * share
    }

    fn summed(&self) -> f64 {
        // Axes for which world directions are the type's own polar ones.
        let axes = LampAxes {
            aim: DVec3::NEG_Z,
            zero: DVec3::X,
            right: DVec3::NEG_Y,
        };
        let (rows, columns) = STEPS;
        let mut sum = 0.0;
        for row in 0..rows {
            let theta = PI * (f64::from(row) + 0.5) / f64::from(rows);
            for column in 0..columns {
                let phi = 2.0 * PI * (f64::from(column) + 0.5) / f64::from(columns);
                let direction = DVec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), -theta.cos());
                sum += self.candela(&axes, direction) * theta.sin();
            }
        }
        sum * (PI / f64::from(rows)) * (2.0 * PI / f64::from(columns))
    }
}

/// The numbers around a value, and its share of the second; `None` beyond them, by more than rounding.
fn between(angles: &[f64], value: f64) -> Option<(usize, usize, f64)> {
    let last = angles.len() - 1;
    if last == 0 && angles[0] == value {
        return Some((0, 0, 0.0));
    }
    if !(angles[0] - 1e-6..=angles[last] + 1e-6).contains(&value) {
        return None;
    }
    let next = angles
        .partition_point(|&angle| angle <= value)
        .clamp(1, last.max(1))
        .min(last);
    let before = next.saturating_sub(1);
    if before == next {
        return Some((next, next, 0.0));
    }
    let share = (value - angles[before]) / (angles[next] - angles[before]);
    Some((before, next, share.clamp(0.0, 1.0)))
}

fn out_of_range(what: &'static str, found: f64, expected: &'static str) -> Result<(), PhotometryError> {
    Err(PhotometryError::Wrong {
        what,
        found,
        expected,
    })
}

/// Whether rising angles lie where those of the type do.
fn check_vertical(kind: Type, angles: &[f64]) -> Result<(), PhotometryError> {
    let (low, high) = (angles[0], angles[angles.len() - 1]);
    let (least, most, expected) = match kind {
        Type::C => (0.0, 180.0, "of type C they lie between 0 and 180"),
        _ => (-180.0, 180.0, "of type A and B they lie between -180 and 180"),
    };
    if low < least || high > most {
        let found = if low < least { low } else { high };
        return out_of_range("a vertical angle", found, expected);
    }
    Ok(())
}

/// The same; of type C they also end where a symmetry ends.
fn check_horizontal(kind: Type, angles: &[f64]) -> Result<(), PhotometryError> {
    let (first, last) = (angles[0], angles[angles.len() - 1]);
    if kind != Type::C {
        if first < -180.0 || last > 180.0 {
            let found = if first < -180.0 { first } else { last };
            let expected = "of type A and B they lie between -180 and 180";
            return out_of_range("a horizontal angle", found, expected);
        }
        return Ok(());
    }
    let known = match angles.len() {
        1 => true,
        _ if first == 90.0 => last == 270.0,
        _ => first == 0.0 && (last == 90.0 || last == 180.0 || (last > 180.0 && last <= 360.0)),
    };
    if known {
        return Ok(());
    }
    out_of_range(
        "the last horizontal angle",
        last,
        "of type C they are one, or go from 0 to 90, 180 or 360, or from 90 to 270",
    )
}

#[cfg(test)]
mod tests;
