//! A unit of work: a job with its request, a seed, the version of the program and an instruction set. Its key is made of what decides its
//! result.

mod digest;
mod file;
mod job;
mod key;
mod origin;
mod prepared;
mod shard;

use petzval_base::FileError;
use petzval_base::simd::{level, widest};
use petzval_jobs::{Call, JobError, Result};
use schemars::{JsonSchema, schema_for};
use serde::{Deserialize, Serialize};
use serde_json::Value;

pub use digest::{Digests, InputDigest};
pub use file::{UnitFile, UnitFileError, read_units};
pub use job::row_of_unit;
pub use key::Key;
pub use origin::Origin;
pub use prepared::Prepared;
pub use shard::{Shard, ShardSource, shard_of_environment, task_without_count};

/// The version of [`Unit`] that this program writes and reads.
pub const UNIT_FORMAT: u32 = 1;

/// The instruction set of a unit that names none. It is the same on every machine, since it is a part of the key.
pub const USUAL_SIMD: &str = "avx2";

/// The version of this program.
pub const PROGRAM: &str = env!("CARGO_PKG_VERSION");

/// A unit of work. A file of units has one in each line, as JSON.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Unit {
    /// Its name, by which it is run again. It does not belong to the key.
    pub name: String,
    /// The job with its request. Relative paths are those of the folder in which the program runs; `petzval unit run` runs in the folder of the
    /// file of units. The folder of results in the request is replaced by one in the store, and may be left out where a call needs one.
    pub call: Call,
    /// Seed of everything random in place of that of the request.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
    /// Instruction set: `avx2`, `avx512`, `neon` or `scalar`. A machine that lacks it refuses the unit.
    #[serde(default = "usual_simd")]
    pub simd: String,
    /// Version of the program; another one refuses the unit.
    #[serde(default = "program")]
    pub version: String,
    /// Its key when the file was made, as a sweep writes it. A unit whose inputs have changed since is refused.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub key: Option<Key>,
    /// Where it was read.
    #[serde(skip)]
    pub origin: Origin,
}

fn usual_simd() -> String {
    USUAL_SIMD.to_owned()
}

fn program() -> String {
    PROGRAM.to_owned()
}

impl Unit {
    /// A unit of this program with the usual instruction set, whose seed is that of the request.
    pub fn new(name: impl Into<String>, call: Call) -> Self {
        Self {
            name: name.into(),
            call,
            seed: None,
            simd: usual_simd(),
            version: program(),
            key: None,
            origin: Origin::default(),
        }
    }

    /// The error of a unit that cannot be run, with its name. It names file and line where the unit was read from a file.
    pub(crate) fn refused(&self, message: &str, hint: impl Into<String>) -> JobError {
        let message = format!("unit \"{}\": {message}", self.name);
        let Some(file) = &self.origin.file else { return JobError::input(message, hint) };
        let hint = Some(hint.into()).filter(|hint| !hint.is_empty());
        let (key, value) = (String::new(), String::new());
        let error = FileError { line: self.origin.line, column: None, key, value, message, hint };
        JobError::File { path: file.clone(), error: Box::new(error) }
    }

    /// The JSON Schema of a unit.
    pub fn schema() -> Value {
        schema_for!(Self).to_value()
    }

    /// Fails if this program has another version than the unit.
    pub fn check_version(&self) -> Result<()> {
        if self.version == PROGRAM {
            return Ok(());
        }
        Err(self.refused(
            &format!("`version` is {}, and this program is Petzval {PROGRAM}", self.version),
            "its result would be another one: run it with that version, or make the units again",
        ))
    }

    /// Fails if this program cannot run the unit on any machine: it has another version, or there is no such instruction set.
    pub fn check(&self) -> Result<()> {
        self.check_version()?;
        self.simd_variable().map(|_| ())
    }

    /// The value of `PETZVAL_SIMD` with which a process computes as the unit says. Fails if there is no such instruction set.
    pub fn simd_variable(&self) -> Result<&'static str> {
        match self.simd.as_str() {
            "avx2" => Ok("avx2"),
            "scalar" => Ok("scalar"),
            "avx512" | "neon" => Ok("best"),
            other => Err(self.refused(
                &format!("`simd` is {other}: there is no such instruction set"),
                "write avx2, avx512, neon or scalar",
            )),
        }
    }

    /// Fails if this process computes with another instruction set than the unit.
    pub fn check_level(&self) -> Result<()> {
        let variable = self.simd_variable()?;
        if self.simd == level() {
            return Ok(());
        }
        let message = format!(
            "`simd` is {}, and this process computes with {}; the widest of this machine is {}",
            self.simd,
            level(),
            widest()
        );
        let hint = format!(
            "start the process with PETZVAL_SIMD={variable}; where the machine lacks {}, run the unit on another one, or give it the level of this one",
            self.simd
        );
        Err(self.refused(&message, hint))
    }
}
