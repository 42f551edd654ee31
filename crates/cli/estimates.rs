//! What a bake expects of its asset's errors, and says in it.

use relight_format::Estimates;

/// Names of the estimates in the file (SPEC 6.10).
pub const TARGET: &str = "target_error";
/// The error that is expected.
pub const ERROR: &str = "error_indirect";
/// The noise of the reference of the estimate.
pub const NOISE: &str = "error_noise";

/// An error in words.
pub fn percent(error: f64) -> String {
    format!("{:.1} %", 100.0 * error)
}

/// What a bake that was asked for an error expects of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Expected {
    /// The error that is expected.
    pub error: f64,
    /// The error that was asked for.
    pub target: f64,
}

impl Expected {
    /// Of an asset, if its bake was asked.
    pub fn of(estimates: Option<&Estimates>) -> Option<Expected> {
        let of = |name: &str| {
            let mut values = estimates.iter().flat_map(|e| &e.values);
            values.find(|e| e.0 == name).map(|e| e.1)
        };
        Some(Expected {
            error: of(ERROR)?,
            target: of(TARGET)?,
        })
    }
}

/// One line on the error that a bake expects of its asset, if it was asked for one.
pub fn line(estimates: Option<&Estimates>) -> Option<String> {
    let Expected { error, target } = Expected::of(estimates)?;
    Some(format!(
        "indirect light is expected to err by {} (--target-error {})",
        percent(error),
        percent(target)
    ))
}
