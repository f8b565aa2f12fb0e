//! Requests of jobs whose values come back as arrays.

use petzval_jobs::{JobError, row};
use serde::de::DeserializeOwned;

/// The request of a job with every default filled in, from JSON. The error names the key that is wrong.
pub fn request<T: DeserializeOwned>(job: &str, text: &str) -> Result<T, JobError> {
    let refused = |e: serde_json::Error| JobError::input(format!("request of {job}: {e}"), "");
    let whole = row(job)?.filled_in(serde_json::from_str(text).map_err(refused)?)?;
    serde_json::from_value(whole).map_err(refused)
}
