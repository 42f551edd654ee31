//! Sections: how each part of an asset becomes raw bytes and back (SPEC 6). Every module has a pair `encode` and
//! `decode`; decoding checks what memory safety and allocation need, `validate` the rest.

pub mod cuts;
pub mod geometry;
pub mod light_tree;
pub mod links;
pub mod points;
pub mod records;
pub mod rows;
pub mod senders;
pub mod separations;
pub mod textures;
pub mod weights;

use crate::asset::{Asset, Coding};
use crate::codec::bytes::Cursor;
use crate::error::Result;
use crate::layout::Kind;

/// Version of the layout in which an asset's section is written: the lowest that holds it.
pub fn version(kind: Kind, asset: &Asset) -> u16 {
    let Coding { grey, short_links } = asset.coding;
    match kind {
        Kind::Points if grey => 2,
        Kind::LinksTransfer if short_links => 2,
        _ => 1,
    }
}

/// The raw bytes of one section of an asset, or `None` when the asset does not need it.
///
/// # Errors
/// `LimitExceeded` when small records take more than the format allows.
pub fn encode(kind: Kind, asset: &Asset) -> Result<Option<Vec<u8>>> {
    let mut out = Vec::new();
    let needed = match kind {
        Kind::Provenance => {
            records::encode(kind, &asset.provenance, &mut out)?;
            true
        }
        Kind::Geometry => {
            let geometry = &asset.geometry;
            geometry::encode(geometry, &mut out);
            !(geometry.meshes.is_empty() && geometry.instances.is_empty())
        }
        Kind::Materials => {
            records::encode(kind, &asset.materials, &mut out)?;
            !asset.materials.is_empty()
        }
        Kind::Textures => {
            textures::encode(&asset.textures, &mut out);
            !asset.textures.is_empty()
        }
        Kind::Stage => {
            out.extend_from_slice(asset.stage.json.as_bytes());
            !asset.stage.json.is_empty()
        }
        Kind::Points => {
            points::encode(&asset.points, asset.coding.grey, &mut out);
            !asset.points.is_empty()
        }
        Kind::LinksTransfer => asset
            .transfer
            .as_ref()
            .map(|links| links::encode(links, asset.coding.short_links, &mut out))
            .is_some(),
        Kind::LinksBounce => asset
            .bounce
            .as_ref()
            .map(|bounce| weights::encode_bounce(bounce, &mut out))
            .is_some(),
        Kind::LinksSolution => asset
            .solution
            .as_ref()
            .map(|solution| weights::encode_solution(solution, &mut out))
            .is_some(),
        Kind::Estimates => match &asset.estimates {
            Some(estimates) => {
                records::encode(kind, estimates, &mut out)?;
                true
            }
            None => false,
        },
        Kind::Senders => asset
            .senders
            .as_ref()
            .map(|senders| senders::encode(senders, &mut out))
            .is_some(),
        Kind::LightTree => asset
            .light_tree
            .as_ref()
            .map(|tree| light_tree::encode(tree, &mut out))
            .is_some(),
        Kind::Cuts => asset
            .cuts
            .as_ref()
            .map(|cuts| cuts::encode(cuts, &mut out))
            .is_some(),
        Kind::Separations => asset
            .separations
            .as_ref()
            .map(|separations| separations::encode(separations, &mut out))
            .is_some(),
    };
    Ok(needed.then_some(out))
}

/// Decodes the raw bytes of a section, in a known version of its layout, into the asset. `memory` is what decoded arrays may still take.
///
/// # Errors
/// `Invalid` when the bytes are not what SPEC 6 says, `LimitExceeded` when `memory` does not suffice.
pub fn decode(kind: Kind, version: u16, raw: &[u8], memory: &mut u64, asset: &mut Asset) -> Result<()> {
    let mut cursor = Cursor::new(kind.name(), raw, memory);
    match kind {
        Kind::Provenance => asset.provenance = records::decode(&mut cursor)?,
        Kind::Geometry => asset.geometry = geometry::decode(&mut cursor)?,
        Kind::Materials => asset.materials = records::decode(&mut cursor)?,
        Kind::Textures => asset.textures = textures::decode(&mut cursor)?,
        Kind::Stage => asset.stage.json = textures::text(&mut cursor, raw.len())?,
        Kind::Points => {
            asset.coding.grey = version == 2;
            asset.points = points::decode(&mut cursor, asset.coding.grey)?;
        }
        Kind::LinksTransfer => {
            asset.coding.short_links = version == 2;
            asset.transfer = Some(links::decode(&mut cursor, asset.coding.short_links)?);
        }
        Kind::LinksBounce => asset.bounce = Some(weights::decode_bounce(&mut cursor)?),
        Kind::LinksSolution => asset.solution = Some(weights::decode_solution(&mut cursor)?),
        Kind::Estimates => asset.estimates = Some(records::decode(&mut cursor)?),
        Kind::Senders => asset.senders = Some(senders::decode(&mut cursor)?),
        Kind::LightTree => asset.light_tree = Some(light_tree::decode(&mut cursor)?),
        Kind::Cuts => asset.cuts = Some(cuts::decode(&mut cursor)?),
        Kind::Separations => asset.separations = Some(separations::decode(&mut cursor)?),
    }
    cursor.finish()
}
