//! What can go wrong when a glTF file is imported.

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

/// Faults listed in one error; further ones are only counted, since they mostly repeat the first.
pub const MAX_FAULTS: usize = 20;

/// One thing that is wrong with a file, and where.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fault {
    /// Place in the JSON, for example `accessors[3].count`.
    pub path: String,
    /// What was found there and what to do.
    pub message: String,
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.path, self.message)
    }
}

/// A required extension that is not supported, and the way out.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnsupportedExtension {
    /// Its name as in `extensionsRequired`.
    pub name: String,
    /// What to do, with the command of a tool where one exists.
    pub advice: String,
}

/// Why a file could not be imported.
#[derive(Debug, thiserror::Error)]
pub enum ImportError {
    /// The file itself could not be read.
    #[error("{}: cannot be read: {source}; check the path and its permissions", file.display())]
    Io {
        /// The file.
        file: PathBuf,
        /// What the operating system said.
        source: io::Error,
    },
    /// Neither a `.glb` nor glTF JSON, or a `.glb` that is cut off or damaged.
    #[error("{}: byte {offset}: {message}", file.display())]
    Container {
        /// The file.
        file: PathBuf,
        /// Byte offset in the file.
        offset: usize,
        /// What was expected and found, and what to do.
        message: String,
    },
    /// The JSON does not parse.
    #[error("{}: JSON, line {line}, column {column}: {message}; export the file again", file.display())]
    Json {
        /// The file.
        file: PathBuf,
        /// Line in the JSON, from 1.
        line: usize,
        /// Column in the JSON, from 1.
        column: usize,
        /// What the parser found.
        message: String,
    },
    /// The file says that it cannot be understood without extensions that are not supported.
    #[error("{}: extensionsRequired: {}", file.display(), list_extensions(extensions))]
    UnsupportedExtensions {
        /// The file.
        file: PathBuf,
        /// All of them.
        extensions: Vec<UnsupportedExtension>,
    },
    /// A variant was asked for that the file does not have.
    #[error("{}: there is no variant {name:?}; {}", file.display(), list_variants(names))]
    UnknownVariant {
        /// The file.
        file: PathBuf,
        /// What was asked for.
        name: String,
        /// What there is.
        names: Vec<String>,
    },
    /// The content breaks the rules of glTF 2.0, or a file that it names is missing.
    #[error("{}: {}", file.display(), list_faults(faults, *more))]
    Invalid {
        /// The file.
        file: PathBuf,
        /// What is wrong, in the order in which it was found; at most [`MAX_FAULTS`].
        faults: Vec<Fault>,
        /// How many more faults there are.
        more: usize,
    },
    /// A valid file without a single triangle to light.
    #[error("{}: {message}", file.display())]
    NoGeometry {
        /// The file.
        file: PathBuf,
        /// Why nothing is left, and what to do.
        message: String,
    },
    /// The importer itself failed. This is a bug in relight.
    #[error("{}: the importer failed ({message}); this is a bug in relight, please report it with the file", file.display())]
    Internal {
        /// The file.
        file: PathBuf,
        /// What the failing code said.
        message: String,
    },
}

impl ImportError {
    /// The file that could not be imported.
    pub fn file(&self) -> &Path {
        match self {
            ImportError::Io { file, .. }
            | ImportError::Container { file, .. }
            | ImportError::Json { file, .. }
            | ImportError::UnsupportedExtensions { file, .. }
            | ImportError::UnknownVariant { file, .. }
            | ImportError::Invalid { file, .. }
            | ImportError::NoGeometry { file, .. }
            | ImportError::Internal { file, .. } => file,
        }
    }
}

fn list_variants(names: &[String]) -> String {
    match names {
        [] => "the file has none (KHR_materials_variants): leave it out".to_owned(),
        _ => format!(
            "choose one of {}",
            names
                .iter()
                .map(|name| format!("{name:?}"))
                .collect::<Vec<_>>()
                .join(", ")
        ),
    }
}

fn list_extensions(extensions: &[UnsupportedExtension]) -> String {
    let parts: Vec<String> = extensions
        .iter()
        .map(|e| format!("{} is not supported: {}", e.name, e.advice))
        .collect();
    parts.join("; ")
}

fn list_faults(faults: &[Fault], more: usize) -> String {
    let mut parts: Vec<String> = faults.iter().map(Fault::to_string).collect();
    if more > 0 {
        parts.push(format!("and {more} more"));
    }
    parts.join("; ")
}
