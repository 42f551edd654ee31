//! Prints where the points of an asset are: `cargo run --release -p relight-format --example read_points ASSET.relight`

use relight_format::{FormatError, Limits, layout::Kind, read_parts};

fn main() -> Result<(), FormatError> {
    let file = std::env::args().nth(1).unwrap_or("asset.relight".into());
    let asset = read_parts(file, &Limits::default(), &[Kind::Points])?;
    for (number, level) in asset.points.iter().enumerate() {
        println!(
            "level {number}: {} points, {} m apart",
            level.positions.len(),
            level.disk_radius
        );
        for (position, normal) in level.positions.iter().zip(&level.normals).take(3) {
            println!("  {position:?} facing {normal:?}");
        }
    }
    Ok(())
}
