//! `report-so-far`: the page of a run as it stands, also while it is at work.

use std::path::PathBuf;

use petzval_design::inputs::{SetupFor, check_parts_or_accepted, setup_of_run};
use petzval_design::report::run_report::{read_metrics, report_so_far};
use petzval_design::run::{DigestCheck, RunFolder};
use petzval_design::scoring::collect_so_far;
use petzval_report::design_report::html;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::context::Context;
use crate::design::scorer;
use crate::error::Result;
use crate::event::WarningKind;
use crate::run_figures::check_figures;
use crate::run_page::page;

/// A run.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Request {
    /// Its folder.
    pub run: PathBuf,
}

/// Its page.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Response {
    /// The page, as HTML that needs no other file.
    pub html: String,
    /// Whether the run is finished: then this is its report.
    pub is_finished: bool,
}

/// Makes the page: of a finished run its report, else the finished cameras, the lens of the camera at work and the losses so far.
pub fn run(request: &Request, context: &Context) -> Result<Response> {
    let folder = RunFolder::open(&request.run)?;
    let experiment = context.assets.experiment_of_run(&folder)?;
    let device = context.device("cpu")?;
    let setup = setup_of_run(&folder, experiment, &context.assets, device, SetupFor::Cameras)?;
    if folder.metrics().is_file() {
        let warn = |text: &str| context.warning(WarningKind::ChangedFile, text);
        let check = DigestCheck::new(&folder, &[], &warn);
        check_figures(&read_metrics(&folder)?, &check)?;
        check_parts_or_accepted(&setup, &folder, &check)?;
        return Ok(Response { html: page(&setup, &folder)?, is_finished: true });
    }
    let scorer = scorer(setup)?;
    let setup = scorer.setup();
    let metrics = scorer.with_reasons(collect_so_far(setup, &folder, scorer.scores())?);
    Ok(Response { html: html(&report_so_far(setup, &folder, metrics)?), is_finished: false })
}
