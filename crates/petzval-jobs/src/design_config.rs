//! `design-config`: the experiment of a run that is to begin, with every default and every change in it.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::context::Context;
use crate::design::{NewRun, config_of};
use crate::error::{JobError, Result};
use crate::experiment::with_every_key;

/// A run to begin.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Request {
    /// The run.
    pub run: NewRun,
}

/// Its experiment.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Response {
    /// Its title.
    pub title: String,
    /// Every key with its value, as in the file.
    pub values: Value,
    /// The same as a file, with units and ranges in comments.
    pub text: String,
    /// The folder that the run would have.
    #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
    pub folder: PathBuf,
    /// Whether that folder holds a run already.
    pub is_taken: bool,
}

/// Gives the experiment. Nothing is written, and no picture is read.
pub fn run(request: &Request, context: &Context) -> Result<Response> {
    let (experiment, folder) = config_of(&request.run, context)?;
    let values = serde_json::to_value(&experiment).map_err(|e| JobError::failed(e.to_string()))?;
    let is_taken = folder.join("config.toml").exists();
    Ok(Response {
        title: experiment.name.clone(),
        text: with_every_key(&experiment)?,
        values,
        folder,
        is_taken,
    })
}
