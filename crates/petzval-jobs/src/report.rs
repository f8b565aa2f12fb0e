//! `report`: the page of a finished run, written again from what its folder holds.

use std::path::PathBuf;

use petzval_design::run::{RunFolder, RunRecord, changed_config, write_file};
use petzval_design::run_report::{read_metrics, report_of_run};
use petzval_design::setup::Setup;
use petzval_report::design_report::{html, sentences};
use serde::{Deserialize, Serialize};

use crate::context::Context;
use crate::error::JobError;

/// A finished run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Request {
    /// Its folder.
    pub run: PathBuf,
}

/// What was written.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Response {
    /// The page.
    pub report: PathBuf,
}

/// Writes the report.
pub fn run(request: &Request, context: &Context) -> Result<Response, JobError> {
    let folder = RunFolder::open(&request.run)?;
    read_metrics(&folder)?;
    warn_of_changed_config(&folder, context)?;
    let experiment = context.assets.experiment_of_run(&folder)?;
    let setup = Setup::without_photos(experiment, &context.assets, context.device("cpu")?)?;
    Ok(Response { report: write(&setup, &folder)?.0 })
}

/// Writes the report of a run; returns its path, and the result in sentences.
pub(crate) fn write(setup: &Setup, folder: &RunFolder) -> Result<(PathBuf, Vec<String>), JobError> {
    let command = format!("petzval design {}", folder.config().display());
    let report = report_of_run(setup, folder, &command)?;
    write_file(&folder.report(), html(&report).as_bytes())?;
    Ok((folder.report(), sentences(&report)))
}

/// Warns where `config.toml` is no longer what a finished run was made from: its figures are those of its record.
pub(crate) fn warn_of_changed_config(folder: &RunFolder, context: &Context) -> Result<(), JobError> {
    if let Some(record) = RunRecord::read(folder)?
        && let Some(error) = changed_config(&record, folder)?
    {
        context.warning(format!("{}; what follows is the run as it was made", error.message));
    }
    Ok(())
}
