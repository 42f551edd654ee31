//! `relight mix`: a lighting sequence's intensities, written back into a copy of the scene's file.

mod document;
mod file;

use crate::console::Console;
use crate::failure::{Failure, Outcome};
use crate::guard::Guard;
use crate::kinds::{self, Kind, Wanted};
use crate::options::LightUnitsName;
use crate::options::ReplaceArgs;
use crate::output::{self, SCHEMA};
use crate::signals;
use crate::words;
use clap::Args;
use document::{Mixed, Strengths};
use file::Source;
use relight_scene::image::write_atomically;
use relight_scene::sequence::read_sequence;
use serde::Serialize;
use std::path::PathBuf;

/// Write the intensities of a lighting sequence into a copy of the scene it was made for.
///
/// Punctual lights, photometric lamps and area lights get colour and intensity by name, emissive materials their emission. What the
/// sequence doesn't name is dark in the copy, as it is where the sequence plays; lights that the scene doesn't have are told. Places and
/// directions stay as the scene has them.
#[derive(Args)]
pub struct MixArgs {
    /// Scene whose lights to set: .glb or .gltf.
    #[arg(value_name = "SCENE.glb")]
    pub scene: PathBuf,
    /// Lighting sequence, such as `view` saves.
    #[arg(long, value_name = "SEQ.json")]
    pub lights: PathBuf,
    /// Frame of the sequence.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub frame: u32,
    /// How the exporter wrote light intensities, as of bake: the copy has the same units.
    #[arg(long, value_enum, default_value_t = LightUnitsName::Spec)]
    pub light_units: LightUnitsName,
    /// The copy, of the same kind as the scene.
    #[arg(short, long, value_name = "COPY.glb")]
    pub output: PathBuf,
    #[command(flatten)]
    pub replace: ReplaceArgs,
    /// Print one JSON object on stdout.
    #[arg(long)]
    pub json: bool,
}

/// What `--json` prints.
#[derive(Serialize)]
struct Report {
    schema: u32,
    command: &'static str,
    scene: String,
    output: String,
    frame: u32,
    #[serde(flatten)]
    mixed: Mixed,
}

/// Runs the command.
pub fn run(args: &MixArgs, console: &Console) -> Result<Outcome, Failure> {
    kinds::check(&args.scene, Wanted::Scene)?;
    kinds::check(&args.lights, Wanted::Lights)?;
    let inputs = [args.scene.as_path(), args.lights.as_path()];
    Guard::new(args.replace.force)
        .reads(inputs)
        .check(&args.output, Kind::Scene)?;
    let source = Source::read(&args.scene)?;
    source.check_copy(&args.output)?;
    let sequence = read_sequence(&args.lights)?;
    if args.frame >= sequence.frames {
        return Err(Failure::Usage(format!(
            "--frame is {}, but the sequence has frames 0 to {}",
            args.frame,
            sequence.frames.max(1) - 1
        )));
    }
    let strengths = Strengths::of(&sequence.lights, args.frame.into(), args.light_units);
    let mut json = source.json.clone();
    let mixed = document::mix(&mut json, &strengths)
        .map_err(|error| error.context(args.scene.display().to_string()))?;
    output::prepare_output(&args.output)?;
    let bytes = source.with_json(&json)?;
    signals::go_on()?;
    {
        let _whole = signals::whole();
        write_atomically(&args.output, &bytes)?;
    }
    for note in mixed.notes() {
        console.note(format!("note: {note}"));
    }
    console.note(format!(
        "Wrote {} and {} into {}.",
        words::plural(mixed.lights.len(), "light"),
        words::plural(mixed.materials.len(), "emissive material"),
        args.output.display()
    ));
    if args.json {
        output::print_json(&Report {
            schema: SCHEMA,
            command: "mix",
            scene: args.scene.display().to_string(),
            output: args.output.display().to_string(),
            frame: args.frame,
            mixed,
        })?;
    }
    Ok(Outcome::Done)
}
