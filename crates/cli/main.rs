//! The command line of relight: bake light transport once, relight as often as you like.
//!
//! One file per command; each parses its options, calls the libraries, reports, and leaves. Human words go to
//! stderr, data to stdout.
#![forbid(unsafe_code)]

mod bake;
mod check;
mod compare;
mod console;
mod demo;
mod export;
mod failure;
mod frames;
mod guard;
mod help;
mod images;
mod inspect;
mod inspection;
mod kinds;
mod mix;
mod movie;
mod options;
mod output;
mod photometric;
mod play;
mod report;
mod schema;
mod shell;
mod signals;
mod statistics;
mod target;
mod text;
mod view;
mod words;

use clap::{Args, CommandFactory, FromArgMatches, Parser, Subcommand};
use console::{Console, ProgressStyleName};
use failure::{Failure, Outcome};
use options::whole;
use std::path::Path;
use std::process::ExitCode;

/// Precomputes how light travels through a static scene, keeps the result in one compact file, and relights
/// the scene for any sequence of lights, many times faster than rendering it again.
#[derive(Parser)]
#[command(name = "relight", version, propagate_version = true, after_help = EXIT_CODES)]
struct Cli {
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    global: Global,
}

const EXIT_CODES: &str = "\
Words for people go to stderr, data to stdout; --json prints exactly one JSON object there.
Exit codes: 0 done; 1 failed (bad input, input or output); 2 wrong usage; 3 a check or comparison fell short;
130 and 143 stopped by Ctrl-C or SIGTERM, with everything left whole.";

/// Options that every command knows.
#[derive(Args)]
#[command(next_help_heading = "Every command")]
struct Global {
    /// No progress and no notes on stderr; errors and --json stay.
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    quiet: bool,
    /// More about what is being done.
    #[arg(short, long, global = true)]
    verbose: bool,
    /// Worker threads; all cores by default. Results do not depend on it.
    #[arg(long, global = true, value_name = "N", value_parser = whole::<u16>(1, 1024))]
    threads: Option<u16>,
    /// Seed of all random numbers: same inputs and seed, same bytes.
    #[arg(long, global = true, value_name = "S", default_value_t = 0, value_parser = whole::<u64>(0, u64::MAX))]
    seed: u64,
    /// How progress is shown on stderr: bars on a terminal and lines elsewhere, lines, or JSON lines for farms.
    #[arg(long, global = true, value_enum, default_value_t = ProgressStyleName::Auto)]
    progress: ProgressStyleName,
}

#[derive(Subcommand)]
enum Command {
    Bake(bake::BakeArgs),
    Play(play::PlayArgs),
    View(view::ViewArgs),
    Inspect(inspect::InspectArgs),
    Check(check::CheckArgs),
    Export(export::ExportArgs),
    Mix(mix::MixArgs),
    Compare(compare::CompareArgs),
    Report(report::ReportArgs),
    Demo(demo::DemoArgs),
    Schema(schema::SchemaArgs),
    Completions(shell::CompletionsArgs),
    Man(shell::ManArgs),
}

fn main() -> ExitCode {
    let matches = help::complete(Cli::command()).try_get_matches();
    let cli = match matches.and_then(|matches| Cli::from_arg_matches(&matches)) {
        Ok(cli) => cli,
        Err(error) => return answer(&error),
    };
    let console = Console::new(cli.global.quiet, cli.global.verbose, cli.global.progress);
    let result = std::thread::scope(|scope| {
        let (running, ended) = std::sync::mpsc::channel();
        scope.spawn(|| {
            // Its own, so that it ends with the command.
            let ended = ended;
            signals::leave_soon(&ended, |failure| say(failure, &cli, &console));
        });
        let result = run(&cli, &console);
        drop(running);
        result
    });
    if let Err(failure) = &result {
        say(failure, &cli, &console);
    }
    console.close();
    output::tidy();
    match result {
        Ok(Outcome::Done) => ExitCode::SUCCESS,
        Ok(Outcome::FellShort) => ExitCode::from(3),
        Err(failure) => failure.exit_code(),
    }
}

/// Help and the version, which go to stdout with code 0, or what is wrong with the command line, with code 2. Then nobody has taken
/// `--progress json` in, which holds all the same.
fn answer(error: &clap::Error) -> ExitCode {
    let words: Vec<_> = std::env::args_os().collect();
    let json = words.iter().any(|word| word == "--progress=json")
        || words
            .windows(2)
            .any(|pair| pair[0] == "--progress" && pair[1] == "json");
    if json && error.use_stderr() {
        let console = Console::new(false, false, ProgressStyleName::Json);
        console.fail(error.render().to_string().trim_end());
    } else {
        // Nobody is left to tell.
        let _ = error.print();
    }
    ExitCode::from(error.exit_code() as u8)
}

/// Says how a command failed.
fn say(failure: &Failure, cli: &Cli, console: &Console) {
    console.close();
    let left = match failure {
        Failure::Stopped(_) => cli.command.left_behind(),
        _ => String::new(),
    };
    output::tidy();
    console.fail(&failure.text(&left));
}

impl Command {
    /// What is there when it was stopped, and how to go on.
    fn left_behind(&self) -> String {
        match self {
            Command::Bake(args) => bake::left_behind(args),
            Command::Play(_) => {
                "frames that were finished are whole, and nothing else was left behind".into()
            }
            Command::Report(args) => format!(
                "what was measured is kept in {}: the same command goes on from there",
                args.output.display()
            ),
            Command::Demo(args) => finished(&args.output),
            Command::Inspect(args) => args.images.as_deref().map_or_else(nothing, finished),
            Command::Check(args) => args.images.as_deref().map_or_else(nothing, finished),
            _ => nothing(),
        }
    }
}

fn nothing() -> String {
    "nothing was left behind".into()
}

/// What a command that writes file after file leaves.
fn finished(folder: &Path) -> String {
    match folder.exists() {
        true => format!("files that were finished are whole in {}", folder.display()),
        false => nothing(),
    }
}

fn run(cli: &Cli, console: &Console) -> Result<Outcome, Failure> {
    signals::install()?;
    if let Some(threads) = cli.global.threads {
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads.into())
            .build_global()?;
    }
    let seed = cli.global.seed;
    match &cli.command {
        Command::Bake(args) => bake::run(args, seed, console),
        Command::Play(args) => play::run(args, seed, console),
        Command::View(args) => view::run(args, seed, console),
        Command::Inspect(args) => inspect::run(args, console),
        Command::Check(args) => check::run(args, seed, console),
        Command::Export(args) => export::run(args, seed, console),
        Command::Mix(args) => mix::run(args, console),
        Command::Compare(args) => compare::run(args, console),
        Command::Report(args) => report::run(args, seed, console),
        Command::Demo(args) => demo::run(args, seed, console),
        Command::Schema(args) => schema::run(args),
        Command::Completions(args) => shell::completions(args, help::complete(Cli::command())),
        Command::Man(args) => shell::man(args, help::complete(Cli::command()), console),
    }
}
