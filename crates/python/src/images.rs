//! OpenEXR files as numpy arrays and back.

use crate::arrays;
use crate::error::{failed, misused};
use crate::work;
use numpy::{PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use relight_scene::image::{self, BEAUTY, ExrHeader, Layer, Layers, Limits};
use std::path::PathBuf;

/// Reads the layers of an OpenEXR file: float32 arrays `(height, width, 3)`, or `(height, width)` of one channel; `R G B` without a
/// name is `beauty`.
///
/// # Errors
/// `relight.Error`: the file cannot be read, or is none.
#[pyfunction]
pub fn read_exr(py: Python<'_>, path: PathBuf) -> PyResult<Bound<'_, PyDict>> {
    let read = work::done(py, None, |_| {
        image::read_exr(&path, &Limits::default()).map_err(failed)
    })?;
    arrays::layers(py, read)
}

/// Writes layers, or one image as `beauty`, as an OpenEXR file: whole or not at all; of 16 bits a number where `float` is `False`.
///
/// # Errors
/// `relight.Error`: the file cannot be written. `ValueError`: an array is no image, or they are of several sizes.
#[pyfunction]
#[pyo3(signature = (path, layers, *, float=true))]
pub fn write_exr(py: Python<'_>, path: PathBuf, layers: &Bound<'_, PyAny>, float: bool) -> PyResult<()> {
    let mut all = Layers::default();
    match layers.cast::<PyDict>() {
        Ok(by_name) => {
            for (name, image) in by_name {
                push(&mut all, name.extract()?, &image)?;
            }
        }
        Err(_) => push(&mut all, BEAUTY.into(), layers)?,
    }
    work::done(py, None, |_| {
        let written = image::write_exr(&path, &all, &ExrHeader::new(), float);
        written.map(|_| ()).map_err(failed)
    })
}

fn push(all: &mut Layers, name: String, image: &Bound<'_, PyAny>) -> PyResult<()> {
    let py = image.py();
    let numpy = py.import("numpy")?;
    let float32 = numpy.getattr("float32")?;
    let image = numpy.call_method1("ascontiguousarray", (image, float32))?;
    let image: PyReadonlyArrayDyn<'_, f32> = image.extract()?;
    let (height, width, channels) = match *image.shape() {
        [height, width] => (height, width, 1),
        [height, width, channels @ (1 | 3)] => (height, width, channels),
        ref shape => {
            return Err(misused(format!(
                "layer {name:?} has shape {shape:?}, but must be (height, width, 3) or (height, width)"
            )));
        }
    };
    if all.layers.is_empty() {
        (all.width, all.height) = (width, height);
    } else if (all.width, all.height) != (width, height) {
        return Err(misused(format!(
            "layer {name:?} is {width} × {height}, but others are {} × {}",
            all.width, all.height
        )));
    }
    let data = image.as_slice().map_err(misused)?.to_vec();
    all.layers.push(Layer { name, channels, data });
    Ok(())
}
