//! An asset: what it holds, and shots of it.

use crate::arrays::{fixed, indices, row, vectors};
use crate::error::{failed, misused};
use crate::lights::{self, Lights};
use crate::shot::Shot;
use crate::statistics;
use crate::work;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyDict, PyTuple};
use relight_format::layout::Kind;
use relight_format::{self as format, Limits, WeightRows};
use relight_play::render::lightcuts::LightcutSettings;
use relight_play::render::many_lights::PointSettings;
use relight_play::render::pixelcuts::PixelcutsSettings;
use relight_play::scene::material_edits::parse_material_edits;
use relight_play::scene::sequence::{Sequence, SequenceCamera};
use relight_play::{Integrator, Player, ShotSettings, Tracer};
use relight_probes::expected::{Expected, line};
use std::path::PathBuf;
use std::sync::Arc;

/// Opens an asset that `relight bake` or `relight.bake` has made.
///
/// # Errors
/// `relight.Error`: the file cannot be read, or is none.
#[pyfunction]
pub fn open(py: Python<'_>, path: PathBuf) -> PyResult<Asset> {
    let player = work::done(py, None, |_| Player::open(&path).map_err(failed))?;
    Ok(Asset::new(path, player))
}

/// An asset, ready to be lit.
#[pyclass(frozen, module = "relight")]
pub struct Asset {
    /// Its file.
    #[pyo3(get)]
    path: PathBuf,
    player: Arc<Player>,
    points: PyOnceLock<Py<Points>>,
    links: PyOnceLock<Py<PyDict>>,
}

/// Points of all levels, coarsest first; coordinates are those of the scene's file, metres, +Y up.
#[pyclass(frozen, get_all, module = "relight")]
pub struct Points {
    /// `(n, 3)` float32, or float64 where the scene is far from its origin, metres.
    positions: Py<PyAny>,
    /// `(n, 3)` float32, unit.
    normals: Py<PyAny>,
    /// `(n, 3)` float32: reflectance, linear RGB.
    albedo: Py<PyAny>,
    /// `(n,)` uint8: level, 0 the coarsest.
    level: Py<PyAny>,
    /// `(n,)` uint8: by how much a point's radii are wider than its level's, as a power of two.
    widening: Py<PyAny>,
    /// `(levels,)` float32: Poisson-disk radius, metres.
    disk_radius: Py<PyAny>,
    /// `(levels,)` float32: radius of the basis functions, metres.
    support_radius: Py<PyAny>,
}

#[pymethods]
impl Points {
    fn __len__(&self, py: Python<'_>) -> PyResult<usize> {
        self.level.bind(py).len()
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let levels = self.disk_radius.bind(py).len()?;
        Ok(format!(
            "<relight.Points: {} on {levels} levels>",
            self.__len__(py)?
        ))
    }
}

#[pymethods]
impl Asset {
    /// What `relight inspect --json` says of the file, as a dict.
    fn statistics(&self, py: Python<'_>) -> PyResult<Py<PyDict>> {
        statistics::of(py, &self.path)
    }

    /// Names of the cameras, the first of which looks where none is named.
    #[getter]
    fn cameras(&self) -> Vec<String> {
        let cameras = &self.player.scene().cameras;
        cameras.iter().map(|camera| camera.name.clone()).collect()
    }

    /// Names of the materials.
    #[getter]
    fn materials(&self) -> Vec<String> {
        let materials = &self.player.scene().materials;
        materials.iter().map(|material| material.name.clone()).collect()
    }

    /// What its bake found out of its error, by path-traced probes; `None` if it has not looked. `error` is the root of relMSE of indirect
    /// light, `bias` the relative error of its mean, each with its standard error (`error_noise`, `bias_noise`); `without_points`, `wide` and
    /// `without_light` are shares of what the probes see; `text` says it in a line.
    #[getter]
    fn expected(&self, py: Python<'_>) -> PyResult<Option<Py<PyDict>>> {
        let estimates = self.player.estimates.as_ref();
        let Some(expected) = Expected::of(estimates) else {
            return Ok(None);
        };
        let all = PyDict::new(py);
        for (name, value) in [
            ("error", expected.error),
            ("error_noise", expected.error_noise),
            ("bias", expected.bias),
            ("bias_noise", expected.bias_noise),
            ("without_points", expected.without_points),
            ("without_light", expected.without_light),
            ("wide", expected.wide),
        ] {
            all.set_item(name, value)?;
        }
        all.set_item("text", line(estimates))?;
        Ok(Some(all.unbind()))
    }

    /// Points of all levels.
    #[getter]
    fn points(&self, py: Python<'_>) -> PyResult<Py<Points>> {
        let points = self
            .points
            .get_or_try_init(py, || Py::new(py, self.read_points(py)?))?;
        Ok(points.clone_ref(py))
    }

    /// Sparse operators by their names, `relight.CSR` each.
    #[getter]
    fn links(&self, py: Python<'_>) -> PyResult<Py<PyDict>> {
        let links = self.links.get_or_try_init(py, || self.read_links(py))?;
        // The arrays are shared, the dict is the caller's.
        Ok(links.bind(py).copy()?.unbind())
    }

    /// The clusters that send light, columns of the transfer operator, coarsest level first.
    #[getter]
    fn senders(&self, py: Python<'_>) -> PyResult<Py<PyDict>> {
        let all = PyDict::new(py);
        if let Some(senders) = self.parts(py, &[Kind::Senders])?.senders {
            all.set_item("counts", indices(py, senders.counts))?;
            all.set_item("of_finest_point", indices(py, senders.leaf_of_point))?;
            all.set_item("importance", row(py, senders.importance))?;
            let parents: Vec<_> = (senders.parents.into_iter())
                .map(|parents| indices(py, parents))
                .collect();
            all.set_item("parents", parents)?;
        }
        Ok(all.unbind())
    }

    /// Prepares lights once for many frames; `None`: the scene's own.
    #[pyo3(signature = (lights=None))]
    fn lights(&self, py: Python<'_>, lights: Option<&Bound<'_, PyAny>>) -> PyResult<Lights> {
        lights::prepared(py, &self.player, lights)
    }

    /// The same asset with other materials: material edits, or their file; those that have keys are as at `time`. The asset is opened
    /// once more, and this one stays as it is.
    #[pyo3(signature = (materials, time=0.0))]
    fn edited(&self, py: Python<'_>, materials: &Bound<'_, PyAny>, time: f64) -> PyResult<Asset> {
        if !(time.is_finite() && time >= 0.0) {
            return Err(misused("time must be a number of frames, at least 0"));
        }
        let source = py
            .import("relight._sequence")?
            .getattr("of_materials")?
            .call1((materials,))?;
        let (file, text): (Option<PathBuf>, String) = source.extract()?;
        let player = work::done(py, None, |_| {
            let mut player = Player::open(&self.path).map_err(failed)?;
            match file {
                Some(file) => player.edit_materials_from(&file, time).map_err(failed)?,
                None => {
                    let edits = parse_material_edits(&text, player.scene(), "materials").map_err(failed)?;
                    player.edit_materials(edits, time).map_err(failed)?;
                }
            }
            Ok(player)
        })?;
        Ok(Asset::new(self.path.clone(), player))
    }

    /// What a camera sees, for any number of frames.
    #[pyo3(
        signature = (camera=None, size=(640, 360), *, time=0.0, spp=None, integrator="auto", vpls=0),
        text_signature = "($self, camera=None, size=(640, 360), *, time=0.0, spp=None, integrator='auto', vpls=0)"
    )]
    fn shot(
        &self,
        py: Python<'_>,
        camera: Option<&Bound<'_, PyAny>>,
        size: (usize, usize),
        time: f64,
        spp: Option<u32>,
        integrator: &str,
        vpls: u32,
    ) -> PyResult<Shot> {
        let (width, height) = size;
        if !(1..=MOST_PIXELS).contains(&width) || !(1..=MOST_PIXELS).contains(&height) {
            return Err(misused(format!(
                "size is ({width}, {height}), but must be two numbers of pixels from 1 to {MOST_PIXELS}: width, height"
            )));
        }
        if spp == Some(0) || !time.is_finite() {
            return Err(misused("spp must be at least 1, and time a number of frames"));
        }
        let mut sequence = Sequence::default();
        let name = match camera {
            None => None,
            Some(camera) => match camera.extract::<String>() {
                Ok(name) => Some(name),
                Err(_) => {
                    sequence = lights::read(camera, "of_camera", self.player.scene().offset)?;
                    None
                }
            },
        };
        if let Some(SequenceCamera::Own(own)) = &mut sequence.camera {
            own.name = "camera".into();
        }
        let track = (self.player.camera(&sequence, name.as_deref())).map_err(failed)?;
        let settings = ShotSettings {
            integrator: integrator_of(integrator, vpls)?,
            width,
            height,
            samples: spp,
            ..ShotSettings::default()
        };
        let shot = work::done(py, None, |watch| {
            (self.player.shot_watched(&track.at(time), &settings, watch)).map_err(failed)
        })?;
        Ok(Shot::new(self.player.clone(), shot, (width, height)))
    }

    fn __repr__(&self) -> String {
        format!("<relight.Asset {}>", self.path.display())
    }
}

/// Most pixels across and down, as the command line has it.
const MOST_PIXELS: usize = 16384;

fn integrator_of(name: &str, vpls: u32) -> PyResult<Integrator> {
    if vpls > 0 && !["lightcuts", "pixelcuts"].contains(&name) {
        return Err(misused(format!(
            "vpls counts with the integrators lightcuts and pixelcuts alone, and integrator is {name:?}"
        )));
    }
    let points = PointSettings {
        vpls,
        ..PointSettings::default()
    };
    Ok(match name {
        "lightcuts" => Tracer::Lightcuts {
            points,
            cuts: LightcutSettings::default(),
            reconstruction: false,
        }
        .into(),
        "pixelcuts" => Tracer::Pixelcuts {
            points,
            cuts: PixelcutsSettings::default(),
        }
        .into(),
        "auto" => Integrator::Auto,
        "transfer" => Integrator::Transfer,
        "cuts" => Integrator::Cuts,
        "path" => Tracer::default().into(),
        "brute" => Tracer::Brute.into(),
        other => {
            return Err(misused(format!(
                "integrator is {other:?}, but must be auto, transfer, cuts, path, brute, lightcuts or pixelcuts"
            )));
        }
    })
}

impl Asset {
    fn new(path: PathBuf, player: Player) -> Asset {
        Asset {
            path,
            player: Arc::new(player),
            points: PyOnceLock::new(),
            links: PyOnceLock::new(),
        }
    }

    fn parts(&self, py: Python<'_>, kinds: &[Kind]) -> PyResult<format::Asset> {
        work::done(py, None, |_| {
            format::read_parts(&self.path, &Limits::default(), kinds)
                .map_err(|error| failed(format_args!("{}: {error}", self.path.display())))
        })
    }

    fn read_points(&self, py: Python<'_>) -> PyResult<Points> {
        let levels = self.parts(py, &[Kind::Points])?.points;
        let all = |of: fn(&format::Level) -> &[[f32; 3]]| -> Vec<[f32; 3]> {
            levels.iter().flat_map(of).copied().collect()
        };
        let counted = |of: &dyn Fn(usize, usize) -> u8| -> Vec<u8> {
            let counts = levels.iter().map(|level| level.positions.len()).enumerate();
            counts
                .flat_map(|(level, count)| (0..count).map(move |i| of(level, i)))
                .collect()
        };
        let positions = all(|level| &level.positions);
        let offset = self.player.scene().offset.to_array();
        let positions = if offset == [0.0; 3] {
            vectors(py, positions)?
        } else {
            let there = positions
                .iter()
                .flat_map(|p| [0, 1, 2].map(|i| f64::from(p[i]) + offset[i]));
            row(py, there.collect()).call_method1("reshape", (-1, 3))?
        };
        let radii = |of: fn(&format::Level) -> f32| levels.iter().map(of).collect::<Vec<f32>>();
        let [normals, albedo] = [
            vectors(py, all(|l| &l.normals))?,
            vectors(py, all(|l| &l.albedo))?,
        ];
        Ok(Points {
            positions: fixed(positions)?.unbind(),
            normals: fixed(normals)?.unbind(),
            albedo: fixed(albedo)?.unbind(),
            level: fixed(row(py, counted(&|level, _| level as u8)))?.unbind(),
            widening: fixed(row(
                py,
                counted(&|level, i| levels[level].widenings.get(i).copied().unwrap_or(0)),
            ))?
            .unbind(),
            disk_radius: fixed(row(py, radii(|level| level.disk_radius)))?.unbind(),
            support_radius: fixed(row(py, radii(|level| level.support_radius)))?.unbind(),
        })
    }

    fn read_links(&self, py: Python<'_>) -> PyResult<Py<PyDict>> {
        let parts = self.parts(py, &[Kind::LinksTransfer, Kind::LinksBounce, Kind::LinksSolution])?;
        let triple = py.import("relight._csr")?.getattr("CSR")?;
        let csr = |data, columns, offsets, shape: (u32, u32)| {
            let [columns, offsets] = [columns, offsets].map(|values| fixed(indices(py, values)));
            let parts = PyTuple::new(py, [fixed(data)?, columns?, offsets?])?;
            triple.call1((parts.get_item(0)?, parts.get_item(1)?, parts.get_item(2)?, shape))
        };
        let links = PyDict::new(py);
        if let Some(t) = parts.transfer {
            let data = vectors(py, t.vectors)?;
            links.set_item(
                "transfer",
                csr(data, t.columns, t.row_offsets, (t.receivers, t.senders))?,
            )?;
        }
        let weights = |name: String, m: WeightRows| {
            let data = row(py, m.weights);
            links.set_item(name, csr(data, m.columns, m.row_offsets, (m.rows, m.rows))?)
        };
        if let Some(bounce) = parts.bounce {
            weights("bounce".into(), bounce.matrix)?;
        }
        for (channel, matrix) in parts.solution.into_iter().flat_map(|s| s.channels).enumerate() {
            weights(format!("solution_{channel}"), matrix)?;
        }
        Ok(links.unbind())
    }
}
