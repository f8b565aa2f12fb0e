//! Jobs over whole folders, which stand above the table of jobs: all runs, and the results of a sweep.

use std::path::PathBuf;

use petzval_jobs::{Call, Context, JobError};
use petzval_units::runs::{USUAL_FOLDER, runs_in};
use petzval_units::store::Seen;
use petzval_units::sweep::{KeptSweep, gather, status};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// `runs`: every run in a folder and below it.
const RUNS: &str = "runs";

/// `sweep-gather`: the results of a sweep so far.
const SWEEP_GATHER: &str = "sweep-gather";

/// Which runs.
#[derive(Deserialize)]
#[serde(default, deny_unknown_fields)]
struct RunsRequest {
    folder: PathBuf,
}

impl Default for RunsRequest {
    fn default() -> Self {
        Self { folder: USUAL_FOLDER.into() }
    }
}

/// Which sweep.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SweepRequest {
    store: PathBuf,
}

/// Makes a call of any job: of the table, or of those above it.
pub fn made(call: Call, context: &Context) -> Result<Value, JobError> {
    match call.job.as_str() {
        RUNS => {
            let RunsRequest { folder } = read(&call)?;
            petzval_jobs::guarded(RUNS, || as_json(&runs_in(&folder, context)?))
        }
        SWEEP_GATHER => {
            let SweepRequest { store } = read(&call)?;
            petzval_jobs::guarded(SWEEP_GATHER, || {
                let kept = KeptSweep::read(&store)?;
                let status = status(&kept, &store, &mut Seen::default(), context.cancel())?;
                as_json(&gather(&kept, &store, status, context.cancel())?)
            })
        }
        _ => call.run(context),
    }
}

fn read<T: DeserializeOwned>(call: &Call) -> Result<T, JobError> {
    serde_json::from_value(call.request.clone())
        .map_err(|error| JobError::input(format!("request of {}: {error}", call.job), "correct its keys"))
}

fn as_json(value: &impl Serialize) -> Result<Value, JobError> {
    serde_json::to_value(value).map_err(|error| JobError::failed(error.to_string()))
}
