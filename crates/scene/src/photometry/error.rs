//! What may be wrong with a photometric file.

use thiserror::Error;

/// Why a photometric file cannot be used.
#[derive(Debug, Error, PartialEq)]
pub enum PhotometryError {
    /// It could not be read.
    #[error("{0}")]
    Read(String),
    /// It has no TILT line, with which the numbers begin.
    #[error("there is no line TILT=…, with which the numbers of an IES file (LM-63) begin; is it one?")]
    NoTilt,
    /// The text ends early.
    #[error("it ends before {0}: the file is cut off; get it anew")]
    Truncated(&'static str),
    /// What should be a number is none.
    #[error("{what} is {found:?}, which is no number")]
    NoNumber {
        /// Which one.
        what: &'static str,
        /// As it stands there.
        found: String,
    },
    /// Factors for tilted lamps are in another file.
    #[error(
        "TILT={name}: {message}; put the file beside this one and mend it, or write TILT=NONE to go without its factors for tilted lamps"
    )]
    TiltFile {
        /// As the line has it.
        name: String,
        /// What is wrong with the other file.
        message: String,
    },
    /// Something on a line is wrong.
    #[error("line {line}: {error}")]
    OnLine {
        /// Counted from 1.
        line: usize,
        /// What.
        error: Box<PhotometryError>,
    },
    /// A number makes no sense.
    #[error("{what} is {found}; {expected}")]
    Wrong {
        /// Which one.
        what: &'static str,
        /// Its value.
        found: f64,
        /// What it may be.
        expected: &'static str,
    },
}
