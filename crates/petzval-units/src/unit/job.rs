//! The job of a unit of work.

use petzval_jobs::{JobError, Result, Row, row};

/// Jobs over runs, sweeps and units. Their responses change while others work, and so have no key.
const OVER_UNITS: [&str; 7] =
    ["runs", "sweep-gather", "sweep-plan", "sweep-status", "unit-gather", "unit-list", "unit-status"];

/// The row of the job of a unit. Fails if there is no such job, or if it looks at units itself.
pub fn row_of_unit(job: &str) -> Result<&'static Row> {
    if OVER_UNITS.contains(&job) {
        let message = format!("the job `{job}` looks at runs or units, and cannot be a unit itself");
        return Err(JobError::input(message, "run it by `petzval call`"));
    }
    row(job)
}
