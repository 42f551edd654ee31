//! `relight inspect`: what an asset holds and what it costs.

use crate::console::Console;
use crate::estimates;
use crate::failure::{Failure, Outcome};
use crate::images;
use crate::output::{self, SCHEMA, log_path, merge};
use crate::words::{self, bytes, count};
use clap::Args;
use comfy_table::presets;
use comfy_table::{CellAlignment, Table};
use relight_format::layout::Kind;
use relight_format::{self as format, Asset, Content, CutContent, Estimates, FormatError, Limits, Summary};
use serde_json::{Value, json};
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Show what an asset holds: how big, how sparse, how deep, what was left out and why.
///
/// Reads the first and last few kilobytes of a file of any size and trusts the rest; --verify reads all of it.
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
    /// Read every byte, compare it with its checksum, and check all that it says.
    #[arg(long)]
    pub verify: bool,
    /// Draw the points of every level, seen from the scene's first camera, into this folder as level_N.png.
    #[arg(long, value_name = "DIR")]
    pub images: Option<PathBuf>,
}

/// Runs the command.
pub fn run(args: &InspectArgs, console: &Console) -> Result<Outcome, Failure> {
    let path = &args.asset;
    let failed = |error: FormatError| anyhow::anyhow!("{}: {error}", path.display());
    let summary = format::read_summary(path).map_err(failed)?;
    let counted = Content::from_counts(&summary.provenance.counts);
    // All of an asset is only read for pictures, on request, and where an older bake has counted nothing.
    let (content, estimates) = match counted {
        Some(content) if !args.verify && args.images.is_none() => {
            let estimates =
                format::read_parts(path, &Limits::default(), &[Kind::Estimates]).map_err(failed)?;
            (content, estimates.estimates)
        }
        counted => {
            let asset = format::read_file(path, &Limits::default()).map_err(failed)?;
            let content = Content::of(&asset);
            if counted.is_some_and(|counted| counted != content) {
                let path = path.display();
                let message = "holds something else than its provenance counts; bake it again";
                return Err(anyhow::anyhow!("{path}: {message}").into());
            }
            if let Some(folder) = &args.images {
                images::draw(path, &asset, folder)?;
            }
            (content, asset.estimates)
        }
    };
    let mut json = content_json(path, &summary, &content, estimates.as_ref())?;
    match read_log(path) {
        Ok(Some(log)) => {
            merge(&mut json, &log);
            add_saved_seconds(&mut json);
        }
        Ok(None) => {}
        Err(complaint) => console.note(format!("note: {complaint}")),
    }
    json["command"] = "inspect".into();
    if args.verify {
        json["verified"] = true.into();
        console.note("Every byte is as its checksum says, and what it says is valid.");
    }
    if let Some(folder) = &args.images {
        let files = images::files(folder, content.points.len());
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

/// Everything that is known from an asset in memory and its file.
pub fn asset_json(path: &Path, asset: &Asset) -> Result<Value, Failure> {
    content_json(
        path,
        &format::read_summary(path)?,
        &Content::of(asset),
        asset.estimates.as_ref(),
    )
}

/// The bake's estimate of the error of its cuts.
fn cut_rms_error(estimates: Option<&Estimates>) -> Option<f64> {
    let mut estimates = estimates.iter().flat_map(|e| &e.values);
    estimates.find(|e| e.0 == "cut_rms_error").map(|e| e.1)
}

fn content_json(
    path: &Path,
    summary: &Summary,
    content: &Content,
    estimates: Option<&Estimates>,
) -> Result<Value, Failure> {
    let mut sections = serde_json::Map::new();
    for section in &summary.sections {
        sections.insert(
            section.name.clone(),
            json!({ "raw": section.raw_bytes, "stored": section.stored_bytes }),
        );
    }
    sections.insert("total".into(), summary.file_bytes.into());
    let provenance = &summary.provenance;
    let counted = |name: &str| provenance.counts.iter().find(|c| c.0 == name).map(|c| c.1);
    let settings: serde_json::Map<String, Value> = provenance
        .settings
        .iter()
        .map(|(name, value)| (name.clone(), value.clone().into()))
        .collect();
    let known: serde_json::Map<String, Value> = (estimates.iter())
        .flat_map(|e| &e.values)
        .map(|(name, value)| (name.clone(), (*value).into()))
        .collect();
    let left_out: Vec<Value> = (provenance.left_out.iter().enumerate())
        .map(|(i, l)| {
            let rays = counted(&format!("saved_rays_{i}")).unwrap_or(0);
            json!({ "what": l.what, "why": l.why, "saved_bytes": l.saved_bytes, "saved_rays": rays })
        })
        .collect();
    Ok(json!({
        "schema": SCHEMA,
        "asset": path.display().to_string(),
        "asset_hash": format!("{:016x}", relight_play::open::asset_hash(path)?),
        "source_hash": format!("{:016x}", provenance.source_hash),
        "tool_version": provenance.tool_version,
        "format_version": summary.format_version,
        "seed": provenance.seed,
        "lambert": provenance.lambert,
        "settings": settings,
        "triangles": content.triangles,
        "meshes": content.meshes,
        "instances": content.instances,
        "materials": content.materials,
        "textures": content.textures,
        "points": content.points,
        "disk_radius": content.disk_radii,
        // Saturating: the counts of a forged file may be anything.
        "links": content.links_transfer.saturating_add(content.links_bounce).saturating_add(content.links_solution),
        "links_by_operator": {
            "transfer": content.links_transfer,
            "solution": content.links_solution,
            "bounce": content.links_bounce,
        },
        "links_per_level": content.links_per_level,
        "longest_row": content.longest_row,
        "potential_links": counted("potential_links"),
        "cuts": content.cuts.map(|cuts| cuts_json(&cuts, cut_rms_error(estimates))),
        "rays": counted("rays"),
        "receivers_gathered": counted("receivers_gathered"),
        "rays_without_points": counted("rays_without_points"),
        "surface_m2": counted("surface_square_mm").map(|n| n as f64 * 1e-6),
        "surface_without_points_m2": counted("uncovered_square_mm").map(|n| n as f64 * 1e-6),
        "bytes": sections,
        "left_out": left_out,
        "estimates": known,
        "expected_error": estimates::line(estimates),
        "notes": provenance.notes,
    }))
}

/// Adds to what was left out the seconds that its rays would have taken, at the pace of the bake's own.
pub fn add_saved_seconds(json: &mut Value) {
    let (seconds, rays) = (json["seconds"]["ray_tracing"].as_f64(), json["rays"].as_f64());
    let (Some(seconds), Some(rays)) = (seconds, rays.filter(|r| *r > 0.0)) else {
        return;
    };
    for left in json["left_out"].as_array_mut().into_iter().flatten() {
        left["saved_seconds"] = (left["saved_rays"].as_f64().unwrap_or(0.0) * seconds / rays).into();
    }
}

/// What visibility cuts an asset holds.
fn cuts_json(cuts: &CutContent, rms_error: Option<f64>) -> Value {
    json!({
        "mode": if cuts.of_surfaces { "indirect" } else { "environment" },
        "lights": cuts.lights,
        "sites": cuts.sites,
        "elements": cuts.elements,
        "mean_length": cuts.elements as f64 / cuts.sites.max(1) as f64,
        "sigma": cuts.sigma,
        "rms_error": rms_error,
    })
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
    let all_points = points.iter().fold(0u64, |sum, &n| sum.saturating_add(n));
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
            "cuts       {}: {} elements of {} sites, {:.0} each, over {} lights, RMS error {:.3}",
            cuts["mode"].as_str().unwrap_or("-"),
            count(of_cuts("elements")),
            count(of_cuts("sites")),
            cuts["mean_length"].as_f64().unwrap_or(0.0),
            count(of_cuts("lights")),
            cuts["rms_error"].as_f64().unwrap_or(0.0),
        ));
    }
    if let Some(expected) = json["expected_error"].as_str() {
        line(format!("error      {expected}"));
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
        let mut saved = vec![bytes(left["saved_bytes"].as_u64().unwrap_or(0))];
        if let Some(rays) = left["saved_rays"].as_u64().filter(|&rays| rays > 0) {
            saved.push(format!("{} rays", count(rays)));
            let seconds = left["saved_seconds"].as_f64();
            saved.extend(seconds.map(|s| format!("{s:.1} s")));
        }
        line(format!(
            "left out   {} ({}): {}",
            part("what"),
            saved.join(", "),
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
