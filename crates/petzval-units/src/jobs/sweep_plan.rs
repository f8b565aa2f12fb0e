//! `sweep-plan`: the units of a sweep before it begins, and what they cost.

use std::path::PathBuf;

use petzval_jobs::{Context, Result};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::sweep::{Estimate, KeptUnit, Source, estimate, keyed, plan, usual_store};

/// A sweep.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Request {
    /// Its file.
    pub file: PathBuf,
    /// Folder of its store, whose results say what the other units cost; `sweeps/FILE` if none is named. It need not exist.
    pub store: Option<PathBuf>,
}

/// A sweep whose units can be run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Response {
    /// Its title.
    pub title: String,
    /// The job of every unit.
    pub job: String,
    /// Keys that vary.
    pub keys: Vec<String>,
    /// The units, in the order in which they are best run.
    pub units: Vec<KeptUnit>,
    /// Draws that gave the values of an earlier one, and are left out.
    pub merged: usize,
    /// What the units cost that have no result yet.
    pub estimate: Estimate,
}

/// Checks every unit, and estimates the cost as [`estimate`] does: a unit may be timed, that of a design in a short form. Fails as [`plan`] and [`keyed`] do.
pub fn run(request: &Request, context: &Context) -> Result<Response> {
    let source = Source::read(&request.file)?;
    let plan = plan(&source, context)?;
    let (kept, _) = keyed(&plan, &source, context)?;
    let store = request.store.clone().unwrap_or_else(|| usual_store(&request.file));
    let estimate = estimate(&plan, &kept, &store, context)?;
    Ok(Response {
        title: plan.title,
        job: plan.job,
        keys: plan.keys,
        units: kept.units,
        merged: plan.merged,
        estimate,
    })
}
