//! How a command ends.

use std::process::ExitCode;

/// A command that ran to its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// All is well: exit code 0.
    Done,
    /// A check or comparison fell short of what was asked: exit code 3. The command has said so.
    FellShort,
}

/// A command that could not run to its end.
#[derive(Debug)]
pub enum Failure {
    /// Bad input, or the system refused: exit code 1.
    Failed(anyhow::Error),
    /// The command line asks for something that makes no sense: exit code 2.
    Usage(String),
    /// A signal asked to stop: exit code 128 + its number.
    Stopped(i32),
}

impl<E: Into<anyhow::Error>> From<E> for Failure {
    fn from(error: E) -> Self {
        Failure::Failed(error.into())
    }
}

impl Failure {
    /// One paragraph; `left` is what a command that was stopped leaves behind.
    pub fn text(&self, left: &str) -> String {
        match self {
            Failure::Failed(error) => format!("relight: error: {}", causes(error)),
            Failure::Usage(message) => format!("relight: error: {message}\nFor more, try --help."),
            Failure::Stopped(_) => format!("relight: stopped; {left}"),
        }
    }

    /// What is wrong, without who says so.
    pub fn words(&self) -> String {
        match self {
            Failure::Failed(error) => causes(error),
            Failure::Usage(message) => message.clone(),
            Failure::Stopped(_) => "stopped".into(),
        }
    }

    /// The process's exit code.
    pub fn exit_code(&self) -> ExitCode {
        match self {
            Failure::Failed(_) => ExitCode::from(1),
            Failure::Usage(_) => ExitCode::from(2),
            Failure::Stopped(signal) => ExitCode::from(128 + *signal as u8),
        }
    }
}

/// An error's words.
fn causes(error: &anyhow::Error) -> String {
    // Library errors carry their causes in their own words: only what was added in front is shown beside the last of them.
    let mut text = String::new();
    for cause in error.chain() {
        let cause = cause.to_string();
        if !text.contains(&cause) {
            text += if text.is_empty() { "" } else { ": " };
            text += &cause;
        }
    }
    text
}
