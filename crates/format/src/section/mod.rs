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

use crate::asset::{Asset, Coding, Material};
use crate::codec::bytes::Cursor;
use crate::error::{Location, Result, require};
use crate::layout::Kind;

/// Version of the layout in which an asset's section is written: the lowest that holds it.
pub fn version(kind: Kind, asset: &Asset) -> u16 {
    let Coding { grey, short_links } = asset.coding;
    match kind {
        Kind::Points => points::version(&asset.points, grey),
        Kind::LinksTransfer if short_links => 2,
        Kind::Materials if !asset.material_glass.is_empty() => 4,
        Kind::Materials if !asset.material_extensions.is_empty() => 3,
        Kind::Materials if asset.materials.iter().any(Material::is_pane) => 2,
        _ => 1,
    }
}

/// The raw bytes of one section of an asset, or `None` when the asset does not need it.
///
/// # Errors
/// `LimitExceeded` when small records take more than the format allows.
pub fn encode(kind: Kind, asset: &Asset) -> Result<Option<Vec<u8>>> {
    fn some<T>(part: &Option<T>, encode: impl FnOnce(&T)) -> bool {
        part.as_ref().map(encode).is_some()
    }
    let mut all = Vec::new();
    let out = &mut all;
    let needed = match kind {
        Kind::Provenance => {
            records::encode(kind, &asset.provenance, out)?;
            true
        }
        Kind::Geometry => {
            let geometry = &asset.geometry;
            geometry::encode(geometry, out);
            !(geometry.meshes.is_empty() && geometry.instances.is_empty())
        }
        Kind::Materials => {
            let (all, further) = (&asset.materials, &asset.material_extensions);
            match version(kind, asset) {
                4 => records::encode(kind, &(all, further, &asset.material_glass), out)?,
                3 => records::encode(kind, &(all, further), out)?,
                _ => records::encode(kind, all, out)?,
            }
            !asset.materials.is_empty()
        }
        Kind::Textures => {
            textures::encode(&asset.textures, out);
            !asset.textures.is_empty()
        }
        Kind::Stage => {
            out.extend_from_slice(asset.stage.json.as_bytes());
            !asset.stage.json.is_empty()
        }
        Kind::Points => {
            points::encode(&asset.points, asset.coding.grey, out);
            !asset.points.is_empty()
        }
        Kind::LinksTransfer => some(&asset.transfer, |links| {
            links::encode(links, asset.coding.short_links, out)
        }),
        Kind::LinksBounce => some(&asset.bounce, |bounce| weights::encode_bounce(bounce, out)),
        Kind::LinksSolution => some(&asset.solution, |solution| {
            weights::encode_solution(solution, out)
        }),
        Kind::Estimates => match &asset.estimates {
            Some(estimates) => {
                records::encode(kind, estimates, out)?;
                true
            }
            None => false,
        },
        Kind::Senders => some(&asset.senders, |senders| senders::encode(senders, out)),
        Kind::LightTree => some(&asset.light_tree, |tree| light_tree::encode(tree, out)),
        Kind::Cuts => some(&asset.cuts, |cuts| cuts::encode(cuts, out)),
        Kind::Separations => some(&asset.separations, |s| separations::encode(s, out)),
    };
    Ok(needed.then_some(all))
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
        Kind::Materials => {
            let (all, further) = (&mut asset.materials, &mut asset.material_extensions);
            match version {
                4.. => (*all, *further, asset.material_glass) = records::decode(&mut cursor)?,
                3 => (*all, *further) = records::decode(&mut cursor)?,
                _ => *all = records::decode(&mut cursor)?,
            }
            let known = version >= 2 || !asset.materials.iter().any(Material::is_pane);
            let (here, found) = (Location::Raw(0), "a pane, which version 2 has");
            require(known, kind.name(), here, "an alpha mode of 0 to 2", found)?;
        }
        Kind::Textures => asset.textures = textures::decode(&mut cursor)?,
        Kind::Stage => asset.stage.json = textures::text(&mut cursor, raw.len())?,
        Kind::Points => {
            (asset.points, asset.coding.grey) = points::decode(&mut cursor, version)?;
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
