//! A last net under decoders of other people's: their panics are damaged data.

use std::panic::{AssertUnwindSafe, catch_unwind};

/// What `decode` returns; a panic in it is an error.
///
/// # Errors
/// What `decode` says, as the rest of a sentence.
pub(super) fn guarded<T>(decode: impl FnOnce() -> Result<T, String>) -> Result<T, String> {
    catch_unwind(AssertUnwindSafe(decode)).unwrap_or_else(|_| Err("is damaged: its decoder failed".into()))
}
