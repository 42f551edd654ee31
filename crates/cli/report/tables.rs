//! Tables of a report: heads in words, each column sorted by a button, wide ones in a box that scrolls by itself.

use super::drawing::escaped;
use super::findings::pareto;
use super::measured::Measured;
use crate::statistics::median;
use std::fmt::Write;

/// A column's head, and what it means.
type Head = (&'static str, &'static str);

const HEADS: [Head; 19] = [
    ("No.", "number of the setting in the plots"),
    (
        "Setting",
        "integrator, and what of its options or of the bake differs",
    ),
    ("Layer", "what the setting makes and is judged by"),
    (
        "Frame, ms",
        "median milliseconds of a frame, without writing files",
    ),
    ("± ms", "standard error of that"),
    ("Error, %", "root of relMSE less the reference's own"),
    (
        "± %",
        "what the error may be off: two standard errors, of repetitions and of the reference's noise",
    ),
    (
        "Indirect error, %",
        "the same of indirect light alone, of which bake --target-error speaks",
    ),
    ("Bias, %", "relative error of the mean"),
    ("FLIP", "difference that people see, from 0 to 1"),
    (
        "99th percentile",
        "relative error that one pixel in a hundred exceeds",
    ),
    (
        "Flicker, %",
        "what one pixel in a hundred changes by from frame to frame beyond an even change; measured of three frames or more in a row",
    ),
    ("Once, ms", "milliseconds of what a standing camera needs once"),
    ("Bake, s", "seconds of the bake"),
    (
        "Planned frames, s",
        "seconds of the bake and all planned frames together",
    ),
    ("Asset, MB", "size of the asset's file"),
    ("Bake rays, million", "rays of the bake"),
    ("Memory, MB", "most memory while playing"),
    ("Pareto front", "whether nothing is both faster and nearer"),
];

fn begin(page: &mut String, title: &str, heads: impl Iterator<Item = (String, String)>) {
    let _ = write!(
        page,
        "<h2>{title}</h2>\n<div class=\"wide\" tabindex=\"0\" role=\"region\" aria-label=\"{title}\"><table class=\"sortable\"><thead><tr>"
    );
    for (head, means) in heads {
        let _ = write!(
            page,
            "<th scope=\"col\"><button type=\"button\" title=\"{}\">{}</button></th>",
            escaped(&means),
            escaped(&head)
        );
    }
    *page += "</tr></thead>\n<tbody>\n";
}

/// All settings.
pub fn settings(page: &mut String, measured: &[Measured], planned: u32) {
    let heads = HEADS
        .iter()
        .map(|(head, means)| ((*head).to_owned(), (*means).to_owned()));
    begin(page, "All settings", heads);
    for (i, (m, pareto)) in measured.iter().zip(pareto(measured)).enumerate() {
        let e = m.judged();
        let bake = m.bake_seconds.filter(|_| m.needs_bake());
        let megabytes = m.needs_bake().then(|| m.asset_bytes() as f64 / 1e6);
        let known = |value: Option<f64>| value.map_or_else(|| "–".into(), |v| format!("{v:.1}"));
        let [_, low, high] = m.error_range();
        let spread = m.ms_spread().map_or_else(|| "–".into(), |v| format!("{v:.2}"));
        let cells = [
            (i + 1).to_string(),
            escaped(&m.setting.label()),
            m.setting.layer.to_owned(),
            format!("{:.2}", m.ms()),
            spread,
            format!("{:.3}", 100.0 * e.relative()),
            format!("{:.3}", 50.0 * (high - low)),
            known(m.indirect().map(|e| 100.0 * e)),
            format!("{:+.2}", 100.0 * e.bias),
            format!("{:.4}", e.flip),
            format!("{:.3}", e.p99),
            e.flicker
                .map_or_else(|| "–".into(), |f| format!("{:.2}", 100.0 * f)),
            format!("{:.1}", m.once_ms()),
            known(bake),
            format!("{:.1}", m.seconds_of(planned)),
            known(megabytes),
            known(m.bake_rays().map(|rays| rays as f64 * 1e-6)),
            known(m.peak_memory.map(|bytes| bytes as f64 * 1e-6)),
            if pareto { "yes".to_owned() } else { String::new() },
        ];
        let cells: String = cells.iter().map(|cell| format!("<td>{cell}</td>")).collect();
        let class = if pareto { " class=\"front\"" } else { "" };
        let _ = writeln!(page, "<tr{class}>{cells}</tr>");
    }
    *page += "</tbody></table></div>\n";
}

/// A name of the program's own in words: `direct_points` is `direct points`.
fn in_words(name: &str) -> String {
    let words = name.replace('_', " ");
    let mut letters = words.chars();
    letters
        .next()
        .map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
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
    let own = (HEADS[1].0.to_owned(), HEADS[1].1.to_owned());
    let heads = columns
        .iter()
        .map(|name| (in_words(name), format!("{name} in report.json")));
    begin(page, title, std::iter::once(own).chain(heads));
    for (m, values) in rows {
        let cells: String = (values.into_iter())
            .map(|value| value.map_or_else(|| "<td>–</td>".into(), |v| format!("<td>{v:.digits$}</td>")))
            .collect();
        let _ = writeln!(page, "<tr><td>{}</td>{cells}</tr>", escaped(&m.setting.label()));
    }
    *page += "</tbody></table></div>\n";
}

/// Milliseconds of a frame's stages.
pub fn stages(page: &mut String, measured: &[Measured]) {
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
    let all = names(
        measured
            .iter()
            .map(|m| m.stages.keys().map(String::as_str).collect()),
    );
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
pub fn sections(page: &mut String, measured: &[Measured]) {
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
