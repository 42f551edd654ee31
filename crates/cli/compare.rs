//! `relight compare`: how far an image, or a sequence of them, is from a reference.

mod args;
mod images;
mod layers;
mod sequences;

use crate::console::Console;
use crate::failure::{Failure, Outcome};

pub use args::CompareArgs;
pub use images::results_table;

/// Runs the command.
pub fn run(args: &CompareArgs, console: &Console) -> Result<Outcome, Failure> {
    match sequences::given(args)? {
        Some(both) => sequences::run(args, &both, console),
        None => images::run(args, console),
    }
}
