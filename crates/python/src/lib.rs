//! The player and the bake as a Python module.
//!
//! [`asset`] opens, [`shot`] looks and lights, [`bake`] bakes; [`work`] runs what takes long without Python's lock, so that other threads
//! run on and Ctrl-C stops it; [`arrays`] hands numbers over to numpy, most of them without a copy. Classes of lights and cameras are
//! plain Python (`python/relight`): they say what a lighting sequence's JSON says, and `relight_scene` reads that.
#![forbid(unsafe_code)]
#![deny(clippy::print_stdout, clippy::print_stderr, clippy::dbg_macro)]

pub mod arrays;
pub mod asset;
pub mod bake;
pub mod error;
pub mod images;
pub mod lights;
pub mod shot;
pub mod statistics;
pub mod work;

use pyo3::prelude::*;

/// The part of `relight` that is not Python.
#[pymodule]
mod _relight {
    #[pymodule_export]
    use super::asset::{Asset, Points, open};
    #[pymodule_export]
    use super::bake::bake;
    #[pymodule_export]
    use super::error::{Error, Warning};
    #[pymodule_export]
    use super::images::{read_exr, write_exr};
    #[pymodule_export]
    use super::lights::Lights;
    #[pymodule_export]
    use super::shot::Shot;
    use pyo3::prelude::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
