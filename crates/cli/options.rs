//! Values of options, and options of one command that another one gives.

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

/// A relative error from text: a share such as 0.05, or 5%.
///
/// # Errors
/// It is no share above 0.
pub fn relative_error(text: &str) -> Result<f64, String> {
    let (number, scale) = match text.strip_suffix('%') {
        Some(percent) => (percent.trim(), 0.01),
        None => (text, 1.0),
    };
    match number.parse::<f64>() {
        Ok(value) if value.is_finite() && value > 0.0 => Ok(value * scale),
        _ => Err("expected a relative error above 0, such as 0.05 or 5%".into()),
    }
}
