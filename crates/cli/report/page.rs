//! The report as a page and as a table of values.

use super::findings::pareto;
use super::measure::Measured;
use super::plot::Plot;
use super::reference::Reference;
use super::summary::Summary;
use super::task::Task;
use crate::failure::Failure;
use crate::statistics::median;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use relight_scene::image::preview::auto_exposure;
use relight_scene::image::{
    BEAUTY, Image8, Limits, display_encoded, error_map, read_exr, tone_mapped, write_png,
};
use std::fmt::Write;
use std::path::Path;

/// Style and behaviour of the page.
const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");

/// One line per setting, names in the first.
pub fn csv(measured: &[Measured]) -> String {
    let mut text =
        "integrator,layer,label,ms_per_frame,ms_once_per_shot,bake_seconds,asset_bytes,error,rmse,relmse,\
                    floor_relmse,error_indirect,bias,flip,p99,bake_rays,peak_memory_bytes,pareto\n"
            .to_owned();
    for (m, pareto) in measured.iter().zip(pareto(measured)) {
        let e = m.judged();
        let known = |value: Option<f64>| value.map_or_else(String::new, |v| v.to_string());
        // Labels hold commas, never quotes.
        let _ = writeln!(
            text,
            "{},{},\"{}\",{},{},{},{},{},{},{},{},{},{},{},{},{},{},{pareto}",
            m.setting.integrator,
            m.setting.layer,
            m.setting.label(),
            m.ms(),
            m.once_ms(),
            known(m.bake_seconds),
            m.asset_bytes(),
            e.relative(),
            e.rmse,
            e.relmse,
            e.floor,
            known(m.indirect()),
            e.bias,
            e.flip,
            e.p99,
            known(m.bake_rays().map(|rays| rays as f64)),
            known(m.peak_memory.map(|b| b as f64)),
        );
    }
    text
}

/// The page, whole: it needs nothing beside it.
///
/// # Errors
/// An image cannot be read or written.
pub fn html(
    task: &Task,
    summary: &Summary,
    measured: &[Measured],
    references: &[Reference],
    plots: &[Plot],
) -> Result<String, Failure> {
    let name = task
        .asset
        .file_name()
        .map_or_else(String::new, |n| n.to_string_lossy().into_owned());
    let mut page = String::new();
    let title = escaped(&format!("{name}: error against run time"));
    let _ = write!(
        page,
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>{title}</title>\n\
         <style>\n{STYLE}</style></head>\n<body>\n<h1>{title}</h1>\n"
    );
    for sentence in &summary.findings {
        let _ = writeln!(page, "<p class=\"finding\">{}</p>", escaped(sentence));
    }
    facts(&mut page, task, summary, measured, references);
    page += "<div class=\"plots\">\n";
    for plot in plots {
        let _ = writeln!(
            page,
            "<figure class=\"plot\" id=\"{}\"><figcaption>{}</figcaption>",
            plot.name,
            escaped(&plot.title)
        );
        page += plot
            .svg
            .trim_start_matches("<?xml version=\"1.0\" encoding=\"utf-8\"?>");
        page += "</figure>\n";
    }
    page += "</div>\n";
    page += "<p class=\"note\">Filled dots are on the Pareto front. Error is the root of relMSE, less the reference's \
             own.</p>\n";
    table(&mut page, measured);
    stages(&mut page, measured);
    sections(&mut page, measured);
    strip(&mut page, task, measured, references)?;
    commands(&mut page, task, summary);
    let _ = write!(page, "<script>\n{SCRIPT}</script>\n</body></html>\n");
    Ok(page)
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

fn facts(page: &mut String, task: &Task, summary: &Summary, measured: &[Measured], references: &[Reference]) {
    let frames: Vec<String> = task.frames.iter().map(|f| f.to_string()).collect();
    let references: Vec<String> = (references.iter())
        .map(|r| {
            let floor = r.floor.map(|_| r.floor_of(BEAUTY).sqrt());
            let own = floor.map_or("unknown".into(), |f| format!("{:.2} %", 100.0 * f));
            let spp = r.spp.map_or("given".into(), |n| format!("{n} samples a pixel"));
            format!("frame {}: {spp}, own error {own}", r.frame)
        })
        .collect();
    let _ = writeln!(
        page,
        "<p class=\"note\">Lights {}, frames {}, {} × {} pixels, seed {}. Machine: {}; {} threads. References: {}. \
         Times are medians of {} interleaved repetitions, without writing the file.</p>",
        escaped(&task.lights.display().to_string()),
        frames.join(", "),
        task.size.0,
        task.size.1,
        task.seed,
        escaped(&summary.machine),
        summary.threads,
        references.join("; "),
        measured.first().map_or(0, |m| m.milliseconds.len()),
    );
}

const COLUMNS: [&str; 14] = [
    "setting",
    "layer",
    "ms a frame",
    "ms once",
    "bake s",
    "asset MB",
    "error %",
    "indirect %",
    "bias %",
    "FLIP",
    "p99",
    "M rays",
    "peak MB",
    "Pareto",
];

fn table(page: &mut String, measured: &[Measured]) {
    *page += "<h2>All settings</h2>\n<div class=\"wide\"><table class=\"sortable\"><thead><tr>";
    for column in COLUMNS {
        let _ = write!(page, "<th tabindex=\"0\">{column}</th>");
    }
    *page += "</tr></thead>\n<tbody>\n";
    for (m, pareto) in measured.iter().zip(pareto(measured)) {
        let e = m.judged();
        let bake = m.bake_seconds.filter(|_| m.needs_bake());
        let megabytes = m.needs_bake().then(|| m.asset_bytes() as f64 / 1e6);
        let known = |value: Option<f64>| value.map_or_else(|| "–".into(), |v| format!("{v:.1}"));
        let _ = writeln!(
            page,
            "<tr{}><td>{}</td><td>{}</td><td>{:.2}</td><td>{:.1}</td><td>{}</td><td>{}</td><td>{:.3}</td><td>{}</td><td>{:+.2}</td>\
             <td>{:.4}</td><td>{:.3}</td><td>{}</td><td>{}</td><td>{}</td></tr>",
            if pareto { " class=\"front\"" } else { "" },
            escaped(&m.setting.label()),
            m.setting.layer,
            m.ms(),
            m.once_ms(),
            known(bake),
            known(megabytes),
            100.0 * e.relative(),
            known(m.indirect().map(|e| 100.0 * e)),
            100.0 * e.bias,
            e.flip,
            e.p99,
            known(m.bake_rays().map(|rays| rays as f64 * 1e-6)),
            known(m.peak_memory.map(|bytes| bytes as f64 * 1e-6)),
            if pareto { "yes" } else { "" },
        );
    }
    *page += "</tbody></table></div>\n";
}

/// Names of what is in any of the lists, in the order of their first appearance.
fn names<'a>(lists: impl Iterator<Item = Vec<&'a str>>) -> Vec<&'a str> {
    let mut all: Vec<&str> = Vec::new();
    for name in lists.flatten() {
        if !all.contains(&name) {
            all.push(name);
        }
    }
    all
}

/// A table with a column for each name and a row for each setting; cells without a value stay empty.
fn grid<'a>(
    page: &mut String,
    title: &str,
    columns: &[&str],
    rows: impl Iterator<Item = (&'a Measured, Vec<Option<f64>>)>,
    digits: usize,
) {
    let heads: String = columns
        .iter()
        .map(|name| format!("<th tabindex=\"0\">{}</th>", escaped(name)))
        .collect();
    let _ = write!(
        page,
        "<h2>{title}</h2>\n<div class=\"wide\"><table class=\"sortable\"><thead><tr><th tabindex=\"0\">setting</th>{heads}</tr>\
         </thead>\n<tbody>\n"
    );
    for (m, values) in rows {
        let cells: String = (values.into_iter())
            .map(|value| value.map_or_else(|| "<td></td>".into(), |v| format!("<td>{v:.digits$}</td>")))
            .collect();
        let _ = writeln!(page, "<tr><td>{}</td>{cells}</tr>", escaped(&m.setting.label()));
    }
    *page += "</tbody></table></div>\n";
}

/// Milliseconds of a frame's stages.
fn stages(page: &mut String, measured: &[Measured]) {
    // Counts that integrators over points tell beside their times.
    const COUNTS: [&str; 11] = [
        "lights",
        "virtual_lights",
        "tree_bytes",
        "nodes_per_pixel",
        "limited_cuts_per_pixel",
        "exact_lights",
        "shadow_rays_per_pixel",
        "eye_rays_per_pixel",
        "samples_per_pixel",
        "shadow_rays_per_reconstruction_cut",
        "illumination_cut_nodes",
    ];
    let timed = |name: &str| !COUNTS.contains(&name) && !name.contains("per_fragment");
    let of = |m: &Measured, name: &str| m.stages.get(name).map(|v| median(v.iter().copied()));
    let all = names(measured.iter().map(|m| m.stages.keys().copied().collect()));
    let (times, counts): (Vec<&str>, Vec<&str>) = all.into_iter().partition(|name| timed(name));
    let rows = |columns: Vec<&str>| {
        let of_columns = |m: &Measured| columns.iter().map(|name| of(m, name)).collect::<Vec<_>>();
        measured
            .iter()
            .map(|m| (m, of_columns(m)))
            .filter(|(_, v)| v.iter().any(Option::is_some))
            .collect::<Vec<_>>()
    };
    grid(
        page,
        "Milliseconds of a frame by stage",
        &times,
        rows(times.clone()).into_iter(),
        2,
    );
    if !counts.is_empty() {
        let title = "Lights, nodes and rays of the integrators over points";
        grid(page, title, &counts, rows(counts.clone()).into_iter(), 1);
    }
}

fn section_names(m: &Measured) -> Vec<&str> {
    m.described.bytes.sections.keys().map(String::as_str).collect()
}

/// Kilobytes of the assets' sections.
fn sections(page: &mut String, measured: &[Measured]) {
    let baked: Vec<&Measured> = measured.iter().filter(|m| m.is_another_asset()).collect();
    let stored = |m: &Measured, name: &str| {
        let section = m.described.bytes.sections.get(name);
        section.map(|s| s.stored as f64 * 1e-3)
    };
    let columns = names(baked.iter().map(|m| section_names(m)));
    let rows = baked
        .iter()
        .map(|m| (*m, columns.iter().map(|name| stored(m, name)).collect()));
    grid(page, "Kilobytes of the assets by section", &columns, rows, 1);
}

/// A picture of each setting, to be flipped against reference and error map.
fn strip(
    page: &mut String,
    task: &Task,
    measured: &[Measured],
    references: &[Reference],
) -> Result<(), Failure> {
    let Some(reference) = references.first() else {
        return Ok(());
    };
    let folder = task.folder.join("pictures");
    let frame = reference.frame;
    let _ = writeln!(
        page,
        "<h2>Frame {frame}</h2>\n<p class=\"note\">Click a picture, or press a key: <b>1</b> pictures, <b>2</b> references, \
         <b>3</b> error maps (relative error, 0.1 % dark to 100 % yellow, logarithmic).</p>\n<div class=\"strip\">"
    );
    for (i, m) in measured.iter().enumerate() {
        let layer = m.setting.layer;
        let exr = m.images.join(format!("frame_{frame:04}.exr"));
        let image = read_exr(&exr, &Limits::default())?.rgb(layer);
        let (Some(image), Some(truth)) = (image, reference.layers.rgb(layer)) else {
            continue;
        };
        let exposure = auto_exposure(&truth).unwrap_or_default();
        let save = |kind: &str, image: &Image8| embedded(&folder.join(format!("{i:02}_{kind}.png")), image);
        let _ = writeln!(
            page,
            "<figure class=\"flip\" tabindex=\"0\"><img class=\"shown\" alt=\"picture\" src=\"{}\"><img alt=\"reference\" \
             src=\"{}\"><img alt=\"error map\" src=\"{}\"><figcaption>{}<br>{:.2} %, {:.1} ms</figcaption></figure>",
            save("picture", &tone_mapped(&image, exposure))?,
            save("reference", &tone_mapped(&truth, exposure))?,
            save("error", &display_encoded(&error_map(&image, &truth)?))?,
            escaped(&m.setting.label()),
            100.0 * m.judged().relative(),
            m.ms(),
        );
    }
    *page += "</div>\n";
    Ok(())
}

/// Writes a PNG and returns it as a data URL.
fn embedded(path: &Path, image: &Image8) -> Result<String, Failure> {
    crate::output::prepare_output(path)?;
    write_png(path, image)?;
    Ok(format!(
        "data:image/png;base64,{}",
        STANDARD.encode(std::fs::read(path)?)
    ))
}

fn commands(page: &mut String, task: &Task, summary: &Summary) {
    let _ = write!(
        page,
        "<h2>Commands</h2>\n<p class=\"note\">SCENE is the file that {} was baked from.</p>\n<pre>",
        escaped(&task.asset.display().to_string()),
    );
    for command in &summary.commands {
        let _ = writeln!(page, "{}", escaped(command));
    }
    *page += "</pre>\n";
    if !summary.not_measured.is_empty() {
        *page += "<p class=\"note\">Not measured for want of time:</p>\n<pre>";
        for command in &summary.not_measured {
            let _ = writeln!(page, "{}", escaped(command));
        }
        *page += "</pre>\n";
    }
}
