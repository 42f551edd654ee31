//! Names of what is kept from report to report, by the content that it was made of.

use super::task::Task;
use crate::failure::Failure;
use crate::frames::FrameRange;
use anyhow::Context;
use relight_format::{Asset, content_hash};
use relight_scene::light::LightKind;
use relight_scene::sequence::Sequence;
use std::path::{Path, PathBuf};

/// Identifies the scene and the lights of a report.
///
/// # Errors
/// The sequence's file is gone.
pub fn scene_key(asset: &Asset, sequence: &Sequence, lights: &Path) -> Result<u64, Failure> {
    let mut bytes = std::fs::read(lights).with_context(|| lights.display().to_string())?;
    for light in &sequence.lights {
        if let LightKind::Environment { maps, .. } = &light.kind {
            let pixels = maps.all().iter().flat_map(|map| &map.pixels);
            for value in pixels.flat_map(|p| p.to_array()) {
                bytes.extend(value.to_le_bytes());
            }
        }
    }
    let provenance = &asset.provenance;
    bytes.extend(provenance.source_hash.to_le_bytes());
    bytes.push(provenance.lambert.into());
    Ok(content_hash(&bytes))
}

/// Identifies the view of a scene, too.
pub fn task_key(scene: u64, frames: FrameRange, size: (usize, usize), seed: u64) -> u64 {
    let numbers = [
        scene,
        frames.first.into(),
        frames.step.into(),
        size.0 as u64,
        size.1 as u64,
        seed,
    ];
    content_hash(numbers.map(u64::to_le_bytes).as_flattened())
}

/// Where something of this report is kept: `folder`/KEY`suffix`, where the key covers the scene, lights and view, the
/// program's version, and `what`.
pub fn place(task: &Task, folder: &str, what: &str, suffix: &str) -> PathBuf {
    let text = format!("{:016x} {} {what}", task.key, env!("CARGO_PKG_VERSION"));
    let key = content_hash(text.as_bytes());
    task.folder.join(folder).join(format!("{key:016x}{suffix}"))
}
