//! `relight inspect`: what an asset holds and what it costs.

use crate::console::Console;
use crate::failure::{Failure, Outcome};
use crate::guard::Guard;
use crate::images;
use crate::inspection::{BakeLog, BakeRun, Inspection, Names};
use crate::kinds::{self, Wanted};
use crate::options::{LightUnitsName, ReplaceArgs, parse_point};
use crate::output;
use crate::photometric::{self, Photometric};
use crate::words::{self, bytes, count};
use clap::Args;
use glam::DVec3;
use relight_format::layout::{Kind, setting};
use relight_format::{self as format, Content, FormatError, Limits};
use serde::Serialize;
use std::fmt::Write;
use std::path::PathBuf;

/// Show what an asset holds: how big, how sparse, how deep, what was left out and why.
///
/// Reads the first and last few kilobytes of a file of any size and trusts the rest; --verify reads all of it, --lights and --lux what it takes to
/// light the scene.
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
    /// Say what the lights of this sequence give, instead of the scene's own: lumens, candela at most, lux.
    #[arg(long, value_name = "SEQ.json")]
    pub lights: Option<PathBuf>,
    /// The frame of the sequence.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub frame: u32,
    /// A place of which the lux are told, in the coordinates of the scene's file, on a small surface that faces up: of each light with its
    /// shadows, and of what the scene reflects there.
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_point, allow_hyphen_values = true)]
    pub lux: Option<DVec3>,
    /// How the scene's file had the intensities of its own lights, as for bake: those of spec are candela and lux themselves, others are
    /// watts, of which each makes 683 lm.
    #[arg(long, value_enum, default_value_t = LightUnitsName::Spec)]
    pub light_units: LightUnitsName,
    #[command(flatten)]
    pub replace: ReplaceArgs,
}

/// Runs the command.
pub fn run(args: &InspectArgs, console: &Console) -> Result<Outcome, Failure> {
    let path = &args.asset;
    kinds::check(path, Wanted::Asset)?;
    let failed = |error: FormatError| anyhow::anyhow!("{}: {error}", path.display());
    let summary = format::read_summary(path).map_err(failed)?;
    let counted = Content::from_counts(&summary.provenance.counts);
    // All of an asset is only read for pictures, on request, and where an older bake has counted nothing.
    let (content, estimates, names) = match counted {
        Some(content) if !args.verify && args.images.is_none() => {
            let [materials, stage] = Names::SECTIONS;
            let parts = [Kind::Estimates, materials, stage];
            let parts = format::read_parts(path, &Limits::default(), &parts).map_err(failed)?;
            let names = Names::of(&parts);
            (content, parts.estimates, names)
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
                let guard = Guard::new(args.replace.force).reads([path.as_path()]);
                for file in images::files(folder, asset.points.len()) {
                    guard.check(&file, kinds::Kind::Png)?;
                }
                images::draw(path, &asset, folder)?;
            }
            let names = Names::of(&asset);
            (content, asset.estimates, names)
        }
    };
    let mut inspection = Inspection::new(path, &summary, &content, estimates.as_ref(), names)?;
    match BakeLog::beside(path) {
        Ok(Some(log)) => {
            inspection = inspection.with_run(BakeRun {
                row_bytes: None,
                ..log.run
            });
        }
        Ok(None) => {}
        Err(complaint) => console.note(format!("note: {complaint}")),
    }
    let photometry = photometric::of(
        path,
        &photometric::Wanted {
            lights: args.lights.as_deref(),
            frame: args.frame,
            place: args.lux,
            own_in_candela: args.light_units == LightUnitsName::Spec,
        },
        console,
    )?;
    if args.verify {
        console.note("Every byte is as its checksum says, and what it says is valid.");
    }
    if !args.json {
        let mut text = describe(&inspection) + "\n";
        for line in photometric::lines(&photometry) {
            text += &line;
            text.push('\n');
        }
        output::print_text(&text)?;
        return Ok(Outcome::Done);
    }
    let images = args.images.as_ref().map(|folder| {
        let files = images::files(folder, content.points.len());
        files.iter().map(|file| file.display().to_string()).collect()
    });
    output::print_json(&InspectReport {
        command: "inspect",
        inspection,
        photometry,
        verified: args.verify.then_some(true),
        images,
    })?;
    Ok(Outcome::Done)
}

/// What the command prints.
#[derive(Serialize)]
struct InspectReport {
    command: &'static str,
    #[serde(flatten)]
    inspection: Inspection,
    /// What its lights, or those of --lights, give.
    photometry: Photometric,
    /// Whether every byte was checked.
    #[serde(skip_serializing_if = "Option::is_none")]
    verified: Option<bool>,
    /// Pictures that were drawn.
    #[serde(skip_serializing_if = "Option::is_none")]
    images: Option<Vec<String>>,
}

/// Variants of materials that are named.
const MOST_VARIANTS: usize = 40;

/// The fixed summary of an asset and, where its log is known, of its bake.
pub fn describe(asset: &Inspection) -> String {
    let mut out = String::new();
    // Writing to a String cannot fail.
    let mut line = |text: String| {
        let _ = writeln!(out, "{text}");
    };
    line(format!(
        "asset      {:016x}  {}, format {}",
        asset.asset_hash, asset.tool_version, asset.format_version
    ));
    line(format!(
        "scene      {} triangles, {} meshes placed {} times, {} materials, {} textures{}",
        count(asset.triangles),
        count(asset.meshes),
        count(asset.instances),
        count(asset.materials),
        count(asset.textures),
        if asset.lambert { ", all Lambert" } else { "" }
    ));
    if !asset.variants.is_empty() {
        let names: Vec<String> = (asset.variants.iter().take(MOST_VARIANTS))
            .map(|name| format!("{name:?}"))
            .collect();
        let more = asset.variants.len() - names.len();
        let more = if more > 0 {
            format!(" and {more} more")
        } else {
            String::new()
        };
        line(format!("variants   {}{more}", names.join(", ")));
    }
    // A line for each object would be a page.
    let settings: Vec<String> = (asset.settings.iter())
        .filter(|(name, _)| ![setting::OBJECTS, setting::VARIANTS].contains(&name.as_str()))
        .map(|(name, value)| format!("{name} {value}"))
        .collect();
    line(format!("settings   {}, seed {}", settings.join(", "), asset.seed));
    let points = (asset.points.iter()).fold(0u64, |sum, &n| sum.saturating_add(n));
    line(format!(
        "points     {} on {}",
        count(points),
        words::plural(asset.points.len(), "level")
    ));
    let potential = asset.potential_links.unwrap_or(0);
    line(format!(
        "links      {} of {} potential ({}), {} a point, longest row {}",
        count(asset.links),
        count(potential),
        if potential > 0 {
            format!("{:.3} %", 100.0 * asset.links as f64 / potential as f64)
        } else {
            "-".into()
        },
        words::per(asset.links, points),
        count(asset.longest_row),
    ));
    if let Some(cuts) = &asset.cuts {
        line(format!(
            "cuts       {}: {} elements of {} sites, {:.0} each, over {} lights, RMS error {:.3}",
            cuts.mode,
            count(cuts.elements),
            count(cuts.sites),
            cuts.mean_length,
            count(cuts.lights),
            cuts.rms_error.unwrap_or(0.0),
        ));
        if let (Some(rms), Some(light)) = (cuts.predicted_rms_error, cuts.predicted_light_error) {
            line(format!(
                "           at most {rms:.3} by what each node may err by (σ = {}); light of an environment by at most {:.2} % (equations \
                 8 and 9 of the cuts paper)",
                cuts.sigma,
                100.0 * light
            ));
        }
    }
    if let Some(expected) = &asset.expected_error {
        line(format!("error      {expected}"));
    }
    line(format!("rays       {}", count(asset.rays.unwrap_or(0))));
    line(format!("\n{}", levels_table(asset)));
    line(format!("\n{}", bytes_table(asset, points)));
    if let Some(run) = &asset.run {
        let seconds = &run.seconds;
        let stages: Vec<String> = (seconds.stages.iter())
            .map(|(name, s)| format!("{name} {s:.2}"))
            .collect();
        line(format!(
            "\nseconds    {:.2} ({}), of which {:.2} casting rays, on {}",
            seconds.total,
            stages.join(", "),
            seconds.ray_tracing.unwrap_or(0.0),
            words::plural(run.threads, "thread")
        ));
        line(format!(
            "memory     {} at its peak",
            bytes(run.peak_memory_bytes.unwrap_or(0))
        ));
    }
    for (what, names) in [
        ("cameras", &asset.names.cameras),
        ("lights", &asset.names.lights),
        ("materials", &asset.names.materials),
    ] {
        if !names.is_empty() {
            line(format!("{what:<10} {}", listed(names)));
        }
    }
    for left in &asset.left_out {
        let mut saved = vec![bytes(left.saved_bytes)];
        if left.saved_rays > 0 {
            saved.push(format!("{} rays", count(left.saved_rays)));
            saved.extend(left.saved_seconds.map(|s| format!("{s:.1} s")));
        }
        line(format!(
            "left out   {} ({}): {}",
            left.what,
            saved.join(", "),
            left.why
        ));
    }
    for note in &asset.notes {
        line(format!("note       {note}"));
    }
    out.trim_end().to_owned()
}

/// Names with commas between them; of very many the first, and their number.
fn listed(names: &[String]) -> String {
    const MOST: usize = 40;
    let mut text: Vec<String> = names.iter().take(MOST).map(|name| format!("{name:?}")).collect();
    if names.len() > MOST {
        text.push(format!("and {} more", count((names.len() - MOST) as u64)));
    }
    text.join(", ")
}

fn levels_table(asset: &Inspection) -> String {
    let levels = asset.points.iter().zip(&asset.disk_radius);
    let rows = (levels.zip(&asset.links_per_level).enumerate()).map(|(i, ((&points, radius), &links))| {
        vec![
            i.to_string(),
            count(points),
            format!("{radius:.4}"),
            count(links),
            words::per(links, points),
        ]
    });
    output::table(&["level", "points", "distance m", "links", "links/point"], rows)
}

fn bytes_table(asset: &Inspection, points: u64) -> String {
    let links = asset.links_by_operator;
    let mut rows = Vec::new();
    for (name, section) in &asset.bytes.sections {
        let (units, unit) = match name.as_str() {
            "links_transfer" => (links.transfer, "link"),
            "links_bounce" => (links.bounce, "link"),
            "links_solution" => (links.solution, "link"),
            "points" | "senders" => (points, "point"),
            _ => (0, ""),
        };
        let each = match (units, unit) {
            (0, "link" | "") => String::new(),
            _ => format!("{} a {unit}", words::per(section.stored, units)),
        };
        rows.push(vec![
            name.clone(),
            count(section.raw),
            count(section.stored),
            each,
        ]);
    }
    rows.push(vec![
        "file".into(),
        String::new(),
        count(asset.bytes.total),
        String::new(),
    ]);
    output::table(&["section", "bytes raw", "stored", ""], rows)
}
