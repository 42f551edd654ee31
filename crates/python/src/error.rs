//! Errors as Python's exceptions, in the words of the command line.

use pyo3::exceptions::{PyException, PyUserWarning, PyValueError};
use pyo3::{PyErr, create_exception};
use std::fmt::Display;

create_exception!(
    relight,
    Error,
    PyException,
    "What relight cannot do, in the words of its command line: which file, what was found, what to do."
);

create_exception!(
    relight,
    Warning,
    PyUserWarning,
    "An asset's own check says that it is wrong, why, and what mends it."
);

/// Something failed.
pub fn failed(error: impl Display) -> PyErr {
    Error::new_err(error.to_string())
}

/// A function was called with something that makes no sense.
pub fn misused(message: impl Display) -> PyErr {
    PyValueError::new_err(message.to_string())
}
