//! Writes the scenes and lighting sequences into `data/`, or into the folder given as the only argument.

use relight_data_generate::files;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

fn main() -> ExitCode {
    let arguments: Vec<_> = std::env::args_os().skip(1).collect();
    let folder = match arguments.as_slice() {
        [] => Path::new(env!("CARGO_MANIFEST_DIR")).join(".."),
        [folder] => PathBuf::from(folder),
        _ => {
            eprintln!("usage: relight-data-generate [FOLDER]");
            return ExitCode::from(2);
        }
    };
    if let Err(error) = std::fs::create_dir_all(&folder) {
        eprintln!("{}: {error}; name a folder that can be written", folder.display());
        return ExitCode::FAILURE;
    }
    for file in files() {
        let path = folder.join(file.name);
        if let Err(error) = std::fs::write(&path, &file.bytes) {
            eprintln!("{}: {error}; name a folder that can be written", path.display());
            return ExitCode::FAILURE;
        }
        // A reader that went away (`| head`) is no reason to stop.
        let _ = writeln!(std::io::stdout(), "{:>9} bytes  {}", file.bytes.len(), file.name);
    }
    ExitCode::SUCCESS
}
