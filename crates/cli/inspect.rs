//! `relight inspect`: what an asset holds and what it costs.

use crate::bake::{log_path, merge};
use crate::console::Console;
use crate::failure::{Failure, Outcome};
use crate::images;
use crate::output::{self, SCHEMA};
use crate::words::{self, bytes, count};
use clap::Args;
use comfy_table::presets;
use comfy_table::{CellAlignment, Table};
use relight_format::{self as format, Asset, Limits};
use serde_json::{Value, json};
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Show what an asset holds: how big, how sparse, how deep, what was left out and why.
///
/// Times, memory and threads of its bake are shown when ASSET.relight.log.json lies beside it.
#[derive(Args)]
pub struct InspectArgs {
    /// Asset to look at.
    #[arg(value_name = "ASSET.relight")]
    pub asset: PathBuf,
    /// Print one JSON object on stdout instead of a table: the fields of `bake --json`.
    #[arg(long)]
    pub json: bool,
    /// Draw the points of every level, seen from the scene's first camera, into this folder as level_N.png.
    #[arg(long, value_name = "DIR")]
    pub images: Option<PathBuf>,
}

/// Runs the command.
pub fn run(args: &InspectArgs, console: &Console) -> Result<Outcome, Failure> {
    let asset = format::read_file(&args.asset, &Limits::default())
        .map_err(|error| anyhow::anyhow!("{}: {error}", args.asset.display()))?;
    let mut json = asset_json(&args.asset, &asset)?;
    match read_log(&args.asset) {
        Ok(Some(log)) => merge(&mut json, &log),
        Ok(None) => {}
        Err(complaint) => console.note(format!("note: {complaint}")),
    }
    json["command"] = "inspect".into();
    if let Some(folder) = &args.images {
        let files = images::draw(&args.asset, &asset, folder)?;
        json["images"] = files.iter().map(|file| file.display().to_string()).collect();
    }
    if args.json {
        output::print_json(&json)?;
    } else {
        output::print_text(&(describe(&json) + "\n"))?;
    }
    Ok(Outcome::Done)
}

fn read_log(asset: &Path) -> Result<Option<Value>, String> {
    let path = log_path(asset);
    let text = match std::fs::read_to_string(&path) {
        Ok(text) => text,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(format!("{}: cannot be read: {error}", path.display())),
    };
    let log: Value = serde_json::from_str(&text).map_err(|error| {
        format!(
            "{}: not valid JSON ({error}), so it is left aside",
            path.display()
        )
    })?;
    // Only what a log holds: it must not be able to contradict the asset.
    let mut kept = json!({});
    for key in ["seconds", "peak_memory_bytes", "threads"] {
        if let Some(value) = log.get(key) {
            kept[key] = value.clone();
        }
    }
    Ok(Some(kept))
}

/// Everything that is known from the asset and its file.
pub fn asset_json(path: &Path, asset: &Asset) -> Result<Value, Failure> {
    let summary = format::read_summary(path)?;
    let mut sections = serde_json::Map::new();
    for section in &summary.sections {
        sections.insert(
            section.name.clone(),
            json!({ "raw": section.raw_bytes, "stored": section.stored_bytes }),
        );
    }
    sections.insert("total".into(), summary.file_bytes.into());
    let provenance = &asset.provenance;
    let counted = |name: &str| provenance.counts.iter().find(|c| c.0 == name).map(|c| c.1);
    let points: Vec<usize> = asset.points.iter().map(|level| level.positions.len()).collect();
    let settings: serde_json::Map<String, Value> = provenance
        .settings
        .iter()
        .map(|(name, value)| (name.clone(), value.clone().into()))
        .collect();
    let left_out: Vec<Value> = provenance
        .left_out
        .iter()
        .map(|l| json!({ "what": l.what, "why": l.why, "saved_bytes": l.saved_bytes }))
        .collect();
    let instances = &asset.geometry.instances;
    let triangles: usize = instances
        .iter()
        .map(|i| asset.geometry.meshes[i.mesh as usize].triangles.len())
        .sum();
    let transfer = asset.transfer.as_ref().map_or(0, |l| l.columns.len());
    let bounce = asset.bounce.as_ref().map_or(0, |b| b.matrix.columns.len());
    let solution: usize = asset
        .solution
        .iter()
        .flat_map(|s| &s.channels)
        .map(|c| c.columns.len())
        .sum();
    Ok(json!({
        "schema": SCHEMA,
        "asset": path.display().to_string(),
        "asset_hash": format!("{:016x}", relight_play::load::asset_hash(path)?),
        "source_hash": format!("{:016x}", provenance.source_hash),
        "tool_version": provenance.tool_version,
        "format_version": summary.format_version,
        "seed": provenance.seed,
        "lambert": provenance.lambert,
        "settings": settings,
        "triangles": triangles,
        "meshes": asset.geometry.meshes.len(),
        "instances": instances.len(),
        "materials": asset.materials.len(),
        "textures": asset.textures.len(),
        "points": points,
        "disk_radius": asset.points.iter().map(|l| l.disk_radius).collect::<Vec<_>>(),
        "links": transfer + bounce + solution,
        "links_by_operator": {
            "transfer": transfer,
            "solution": solution,
            "bounce": bounce,
        },
        "links_per_level": links_per_level(asset),
        "longest_row": longest_row(asset),
        "potential_links": counted("potential_links"),
        "cuts": cuts_json(asset),
        "rays": counted("rays"),
        "receivers_gathered": counted("receivers_gathered"),
        "rays_without_points": counted("rays_without_points"),
        "surface_m2": counted("surface_square_mm").map(|n| n as f64 * 1e-6),
        "surface_without_points_m2": counted("uncovered_square_mm").map(|n| n as f64 * 1e-6),
        "bytes": sections,
        "left_out": left_out,
        "notes": provenance.notes,
    }))
}

/// What visibility cuts the asset holds; null for none.
fn cuts_json(asset: &Asset) -> Value {
    let (Some(cuts), Some(tree)) = (&asset.cuts, &asset.light_tree) else {
        return Value::Null;
    };
    let mode = match tree.lights {
        format::LightSamples::Environment { .. } => "environment",
        format::LightSamples::Surface { .. } => "indirect",
    };
    let sites = cuts.row_offsets.len().saturating_sub(1);
    let place = match cuts.sites {
        format::CutSites::Points => "points",
        format::CutSites::Vertices => "vertices",
    };
    let estimates = asset.estimates.iter().flat_map(|e| &e.values);
    json!({
        "mode": mode,
        "sites_at": place,
        "lights": tree.lights.len(),
        "sites": sites,
        "elements": cuts.heights.len(),
        "mean_length": cuts.heights.len() as f64 / sites.max(1) as f64,
        "sigma": cuts.sigma,
        "rms_error": estimates.clone().find(|e| e.0 == "cut_rms_error").map(|e| e.1),
    })
}

fn links_per_level(asset: &Asset) -> Vec<u32> {
    let mut first = 0;
    asset
        .points
        .iter()
        .map(|level| {
            let rows = first..first + level.positions.len();
            first = rows.end;
            asset
                .transfer
                .as_ref()
                .map_or(0, |l| l.row_offsets[rows.end] - l.row_offsets[rows.start])
        })
        .collect()
}

fn longest_row(asset: &Asset) -> u32 {
    let rows = asset.transfer.as_ref().map_or(&[][..], |l| &l.row_offsets);
    rows.windows(2).map(|pair| pair[1] - pair[0]).max().unwrap_or(0)
}

fn table(header: &[&str], rows: Vec<Vec<String>>) -> String {
    let mut table = Table::new();
    table.load_style(presets::NOTHING).set_header(header.to_vec());
    for row in rows {
        table.add_row(row);
    }
    for (i, column) in table.column_iter_mut().enumerate() {
        column.set_cell_alignment(if i == 0 {
            CellAlignment::Left
        } else {
            CellAlignment::Right
        });
    }
    table.trim_fmt()
}

/// The fixed summary of an asset and, where the JSON has it, of its bake.
pub fn describe(json: &Value) -> String {
    let number = |key: &str| json[key].as_u64().unwrap_or(0);
    let text = |key: &str| json[key].as_str().unwrap_or("-").to_owned();
    let mut out = String::new();
    // Writing to a String cannot fail.
    let mut line = |text: String| {
        let _ = writeln!(out, "{text}");
    };
    line(format!(
        "asset      {}  {}, format {}",
        text("asset_hash"),
        text("tool_version"),
        number("format_version")
    ));
    line(format!(
        "scene      {} triangles, {} meshes placed {} times, {} materials, {} textures{}",
        count(number("triangles")),
        count(number("meshes")),
        count(number("instances")),
        count(number("materials")),
        count(number("textures")),
        if json["lambert"] == true {
            ", all Lambert"
        } else {
            ""
        }
    ));
    if let Some(settings) = json["settings"].as_object() {
        let pairs: Vec<String> = settings
            .iter()
            .map(|(k, v)| format!("{k} {}", v.as_str().unwrap_or("-")))
            .collect();
        line(format!(
            "settings   {}, seed {}",
            pairs.join(", "),
            number("seed")
        ));
    }
    let array = |key: &str| json[key].as_array().cloned().unwrap_or_default();
    let points: Vec<u64> = array("points").iter().filter_map(Value::as_u64).collect();
    let all_points: u64 = points.iter().sum();
    line(format!(
        "points     {} on {}",
        count(all_points),
        words::plural(points.len(), "level")
    ));
    let (links, potential) = (number("links"), number("potential_links"));
    line(format!(
        "links      {} of {} potential ({}), {} a point, longest row {}",
        count(links),
        count(potential),
        if potential > 0 {
            format!("{:.3} %", 100.0 * links as f64 / potential as f64)
        } else {
            "-".into()
        },
        words::per(links, all_points),
        count(number("longest_row")),
    ));
    let cuts = &json["cuts"];
    if cuts.is_object() {
        let of_cuts = |key: &str| cuts[key].as_u64().unwrap_or(0);
        line(format!(
            "cuts       {}: {} elements of {} sites at {}, {:.0} each, over {} lights, RMS error {:.3}",
            cuts["mode"].as_str().unwrap_or("-"),
            count(of_cuts("elements")),
            count(of_cuts("sites")),
            cuts["sites_at"].as_str().unwrap_or("-"),
            cuts["mean_length"].as_f64().unwrap_or(0.0),
            count(of_cuts("lights")),
            cuts["rms_error"].as_f64().unwrap_or(0.0),
        ));
    }
    line(format!("rays       {}", count(number("rays"))));
    let (radii, per_level) = (array("disk_radius"), array("links_per_level"));
    let rows = (0..points.len())
        .map(|i| {
            let level_links = per_level.get(i).and_then(Value::as_u64).unwrap_or(0);
            vec![
                i.to_string(),
                count(points[i]),
                format!("{:.4}", radii.get(i).and_then(Value::as_f64).unwrap_or(0.0)),
                count(level_links),
                words::per(level_links, points[i]),
            ]
        })
        .collect();
    line(format!(
        "\n{}",
        table(&["level", "points", "distance m", "links", "links/point"], rows)
    ));
    line(format!("\n{}", bytes_table(json, all_points)));
    if let Some(seconds) = json["seconds"].as_object() {
        let stages: Vec<String> = seconds
            .iter()
            .filter(|(name, _)| *name != "total" && *name != "ray_tracing")
            .map(|(name, s)| format!("{name} {:.2}", s.as_f64().unwrap_or(0.0)))
            .collect();
        let of = |name: &str| seconds.get(name).and_then(Value::as_f64).unwrap_or(0.0);
        line(format!(
            "\nseconds    {:.2} ({}), of which {:.2} casting rays, on {}",
            of("total"),
            stages.join(", "),
            of("ray_tracing"),
            words::plural(number("threads") as usize, "thread")
        ));
        line(format!(
            "memory     {} at its peak",
            bytes(number("peak_memory_bytes"))
        ));
    }
    for left in array("left_out") {
        let part = |key: &str| left[key].as_str().unwrap_or("-").to_owned();
        let saved = left["saved_bytes"].as_u64().unwrap_or(0);
        line(format!(
            "left out   {} ({}): {}",
            part("what"),
            bytes(saved),
            part("why")
        ));
    }
    for note in array("notes") {
        line(format!("note       {}", note.as_str().unwrap_or("-")));
    }
    out.trim_end().to_owned()
}

fn bytes_table(json: &Value, points: u64) -> String {
    let empty = serde_json::Map::new();
    let sections = json["bytes"].as_object().unwrap_or(&empty);
    let mut rows = Vec::new();
    for (name, section) in sections {
        let (Some(raw), Some(stored)) = (section["raw"].as_u64(), section["stored"].as_u64()) else {
            continue;
        };
        let links = json["links_by_operator"][name.trim_start_matches("links_")].as_u64();
        let each = match (name.as_str(), links) {
            (_, Some(links)) if links > 0 => format!("{} a link", words::per(stored, links)),
            ("points" | "senders", _) => format!("{} a point", words::per(stored, points)),
            _ => String::new(),
        };
        rows.push(vec![name.clone(), count(raw), count(stored), each]);
    }
    let total = sections.get("total").and_then(Value::as_u64).unwrap_or(0);
    rows.push(vec!["file".into(), String::new(), count(total), String::new()]);
    table(&["section", "bytes raw", "stored", ""], rows)
}
