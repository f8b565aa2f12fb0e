//! The files of a unit in a store, as values.

use std::path::PathBuf;

use petzval_design::run::{Holder, hex};
use petzval_jobs::ErrorReport;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use sha2::{Digest, Sha256};

use crate::unit::{InputDigest, Key, Unit};

/// The version of a store that this program writes and reads.
pub const STORE_FORMAT: u32 = 1;

/// `store.json`: what a folder is.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct StoreRecord {
    /// Version of the store.
    pub format: u32,
    /// Version of the program whose results it holds.
    pub program: String,
}

/// `unit.json`: what a folder of a store is about.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct UnitRecord {
    pub unit: Unit,
    pub inputs: Vec<InputDigest>,
}

/// `claim-N.json`: who makes attempt N. It never changes.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Claim {
    /// The process.
    pub holder: Holder,
    /// Time of day when it began, by its own clock.
    pub began: String,
}

/// `attempt-N.json`: how far attempt N is. Only its process writes it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct AttemptRecord {
    /// How many times the claim was renewed.
    pub renewed: u64,
    /// Seconds of work.
    pub seconds: f64,
    /// CPU seconds of the process.
    pub cpu_seconds: f64,
    /// How it ended; none while it goes on.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ended: Option<Ended>,
}

/// How an attempt ended.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub(super) enum Ended {
    /// With the result.
    Finished,
    /// With a result, when there was one already.
    Superfluous,
    /// By a signal or a fault of the disk: anyone may go on.
    Stopped,
    /// With an error of the unit.
    Failed(Box<Failure>),
}

/// `error.json`: why a unit failed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Failure {
    /// Name of the unit.
    pub unit: String,
    /// Number of the attempt, from 1.
    pub attempt: u32,
    /// Message, place and hint.
    pub error: ErrorReport,
    /// What it cost until then.
    pub cost: Cost,
}

/// What an attempt cost, and where.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Cost {
    /// The process.
    pub holder: Holder,
    /// Time of day when the attempt began, by the clock of its machine.
    pub began: String,
    /// Time that it took, s.
    pub seconds: f64,
    /// CPU seconds of its process.
    pub cpu_seconds: f64,
    /// CPU seconds of all attempts, with those that were killed until their last renewal.
    pub all_cpu_seconds: f64,
    /// Most memory that the process held, MB; none if the system does not say so.
    pub peak_memory_mb: Option<f64>,
    /// Threads.
    pub threads: usize,
    /// Instruction set of the kernels.
    pub simd: String,
    /// Widest instruction set of the machine, by which the tensor framework chooses its own kernels.
    pub widest_simd: String,
}

/// `result.json`: the result of a unit. It is written last, once.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StoredResult {
    /// Version of the store.
    pub format: u32,
    /// The unit.
    pub unit: Unit,
    /// Its key.
    pub key: Key,
    /// Its inputs by content.
    pub inputs: Vec<InputDigest>,
    /// Number of the attempt that made it, from 1.
    pub attempt: u32,
    /// The response of the job. Paths below the folder of results begin with `files/`.
    pub response: Value,
    /// Folder of the results in the folder of the unit when the result was written; none if the job wrote nothing. It is called `files` as soon as
    /// it could be renamed.
    pub files: Option<PathBuf>,
    /// What it cost.
    pub cost: Cost,
    /// SHA-256 of all the rest as JSON with sorted keys, hexadecimal: an edited result is not believed. None in a result of an earlier build, which
    /// is read as it is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sha256: Option<String>,
}

impl StoredResult {
    /// The same with its digest. Fails if it cannot be JSON.
    pub(super) fn with_digest(self) -> serde_json::Result<Self> {
        Ok(Self { sha256: Some(self.digest()?), ..self })
    }

    /// Whether it agrees with its digest, or has none.
    pub(super) fn is_as_written(&self) -> bool {
        self.sha256.as_ref().is_none_or(|written| self.digest().is_ok_and(|digest| digest == *written))
    }

    fn digest(&self) -> serde_json::Result<String> {
        let rest = serde_json::to_value(Self { sha256: None, ..self.clone() })?;
        Ok(hex(Sha256::new_with_prefix(rest.to_string())))
    }
}
