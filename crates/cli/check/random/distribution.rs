//! Median, worst tenth and worst of what the seeds gave.

use super::trial::Trial;
use relight_scene::image::metrics::percentile;
use serde::Serialize;

/// One number of all seeds.
#[derive(Clone, Debug, Serialize)]
pub struct Spread {
    /// What it is.
    pub what: &'static str,
    /// Half of the seeds have no more.
    pub median: f64,
    /// Nine tenths of the seeds have no more.
    pub worst_tenth: f64,
    /// No seed has more.
    pub worst: f64,
    /// The seed of the worst.
    pub worst_seed: u64,
}

/// What the table calls a number, and how a trial gives it.
type Column = (&'static str, fn(&Trial) -> f64);

/// Numbers of a trial; those of images first.
pub const COLUMNS: [Column; 7] = [
    ("indirect error", |t| t.indirect.error),
    ("indirect bias", |t| t.indirect.bias.abs()),
    ("direct error", |t| t.direct.error),
    ("direct bias", |t| t.direct.bias.abs()),
    ("bake, s", |t| t.bake_seconds),
    ("frame, ms", |t| t.frame_ms),
    ("points", |t| t.points as f64),
];

/// Of at least one trial.
pub fn spreads(trials: &[Trial]) -> Vec<Spread> {
    let spread = |(what, of): Column| {
        let mut values: Vec<f64> = trials.iter().map(of).collect();
        let worst = (trials.iter()).max_by(|a, b| of(a).total_cmp(&of(b)));
        Spread {
            what,
            median: percentile(&mut values, 0.5),
            worst_tenth: percentile(&mut values, 0.9),
            worst: percentile(&mut values, 1.0),
            worst_seed: worst.map_or(0, |trial| trial.seed),
        }
    };
    COLUMNS.map(spread).to_vec()
}
