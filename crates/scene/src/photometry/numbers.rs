//! The numbers of a photometric file.

use super::error::PhotometryError;

/// Most measured directions.
pub(super) const MAX_VALUES: usize = 1 << 20;

/// UTF-8, or else Latin-1, in which old files are.
pub(crate) fn text(bytes: &[u8]) -> String {
    match std::str::from_utf8(bytes) {
        Ok(text) => text.to_owned(),
        Err(_) => bytes.iter().map(|&byte| char::from(byte)).collect(),
    }
}

/// The words of a file that follow each other whatever line they are in.
pub(super) struct Numbers<I> {
    /// Each with the number of its line.
    pub words: I,
    /// That of the last one.
    pub line: usize,
}

/// The words of lines, each with its line's number.
pub(super) fn words<'a>(
    lines: impl Iterator<Item = (usize, &'a str)>,
) -> impl Iterator<Item = (usize, &'a str)> {
    lines.flat_map(|(number, line)| {
        let words = line.split([' ', '\t', ',', '\r']);
        words
            .filter(|word| !word.is_empty())
            .map(move |word| (number, word))
    })
}

impl<'a, I: Iterator<Item = (usize, &'a str)>> Numbers<I> {
    /// What went wrong, with the line where it did.
    pub fn placed(&self, error: PhotometryError) -> PhotometryError {
        match error {
            PhotometryError::NoNumber { .. } | PhotometryError::Wrong { .. } => PhotometryError::OnLine {
                line: self.line,
                error: Box::new(error),
            },
            error => error,
        }
    }

    pub fn next(&mut self, what: &'static str) -> Result<f64, PhotometryError> {
        let (line, word) = self.words.next().ok_or(PhotometryError::Truncated(what))?;
        self.line = line;
        match word.parse::<f64>() {
            Ok(number) if number.is_finite() => Ok(number),
            _ => Err(PhotometryError::NoNumber {
                what,
                found: word.chars().take(40).collect(),
            }),
        }
    }

    pub fn one_of(
        &mut self,
        what: &'static str,
        known: &[f64],
        expected: &'static str,
    ) -> Result<f64, PhotometryError> {
        let found = self.next(what)?;
        if known.contains(&found) {
            return Ok(found);
        }
        Err(PhotometryError::Wrong {
            what,
            found,
            expected,
        })
    }

    pub fn within(
        &mut self,
        what: &'static str,
        low: f64,
        high: f64,
        expected: &'static str,
    ) -> Result<f64, PhotometryError> {
        let found = self.next(what)?;
        if (low..=high).contains(&found) {
            return Ok(found);
        }
        Err(PhotometryError::Wrong {
            what,
            found,
            expected,
        })
    }

    pub fn count(&mut self, what: &'static str) -> Result<usize, PhotometryError> {
        let found = self.next(what)?;
        if found >= 1.0 && found <= MAX_VALUES as f64 && found.fract() == 0.0 {
            return Ok(found as usize);
        }
        Err(PhotometryError::Wrong {
            what,
            found,
            expected: "expected a whole number from 1 to 1048576",
        })
    }

    pub fn factor(&mut self, what: &'static str) -> Result<f64, PhotometryError> {
        let found = self.next(what)?;
        if found >= 0.0 {
            return Ok(found);
        }
        Err(PhotometryError::Wrong {
            what,
            found,
            expected: "expected a number of at least 0",
        })
    }

    pub fn angles(&mut self, count: usize, what: &'static str) -> Result<Vec<f64>, PhotometryError> {
        let mut angles: Vec<f64> = Vec::new();
        for _ in 0..count {
            let angle = self.next(what)?;
            if angles.last().is_some_and(|last| *last >= angle) {
                return Err(PhotometryError::Wrong {
                    what,
                    found: angle,
                    expected: "angles rise from one to the next",
                });
            }
            angles.push(angle);
        }
        Ok(angles)
    }
}
