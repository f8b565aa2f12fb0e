//! Errors of jobs as exceptions of the Python package.

use std::any::Any;

use petzval_jobs::{Fault, JobError};
use pyo3::prelude::*;

/// The exception of an error. The package makes it, so that users can catch it by kind.
pub fn exception(py: Python<'_>, error: &JobError) -> PyErr {
    made(py, error).unwrap_or_else(|failed| failed)
}

fn made(py: Python<'_>, error: &JobError) -> PyResult<PyErr> {
    let report = serde_json::to_string(&error.report()).unwrap_or_default();
    let make = py.import("petzval._errors")?.getattr("of_report")?;
    Ok(PyErr::from_value(make.call1((report, error.to_string(), error.fault() == Fault::Input))?))
}

/// The error of a panic.
pub fn panicked(panic: &(dyn Any + Send)) -> JobError {
    let message = match (panic.downcast_ref::<&str>(), panic.downcast_ref::<String>()) {
        (Some(text), _) => (*text).to_owned(),
        (None, Some(text)) => text.clone(),
        (None, None) => "no message".to_owned(),
    };
    JobError::Panic { job: "petzval".to_owned(), message, place: None }
}
