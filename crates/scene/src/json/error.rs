//! What can be wrong with a JSON file.

use std::path::PathBuf;
use thiserror::Error;

/// Why a lighting sequence, material edits or a scene description cannot be used.
#[derive(Debug, Error)]
pub enum JsonError {
    /// The file could not be read.
    #[error("cannot read the {what} {}: {source}", file.display())]
    Read {
        /// What the file should be, such as `lighting sequence`.
        what: &'static str,
        /// Which file.
        file: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// It is not JSON.
    #[error("{name}: not valid JSON at {place}: {message}")]
    Syntax {
        /// The file, as the caller names it.
        name: String,
        /// Where in it.
        place: LineColumn,
        /// What the parser said.
        message: String,
    },
    /// A field is missing, unknown, given twice, or holds something that it cannot hold.
    #[error("{name}: {path}: {message} ({place})")]
    Field {
        /// The file, as the caller names it.
        name: String,
        /// Where in it, such as `lights[2].intensity`.
        path: String,
        /// What was expected and what was found.
        message: String,
        /// Where the field's value begins, or what should hold the field; of one given twice, where the second begins.
        place: LineColumn,
    },
}

/// A place in a text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LineColumn {
    /// Line, from 1.
    pub line: usize,
    /// Column in bytes, from 1.
    pub column: usize,
}

impl std::fmt::Display for LineColumn {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "line {}, column {}", self.line, self.column)
    }
}
