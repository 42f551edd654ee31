//! The program itself: built, and run for its JSON.

use serde_json::Value;
use std::error::Error;
use std::path::Path;
use std::process::Command;

pub type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// Of this build, and of the program that it runs.
pub const PROFILE: &str = ["release", "dev"][cfg!(debug_assertions) as usize];
/// Where assets go, and a picture of each of our own scenes.
pub const FOLDER: &str = "target/results";
/// Where scenes and references of others are.
pub const SHARED: &str = "../shared";
/// Exit codes with a result: all is well, or a bound was missed.
const CODES: [Option<i32>; 2] = [Some(0), Some(3)];

/// Builds the program in the profile of this example.
pub fn build() -> Result<()> {
    let arguments = ["build", "--bin", "relight", "--profile", PROFILE];
    match Command::new(env!("CARGO")).args(arguments).status()? {
        status if status.success() => Ok(()),
        status => Err(format!("cargo {}: {status}", arguments.join(" ")).into()),
    }
}

/// Runs the program; what it prints is JSON. What it complains of goes to stderr.
pub fn relight(arguments: &[&str]) -> Result<Value> {
    let command = format!("relight {}", arguments.join(" "));
    eprintln!("{command}");
    let program = std::env::current_exe()?.with_file_name("../relight");
    let output = (Command::new(program).args(arguments).output())
        .map_err(|error| format!("{command}: cannot be run: {error}"))?;
    let complaints = String::from_utf8_lossy(&output.stderr);
    eprint!("{complaints}");
    if !CODES.contains(&output.status.code()) {
        return Err(format!("{command}: {}: {}", output.status, complaints.trim()).into());
    }
    let said = serde_json::from_slice(&output.stdout);
    Ok(said.map_err(|error| format!("{command}: did not print JSON: {error}"))?)
}

/// What another program prints, or that it is unknown.
pub fn says(program: &str, arguments: &[&str]) -> String {
    let output = Command::new(program).args(arguments).output().ok();
    let text = output.and_then(|output| String::from_utf8(output.stdout).ok());
    let text = text.filter(|text| !text.trim().is_empty());
    text.unwrap_or("unknown".into()).trim().into()
}

/// The first of these files that is not there, in words.
pub fn absent<'a>(files: impl IntoIterator<Item = &'a str>) -> Option<String> {
    let file = files.into_iter().find(|file| !Path::new(file).exists())?;
    Some(format!("absent: {file}"))
}

/// An asset, and what its bake said.
#[derive(Clone)]
pub struct Baked {
    pub asset: String,
    said: Value,
}

impl Baked {
    /// Bakes a scene with options that have blanks between them.
    pub fn new(scene: &str, asset: String, options: &str) -> Result<Baked> {
        let mut arguments = vec!["bake", scene, "-o", &asset, "--json", "--quiet"];
        arguments.extend(options.split_whitespace());
        let said = relight(&arguments)?;
        Ok(Baked { asset, said })
    }

    /// The number at this place of the JSON; NaN if it is unknown.
    pub fn number(&self, at: &str) -> f64 {
        number(self.said.pointer(at))
    }

    /// Points of all levels.
    pub fn points(&self) -> f64 {
        let points = self.said["points"].as_array().into_iter().flatten();
        points.filter_map(Value::as_f64).sum()
    }

    /// Links of T.
    pub fn links(&self) -> f64 {
        self.number("/links_by_operator/transfer")
    }

    /// Error of indirect light that the bake expects, and its standard error.
    pub fn expected_error(&self) -> [f64; 2] {
        ["error", "error_noise"].map(|of| self.number(&format!("/expected/{of}")))
    }

    /// Bias, likewise.
    pub fn expected_bias(&self) -> [f64; 2] {
        ["bias", "bias_noise"].map(|of| self.number(&format!("/expected/{of}")))
    }
}

/// NaN where JSON has no number, as in place of what is not finite.
pub fn number(value: Option<&Value>) -> f64 {
    value.and_then(Value::as_f64).unwrap_or(f64::NAN)
}
