//! `sweep-status`: how the units of a sweep stand.

use std::path::PathBuf;

use petzval_jobs::{Context, Result};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::store::Seen;
use crate::sweep::{KeptSweep, SweepStatus, status};

/// A sweep.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Request {
    /// Folder of its store.
    pub store: PathBuf,
}

/// Looks at every unit once. One look does not show whether a process of another machine still lives.
pub fn run(request: &Request, context: &Context) -> Result<SweepStatus> {
    let kept = KeptSweep::read(&request.store)?;
    status(&kept, &request.store, &mut Seen::default(), context.cancel())
}
