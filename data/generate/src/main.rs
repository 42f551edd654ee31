//! Writes the scenes and lighting sequences into `data/`, or into the folder given as the only argument; `random --seed N
//! [FOLDER]` writes `random_N.glb` and `random_N.lights.json`, into this folder unless told otherwise, and says what they hold.

use relight_data_generate::{files, random};
use std::io::Write;
use std::path::Path;
use std::process::ExitCode;

const USAGE: &str =
    "usage: relight-data-generate [FOLDER]\n       relight-data-generate random --seed N [FOLDER]";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let done = match words.as_slice() {
        ["random", "--seed", seed, folder @ ..] if folder.len() < 2 => match seed.parse() {
            Ok(seed) => write_random(seed, Path::new(folder.first().unwrap_or(&"."))),
            Err(error) => Err(format!("--seed {seed}: {error}; give a whole number from 0")),
        },
        ["random", ..] => return usage(),
        [] => write_all(&Path::new(env!("CARGO_MANIFEST_DIR")).join("..")),
        [folder] => write_all(Path::new(folder)),
        _ => return usage(),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("{message}");
            ExitCode::FAILURE
        }
    }
}

fn usage() -> ExitCode {
    eprintln!("{USAGE}");
    ExitCode::from(2)
}

fn write_all(folder: &Path) -> Result<(), String> {
    files().iter().try_for_each(|file| {
        write(folder, file.name, &file.bytes)?;
        say(&format!("{:>9} bytes  {}", file.bytes.len(), file.name));
        Ok(())
    })
}

fn write_random(seed: u64, folder: &Path) -> Result<(), String> {
    let scene = random(seed);
    write(folder, &format!("random_{seed}.glb"), &scene.glb.to_bytes())?;
    write(folder, &format!("random_{seed}.lights.json"), &scene.sequence)?;
    say(&format!("random_{seed}: {}", scene.says));
    Ok(())
}

fn write(folder: &Path, name: &str, bytes: &[u8]) -> Result<(), String> {
    let path = folder.join(name);
    let written = std::fs::create_dir_all(folder).and_then(|()| std::fs::write(&path, bytes));
    written.map_err(|error| format!("{}: {error}; name a folder that can be written", path.display()))
}

/// A reader that went away (`| head`) is no reason to stop.
fn say(line: &str) {
    let _ = writeln!(std::io::stdout(), "{line}");
}
