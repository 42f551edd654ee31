//! What shines: lights as Python has them, a sequence's JSON or its file, prepared for an asset.

use crate::error::{failed, misused};
use crate::work;
use pyo3::prelude::*;
use relight_play::Player;
use relight_play::glam::DVec3;
use relight_play::scene::sequence::{Sequence, parse_sequence_at, read_sequence_at};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Lights that are prepared for an asset, for any number of frames: tables of environments and emissive surfaces are made once.
#[pyclass(frozen, module = "relight")]
pub struct Lights {
    player: Arc<Player>,
    /// As the player takes them.
    pub prepared: Arc<relight_play::Lights>,
    /// Number of frames of the sequence.
    #[pyo3(get)]
    frames: u32,
    /// Frames per second.
    #[pyo3(get)]
    fps: f64,
}

#[pymethods]
impl Lights {
    /// Names of the lights, in the order of `Shot.basis`.
    #[getter]
    fn names(&self) -> Vec<String> {
        self.prepared
            .tracks()
            .iter()
            .map(|track| track.name.clone())
            .collect()
    }

    fn __len__(&self) -> usize {
        self.prepared.tracks().len()
    }

    fn __repr__(&self) -> String {
        format!(
            "<relight.Lights {}, {} frames>",
            self.names().join(", "),
            self.frames
        )
    }
}

/// Reads what somebody gave for lights or a camera: `function` of `relight._sequence` says which file it is, or makes JSON of it.
///
/// # Errors
/// What is wrong with it.
pub fn read(given: &Bound<'_, PyAny>, function: &str, offset: DVec3) -> PyResult<Sequence> {
    let py = given.py();
    let source = py
        .import("relight._sequence")?
        .getattr(function)?
        .call1((given,))?;
    let (file, text): (Option<PathBuf>, String) = source.extract()?;
    let name = &function["of_".len()..];
    work::done(py, None, |_| {
        let read = match file {
            Some(file) => read_sequence_at(&file, offset),
            None => parse_sequence_at(&text, Path::new(""), name, offset),
        };
        read.map_err(failed)
    })
}

/// Prepares what somebody gave for lights of a player; the scene's own where nothing was given.
///
/// # Errors
/// They are of another asset, wrong, or want what the asset lacks.
pub fn prepared(py: Python<'_>, player: &Arc<Player>, given: Option<&Bound<'_, PyAny>>) -> PyResult<Lights> {
    let sequence = match given {
        Some(given) => {
            if let Ok(lights) = given.cast::<Lights>() {
                let lights = lights.get();
                if !Arc::ptr_eq(&lights.player, player) {
                    return Err(misused(
                        "these lights were prepared for another asset: prepare them with Asset.lights of this one",
                    ));
                }
                return Ok(Lights {
                    player: player.clone(),
                    prepared: lights.prepared.clone(),
                    ..*lights
                });
            }
            read(given, "of_lights", player.scene().offset)?
        }
        None => player.own_lights().map_err(failed)?.clone(),
    };
    let prepared = work::done(py, None, |_| player.lights(&sequence.lights).map_err(failed))?;
    Ok(Lights {
        player: player.clone(),
        prepared: Arc::new(prepared),
        frames: sequence.frames,
        fps: sequence.fps,
    })
}
