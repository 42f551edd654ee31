//! The smallest player: an asset and a lighting sequence to an OpenEXR frame, as `relight play` makes it.
//!
//! `cargo run --release -p relight-play --example smallest_player -- ASSET.relight SEQ.json FRAME.exr`

use relight_play::scene::image::{ExrHeader, write_exr};
use relight_play::scene::sequence::read_sequence;
use relight_play::{FrameSettings, Player, ShotSettings};
use std::error::Error;
use std::path::Path;

/// Relights the first frame of a sequence.
pub fn relight(asset: &Path, lights: &Path, output: &Path) -> Result<(), Box<dyn Error>> {
    let player = Player::open(asset)?;
    let sequence = read_sequence(lights)?;
    let camera = player.camera(&sequence, None)?;
    let lights = player.lights(&sequence.lights)?;
    let size = ShotSettings {
        width: 160,
        height: 90,
        ..ShotSettings::default()
    };
    let shot = player.shot(&camera.at(0.0), &size)?;
    let frame = player.frame(&shot, &lights, 0.0, &FrameSettings::default())?;
    write_exr(output, &frame.layers, &ExrHeader::new(), true)?;
    println!("{}", frame.choice);
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.as_slice() {
        [asset, lights, output] => relight(asset.as_ref(), lights.as_ref(), output.as_ref()),
        _ => Err("usage: smallest_player ASSET.relight SEQ.json FRAME.exr".into()),
    }
}
