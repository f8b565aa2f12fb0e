//! Lenses that a tolerance analysis made at random.

use std::path::PathBuf;

use petzval_jobs::glass::context_with;
use petzval_jobs::lens::tolerance;
use pyo3::prelude::*;

use crate::lens::PyLens;
use crate::requests::request;
use crate::watch::{Watch, watched};

/// The random lens of a number, made again by a request of `lens-tolerance`.
#[pyfunction]
pub fn lens_of_trial(
    py: Python<'_>,
    request_of: &str,
    trial: usize,
    glasses: Vec<PathBuf>,
    watch: Watch<'_>,
) -> PyResult<PyLens> {
    let file = watched(py, &watch, |context| {
        let request: tolerance::Request = request("lens-tolerance", request_of)?;
        tolerance::lens_of_trial(&request, trial, &context_with(context.clone(), &glasses)?)
    })?;
    Ok(PyLens { file, glasses })
}
