//! The four ways in which reading or writing an asset fails, each with the evidence.

use std::fmt;
use std::path::{Path, PathBuf};

/// Shorthand for results of this crate.
pub type Result<T> = std::result::Result<T, FormatError>;

/// Why an asset could not be read or written. The class says who can act: the system's administrator
/// ([`Io`](Self::Io)), whoever made the file or the structure ([`Invalid`](Self::Invalid)), whoever installs
/// relight ([`Unsupported`](Self::Unsupported)), or the caller ([`LimitExceeded`](Self::LimitExceeded)).
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FormatError {
    /// The operating system refused a file operation.
    #[error("cannot {action} {}{}: {source}", path.display(), place_in_file(section, *offset))]
    Io {
        /// What was being done: "open", "read", "write", ...
        action: &'static str,
        /// The file concerned.
        path: PathBuf,
        /// The part of it, as [`Fault::section`] has it: `"file"` for the whole.
        section: String,
        /// Byte offset in the file.
        offset: u64,
        /// The operating system's reason.
        source: std::io::Error,
    },
    /// The bytes are damaged or no asset, or a structure breaks one of its rules.
    #[error("invalid asset: {0}; bake it again, or fetch it again if it was copied")]
    Invalid(Box<Fault>),
    /// The bytes may be right, but need another version of relight.
    #[error("unsupported asset: {0}; use a relight that reads it, or bake it again with this one")]
    Unsupported(Box<Fault>),
    /// Reading would take more than [`Limits`](crate::Limits) allow, or than the file can justify.
    #[error("limit exceeded: {0}; raise the limit if the file can be trusted")]
    LimitExceeded(Box<Fault>),
}

/// Nothing for the whole file.
fn place_in_file(section: &str, offset: u64) -> String {
    if section == "file" {
        String::new()
    } else {
        format!(" ({section}, byte {offset})")
    }
}

impl FormatError {
    /// The evidence, whatever the class: of [`Io`](Self::Io) what was to be done and what the system said.
    pub fn fault(&self) -> Fault {
        match self {
            FormatError::Io {
                action,
                path,
                section,
                offset,
                source,
            } => Fault {
                section: section.clone(),
                location: Location::File(*offset),
                expected: format!("to {action} {}", path.display()),
                found: source.to_string(),
            },
            FormatError::Invalid(fault)
            | FormatError::Unsupported(fault)
            | FormatError::LimitExceeded(fault) => Fault::clone(fault),
        }
    }
}

/// The evidence of a failure: where it is, what should stand there and what does.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fault {
    /// `"header"`, `"table"`, `"file"`, or the name of a section as [`layout::Kind::name`](crate::layout::Kind::name) has it.
    pub section: String,
    /// The location inside it.
    pub location: Location,
    /// What the specification or a limit asks for.
    pub expected: String,
    /// What was found instead.
    pub found: String,
}

/// A location in an asset.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Location {
    /// Byte offset from the start of the file.
    File(u64),
    /// Byte offset in the section's raw (decompressed) bytes.
    Raw(u64),
    /// Index of the offending element of an array in memory (vertex, point, row, link, material ...).
    Element(u64),
}

impl fmt::Display for Location {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Location::File(offset) => write!(f, "byte {offset} of the file"),
            Location::Raw(offset) => write!(f, "byte {offset} of the section's raw bytes"),
            Location::Element(index) => write!(f, "element {index}"),
        }
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Fault {
            section,
            location,
            expected,
            found,
        } = self;
        write!(f, "{section}, {location}: expected {expected}, found {found}")
    }
}

fn fault(
    section: &str,
    location: Location,
    expected: impl fmt::Display,
    found: impl fmt::Display,
) -> Box<Fault> {
    Box::new(Fault {
        section: section.to_string(),
        location,
        expected: expected.to_string(),
        found: found.to_string(),
    })
}

/// A [`FormatError::Io`] from the system's reason.
pub(crate) fn io(
    action: &'static str,
    path: &Path,
    section: &str,
    offset: u64,
) -> impl FnOnce(std::io::Error) -> FormatError {
    let (path, section) = (path.to_path_buf(), section.to_string());
    move |source| FormatError::Io {
        action,
        path,
        section,
        offset,
        source,
    }
}

/// An [`FormatError::Invalid`] with its evidence.
pub(crate) fn invalid(
    section: &str,
    location: Location,
    expected: impl fmt::Display,
    found: impl fmt::Display,
) -> FormatError {
    FormatError::Invalid(fault(section, location, expected, found))
}

/// [`invalid`] unless a rule holds.
pub(crate) fn require(
    holds: bool,
    section: &str,
    location: Location,
    expected: impl fmt::Display,
    found: impl fmt::Display,
) -> Result<()> {
    match holds {
        true => Ok(()),
        false => Err(invalid(section, location, expected, found)),
    }
}

/// An [`FormatError::Unsupported`] with its evidence.
pub(crate) fn unsupported(
    section: &str,
    location: Location,
    expected: impl fmt::Display,
    found: impl fmt::Display,
) -> FormatError {
    FormatError::Unsupported(fault(section, location, expected, found))
}

/// An [`FormatError::LimitExceeded`] with its evidence.
pub(crate) fn limit(
    section: &str,
    location: Location,
    expected: impl fmt::Display,
    found: impl fmt::Display,
) -> FormatError {
    FormatError::LimitExceeded(fault(section, location, expected, found))
}
