//! Values of options, and options of one command that another one gives.

use crate::failure::Failure;
use clap::{Args, ValueEnum};
use glam::DVec3;
use std::fmt::Display;
use std::str::FromStr;

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

/// What may be replaced.
#[derive(Args, Clone, Copy, Debug, Default)]
pub struct ReplaceArgs {
    /// Replace files that are there although they are of another kind than what is written; of `bake`, also go on although the disk
    /// seems to have too little room. What the command reads is never replaced.
    #[arg(long)]
    pub force: bool,
}

/// Reads a whole number from `low` to `high`.
pub fn whole<T: FromStr + PartialOrd + Display + Copy + Send + Sync + 'static>(
    low: T,
    high: T,
) -> impl Fn(&str) -> Result<T, String> + Clone + Send + Sync + 'static {
    move |text| match text.parse::<T>() {
        Ok(number) if number >= low && number <= high => Ok(number),
        _ => Err(format!("expected a whole number from {low} to {high}")),
    }
}

/// Reads a number from `low` to `high`.
pub fn real(low: f32, high: f32) -> impl Fn(&str) -> Result<f32, String> + Clone + Send + Sync + 'static {
    move |text| match text.parse::<f32>() {
        Ok(number) if number >= low && number <= high => Ok(number),
        _ => Err(format!("expected a number from {low} to {high}")),
    }
}

/// Reads a number above 0 up to `high`; what one may be has `unit` after it.
pub fn above_0(
    high: f32,
    unit: &'static str,
) -> impl Fn(&str) -> Result<f32, String> + Clone + Send + Sync + 'static {
    move |text| match text.parse::<f32>() {
        Ok(number) if number > 0.0 && number <= high => Ok(number),
        _ if high == f32::INFINITY => Err(format!("expected a number above 0{unit}")),
        _ => Err(format!("expected a number above 0 and at most {high}{unit}")),
    }
}

/// A relative error from text: a share such as 0.05, or 5%.
///
/// # Errors
/// It is no share above 0 and at most 1.
pub fn relative_error(text: &str) -> Result<f64, String> {
    let (number, scale) = match text.strip_suffix('%') {
        Some(percent) => (percent.trim(), 0.01),
        None => (text, 1.0),
    };
    match number.parse::<f64>() {
        Ok(value) if value > 0.0 && value * scale <= 1.0 => Ok(value * scale),
        _ => Err("expected a relative error above 0 and at most 1 (100%), such as 0.05 or 5%".into()),
    }
}

/// Units in which an exporter wrote light intensities.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum LightUnitsName {
    /// Candela and lux.
    Spec,
    /// W/sr and W/m².
    Unitless,
    /// Watts and W/m².
    Raw,
}

/// Beyond this no scene lies; squares of distances are within 32-bit numbers.
const FARTHEST: f64 = 1e12;

/// Reads a point of the scene's file.
///
/// # Errors
/// It is none.
pub fn parse_point(text: &str) -> Result<DVec3, String> {
    let numbers: Option<Vec<f64>> = text
        .split(',')
        .map(|part| part.trim().parse().ok().filter(|x: &f64| x.abs() <= FARTHEST))
        .collect();
    match numbers.as_deref() {
        Some(&[x, y, z]) => Ok(DVec3::new(x, y, z)),
        _ => Err(format!(
            "expected three numbers from -{FARTHEST:e} to {FARTHEST:e} with commas between them, such as 1.5,2,-3"
        )),
    }
}
