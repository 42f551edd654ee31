//! `relight export`: what an asset holds, for other tools: numpy arrays, PLY point clouds, Matrix Market and Radiance
//! matrices, and its light as engines take it: lightmaps and irradiance volumes.

mod args;
mod files;
mod glb;
mod ktx2;
mod lightmap;
mod lit;
mod operators;
mod readme;
mod report;
mod unwrap;
mod volume;

use crate::console::Console;
use crate::failure::{Failure, Outcome};
use crate::guard::Guard;
use crate::kinds::{self, Wanted};
use crate::output::{self, SCHEMA};
use crate::signals;
use crate::words;
use anyhow::{Context, anyhow, bail};
pub use args::ExportArgs;
use args::What;
use clap::ValueEnum;
use files::{Column, Folder, Positions, Unwritten};
use relight_format::layout::Kind;
use relight_format::{self as format, Asset, LightSamples, Limits, WeightRows};
use relight_transport::light_tree::sphere_direction;
use report::{Facts, Report};
use std::path::PathBuf;

/// Runs the command.
pub fn run(args: &ExportArgs, seed: u64, console: &Console) -> Result<Outcome, Failure> {
    check_options(args)?;
    let kinds: &[Kind] = match args.what {
        What::Points => &[Kind::Points],
        What::Links => &[Kind::LinksTransfer, Kind::LinksBounce, Kind::LinksSolution],
        What::Bounce => &[Kind::LinksBounce, Kind::LinksSolution],
        What::Cuts => &[Kind::Cuts],
        What::Lights => &[Kind::LightTree],
        // Read as a player reads them.
        What::Transfer | What::Factors | What::PointCloud | What::IrradianceVolume | What::Lightmap => &[],
    };
    kinds::check(&args.asset, Wanted::Asset)?;
    let name = args.asset.display();
    let asset =
        format::read_parts(&args.asset, &Limits::default(), kinds).map_err(|e| anyhow!("{name}: {e}"))?;
    output::make_folder(&args.output)?;
    let inputs = [Some(&args.asset), args.lights.as_ref()];
    let guard = Guard::new(args.replace.force).reads(inputs.into_iter().flatten().map(PathBuf::as_path));
    let mut folder = Folder::new(&args.output, &guard)?;
    let facts = match args.what {
        What::Points => points(&asset, &mut folder),
        What::Links => links(&asset, &mut folder),
        What::Cuts => cuts(&asset, &mut folder),
        What::Lights => lights(&asset, &mut folder),
        What::Transfer => operators::transfer(&args.asset, &mut folder, Some(args.matrix_limit)),
        What::Factors => operators::transfer(&args.asset, &mut folder, None),
        What::Bounce => operators::bounce(&asset, &mut folder, args.matrix_limit),
        // Names what is wrong with which file by itself.
        What::PointCloud => Ok(lit::points(args, seed, &mut folder, console)?),
        What::IrradianceVolume => Ok(volume::write(args, seed, &mut folder, console)?),
        What::Lightmap => Ok(lightmap::write(args, seed, &mut folder, console)?),
    };
    signals::go_on()?;
    let facts = facts.map_err(|error| match error.is::<Unwritten>() {
        true => error,
        false => error.context(name.to_string()),
    })?;
    let text = readme::text(args.what, &facts, &folder.written);
    folder.text(readme::FILE, &text)?;
    folder.finish()?;
    console.note(format!(
        "Wrote {} into {}.",
        words::plural(folder.written.len(), "file"),
        args.output.display()
    ));
    if args.json {
        output::print_json(&Report {
            schema: SCHEMA,
            command: "export",
            asset: name.to_string(),
            what: args.what.to_possible_value().map(|v| v.get_name().to_owned()),
            facts,
            files: folder.written,
        })?;
    }
    Ok(Outcome::Done)
}

/// Refuses options that mean nothing to what is exported.
fn check_options(args: &ExportArgs) -> Result<(), Failure> {
    let usage = |text: &str| Err(Failure::Usage(text.into()));
    let lit = matches!(
        args.what,
        What::PointCloud | What::IrradianceVolume | What::Lightmap
    );
    if !lit && (args.lights.is_some() || args.frame != 0) {
        return usage(
            "--lights and --frame are for --what point-cloud, irradiance-volume and lightmap; what else is exported is the same \
             under all lights",
        );
    }
    if args.grid.is_some() && args.what != What::IrradianceVolume {
        return usage("--grid is for --what irradiance-volume");
    }
    let of_lightmap = args.uv.is_some() || args.size.is_some() || args.part.is_some() || args.per_light;
    if of_lightmap && args.what != What::Lightmap {
        return usage("--uv, --size, --part and --per-light are for --what lightmap");
    }
    Ok(())
}

/// Positions in the coordinates of the scene's file: 64-bit numbers where the asset's are moved.
fn in_the_scene<'a>(asset: &Asset, positions: &'a [[f32; 3]]) -> anyhow::Result<Positions<'a>> {
    let offset = (asset.provenance.offset()).context("its setting offset is not three numbers")?;
    if offset == [0.0; 3] {
        return Ok(Positions::Here(positions));
    }
    let moved = |p: &[f32; 3]| [0, 1, 2].map(|i| f64::from(p[i]) + offset[i]);
    Ok(Positions::Moved(positions.iter().map(moved).collect()))
}

fn points(asset: &Asset, folder: &mut Folder) -> anyhow::Result<Facts> {
    if asset.points.is_empty() {
        bail!("holds no points; bake it with points, or export something else");
    }
    let levels = &asset.points;
    let positions: Vec<[f32; 3]> = levels.iter().flat_map(|l| l.positions.iter().copied()).collect();
    let normals: Vec<[f32; 3]> = levels.iter().flat_map(|l| l.normals.iter().copied()).collect();
    let albedo: Vec<[f32; 3]> = levels.iter().flat_map(|l| l.albedo.iter().copied()).collect();
    let level: Vec<u8> = levels
        .iter()
        .zip(0u8..)
        .flat_map(|(l, i)| vec![i; l.positions.len()])
        .collect();
    let positions = in_the_scene(asset, &positions)?;
    folder.positions("positions", &positions)?;
    folder.vectors("normals", "1", &normals)?;
    folder.vectors("albedo", "1", &albedo)?;
    folder.bytes("level", "1", &level)?;
    let widening: Vec<u8> = (levels.iter())
        .flat_map(|l| (0..l.positions.len()).map(|i| l.widenings.get(i).copied().unwrap_or(0)))
        .collect();
    folder.bytes("widening", "1", &widening)?;
    let radii: Vec<f32> = levels.iter().map(|l| l.disk_radius).collect();
    folder.floats("disk_radius", "m", &radii)?;
    let supports: Vec<f32> = levels.iter().map(|l| l.support_radius).collect();
    folder.floats("support_radius", "m", &supports)?;
    folder.ply(
        "points",
        &[
            (["x", "y", "z"], positions.column()),
            (["nx", "ny", "nz"], Column::Vectors(&normals)),
            (["albedo_r", "albedo_g", "albedo_b"], Column::Vectors(&albedo)),
            (["level", "", ""], Column::Bytes(&level)),
            (["widening", "", ""], Column::Bytes(&widening)),
        ],
    )?;
    Ok(Facts::Points { levels: levels.len() })
}

fn links(asset: &Asset, folder: &mut Folder) -> anyhow::Result<Facts> {
    let Some(senders) = &asset.senders else {
        bail!("holds no links: no surface sends light to another");
    };
    if let Some(t) = &asset.transfer {
        folder.numbers("transfer_row_offsets", "1", &t.row_offsets)?;
        folder.numbers("transfer_columns", "1", &t.columns)?;
        folder.vectors("transfer_vectors", "W/m² per W/m²", &t.vectors)?;
    }
    let mut weights = |name: &str, matrix: &WeightRows| -> anyhow::Result<()> {
        folder.numbers(&format!("{name}_row_offsets"), "1", &matrix.row_offsets)?;
        folder.numbers(&format!("{name}_columns"), "1", &matrix.columns)?;
        folder.floats(&format!("{name}_weights"), "W/m² per W/m²", &matrix.weights)
    };
    if let Some(bounce) = &asset.bounce {
        weights("bounce", &bounce.matrix)?;
    }
    for (channel, matrix) in asset.solution.iter().flat_map(|s| s.channels.iter().enumerate()) {
        weights(&format!("solution_{channel}"), matrix)?;
    }
    folder.numbers("sender_counts", "1", &senders.counts)?;
    folder.numbers("sender_of_finest_point", "1", &senders.leaf_of_point)?;
    folder.bytes("importance", "1", &senders.importance)?;
    for (i, parents) in senders.parents.iter().enumerate() {
        folder.numbers(&format!("sender_parents_{}", i + 1), "1", parents)?;
    }
    Ok(Facts::Links {
        receivers: asset.transfer.as_ref().map(|t| t.receivers),
        senders: asset.transfer.as_ref().map(|t| t.senders),
        bounce_level: asset.bounce.as_ref().map(|b| b.level),
        solution_level: asset.solution.as_ref().map(|s| s.level),
    })
}

fn cuts(asset: &Asset, folder: &mut Folder) -> anyhow::Result<Facts> {
    let (Some(cuts), Some(tree)) = (&asset.cuts, &asset.light_tree) else {
        bail!("holds no visibility cuts; bake it with --cuts environment or --cuts indirect");
    };
    folder.numbers("cut_row_offsets", "1", &cuts.row_offsets)?;
    folder.bytes("cut_heights", "1", &cuts.heights)?;
    folder.floats("cut_values", "unit", &cuts.values)?;
    // Not in the file: it follows from the heights.
    let mut first = Vec::with_capacity(cuts.heights.len());
    for row in cuts.row_offsets.windows(2) {
        let mut leaf = 0u32;
        for &height in &cuts.heights[row[0] as usize..row[1] as usize] {
            first.push(leaf);
            leaf += 1 << height;
        }
    }
    folder.numbers("cut_first_leaves", "1", &first)?;
    Ok(Facts::Cuts {
        sigma: cuts.sigma,
        unit: cuts.unit,
        lights: tree.lights.len(),
    })
}

fn lights(asset: &Asset, folder: &mut Folder) -> anyhow::Result<Facts> {
    let Some(tree) = &asset.light_tree else {
        bail!("holds no lights that cuts cluster; bake it with --cuts environment or --cuts indirect");
    };
    match &tree.lights {
        LightSamples::Environment { order } => {
            let count = order.len() as u32;
            let directions: Vec<[f32; 3]> = (order.iter())
                .map(|&i| sphere_direction(i, count).to_array())
                .collect();
            folder.vectors("light_directions", "1", &directions)?;
            folder.numbers("light_lattice_indices", "1", order)?;
            folder.ply("lights", &[(["x", "y", "z"], Column::Vectors(&directions))])?;
            Ok(Facts::Lights {
                kind: "environment",
                steradians: Some(4.0 * std::f64::consts::PI / f64::from(count)),
                area_m2: None,
            })
        }
        LightSamples::Surface {
            area,
            positions,
            normals,
        } => {
            let positions = in_the_scene(asset, positions)?;
            folder.positions("light_positions", &positions)?;
            folder.vectors("light_normals", "1", normals)?;
            folder.ply(
                "lights",
                &[
                    (["x", "y", "z"], positions.column()),
                    (["nx", "ny", "nz"], Column::Vectors(normals)),
                ],
            )?;
            Ok(Facts::Lights {
                kind: "surface",
                steradians: None,
                area_m2: Some(*area),
            })
        }
    }
}
