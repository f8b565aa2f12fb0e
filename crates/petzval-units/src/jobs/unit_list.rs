//! `unit-list`: units of work with their keys.

use petzval_jobs::{Context, Result};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::unit::{Digests, InputDigest, Key, Prepared, Unit};

/// Units of work.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Request {
    /// The units, as the lines of a file of units hold them. Relative paths in them start in the folder in which this program runs.
    pub units: Vec<Unit>,
}

/// A unit that can be run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Entry {
    /// Its name.
    pub name: String,
    /// Its job.
    pub job: String,
    /// Its key in a store.
    pub key: Key,
    /// Its seed; none if that of its request counts.
    pub seed: Option<u64>,
    /// Its instruction set.
    pub simd: String,
    /// The files and folders on which its result depends, by content.
    pub inputs: Vec<InputDigest>,
}

/// Checks every unit as before its run, and computes its key. Fails at the first one that cannot be run, but not if only this machine lacks its
/// instruction set.
pub fn run(request: &Request, context: &Context) -> Result<Vec<Entry>> {
    let (digests, count) = (Digests::default(), request.units.len());
    let mut entries = Vec::with_capacity(count);
    for unit in &request.units {
        context.check(|| format!("stopped after {} of {count} units", entries.len()))?;
        let Prepared { unit, key, inputs, .. } = Prepared::checked(unit, context, &digests)?;
        let Unit { name, call, seed, simd, .. } = unit;
        entries.push(Entry { name, job: call.job, key, seed, simd, inputs });
    }
    Ok(entries)
}
