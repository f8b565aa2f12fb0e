//! `unit-gather`: tolerance analyses that were made in parts, each joined to one.

use std::path::PathBuf;

use petzval_jobs::lens::tolerance::Report;
use petzval_jobs::{Context, Result};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::store::{Joined, Store, gather_tolerances};
use crate::unit::Unit;

/// Units of work, and where their results are.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Request {
    /// The units, as the lines of a file of units hold them. Those of other jobs than `lens-tolerance` are passed over. Relative paths in them start in
    /// the folder in which this program runs.
    pub units: Vec<Unit>,
    /// Folder of their store.
    pub store: PathBuf,
    /// Folder for the files of the analysis, as `lens-tolerance` writes them; of several analyses one folder each in it. Nothing is written if none is
    /// named.
    pub out: Option<PathBuf>,
}

/// An analysis that was made in parts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Analysis {
    /// Names of the units.
    pub units: Vec<String>,
    /// All figures, as in `tolerance.json`.
    pub report: Report,
}

/// Joins units that differ in `part` alone. Fails if one has no result yet, or if this process computes with another instruction set than they did.
pub fn run(request: &Request, context: &Context) -> Result<Vec<Analysis>> {
    let store = Store::open(&request.store)?;
    let units: Vec<&Unit> = request.units.iter().collect();
    let joined = gather_tolerances(&units, &store, context, request.out.as_deref())?;
    let analysis = |Joined { units, response }: Joined| Analysis { units, report: response.report };
    Ok(joined.into_iter().map(analysis).collect())
}
