//! The smallest reader of an asset: what an engine of its own light needs, and no crate of ours but this one.
//!
//! `cargo run --release -p relight-format --example smallest_reader -- ASSET.relight`

use relight_format::{Limits, read_file};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args()
        .nth(1)
        .ok_or("usage: smallest_reader ASSET.relight")?;
    let asset = read_file(&path, &Limits::default())?;
    let points: usize = asset.points.iter().map(|level| level.positions.len()).sum();
    let links = asset.transfer.map_or(0, |links| links.columns.len());
    println!("{points} points, {links} links");
    Ok(())
}
