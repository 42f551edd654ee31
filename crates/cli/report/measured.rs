//! What was measured of a setting, and how sure that is.

use super::doubt;
use super::settings::Setting;
use crate::inspection::{Bytes, Inspection};
use crate::statistics::median;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Standard errors within which two values count as equal: of twenty pairs of equal ones, one is told apart wrongly.
pub const SURE: f64 = 2.0;
/// Share of a time that its standard error may be.
const CLOSE: f64 = 0.03;
/// Share of a time that may be chance where it was measured once.
const UNKNOWN: f64 = 0.1;
/// Repetitions after which a spread that is still large is the machine's own.
const MOST_REPETITIONS: usize = 6;

/// Errors of a layer over all frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Errors {
    /// Root of the mean square over the frames.
    pub rmse: f64,
    /// Mean over the frames.
    pub relmse: f64,
    /// The references' own, mean over the frames.
    #[serde(rename = "floor_relmse")]
    pub floor: f64,
    /// Mean over the frames.
    pub bias: f64,
    /// Mean over the frames.
    pub flip: f64,
    /// Largest of the frames.
    pub p99: f64,
    /// Second difference in time over the mean that one pixel in a hundred exceeds; `None` unless three frames or more that follow each other
    /// were measured.
    pub flicker: Option<f64>,
}

impl Errors {
    /// Root of relMSE less the reference's own error.
    pub fn relative(&self) -> f64 {
        (self.relmse - self.floor).max(0.0).sqrt()
    }
}

/// A setting and what came of it.
pub struct Measured {
    /// What was tried.
    pub setting: Setting,
    /// The asset that was played.
    pub asset: PathBuf,
    /// Where frames are: one EXR per frame, `frame_0000.exr`.
    pub images: PathBuf,
    /// Milliseconds a frame (mean over the frames), one per repetition.
    pub milliseconds: Vec<f64>,
    /// relMSE by layer, mean over the frames, one per repetition: each has random numbers of its own.
    pub relmse: BTreeMap<String, Vec<f64>>,
    /// Standard error of relMSE by layer for the noise of the references.
    pub doubt: BTreeMap<&'static str, f64>,
    /// Stages of a frame, likewise.
    pub stages: BTreeMap<String, Vec<f64>>,
    /// Milliseconds of what a standing camera needs once.
    pub once: Vec<f64>,
    /// By the names of the layers; those that the integrator makes.
    pub errors: BTreeMap<&'static str, Errors>,
    /// Seconds of the bake; `None` where no log says.
    pub bake_seconds: Option<f64>,
    /// What `inspect` says of the asset.
    pub described: Inspection,
    /// Most memory during play, bytes.
    pub peak_memory: Option<u64>,
}

impl Measured {
    /// Errors of the layer by which the setting is judged.
    pub fn judged(&self) -> Errors {
        self.errors.get(self.setting.layer).copied().unwrap_or_default()
    }

    /// Error of indirect light, which `bake --target-error` speaks of.
    pub fn indirect(&self) -> Option<f64> {
        self.errors.get("indirect").map(Errors::relative)
    }

    /// Whether it is the first that plays its asset in the order of measuring: the asset itself, or one baked for it.
    pub fn is_another_asset(&self) -> bool {
        self.needs_bake() && self.setting.play.is_empty() && matches!(self.setting.integrator, "auto")
    }

    /// Rays of the bake, or nothing where nothing was baked.
    pub fn bake_rays(&self) -> Option<u64> {
        self.described.rays.filter(|_| self.needs_bake())
    }

    /// Median milliseconds a frame.
    pub fn ms(&self) -> f64 {
        median(self.milliseconds.iter().copied())
    }

    /// Standard error of [`Measured::ms`]; `None` of a single repetition.
    pub fn ms_spread(&self) -> Option<f64> {
        doubt::of_mean(&self.milliseconds)
    }

    /// Milliseconds a frame, the least and the most that they may be by what was measured.
    pub fn ms_range(&self) -> [f64; 3] {
        let (ms, spread) = (self.ms(), SURE * self.ms_spread().unwrap_or(0.0));
        [ms, (ms - spread).max(0.2 * ms), ms + spread]
    }

    /// The square of the relative error by which the setting is judged, and its standard error.
    pub fn square(&self) -> (f64, f64) {
        let judged = self.judged();
        let seeds = self
            .relmse
            .get(self.setting.layer)
            .and_then(|values| doubt::of_mean(values));
        let reference = self.doubt.get(self.setting.layer).copied().unwrap_or(0.0);
        (
            judged.relmse - judged.floor,
            seeds.unwrap_or(0.0).hypot(reference),
        )
    }

    /// The relative error, the least and the most that it may be by what was measured.
    pub fn error_range(&self) -> [f64; 3] {
        let (square, doubt) = self.square();
        [0.0, -SURE, SURE].map(|by| (square + by * doubt).max(0.0).sqrt())
    }

    /// The relative error in words: `6.6 ± 0.3 %`.
    pub fn error_words(&self) -> String {
        let [error, low, high] = self.error_range().map(|e| 100.0 * e);
        format!("{error:.2} ± {:.2} %", 0.5 * (high - low))
    }

    /// Whether the errors of two settings can't be told apart.
    pub fn errs_as(&self, other: &Measured) -> bool {
        let ((a, doubt_a), (b, doubt_b)) = (self.square(), other.square());
        (a - b).abs() <= SURE * doubt_a.hypot(doubt_b)
    }

    /// Whether the times of a frame of two settings can't be told apart.
    pub fn lasts_as(&self, other: &Measured) -> bool {
        let spread = |m: &Measured| m.ms_spread().unwrap_or(UNKNOWN * m.ms());
        (self.ms() - other.ms()).abs() <= SURE * spread(self).hypot(spread(other))
    }

    /// Seconds of a bake, of what is done once, and of so many frames.
    pub fn seconds_of(&self, frames: u32) -> f64 {
        let bake = self.bake_seconds.filter(|_| self.needs_bake()).unwrap_or(0.0);
        bake + 1e-3 * (self.once_ms() + f64::from(frames) * self.ms())
    }

    /// Whether more repetitions would tell hardly more.
    pub fn is_settled(&self, least: usize) -> bool {
        let (square, _) = self.square();
        let seeds = self
            .relmse
            .get(self.setting.layer)
            .and_then(|values| doubt::of_mean(values));
        let reference = self.doubt.get(self.setting.layer).copied().unwrap_or(0.0);
        // Below the reference's noise there is nothing to be found; of the error itself a twentieth, which is a tenth of its square.
        let known = seeds.is_some_and(|seeds| seeds <= reference.max(0.1 * square));
        let timed = self.ms_spread().is_some_and(|spread| spread <= CLOSE * self.ms());
        let count = self.milliseconds.len();
        count >= least && (count >= MOST_REPETITIONS || (known && timed))
    }

    /// Median milliseconds of what a standing camera needs once.
    pub fn once_ms(&self) -> f64 {
        median(self.once.iter().copied())
    }

    /// Bytes of the asset file.
    pub fn asset_bytes(&self) -> u64 {
        self.described.bytes.total
    }

    /// Whether the integrator needs what the bake made.
    pub fn needs_bake(&self) -> bool {
        !matches!(
            self.setting.integrator,
            "path" | "brute" | "lightcuts" | "pixelcuts"
        )
    }

    /// For the report; `pareto`: nothing is both faster and nearer.
    pub fn summary(&self, pareto: bool) -> SettingSummary<'_> {
        let judged = self.judged();
        let knobs = self.setting.varied.iter().chain(&self.setting.play);
        SettingSummary {
            integrator: self.setting.integrator,
            knobs: knobs
                .map(|(option, value)| {
                    let number = value.parse().map(Knob::Number);
                    let name = option.trim_start_matches('-').replace('-', "_");
                    (name, number.unwrap_or(Knob::Word(value)))
                })
                .collect(),
            label: self.setting.label(),
            command: self.setting.command(),
            layer: self.setting.layer,
            ms_per_frame: self.ms(),
            ms_by_stage: (self.stages.iter())
                .map(|(name, values)| (name.as_str(), median(values.iter().copied())))
                .collect(),
            ms_spread: self.ms_spread(),
            error_range: [self.error_range()[1], self.error_range()[2]],
            ms_once_per_shot: self.once_ms(),
            repetitions: &self.milliseconds,
            bake_seconds: self.bake_seconds,
            asset_bytes: self.asset_bytes(),
            bytes: &self.described.bytes,
            rays: self.described.rays,
            error: judged.relative(),
            error_indirect: self.indirect(),
            rmse: judged.rmse,
            relmse: judged.relmse,
            bias: judged.bias,
            flip: judged.flip,
            p99: judged.p99,
            flicker: judged.flicker,
            layers: &self.errors,
            peak_memory_bytes: self.peak_memory,
            pareto,
        }
    }
}

/// What a report's JSON says of a setting.
#[derive(Serialize)]
pub struct SettingSummary<'a> {
    integrator: &'static str,
    /// What differs from the asset and from the integrator's defaults, by the options' names.
    knobs: BTreeMap<String, Knob<'a>>,
    label: String,
    command: String,
    layer: &'static str,
    ms_per_frame: f64,
    ms_by_stage: BTreeMap<&'a str, f64>,
    /// Standard error of `ms_per_frame`; null of a single repetition.
    ms_spread: Option<f64>,
    /// Twice the standard error of relMSE below and above `error`.
    error_range: [f64; 2],
    ms_once_per_shot: f64,
    repetitions: &'a [f64],
    bake_seconds: Option<f64>,
    asset_bytes: u64,
    bytes: &'a Bytes,
    rays: Option<u64>,
    error: f64,
    error_indirect: Option<f64>,
    rmse: f64,
    relmse: f64,
    bias: f64,
    flip: f64,
    p99: f64,
    flicker: Option<f64>,
    layers: &'a BTreeMap<&'static str, Errors>,
    peak_memory_bytes: Option<u64>,
    pareto: bool,
}

/// An option's value.
#[derive(Serialize)]
#[serde(untagged)]
enum Knob<'a> {
    Number(f64),
    Word(&'a str),
}
