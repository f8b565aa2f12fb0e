//! The files of a unit in a store, as values.

use std::collections::BTreeMap;
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
    /// By a signal: anyone may go on.
    Stopped,
    /// By a fault of the disk: anyone may go on, and the time of a task was not too short.
    StoppedByDisk,
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

/// A file of the results of a unit.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct StoredFile {
    /// Its path below the folder of results, with slashes.
    pub path: String,
    /// Its size, bytes.
    pub bytes: u64,
    /// SHA-256 of its content, hexadecimal.
    pub sha256: String,
}

/// `contents-N.json`: the files of the results of attempt N when it ended. It is written before `result.json`. It is a file of its own: an earlier
/// build takes a result with a field that it does not know for a damaged one.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ContentsRecord {
    /// Version of the store.
    pub format: u32,
    /// The files, in the order of their paths.
    pub files: Vec<StoredFile>,
    /// SHA-256 of all the rest as JSON with sorted keys, hexadecimal.
    pub sha256: String,
}

impl ContentsRecord {
    /// A list of files with its digest. Fails if it cannot be JSON.
    pub fn new(files: Vec<StoredFile>) -> serde_json::Result<Self> {
        let record = Self { format: STORE_FORMAT, files, sha256: String::new() };
        let sha256 = digest(&serde_json::to_value(&record)?);
        Ok(Self { sha256, ..record })
    }
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
    /// The same with the digest of its JSON. Fails if it cannot be JSON.
    pub(super) fn with_digest(self) -> serde_json::Result<Self> {
        // The digest is that of the text as it will be read.
        let written: Value = serde_json::from_str(&serde_json::to_string(&self)?)?;
        Ok(Self { sha256: Some(digest(&written)), ..self })
    }
}

/// Whether the JSON of a record agrees with its `sha256`, or has none.
pub(super) fn is_as_written(record: &Value) -> bool {
    record.get("sha256").is_none_or(|written| written.as_str() == Some(digest(record).as_str()))
}

/// The digest of the JSON of a record, without its `sha256`.
fn digest(record: &Value) -> String {
    let mut rest = record.clone();
    if let Some(keys) = rest.as_object_mut() {
        keys.remove("sha256");
    }
    hex(Sha256::new_with_prefix(canonical(&rest)))
}

/// JSON without spaces and with sorted keys. The keys of a `Value` are sorted only without serde_json's feature `preserve_order`.
fn canonical(of: &Value) -> String {
    match of {
        Value::Object(keys) => {
            let sorted: BTreeMap<&String, &Value> = keys.iter().collect();
            let items: Vec<String> = sorted
                .into_iter()
                .map(|(key, value)| format!("{}:{}", Value::from(key.as_str()), canonical(value)))
                .collect();
            format!("{{{}}}", items.join(","))
        }
        Value::Array(items) => {
            let items: Vec<String> = items.iter().map(canonical).collect();
            format!("[{}]", items.join(","))
        }
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A result whose digest is that of Python: `hashlib.sha256` of `json.dumps` with `sort_keys`, `separators=(",", ":")` and
    /// `ensure_ascii=False`. It has to be believed by every later build.
    const FROZEN: &str = r#"{
  "format": 1,
  "unit": {
    "name": "façade \u2028\u0001\n\"é/\\",
    "call": {
      "format": 1,
      "job": "lens-trace",
      "request": {"pupil": [0.0, -1], "lens": "cooke-triplet-nominal", "field": 2.5, "Z": {}, "é": [], "a": {"c": true, "b": null}}
    },
    "simd": "avx2",
    "version": "0.1.0"
  },
  "key": "00ff",
  "inputs": [],
  "attempt": 1,
  "response": {"z": 0.1, "a": {"y": [2.5, 3, 18446744073709551615], "x": "1e5"}},
  "files": null,
  "cost": {
    "holder": {"host": "node", "pid": 7, "process_start": 12, "system": ""},
    "began": "2026-01-02 03:04:05",
    "seconds": 2.5,
    "cpu_seconds": 0.1,
    "all_cpu_seconds": 0.1,
    "peak_memory_mb": 2.5,
    "threads": 1,
    "simd": "avx2",
    "widest_simd": "avx2"
  },
  "sha256": "b5c70d3f52d43215bb591b647610018437b2616c7f5adcbd4c55350e076b5fb8"
}"#;

    #[test]
    fn a_frozen_result_agrees_with_its_digest_in_any_order_of_its_keys() {
        let frozen: Value = serde_json::from_str(FROZEN).unwrap();
        assert_eq!(frozen["sha256"], digest(&frozen));
        assert!(is_as_written(&frozen));
        serde_json::from_str::<StoredResult>(FROZEN).unwrap();
        let reordered =
            FROZEN.replace("\"z\": 0.1, \"a\": {", "\"a\": {").replace("\"1e5\"}}", "\"1e5\"}, \"z\": 0.1}");
        assert_ne!(reordered, FROZEN);
        assert!(is_as_written(&serde_json::from_str(&reordered).unwrap()));
    }

    #[test]
    fn an_edit_is_seen_and_a_result_without_digest_is_believed() {
        let edited = |from: &str, to: &str| -> Value {
            let text = FROZEN.replacen(from, to, 1);
            assert_ne!(text, FROZEN);
            serde_json::from_str(&text).unwrap()
        };
        assert!(!is_as_written(&edited("\"z\": 0.1", "\"z\": 0.2")));
        assert!(!is_as_written(&edited("\"attempt\": 1,", "\"attempt\": 1, \"more\": 1,")));
        assert!(!is_as_written(&edited("\"sha256\": \"b5", "\"sha256\": \"b6")));
        let mut earlier = edited("\"z\": 0.1", "\"z\": 0.2");
        assert!(earlier.as_object_mut().unwrap().remove("sha256").is_some());
        assert!(is_as_written(&earlier));
    }

    #[test]
    fn a_result_with_its_digest_is_as_written() {
        let mut result: StoredResult = serde_json::from_str(FROZEN).unwrap();
        result.response = serde_json::json!({"b": [-0.0, 1e-7, 1e300], "a": "\u{7f}\u{1f600}"});
        let text = serde_json::to_string_pretty(&result.with_digest().unwrap()).unwrap();
        let written: Value = serde_json::from_str(&text).unwrap();
        assert!(written["sha256"].is_string() && is_as_written(&written));
    }

    #[test]
    fn a_list_of_files_has_a_digest_that_shows_an_edit() {
        let file = StoredFile { path: "é/a".to_owned(), bytes: 7, sha256: "00ff".to_owned() };
        let written = serde_json::to_value(ContentsRecord::new(vec![file]).unwrap()).unwrap();
        assert!(is_as_written(&written));
        let mut edited = written.clone();
        edited["files"][0]["bytes"] = 8.into();
        assert!(!is_as_written(&edited));
        // A list always has its digest.
        edited.as_object_mut().unwrap().remove("sha256");
        assert!(serde_json::from_value::<ContentsRecord>(edited).is_err());
    }
}
