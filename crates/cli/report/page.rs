//! The report as a page that needs nothing beside it, and as a table of values.

use super::drawing::escaped;
use super::findings::pareto;
use super::measured::Measured;
use super::pictures;
use super::plot::Plot;
use super::reference::Reference;
use super::summary::Summary;
use super::tables;
use super::task::Task;
use crate::failure::Failure;
use relight_scene::image::BEAUTY;
use std::fmt::Write;

/// Style and behaviour of the page.
const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");

/// One line per setting, names in the first.
pub fn csv(measured: &[Measured]) -> String {
    let mut text =
        "integrator,layer,label,ms_per_frame,ms_once_per_shot,bake_seconds,asset_bytes,error,rmse,relmse,\
                    floor_relmse,error_indirect,bias,flip,p99,flicker,bake_rays,peak_memory_bytes,pareto,\
         error_low,error_high,ms_spread,repetitions\n"
            .to_owned();
    for (m, pareto) in measured.iter().zip(pareto(measured)) {
        let e = m.judged();
        let known = |value: Option<f64>| value.map_or_else(String::new, |v| v.to_string());
        // Labels hold commas, never quotes.
        let _ = writeln!(
            text,
            "{},{},\"{}\",{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{pareto},{},{},{},{}",
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
            known(e.flicker),
            known(m.bake_rays().map(|rays| rays as f64)),
            known(m.peak_memory.map(|b| b as f64)),
            m.error_range()[1],
            m.error_range()[2],
            known(m.ms_spread()),
            m.milliseconds.len(),
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
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta name=\"color-scheme\" content=\"light dark\">\n<title>{title}</title>\n\
         <style>\n{STYLE}</style></head>\n<body>\n<main>\n<h1>{title}</h1>\n<section aria-label=\"Findings\">\n"
    );
    for sentence in &summary.findings {
        // No line ends between a number and its unit.
        let sentence = escaped(sentence).replace(" %", "\u{a0}%");
        let _ = writeln!(page, "<p class=\"finding\">{sentence}</p>");
    }
    page += "</section>\n";
    facts(&mut page, task, summary, measured, references);
    page += "<h2>Plots</h2>\n<p class=\"note\">Numbers are those of the table below; full dots are on the Pareto front: nothing is both faster \
             and nearer. Bars are what each value may be by what was measured (two standard errors). Error is the root of relMSE, less the \
             reference's own. Point at a dot, or step from dot to dot by Tab, for its words.</p>\n<div class=\"plots\">\n";
    for plot in plots {
        let _ = writeln!(
            page,
            "<figure class=\"plot\" id=\"{}\"><figcaption>{}</figcaption>\n{}</figure>",
            plot.name,
            escaped(plot.title),
            plot.svg
        );
    }
    page += "</div>\n<div id=\"tip\" role=\"status\" hidden></div>\n";
    tables::settings(&mut page, measured, summary.frames_planned);
    tables::stages(&mut page, measured);
    tables::sections(&mut page, measured);
    pictures::strip(&mut page, task, measured, references)?;
    commands(&mut page, task, summary);
    let _ = write!(page, "</main>\n<script>\n{SCRIPT}</script>\n</body></html>\n");
    Ok(page)
}

/// What all was measured with.
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
    let repetitions = measured.iter().map(|m| m.milliseconds.len());
    let (least, most) = (
        repetitions.clone().min().unwrap_or(0),
        repetitions.max().unwrap_or(0),
    );
    let rows = [
        ("Lights", task.lights.display().to_string()),
        ("Frames measured", frames.join(", ")),
        ("Frames planned", summary.frames_planned.to_string()),
        (
            "Image",
            format!("{} × {} pixels, seed {}", task.size.0, task.size.1, task.seed),
        ),
        ("References", references.join("; ")),
        (
            "Repetitions",
            format!(
                "{}, each with its own random numbers; times are medians, without writing files",
                if least == most {
                    least.to_string()
                } else {
                    format!("{least} to {most}")
                }
            ),
        ),
        (
            "Machine",
            format!("{}; {} threads", summary.machine, summary.threads),
        ),
    ];
    *page += "<dl class=\"facts\">\n";
    for (name, value) in rows {
        let _ = writeln!(page, "<dt>{name}</dt><dd>{}</dd>", escaped(&value));
    }
    *page += "</dl>\n";
}

fn commands(page: &mut String, task: &Task, summary: &Summary) {
    let _ = write!(
        page,
        "<h2>Commands</h2>\n<p class=\"note\">SCENE is the file that {} was baked from.</p>\n<pre tabindex=\"0\">",
        escaped(&task.asset.display().to_string()),
    );
    for command in &summary.commands {
        let _ = writeln!(page, "{}", escaped(command));
    }
    *page += "</pre>\n";
    if !summary.not_measured.is_empty() {
        *page += "<p class=\"note\">Not measured for want of time:</p>\n<pre tabindex=\"0\">";
        for command in &summary.not_measured {
            let _ = writeln!(page, "{}", escaped(command));
        }
        *page += "</pre>\n";
    }
}
