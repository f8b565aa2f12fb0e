//! Errors of jobs as exceptions of the Python package.

use std::fmt::Display;

use petzval_jobs::{Fault, JobError};
use pyo3::prelude::*;

/// The exception of an error. The package makes it, so that users can catch it by kind.
pub fn exception(py: Python<'_>, error: &JobError) -> PyErr {
    made(py, error).unwrap_or_else(|failed| failed)
}

/// The exception of an argument with a value that cannot be used.
pub fn refusal(
    py: Python<'_>,
    argument: &'static str,
    value: impl Display,
    message: impl Into<String>,
    hint: impl Into<String>,
) -> PyErr {
    exception(py, &JobError::setting(argument, value, message, hint))
}

fn made(py: Python<'_>, error: &JobError) -> PyResult<PyErr> {
    let report = serde_json::to_string(&error.report()).unwrap_or_default();
    let make = py.import("petzval._errors")?.getattr("of_report")?;
    Ok(PyErr::from_value(make.call1((report, error.to_string(), error.fault() == Fault::Input))?))
}
