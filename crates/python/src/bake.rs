//! `relight.bake`: a scene's file to an asset's.

use crate::asset::{Asset, open};
use crate::error::{Warning, failed, misused};
use crate::lights;
use crate::work::{self, Watched};
use pyo3::prelude::*;
use relight_bake::error::BakeError;
use relight_bake::memory;
use relight_bake::params::{BakeParams, CutMode, CutParams, Omittable, Preset};
use relight_bake::settings::validate;
use relight_bake::{Progress, Request, bake as baked};
use relight_format as format;
use relight_play::glam::DVec3;
use relight_probes::{ProbeError, check};
use relight_scene::gltf::{ImportOptions, import};
use relight_scene::scene::Scene;
use relight_scene::surface_scene::read_meshed;
use relight_scene::traced::Shading;
use std::ffi::CString;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Bakes a scene (`.glb`, `.gltf` or `.scene.json`) and opens the asset; options mean what those of `relight bake` mean. The file is
/// written whole or not at all. It measures itself by path-traced probes: `asset.expected`, and a `relight.Warning` where the asset is
/// wrong.
///
/// # Errors
/// `relight.Error`: the scene cannot be read or baked, needs more memory or room on its disk than there is, the asset not be written, or
/// another file is in its place. `ValueError`: an option is out of range.
#[pyfunction]
#[pyo3(signature = (scene, out, *, preset="standard", lights=None, levels=None, sender_levels=None, coarse_radius=None, epsilon=None,
    rays=None, bounces=None, solution=false, cuts=None, viewpoints=Vec::new(), cameras_only=false, keep=Vec::new(), lambert=false,
    variant=None, seed=0, progress=None))]
pub fn bake(
    py: Python<'_>,
    scene: PathBuf,
    out: PathBuf,
    preset: &str,
    lights: Option<&Bound<'_, PyAny>>,
    levels: Option<usize>,
    sender_levels: Option<usize>,
    coarse_radius: Option<f32>,
    epsilon: Option<f32>,
    rays: Option<usize>,
    bounces: Option<u32>,
    solution: bool,
    cuts: Option<&str>,
    viewpoints: Vec<[f64; 3]>,
    cameras_only: bool,
    keep: Vec<String>,
    lambert: bool,
    variant: Option<String>,
    seed: u64,
    progress: Option<Py<PyAny>>,
) -> PyResult<Asset> {
    let preset = match preset {
        "draft" => Preset::Draft,
        "standard" => Preset::Standard,
        "fine" => Preset::Fine,
        other => {
            return Err(misused(format!(
                "preset is {other:?}, but must be draft, standard or fine"
            )));
        }
    };
    let mut params = BakeParams::preset(preset);
    params.levels = levels.unwrap_or(params.levels);
    params.sender_levels = sender_levels.unwrap_or(params.sender_levels.min(params.levels));
    params.coarse_radius = coarse_radius;
    params.epsilon = epsilon.unwrap_or(params.epsilon);
    params.rays = rays.unwrap_or(params.rays);
    params.bounces = bounces;
    params.solution = solution;
    params.cuts = cut_params(cuts)?;
    params.cameras_only = cameras_only;
    params.keep = kept(&keep)?;
    params.seed = seed;
    validate(&params).map_err(misused)?;
    replaceable(&scene, &out)?;
    let (imported, hash) = work::done(py, None, |_| read(&scene, variant))?;
    let offset = imported.offset;
    params.viewpoints = viewpoints
        .iter()
        .map(|v| (DVec3::from(*v) - offset).as_vec3())
        .collect();
    let lights = lights
        .map(|given| lights::read(given, "of_lights", offset))
        .transpose()?;
    let request = Request {
        shading: if lambert { Shading::Lambert } else { Shading::Full },
        lights: lights.as_ref(),
        source_hash: hash,
        memory: memory::of_this_machine(),
        ..Request::new(Arc::new(imported), &params)
    };
    let complaint = work::done(py, progress.as_ref(), |watch: &Watched| {
        watch.writes(&out);
        let mut baked =
            baked(&request, None, watch).map_err(|error| watch.refused().unwrap_or_else(|| failed(error)))?;
        Progress::stage(watch, "check", None);
        let expected = match check(&mut baked, &request, watch, &|_| {}) {
            Err(ProbeError::Stopped) => return Err(failed(BakeError::Stopped)),
            expected => expected.map_err(failed)?,
        };
        if Progress::stopped(watch) {
            return Err(failed(BakeError::Stopped));
        }
        forget_log(&out);
        format::write_file(&out, &baked.asset).map_err(failed)?;
        Ok(expected.and_then(|expected| expected.complaint(coarse_radius)))
    })?;
    if let Some(complaint) = complaint {
        warn(py, &complaint)?;
    }
    open(py, out)
}

/// Says that an asset is wrong, or that nobody can tell: at who called `bake`.
fn warn(py: Python<'_>, complaint: &str) -> PyResult<()> {
    PyErr::warn(py, &py.get_type::<Warning>(), &CString::new(complaint)?, 1)
}

fn cut_params(cuts: Option<&str>) -> PyResult<Option<CutParams>> {
    let (mode, if_used) = match cuts {
        None | Some("none") => return Ok(None),
        Some("environment") => (CutMode::Environment, false),
        Some("auto") => (CutMode::Environment, true),
        Some("indirect") => (CutMode::Indirect, false),
        Some(other) => {
            return Err(misused(format!(
                "cuts is {other:?}, but must be none, environment, auto or indirect"
            )));
        }
    };
    Ok(Some(CutParams {
        mode,
        if_used,
        ..CutParams::default()
    }))
}

fn kept(names: &[String]) -> PyResult<Vec<Omittable>> {
    let mut parts = Vec::new();
    for name in names {
        match Omittable::ALL.iter().find(|part| part.name() == name) {
            Some(part) => parts.push(*part),
            None if name == "all" => parts.extend(Omittable::ALL),
            None => {
                let known = Omittable::ALL.map(Omittable::name).join(", ");
                return Err(misused(format!("keep has {name:?}, but knows all, {known}")));
            }
        }
    }
    Ok(parts)
}

/// Removes the log of the command's bake of what was there before: `relight inspect` would take its times for those of this one.
fn forget_log(out: &Path) {
    let mut log = out.as_os_str().to_owned();
    log.push(".log.json");
    let is_log = std::fs::read_to_string(&log)
        .is_ok_and(|text| text.contains("\"schema\"") && text.contains("\"seconds\""));
    if is_log {
        // A log that stays is told by its date.
        let _ = std::fs::remove_file(log);
    }
}

/// Nothing is replaced but assets.
fn replaceable(scene: &Path, out: &Path) -> PyResult<()> {
    use std::io::Read;
    let mut head = Vec::new();
    let Ok(file) = std::fs::File::open(out) else {
        return Ok(());
    };
    let magic = format::layout::MAGIC;
    let read = file.take(magic.len() as u64).read_to_end(&mut head);
    if read.is_ok() && (head.is_empty() || head == magic) {
        return Ok(());
    }
    let what = if same(scene, out) {
        "is the scene itself"
    } else {
        "is no asset"
    };
    Err(failed(format_args!(
        "{} {what}, and is not replaced: give another name",
        out.display()
    )))
}

fn same(a: &Path, b: &Path) -> bool {
    matches!((a.canonicalize(), b.canonicalize()), (Ok(a), Ok(b)) if a == b)
}

fn read(path: &Path, variant: Option<String>) -> PyResult<(Scene, u64)> {
    if path.to_string_lossy().ends_with(".scene.json") {
        if variant.is_some() {
            return Err(misused(
                "variant is for glTF files: descriptions have no variants",
            ));
        }
        let (scene, bytes) = read_meshed(path).map_err(failed)?;
        return Ok((scene, format::content_hash(&bytes)));
    }
    let options = ImportOptions {
        variant,
        ..ImportOptions::default()
    };
    let scene = import(path, &options).map_err(failed)?;
    let bytes = std::fs::read(path)
        .map_err(|error| failed(format_args!("{}: cannot be read: {error}", path.display())))?;
    Ok((scene, format::content_hash(&bytes)))
}
