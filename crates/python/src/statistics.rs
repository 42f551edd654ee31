//! How much an asset holds, as `relight inspect --json` says it.

use crate::error::failed;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use relight_format::layout::Kind;
use relight_format::{Content, CutContent, Limits, read_parts, read_summary};
use std::path::Path;

/// The statistics of a file.
///
/// # Errors
/// It cannot be read.
pub fn of(py: Python<'_>, path: &Path) -> PyResult<Py<PyDict>> {
    let failed = |error| failed(format_args!("{}: {error}", path.display()));
    let summary = read_summary(path).map_err(failed)?;
    let provenance = &summary.provenance;
    let content = match Content::from_counts(&provenance.counts) {
        Some(content) => content,
        None => Content::of(&relight_format::read_file(path, &Limits::default()).map_err(failed)?),
    };
    let estimates = read_parts(path, &Limits::default(), &[Kind::Estimates])
        .map_err(failed)?
        .estimates;
    let counted = |name: &str| {
        provenance
            .counts
            .iter()
            .find(|count| count.0 == name)
            .map(|count| count.1)
    };
    let square_metres = |name: &str| counted(name).map(|n| n as f64 * 1e-6);
    let all = PyDict::new(py);
    all.set_item("asset", path)?;
    all.set_item("tool_version", &provenance.tool_version)?;
    all.set_item("format_version", summary.format_version)?;
    all.set_item("seed", provenance.seed)?;
    all.set_item("lambert", provenance.lambert)?;
    let settings = PyDict::new(py);
    for (name, value) in &provenance.settings {
        settings.set_item(name, value)?;
    }
    all.set_item("settings", settings)?;
    for (name, count) in [
        ("triangles", content.triangles),
        ("meshes", content.meshes),
        ("instances", content.instances),
        ("materials", content.materials),
        ("textures", content.textures),
        ("longest_row", content.longest_row),
    ] {
        all.set_item(name, count)?;
    }
    all.set_item("points", &content.points)?;
    all.set_item("disk_radius", &content.disk_radii)?;
    all.set_item("links_per_level", &content.links_per_level)?;
    let operators = [
        ("transfer", content.links_transfer),
        ("solution", content.links_solution),
        ("bounce", content.links_bounce),
    ];
    let links = PyDict::new(py);
    for (name, count) in operators {
        links.set_item(name, count)?;
    }
    all.set_item("links_by_operator", links)?;
    // The counts of a forged file may be anything.
    let sum = operators
        .iter()
        .fold(0u64, |sum, (_, count)| sum.saturating_add(*count));
    all.set_item("links", sum)?;
    all.set_item("potential_links", counted("potential_links"))?;
    all.set_item("cuts", content.cuts.map(|c| cuts(py, &c)).transpose()?)?;
    for name in ["rays", "receivers_gathered", "rays_without_points"] {
        all.set_item(name, counted(name))?;
    }
    all.set_item("surface_m2", square_metres("surface_square_mm"))?;
    all.set_item("surface_without_points_m2", square_metres("uncovered_square_mm"))?;
    let bytes = PyDict::new(py);
    for section in &summary.sections {
        let both = PyDict::new(py);
        both.set_item("raw", section.raw_bytes)?;
        both.set_item("stored", section.stored_bytes)?;
        bytes.set_item(&section.name, both)?;
    }
    bytes.set_item("total", summary.file_bytes)?;
    all.set_item("bytes", bytes)?;
    let known = PyDict::new(py);
    for (name, value) in estimates.iter().flat_map(|estimates| &estimates.values) {
        known.set_item(name, *value)?;
    }
    all.set_item("estimates", known)?;
    all.set_item("notes", &provenance.notes)?;
    Ok(all.unbind())
}

fn cuts<'py>(py: Python<'py>, cuts: &CutContent) -> PyResult<Bound<'py, PyDict>> {
    let all = PyDict::new(py);
    all.set_item(
        "mode",
        if cuts.of_surfaces {
            "indirect"
        } else {
            "environment"
        },
    )?;
    all.set_item("lights", cuts.lights)?;
    all.set_item("sites", cuts.sites)?;
    all.set_item("elements", cuts.elements)?;
    all.set_item("mean_length", cuts.elements as f64 / cuts.sites.max(1) as f64)?;
    all.set_item("sigma", cuts.sigma)?;
    Ok(all)
}
