//! The table of jobs: a call comes in as JSON, and its response goes out.

use petzval::units::table;
use petzval_jobs::{Call, JobError, json};
use pyo3::prelude::*;

use crate::error::exception;
use crate::watch::{Watch, watched};

/// Makes a call; both are JSON.
#[pyfunction]
pub fn call(py: Python<'_>, call: &str, watch: Watch<'_>) -> PyResult<String> {
    watched(py, &watch, |context| json(&Call::parse(call)?.run_by(&table(), context)?))
}

/// Name and purpose of every job.
#[pyfunction]
pub fn job_names() -> Vec<(&'static str, &'static str)> {
    table().rows().iter().map(|row| (row.name, row.about)).collect()
}

/// The JSON Schemas of a job's request and response.
#[pyfunction]
pub fn job_schemas(py: Python<'_>, name: &str) -> PyResult<(String, String)> {
    let schemas = || -> Result<_, JobError> {
        let table = table();
        let row = table.row(name)?;
        Ok((json(&row.schema())?, json(&row.response_schema())?))
    };
    schemas().map_err(|error| exception(py, &error))
}
