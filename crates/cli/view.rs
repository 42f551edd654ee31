//! `relight view`: an asset in the browser.

use crate::console::Console;
use crate::demo;
use crate::failure::{Failure, Outcome};
use crate::kinds::{self, Wanted};
use crate::options::whole;
use crate::output;
use crate::signals;
use clap::Args;
use relight_play::Player;
use relight_scene::sequence::read_sequence_at;
use relight_view::{Exhibit, View};
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Open an asset in the browser and move its lights by hand, with indirect light, at once.
///
/// Serves one page on this machine and prints its address, which ends in a random word: whoever has it may look. Whatever is
/// changed is a lighting sequence and material edits, which the page saves as the JSON that relight play takes; at rest
/// the picture is what relight play writes. Ctrl-C ends it.
#[derive(Args)]
pub struct ViewArgs {
    /// Asset to show.
    #[arg(value_name = "ASSET.relight", required_unless_present = "demo")]
    pub asset: Option<PathBuf>,
    /// Lighting sequence to begin with; without it the scene's own lights.
    #[arg(long, value_name = "SEQ.json")]
    pub lights: Option<PathBuf>,
    /// Port to listen at; 0 for any that is free.
    #[arg(long, value_name = "N", default_value_t = 8420, value_parser = whole::<u16>(0, u16::MAX))]
    pub port: u16,
    /// Address to listen at instead of this machine's own: others who can reach it and have the page's address may look,
    /// and what is sent is not encrypted.
    #[arg(long, value_name = "ADDRESS", default_value_t = IpAddr::V4(Ipv4Addr::LOCALHOST))]
    pub listen: IpAddr,
    /// Open the page in the browser.
    #[arg(long)]
    pub open: bool,
    /// Show data/atrium.glb of a clone of the repository, which is baked into out/demo first if it wasn't yet.
    #[arg(long, conflicts_with_all = ["asset", "lights"])]
    pub demo: bool,
}

/// Runs the command.
pub fn run(args: &ViewArgs, seed: u64, console: &Console) -> Result<Outcome, Failure> {
    let (asset, lights) = match &args.asset {
        Some(asset) => (asset.clone(), args.lights.clone()),
        None => {
            let (asset, lights) = demo::asset(seed, console)?;
            (asset, Some(lights))
        }
    };
    kinds::check(&asset, Wanted::Asset)?;
    if let Some(lights) = &lights {
        kinds::check(lights, Wanted::Lights)?;
    }
    console.begin("Reading the asset", None);
    let exhibit = opened(&asset, lights.as_deref(), seed)?;
    signals::go_on()?;
    let watched = asset.clone();
    let view = View::bind(SocketAddr::new(args.listen, args.port), exhibit)?.watching(
        watched,
        Box::new(move || opened(&asset, lights.as_deref(), seed).map_err(|failure| failure.words())),
    );
    console.close();
    if !args.listen.is_loopback() {
        console.note(format!(
            "WARNING: listening at {}, not on this machine alone: whoever can reach it and has the address below sees the scene \
             and may use this machine's processors; nothing is encrypted.",
            args.listen
        ));
    }
    output::print_text(&format!("{}\n", view.url()))?;
    console.note("Open this address in a browser. Ctrl-C ends it.");
    if args.open
        && let Err(why) = open_browser(&view.url())
    {
        console.note(format!(
            "No browser was opened ({why}): open the address by hand."
        ));
    }
    view.serve(signals::stopped)?;
    console.note("Ended.");
    Ok(Outcome::Done)
}

/// The asset and its first lights.
fn opened(asset: &Path, lights: Option<&Path>, seed: u64) -> Result<Exhibit, Failure> {
    let player = Player::open(asset)?;
    let sequence = match lights {
        Some(file) => read_sequence_at(file, player.scene().offset)?,
        None => player.own_lights()?.clone(),
    };
    Ok(Exhibit {
        player,
        sequence,
        asset: asset.display().to_string(),
        lights_file: lights.map(|file| file.display().to_string()),
        seed,
    })
}

/// Opens the system's browser.
fn open_browser(url: &str) -> Result<(), String> {
    let program = if cfg!(target_os = "macos") {
        "open"
    } else if cfg!(windows) {
        "explorer"
    } else {
        "xdg-open"
    };
    let started = Command::new(program)
        .arg(url)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn();
    started.map(drop).map_err(|error| format!("{program}: {error}"))
}
