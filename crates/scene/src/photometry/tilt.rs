//! TILT of a photometric file: lamps that burn brighter or darker as their luminaire is tilted.
//!
//! Source: LM-63-2002, 5.10 to 5.13, and LM-63-2019, annex F. A discharge lamp's light depends on how it lies. Factors on all candela are
//! given over the angle by which the luminaire is tilted from where it points straight down, 0 to 180°. Between angles they are interpolated
//! linearly, beyond the first and the last one the nearest holds.
//!
//! Down is −Y. How the lamp lies in its luminaire (vertical; horizontal, about its own axis or not) says about which axis the factors were measured;
//! files have one row of factors whichever it is, and it is applied to any tilt.

use super::error::PhotometryError;
use super::numbers::{Numbers, text, words};
use glam::DVec3;
use std::path::Path;

/// Most bytes of a file of factors.
const MAX_BYTES: u64 = 1 << 20;
/// Most angles: files have ten or so.
const MOST_ANGLES: f64 = 4096.0;
/// Largest factor; lamps have 0.7 to 1.2.
const MOST_FACTOR: f64 = 100.0;

/// Factors over the tilt.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Tilt {
    /// Degrees, rising, 0 to 180; at least one.
    angles: Vec<f64>,
    /// As many.
    factors: Vec<f64>,
}

impl Tilt {
    /// Reads what follows TILT=INCLUDE, or all of a file of its own.
    pub fn parse<'a>(
        numbers: &mut Numbers<impl Iterator<Item = (usize, &'a str)>>,
    ) -> Result<Tilt, PhotometryError> {
        numbers.one_of(
            "the lamp's place in the luminaire, first of TILT,",
            &[1.0, 2.0, 3.0],
            "1 is a vertical lamp, 2 and 3 are horizontal ones; mend the lines behind TILT, or write TILT=NONE and leave them out",
        )?;
        let count = numbers.within(
            "the number of tilt angles",
            1.0,
            MOST_ANGLES,
            "expected a whole number from 1 to 4096; mend the lines behind TILT, or write TILT=NONE and leave them out",
        )?;
        if count.fract() != 0.0 {
            return Err(PhotometryError::Wrong {
                what: "the number of tilt angles",
                found: count,
                expected: "expected a whole number from 1 to 4096",
            });
        }
        let angles = numbers.angles(count as usize, "a tilt angle")?;
        for &angle in &angles {
            if !(0.0..=180.0).contains(&angle) {
                return Err(PhotometryError::Wrong {
                    what: "a tilt angle",
                    found: angle,
                    expected: "they lie between 0 (straight down) and 180",
                });
            }
        }
        let mut factors = Vec::with_capacity(angles.len());
        for _ in &angles {
            let expected = "expected a number from 0 to 100, as many as there are tilt angles";
            factors.push(numbers.within("a factor of TILT", 0.0, MOST_FACTOR, expected)?);
        }
        Ok(Tilt { angles, factors })
    }

    /// Factor of a lamp that points along a unit vector.
    pub fn factor(&self, aim: DVec3) -> f64 {
        let down = DVec3::NEG_Y;
        // Accurate also near straight down, where the arc cosine is not.
        let angle = aim.cross(down).length().atan2(aim.dot(down)).to_degrees();
        let next = self.angles.partition_point(|&other| other <= angle);
        if next == 0 || next == self.angles.len() {
            return self.factors[next.saturating_sub(1)];
        }
        let share = (angle - self.angles[next - 1]) / (self.angles[next] - self.angles[next - 1]);
        self.factors[next - 1] * (1.0 - share) + self.factors[next] * share
    }
}

/// The value of a line TILT=….
pub(super) fn value(line: &str) -> Option<&str> {
    let (key, value) = line.split_once('=')?;
    key.trim().eq_ignore_ascii_case("TILT").then(|| value.trim())
}

/// The text of a photometric file with the factors of TILT in it: where it names another file for them, `read` (a name, as it stands there) gets
/// that one's bytes.
///
/// # Errors
/// The other file cannot be read, or is none of factors.
pub fn with_tilt(
    file: String,
    read: impl FnOnce(&str) -> Result<Vec<u8>, String>,
) -> Result<String, PhotometryError> {
    let named = file
        .lines()
        .enumerate()
        .find_map(|(i, line)| Some((i, value(line)?)));
    let Some((at, name)) = named else {
        return Ok(file);
    };
    if ["NONE", "INCLUDE"]
        .iter()
        .any(|word| name.eq_ignore_ascii_case(word))
    {
        return Ok(file);
    }
    let wrong = |message: String| PhotometryError::TiltFile {
        name: name.to_owned(),
        message,
    };
    // As DOS writes folders.
    let bytes = read(&name.replace('\\', "/")).map_err(wrong)?;
    let factors = text(&bytes);
    // Some have the line TILT=INCLUDE before the numbers.
    let factors: Vec<(usize, &str)> = (1..)
        .zip(factors.lines().map(str::trim))
        .filter(|(_, line)| value(line).is_none())
        .collect();
    let mut numbers = Numbers {
        words: words(factors.iter().copied()),
        line: 0,
    };
    Tilt::parse(&mut numbers).map_err(|error| wrong(numbers.placed(error).to_string()))?;
    if let Some((line, word)) = numbers.words.next() {
        let word: String = word.chars().take(40).collect();
        return Err(wrong(format!(
            "line {}: there is more behind the factors, {word:?}; take it out",
            line
        )));
    }
    let mut out = String::new();
    for (i, line) in file.lines().enumerate() {
        out += if i == at { "TILT=INCLUDE" } else { line };
        out.push('\n');
        if i == at {
            for (_, line) in &factors {
                out += line;
                out.push('\n');
            }
        }
    }
    Ok(out)
}

/// Reads the file that TILT names, beside the photometric one in `folder`.
///
/// # Errors
/// Why it cannot be read.
pub fn read_beside(folder: &Path, name: &str) -> Result<Vec<u8>, String> {
    let path = folder.join(name);
    let fail = |error: std::io::Error| format!("{}: cannot be read: {error}", path.display());
    let metadata = std::fs::metadata(&path).map_err(fail)?;
    let size = metadata.len();
    if !metadata.is_file() {
        return Err(format!("{}: is no plain file", path.display()));
    }
    if size > MAX_BYTES {
        return Err(format!("{}: has {size} bytes, too many for it", path.display()));
    }
    std::fs::read(&path).map_err(fail)
}
