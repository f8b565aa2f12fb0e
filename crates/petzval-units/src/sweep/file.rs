//! The file of a sweep: what is run, and what varies.

use std::path::{Path, PathBuf};

use petzval_base::FileError;
use petzval_jobs::{JobError, Result};
use schemars::{JsonSchema, schema_for};
use serde::{Deserialize, Serialize};

use super::place::at_place;

/// What a sweep runs, and what varies from unit to unit.
///
/// Units are all combinations of the values of `grid`, the rows of `list`, the draws of `random`, `variants` and `seeds`. A key is a key path of the
/// experiment, as in `petzval design --set`; of the request, where a job is named.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SweepFile {
    /// Title of the table; that of the file if none is given.
    pub name: Option<String>,
    /// Experiment, by path or built-in name. A path is looked for beside the sweep first.
    pub experiment: Option<String>,
    /// A job of `petzval jobs` in place of an experiment.
    pub job: Option<String>,
    /// Request of the job; what does not vary.
    #[schemars(with = "Keys")]
    pub request: toml::Table,
    /// Values in place of those of the experiment's file, the same for every unit.
    #[schemars(with = "Keys")]
    pub set: toml::Table,
    /// Network steps of each variant in place of the experiment's; all other steps in proportion.
    pub steps: Option<usize>,
    /// Where tensors live.
    pub device: Option<String>,
    /// Instruction set of every unit, on whichever machine it runs: the last digits of results depend on it.
    pub simd: Level,
    /// Threads of a unit; 0 means those that the machine or the cluster gives.
    pub threads: usize,
    /// Seeds: every combination is run with each.
    pub seeds: Vec<u64>,
    /// Variants of the experiment, each made by a unit of its own, with those from which it starts.
    pub variants: Vec<String>,
    /// Keys with lists of values, of which all combinations are run.
    #[schemars(with = "Keys")]
    pub grid: toml::Table,
    /// Keys with lists of values of one length, of which the first values are run together, then the second, and so on.
    #[schemars(with = "Keys")]
    pub list: toml::Table,
    /// Keys whose values are drawn, `n` times by `seed`: `{from, to, log}`, or `{choice = [...]}`.
    #[schemars(with = "Keys")]
    pub random: toml::Table,
}

/// A table as the schema describes it: keys with any values.
type Keys = std::collections::BTreeMap<String, serde_json::Value>;

/// An instruction set that the last digits of results depend on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Level {
    /// Four doubles at a time: every x86-64 machine of the last ten years.
    #[default]
    Avx2,
    /// Eight doubles at a time.
    Avx512,
    /// Two doubles at a time: ARM.
    Neon,
    /// One number at a time.
    Scalar,
}

impl SweepFile {
    /// The JSON Schema of the file.
    pub fn schema() -> serde_json::Value {
        schema_for!(Self).to_value()
    }
}

impl Level {
    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Avx2 => "avx2",
            Self::Avx512 => "avx512",
            Self::Neon => "neon",
            Self::Scalar => "scalar",
        }
    }

    /// The value of `PETZVAL_SIMD` with which a process has it, where the machine does.
    pub fn variable(self) -> &'static str {
        match self {
            Self::Avx2 => "avx2",
            Self::Scalar => "scalar",
            // The widest of such machines.
            Self::Avx512 | Self::Neon => "best",
        }
    }
}

/// A file with its text, for the places of errors.
#[derive(Clone, Debug, PartialEq)]
pub struct Source {
    /// The file.
    pub path: PathBuf,
    /// Its text.
    pub text: String,
    /// What it says.
    pub file: SweepFile,
}

impl Source {
    /// Reads a sweep. Errors name the file, line, key, value and a hint.
    pub fn read(path: &Path) -> Result<Self> {
        let text = petzval_base::read_text(path).map_err(|e| {
            JobError::input(format!("{}: {e}", path.display()), "give the file of a sweep, in TOML")
        })?;
        let file = parse(&text).map_err(|error| in_file(path, error))?;
        Ok(Self { path: path.to_path_buf(), text, file })
    }

    /// An error about the value at a path of keys.
    pub fn at(&self, place: &[&str], message: impl Into<String>, hint: impl Into<String>) -> JobError {
        in_file(&self.path, at_place(&self.text, place, message).hint(hint))
    }

    /// The value at a path of keys.
    pub(super) fn value_at(&self, place: &[&str]) -> Option<toml::Value> {
        let table: toml::Table = self.text.parse().ok()?;
        place.iter().try_fold(toml::Value::Table(table), |value, key| value.get(*key).cloned())
    }

    /// Its title.
    pub fn title(&self) -> String {
        let stem = || self.path.file_stem().map_or_else(|| "sweep".into(), |s| s.to_string_lossy());
        self.file.name.clone().unwrap_or_else(|| stem().into_owned())
    }
}

/// Reads the text of a sweep. Errors name line, key, value and a hint.
pub fn parse(text: &str) -> Result<SweepFile, FileError> {
    FileError::read_toml(text)
}

/// An error of a file.
pub(crate) fn in_file(path: &Path, error: FileError) -> JobError {
    JobError::File { path: path.to_path_buf(), error: Box::new(error) }
}
