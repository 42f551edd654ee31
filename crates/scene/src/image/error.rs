//! What can go wrong with an image, and the limits under which readers work.

use crate::lfs::{LFS_ADVICE, is_lfs_pointer};
use std::path::Path;

/// Why an image could not be read or written. `file` is the path, or says where the bytes came from.
#[derive(Debug, thiserror::Error)]
pub enum ImageError {
    /// The file system refused.
    #[error("{file}: {action} failed: {source}")]
    Io {
        /// The file.
        file: String,
        /// What was tried.
        action: &'static str,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The content is not what the format, or the caller's contract, demands.
    #[error("{file}: {detail}")]
    Invalid {
        /// The file.
        file: String,
        /// Place, what was found and what to do.
        detail: String,
    },
    /// The content is legal but relight does not read it.
    #[error("{file}: {detail}")]
    Unsupported {
        /// The file.
        file: String,
        /// What was found and what to do.
        detail: String,
    },
    /// Reading would need more memory than [`Limits`] allow.
    #[error(
        "{file}: {what} is {found}, over the limit of {limit}; make the image smaller or raise the limit"
    )]
    LimitExceeded {
        /// The file.
        file: String,
        /// Which quantity.
        what: &'static str,
        /// What the file asks for.
        found: u64,
        /// What is allowed.
        limit: u64,
    },
}

impl ImageError {
    pub(crate) fn io(path: &Path, action: &'static str, source: std::io::Error) -> Self {
        Self::Io {
            file: path.display().to_string(),
            action,
            source,
        }
    }

    pub(crate) fn invalid(file: &str, detail: impl Into<String>) -> Self {
        Self::Invalid {
            file: file.into(),
            detail: detail.into(),
        }
    }

    pub(crate) fn unsupported(file: &str, detail: impl Into<String>) -> Self {
        Self::Unsupported {
            file: file.into(),
            detail: detail.into(),
        }
    }
}

/// How much a reader may be asked for. Checked against a file's own statements before anything is allocated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Largest number of pixels (width × height).
    pub max_pixels: u64,
    /// Largest number of decoded bytes, over all channels and layers.
    pub max_bytes: u64,
    /// Largest file, in bytes.
    pub max_file_bytes: u64,
}

impl Default for Limits {
    /// An environment map of 16,384 × 8,192 pixels passes in RGB floats (1.6 GB); little above it does.
    fn default() -> Self {
        Self {
            max_pixels: 1 << 27,
            max_bytes: 2 << 30,
            max_file_bytes: 2 << 30,
        }
    }
}

impl Limits {
    /// Refuses an image of that size.
    pub(crate) fn check(
        &self,
        file: &str,
        width: u64,
        height: u64,
        bytes_per_pixel: u64,
    ) -> Result<(), ImageError> {
        let over = |what, found, limit| ImageError::LimitExceeded {
            file: file.into(),
            what,
            found,
            limit,
        };
        let pixels = width.saturating_mul(height);
        if pixels > self.max_pixels {
            return Err(over("the number of pixels", pixels, self.max_pixels));
        }
        let bytes = pixels.saturating_mul(bytes_per_pixel);
        if bytes > self.max_bytes {
            return Err(over("the decoded size in bytes", bytes, self.max_bytes));
        }
        Ok(())
    }
}

/// Reads a whole file that is no larger than the limit.
pub(crate) fn read_file(path: &Path, limits: &Limits) -> Result<Vec<u8>, ImageError> {
    use std::io::Read;
    let file = std::fs::File::open(path).map_err(|e| ImageError::io(path, "opening", e))?;
    let metadata = file.metadata().map_err(|e| ImageError::io(path, "opening", e))?;
    let too_large = |found| ImageError::LimitExceeded {
        file: path.display().to_string(),
        what: "the file's size in bytes",
        found,
        limit: limits.max_file_bytes,
    };
    if metadata.len() > limits.max_file_bytes {
        return Err(too_large(metadata.len()));
    }
    let mut bytes = Vec::with_capacity(metadata.len() as usize);
    // A pipe or a growing file says nothing true about its length: stop one byte over the limit.
    file.take(limits.max_file_bytes.saturating_add(1))
        .read_to_end(&mut bytes)
        .map_err(|e| ImageError::io(path, "reading", e))?;
    if bytes.len() as u64 > limits.max_file_bytes {
        return Err(too_large(bytes.len() as u64));
    }
    if is_lfs_pointer(&bytes) {
        let detail = format!("this {LFS_ADVICE}");
        return Err(ImageError::invalid(&path.display().to_string(), detail));
    }
    Ok(bytes)
}
