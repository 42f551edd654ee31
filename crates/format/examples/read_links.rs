//! Prints what lights the first points: `cargo run --release -p relight-format --example read_links ASSET.relight`

use relight_format::{FormatError, Limits, layout::Kind, read_parts};

fn main() -> Result<(), FormatError> {
    let file = std::env::args().nth(1).unwrap_or("asset.relight".into());
    let asset = read_parts(file, &Limits::default(), &[Kind::LinksTransfer])?;
    let links = asset.transfer.unwrap_or_default();
    for (receiver, row) in links.row_offsets.windows(2).enumerate().take(10) {
        for link in row[0] as usize..row[1] as usize {
            println!(
                "point {receiver} gets {:?} W/m² per W/m² of sender {}",
                links.vectors[link], links.columns[link]
            );
        }
    }
    Ok(())
}
