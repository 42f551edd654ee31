//! What the measurements mean.

use super::measured::{Measured, SURE};
use super::reference::Reference;
use crate::words;
use relight_format::Estimates;
use relight_probes::expected::{Expected, percent};
use relight_scene::image::BEAUTY;

/// Errors that a report speaks of.
const WANTED: [f64; 3] = [0.01, 0.03, 0.10];

/// Whether each setting is on the Pareto front of those that make the same layers: no other is at least as fast and as
/// right, and better in one of the two by more than can be chance.
pub fn pareto(measured: &[Measured]) -> Vec<bool> {
    let beats = |a: &Measured, b: &Measured| {
        let (faster, nearer) = (a.ms() <= b.ms(), a.judged().relative() <= b.judged().relative());
        a.setting.layer == b.setting.layer && faster && nearer && !(a.lasts_as(b) && a.errs_as(b))
    };
    (measured.iter())
        .map(|one| !measured.iter().any(|other| beats(other, one)))
        .collect()
}

/// Sentences for the top of the page.
pub fn sentences(
    measured: &[Measured],
    references: &[Reference],
    skipped: usize,
    frames: u32,
    estimates: Option<&Estimates>,
) -> Vec<String> {
    if references.iter().all(is_dark) {
        return vec![
            "No light reaches the camera in any frame that was measured, so that no setting can be told from another: take frames or \
             lights with --frames or --lights that shine."
                .into(),
        ];
    }
    let mut all: Vec<String> = WANTED
        .iter()
        .map(|&wanted| advice(measured, wanted, frames))
        .collect();
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

/// What is best for an error, all that is done for so many frames counted.
fn advice(measured: &[Measured], wanted: f64, frames: u32) -> String {
    let percent = 100.0 * wanted;
    let whole = || measured.iter().filter(|m| m.setting.layer != "direct");
    let seconds = |m: &&Measured| m.seconds_of(frames);
    let good_enough = |m: &&Measured| m.judged().relative() <= wanted;
    let fastest = whole()
        .filter(good_enough)
        .min_by(|a, b| seconds(a).total_cmp(&seconds(b)));
    let path = path_ms(measured, wanted);
    let Some(best) = fastest else {
        let closest = whole().min_by(|a, b| a.judged().relative().total_cmp(&b.judged().relative()));
        let closest = closest.map_or_else(String::new, |m| {
            let alike = whole().filter(|other| !std::ptr::eq(*other, m) && other.errs_as(m));
            format!(
                " The closest was {}, {} in {:.0} ms a frame{}.",
                m.setting.label(),
                m.error_words(),
                m.ms(),
                or_equal(alike, "as close")
            )
        });
        let path = path.map_or_else(String::new, |ms| {
            format!(" The path tracer would take some {} a frame.", lasting(ms))
        });
        return format!("For {percent:.0} % error no setting that was measured will do.{closest}{path}");
    };
    // What serves as well within what is known of both: about as long in all, for an error that will do.
    let takes = seconds(&best);
    let alike = whole().filter(good_enough).filter(|other| {
        let spread = |m: &Measured| f64::from(frames) * 1e-3 * m.ms_spread().unwrap_or(0.1 * m.ms());
        !std::ptr::eq(*other, best)
            && (seconds(other) - takes).abs() <= SURE * spread(other).hypot(spread(best))
    });
    let bake = best.bake_seconds.filter(|_| best.needs_bake());
    let with_bake = bake.map_or_else(String::new, |bake| {
        format!(" with the bake of {}", lasting(1e3 * bake))
    });
    let first = format!(
        "For {percent:.0} % error use {}: {}, {:.1} ms a frame, {} for {}{with_bake}{}",
        best.setting.label(),
        best.error_words(),
        best.ms(),
        lasting(1e3 * takes),
        words::plural(frames as usize, "frame"),
        or_equal(alike, "as good")
    );
    let Some(path) = path else {
        return format!("{first}.");
    };
    let Some(bake) = bake else {
        return format!("{first}. Nothing that was baked is as fast at that error for so few frames.");
    };
    if path <= best.ms() {
        return format!(
            "{first}; path tracing takes {} a frame for it, so the bake never pays.",
            lasting(path)
        );
    }
    let pays = ((1e3 * bake + best.once_ms()) / (path - best.ms())).ceil();
    format!(
        "{first}; path tracing takes {} a frame for it, so the bake pays from frame {pays:.0} on.",
        lasting(path)
    )
}

/// Names of settings that can't be told from the one before; of many the first.
fn or_equal<'a>(alike: impl Iterator<Item = &'a Measured>, how: &str) -> String {
    const MOST: usize = 3;
    let labels: Vec<String> = alike.map(|m| m.setting.label()).collect();
    if labels.is_empty() {
        return String::new();
    }
    let more = match labels.len().saturating_sub(MOST) {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    format!(
        " ({how}, for all that can be told: {}{more})",
        labels[..labels.len().min(MOST)].join("; ")
    )
}
