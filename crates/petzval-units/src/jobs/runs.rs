//! `runs`: all runs below a folder.

use std::path::PathBuf;

use petzval_jobs::{Context, Result};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::runs::{Runs, USUAL_FOLDER, runs_in};

/// Which runs.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Request {
    /// Folder with runs, at any depth. Links to folders are followed one level.
    pub folder: PathBuf,
}

impl Default for Request {
    fn default() -> Self {
        Self { folder: USUAL_FOLDER.into() }
    }
}

/// Looks for the runs. Fails if there is no such folder.
pub fn run(request: &Request, context: &Context) -> Result<Runs> {
    runs_in(&request.folder, context)
}
