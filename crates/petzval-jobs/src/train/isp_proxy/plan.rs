//! The plan of a training.

use petzval_design::camera::isp_proxy::ProxyTraining;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::experiment::DEFAULT_EXPERIMENT;
use crate::isp::NEUTRAL;

/// What is imitated, and how.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Plan {
    /// Name of a preset, or a file of settings or of the description of an external ISP.
    pub isp: String,
    /// Further values, each `stage.key=value`.
    pub set: Vec<String>,
    /// Parameters that vary: names, stages, or `all`.
    pub vary: Vec<String>,
    /// Experiment that gives lens, sensor, exposure and photographs.
    pub experiment: String,
    /// Steps and size of the network.
    pub training: ProxyTraining,
}

impl Default for Plan {
    fn default() -> Self {
        Self {
            isp: NEUTRAL.to_owned(),
            set: Vec::new(),
            vary: crate::usual::every_parameter(),
            experiment: DEFAULT_EXPERIMENT.to_owned(),
            training: ProxyTraining::default(),
        }
    }
}
