//! What the measurements mean.

use super::measure::Measured;
use super::reference::Reference;
use crate::estimates::{Expected, percent};
use crate::words;
use relight_format::Estimates;
use relight_scene::image::BEAUTY;

/// Errors that a report speaks of.
const WANTED: [f64; 3] = [0.01, 0.03, 0.10];

/// Whether each setting is on the Pareto front of those that make the same layers: no other is at least as fast and as
/// right, and better in one of the two.
pub fn pareto(measured: &[Measured]) -> Vec<bool> {
    let of = |m: &Measured| (m.setting.layer, m.ms(), m.judged().relative());
    (measured.iter().map(of))
        .map(|(layer, ms, error)| {
            !measured.iter().map(of).any(|(other, other_ms, other_error)| {
                other == layer
                    && other_ms <= ms
                    && other_error <= error
                    && (other_ms < ms || other_error < error)
            })
        })
        .collect()
}

/// Sentences for the top of the page.
pub fn sentences(
    measured: &[Measured],
    references: &[Reference],
    skipped: usize,
    estimates: Option<&Estimates>,
) -> Vec<String> {
    if references.iter().all(is_dark) {
        return vec![
            "No light reaches the camera in any frame that was measured, so that no setting can be told from another: take frames or \
             lights with --frames or --lights that shine."
                .into(),
        ];
    }
    let mut all: Vec<String> = WANTED.iter().map(|&wanted| advice(measured, wanted)).collect();
    all.extend(asset_itself(measured, references, estimates));
    let own = references.iter().map(|r| r.floor_of(BEAUTY)).sum::<f64>() / references.len().max(1) as f64;
    if references.iter().any(|r| r.floor.is_none()) {
        all.push(
            "How far the given references are from the truth is not known: errors count theirs, too.".into(),
        );
    } else if own.sqrt() > WANTED[0] {
        all.push(format!(
            "The references' own error is {:.1} %: errors below that are differences of large numbers; a longer --budget \
             makes them certain.",
            100.0 * own.sqrt()
        ));
    }
    if skipped > 0 {
        all.push(format!(
            "{} found no time and were not measured; a longer --budget takes them up.",
            words::plural(skipped, "setting")
        ));
    }
    all
}

/// Whether a reference has no light.
fn is_dark(reference: &Reference) -> bool {
    let beauty = reference.layers.rgb(BEAUTY).unwrap_or_default();
    beauty.pixels.iter().all(|pixel| *pixel == [0.0; 3])
}

/// What the asset's indirect light errs by, and what its bake expected.
fn asset_itself(
    measured: &[Measured],
    references: &[Reference],
    estimates: Option<&Estimates>,
) -> Option<String> {
    let plain = |m: &&Measured| m.setting.bake.is_empty() && m.setting.play.is_empty() && m.needs_bake();
    let error = measured.iter().find(plain)?.indirect()?;
    let expected = Expected::of(estimates).map_or_else(String::new, |expected| {
        format!("; its bake expected {}", percent(expected.error))
    });
    let floor = references.iter().map(|r| r.floor_of("indirect")).sum::<f64>();
    let own = (floor / references.len().max(1) as f64).sqrt();
    let found = if own > 2.0 * error {
        // What is left of the difference of two such numbers says nothing.
        format!(
            "by less than can be told: its reference's own error is {:.1} %",
            100.0 * own
        )
    } else {
        format!(
            "by {:.1} % (its reference's own error is {:.1} %)",
            100.0 * error,
            100.0 * own
        )
    };
    Some(format!(
        "The asset's indirect light alone errs {found}{expected}."
    ))
}

/// Milliseconds that a path tracer takes for an error: its variance falls as 1 over time, the constant is that of its
/// longest measurement. `None` if it was not measured.
fn path_ms(measured: &[Measured], error: f64) -> Option<f64> {
    let paths = measured.iter().filter(|m| is_path(m));
    let longest = paths.max_by(|a, b| a.ms().total_cmp(&b.ms()))?;
    let reached = longest.judged().relative();
    (reached > 0.0).then(|| longest.ms() * (reached / error).powi(2))
}

/// Milliseconds in words.
fn lasting(ms: f64) -> String {
    match ms * 1e-3 {
        s if s < 10.0 => format!("{ms:.0} ms"),
        s if s < 120.0 => format!("{s:.0} s"),
        s if s < 7200.0 => format!("{:.0} minutes", s / 60.0),
        s => format!("{:.0} hours", s / 3600.0),
    }
}

fn is_path(m: &Measured) -> bool {
    m.setting.integrator == "path" && m.setting.layer != "direct"
}

fn advice(measured: &[Measured], wanted: f64) -> String {
    let percent = 100.0 * wanted;
    let whole = || measured.iter().filter(|m| m.setting.layer != "direct");
    let fastest = whole()
        .filter(|m| m.judged().relative() <= wanted)
        .min_by(|a, b| a.ms().total_cmp(&b.ms()));
    let path = path_ms(measured, wanted);
    let Some(best) = fastest else {
        let closest = whole().min_by(|a, b| a.judged().relative().total_cmp(&b.judged().relative()));
        let closest = closest.map_or_else(String::new, |m| {
            format!(
                " The closest was {}, {:.1} % in {:.0} ms a frame.",
                m.setting.label(),
                100.0 * m.judged().relative(),
                m.ms()
            )
        });
        let path = path.map_or_else(String::new, |ms| {
            format!(" The path tracer would take some {} a frame.", lasting(ms))
        });
        return format!("For {percent:.0} % error no setting that was measured will do.{closest}{path}");
    };
    let first = format!(
        "For {percent:.0} % error use {}: {:.1} ms a frame, {:.1} %",
        best.setting.label(),
        best.ms(),
        100.0 * best.judged().relative()
    );
    if !best.needs_bake() {
        return format!("{first}. Nothing that was baked is as fast at that error.");
    }
    let (Some(path), Some(bake)) = (path, best.bake_seconds) else {
        return format!("{first}.");
    };
    if path <= best.ms() {
        return format!(
            "{first}; path tracing takes {} for it, so the bake never pays.",
            lasting(path)
        );
    }
    let once = best.once_ms();
    let frames = ((1e3 * bake + once) / (path - best.ms())).ceil();
    format!(
        "{first}; path tracing takes {} for it, so the bake of {bake:.0} s pays from frame {frames:.0} on.",
        lasting(path)
    )
}
