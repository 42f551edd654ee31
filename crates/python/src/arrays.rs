//! Numbers as numpy arrays: memory is handed over, not copied, wherever its layout is numpy's.

use numpy::{Element, IntoPyArray, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use relight_play::scene::image::Layers;

/// An array that may have any shape.
pub type Array<'py> = Bound<'py, PyAny>;

/// A row of numbers.
pub fn row<T: Element>(py: Python<'_>, values: Vec<T>) -> Array<'_> {
    values.into_pyarray(py).into_any()
}

/// `(n, 3)`.
pub fn vectors(py: Python<'_>, values: Vec<[f32; 3]>) -> PyResult<Array<'_>> {
    let count = values.len();
    let flat = values.into_flattened().into_pyarray(py);
    Ok(flat.reshape([count, 3])?.into_any())
}

/// Indices as scipy takes them: 32 bits with a sign where they fit, else 64.
pub fn indices(py: Python<'_>, values: Vec<u32>) -> Array<'_> {
    match values.iter().all(|v| i32::try_from(*v).is_ok()) {
        true => row(py, values.into_iter().map(|v| v as i32).collect()),
        false => row(py, values.into_iter().map(i64::from).collect()),
    }
}

/// An array that many may hold, which none may change.
pub fn fixed(array: Array<'_>) -> PyResult<Array<'_>> {
    let keywords = PyDict::new(array.py());
    keywords.set_item("write", false)?;
    array.call_method("setflags", (), Some(&keywords))?;
    Ok(array)
}

/// `(height, width, 3)` by layer; of layers of one channel `(height, width)`.
pub fn layers(py: Python<'_>, layers: Layers) -> PyResult<Bound<'_, PyDict>> {
    let by_name = PyDict::new(py);
    let (width, height) = (layers.width, layers.height);
    for layer in layers.layers {
        let flat = layer.data.into_pyarray(py);
        let image = match layer.channels {
            1 => flat.reshape([height, width])?.into_any(),
            channels => flat.reshape([height, width, channels])?.into_any(),
        };
        by_name.set_item(layer.name, image)?;
    }
    Ok(by_name)
}
