//! What a camera sees, lit as often as one likes.

use crate::arrays;
use crate::error::{failed, misused};
use crate::lights;
use crate::work;
use numpy::{IntoPyArray, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use relight_play::{Frame, FrameSettings, Player};
use std::sync::Arc;

/// What a camera sees, with all that lighting it needs.
#[pyclass(frozen, module = "relight")]
pub struct Shot {
    player: Arc<Player>,
    shot: relight_play::Shot,
    /// Pixels across and down.
    #[pyo3(get)]
    size: (usize, usize),
}

impl Shot {
    /// Of a player.
    pub fn new(player: Arc<Player>, shot: relight_play::Shot, size: (usize, usize)) -> Shot {
        Shot { player, shot, size }
    }

    fn lit(
        &self,
        py: Python<'_>,
        lights: &lights::Lights,
        time: f64,
        settings: &FrameSettings,
    ) -> PyResult<Frame> {
        if !time.is_finite() {
            return Err(misused("time must be a number of frames"));
        }
        work::done(py, None, |watch| {
            let player = &self.player;
            (player.frame_watched(&self.shot, &lights.prepared, time, settings, watch)).map_err(failed)
        })
    }
}

#[pymethods]
impl Shot {
    /// A frame: linear RGB in W/(m² sr), by layer.
    #[pyo3(signature = (lights=None, time=0.0, *, light_layers=false, surface_layers=false, seed=0))]
    fn frame<'py>(
        &self,
        py: Python<'py>,
        lights: Option<&Bound<'py, PyAny>>,
        time: f64,
        light_layers: bool,
        surface_layers: bool,
        seed: u64,
    ) -> PyResult<Bound<'py, PyDict>> {
        let lights = lights::prepared(py, &self.player, lights)?;
        let settings = FrameSettings {
            seed,
            light_layers,
            surface_layers,
            ..FrameSettings::default()
        };
        arrays::layers(py, self.lit(py, &lights, time, &settings)?.layers)
    }

    /// One image per light, `(lights, height, width, 3)`: their sum is the beauty, and each is proportional to its light.
    #[pyo3(signature = (lights=None, time=0.0, *, seed=0))]
    fn basis<'py>(
        &self,
        py: Python<'py>,
        lights: Option<&Bound<'py, PyAny>>,
        time: f64,
        seed: u64,
    ) -> PyResult<Bound<'py, PyAny>> {
        let lights = lights::prepared(py, &self.player, lights)?;
        let settings = FrameSettings {
            seed,
            light_layers: true,
            ..FrameSettings::default()
        };
        let layers = self.lit(py, &lights, time, &settings)?.layers;
        let names = lights.prepared.tracks().iter().map(|track| track.name.as_str());
        let mut images: Vec<f32> =
            Vec::with_capacity(layers.width * layers.height * 3 * lights.prepared.tracks().len());
        for name in names {
            let layer = layers.layer(&format!("light.{name}"));
            images.extend(layer.into_iter().flat_map(|layer| &layer.data));
        }
        let shape = [lights.prepared.tracks().len(), layers.height, layers.width, 3];
        Ok(images.into_pyarray(py).reshape(shape)?.into_any())
    }

    fn __repr__(&self) -> String {
        format!("<relight.Shot {} × {}>", self.size.0, self.size.1)
    }
}
