//! Names of what is kept from report to report, by the content that it was made of.

use super::Task;
use crate::failure::Failure;
use crate::frames::FrameRange;
use anyhow::Context;
use relight_format::{Asset, content_hash};
use relight_scene::light::LightKind;
use relight_scene::sequence::Sequence;
use std::path::{Path, PathBuf};

/// Identifies the scene, the lights and the view of a report.
///
/// # Errors
/// The sequence's file is gone.
pub fn task_key(
    asset: &Asset,
    sequence: &Sequence,
    lights: &Path,
    frames: FrameRange,
    size: (usize, usize),
    seed: u64,
) -> Result<u64, Failure> {
    let mut bytes = std::fs::read(lights).with_context(|| lights.display().to_string())?;
    for light in &sequence.lights {
        if let LightKind::Environment { map, .. } = &light.kind {
            for value in map.pixels.iter().flat_map(|p| p.to_array()) {
                bytes.extend(value.to_le_bytes());
            }
        }
    }
    let provenance = &asset.provenance;
    for number in [
        provenance.source_hash,
        provenance.lambert.into(),
        frames.first.into(),
        frames.step.into(),
        size.0 as u64,
        size.1 as u64,
        seed,
    ] {
        bytes.extend(number.to_le_bytes());
    }
    Ok(content_hash(&bytes))
}

/// Where something of this report is kept: `folder`/KEY`suffix`, where the key covers the scene, lights and view, the
/// program's version, and `what`.
pub fn place(task: &Task, folder: &str, what: &str, suffix: &str) -> PathBuf {
    let text = format!("{:016x} {} {what}", task.key, env!("CARGO_PKG_VERSION"));
    let key = content_hash(text.as_bytes());
    task.folder.join(folder).join(format!("{key:016x}{suffix}"))
}
