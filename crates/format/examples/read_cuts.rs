//! Prints what the first sites see of the lights: `cargo run --release -p relight-format --example read_cuts ASSET.relight`

use relight_format::{FormatError, Limits, layout::Kind, read_parts};

fn main() -> Result<(), FormatError> {
    let file = std::env::args().nth(1).unwrap_or("asset.relight".into());
    let asset = read_parts(file, &Limits::default(), &[Kind::Cuts])?;
    let cuts = asset.cuts.unwrap_or_default();
    for (site, row) in cuts.row_offsets.windows(2).enumerate().take(3) {
        let mut first = 0;
        for i in row[0] as usize..row[1] as usize {
            let end = first + (1 << cuts.heights[i]);
            println!(
                "site {site}: {} of the lights {first} to {}",
                cuts.values[i],
                end - 1
            );
            first = end;
        }
    }
    Ok(())
}
