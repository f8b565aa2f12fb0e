//! Classes of a user in Python: the table `python` of an experiment.

use petzval_learn::guest::GuestClass;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The task whose loss and scores are a class in Python.
pub(crate) const PYTHON: &str = "python";

/// Range of the longest time of a call, s.
pub(super) const TIMEOUTS_S: std::ops::RangeInclusive<f64> = 0.1..=1e6;

/// Classes of a user in Python.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PythonConfig {
    /// Longest time of one call of a class, s. Where Petzval was started from Python, calls are not limited.
    #[schemars(range(min = 0.1, max = 1e6))]
    pub timeout_s: f64,
    /// The network behind the development, where `network.kind` is "python".
    #[serde(skip_serializing_if = "Option::is_none")]
    pub network: Option<GuestClass>,
    /// Loss and scores of pictures, where `task` is "python".
    #[serde(skip_serializing_if = "Option::is_none")]
    pub task: Option<GuestClass>,
}

impl Default for PythonConfig {
    fn default() -> Self {
        Self { timeout_s: 600.0, network: None, task: None }
    }
}
