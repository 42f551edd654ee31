//! `relight schema`: the JSON Schemas of the files that people write.

use crate::failure::{Failure, Outcome};
use crate::output::print_json;
use clap::{Args, ValueEnum};
use relight_scene::schema;

/// Prints the JSON Schema of a kind of file, for editors to complete from and to check against.
#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub struct SchemaArgs {
    /// Of what: lighting sequences (`*.lights.json`), material edits, or scene descriptions (`*.scene.json`).
    #[arg(value_enum)]
    of: SchemaName,
}

const EXAMPLES: &str = "\
Examples:
  relight schema sequence > sequence.schema.json
  relight schema materials > materials.schema.json
  relight schema scene > scene.schema.json";

#[derive(Clone, Copy, ValueEnum)]
enum SchemaName {
    Sequence,
    Materials,
    Scene,
}

pub fn run(args: &SchemaArgs) -> Result<Outcome, Failure> {
    let schema = match args.of {
        SchemaName::Sequence => schema::sequence(),
        SchemaName::Materials => schema::materials(),
        SchemaName::Scene => schema::scene(),
    };
    print_json(&schema)?;
    Ok(Outcome::Done)
}
