//! Options of one command that another one gives.

use crate::failure::Failure;
use clap::Args;

/// Options that clap parses as a command of ours would.
///
/// # Errors
/// The words are no such options.
pub fn parsed<T: Args>(words: &[String]) -> Result<T, Failure> {
    let command = T::augment_args(clap::Command::new("relight").no_binary_name(true));
    let matches = command
        .try_get_matches_from(words)
        .map_err(|error| Failure::Usage(error.to_string()))?;
    T::from_arg_matches(&matches).map_err(|error| Failure::Usage(error.to_string()))
}
