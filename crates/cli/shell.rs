//! `relight completions` and `relight man`: what shells complete from, and pages for `man`.

use crate::console::Console;
use crate::failure::{Failure, Outcome};
use crate::guard::Guard;
use crate::kinds::Kind;
use crate::options::ReplaceArgs;
use crate::output;
use crate::signals;
use crate::words;
use clap::{Args, Command};
use clap_complete::{Shell, generate};
use clap_mangen::Man;
use relight_scene::image::write_atomically;
use std::path::PathBuf;

/// Print what a shell needs to complete the commands and options of relight.
///
/// bash: relight completions bash > ~/.local/share/bash-completion/completions/relight. zsh: write to _relight in a folder of
/// $fpath. fish: write to ~/.config/fish/completions/relight.fish. elvish and powershell: add it to what they read at their start.
#[derive(Args)]
pub struct CompletionsArgs {
    /// The shell.
    #[arg(value_enum, value_name = "SHELL")]
    shell: Shell,
}

/// Write pages for man: relight.1, and one for each command.
///
/// Afterwards, with ~/.local/share/man/man1 for DIR: man relight-bake.
#[derive(Args)]
pub struct ManArgs {
    /// Folder to write into.
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    #[command(flatten)]
    replace: ReplaceArgs,
}

/// Prints completions of `cli`.
///
/// # Errors
/// stdout cannot be written.
pub fn completions(args: &CompletionsArgs, mut cli: Command) -> Result<Outcome, Failure> {
    let mut script = Vec::new();
    generate(args.shell, &mut cli, "relight", &mut script);
    output::print_text(&String::from_utf8_lossy(&script))?;
    Ok(Outcome::Done)
}

/// Writes the pages of `cli`: all of them or none.
///
/// # Errors
/// One would replace something else, or cannot be written.
pub fn man(args: &ManArgs, mut cli: Command, console: &Console) -> Result<Outcome, Failure> {
    cli.build();
    let mut pages = vec![("relight.1".to_owned(), rendered(cli.clone())?)];
    for command in cli.get_subcommands().filter(|c| c.get_name() != "help") {
        let name = format!("relight-{}.1", command.get_name());
        pages.push((name, rendered(command.clone())?));
    }
    let guard = Guard::new(args.replace.force);
    for (name, _) in &pages {
        let file = args.folder.join(name);
        guard.check(&file, Kind::Man)?;
        output::prepare_output(&file)?;
    }
    let _whole = signals::whole();
    for (name, page) in &pages {
        write_atomically(&args.folder.join(name), page)?;
    }
    console.note(format!(
        "Wrote {} into {}.",
        words::plural(pages.len(), "page"),
        args.folder.display()
    ));
    Ok(Outcome::Done)
}

fn rendered(command: Command) -> std::io::Result<Vec<u8>> {
    let mut page = Vec::new();
    Man::new(command).render(&mut page)?;
    Ok(page)
}
