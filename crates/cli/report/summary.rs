//! What a report says, as JSON and on its page.

use super::measured::SettingSummary;
use super::reference::ReferenceSummary;
use crate::inspection::Inspection;
use serde::Serialize;

/// What a report says.
#[derive(Serialize)]
pub struct Summary<'a> {
    /// Version of the JSON.
    pub schema: u32,
    /// `report`.
    pub command: &'static str,
    /// `quick` or `full`.
    pub preset: &'static str,
    /// What `inspect` says of the asset.
    pub asset: &'a Inspection,
    /// The lighting sequence's file.
    pub lights: String,
    /// Frames that were measured.
    pub frames: Vec<u32>,
    /// Frames over which the time of a bake counts.
    pub frames_planned: u32,
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    /// Seed of everything.
    pub seed: u64,
    /// Processor and number of cores.
    pub machine: String,
    /// Worker threads.
    pub threads: usize,
    /// What errors are.
    pub error_measure: &'static str,
    /// What all was judged by.
    pub references: Vec<ReferenceSummary>,
    /// What was measured.
    pub settings: Vec<SettingSummary<'a>>,
    /// Commands that found no time.
    pub not_measured: Vec<String>,
    /// What it means, in sentences.
    pub findings: Vec<String>,
    /// Commands that do by hand what was done.
    pub commands: Vec<String>,
    /// What the report took.
    pub seconds: f64,
}
