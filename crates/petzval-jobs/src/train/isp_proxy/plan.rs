//! The plan of a training.

use petzval_design::camera::isp_proxy::ProxyTraining;

use crate::experiment::DEFAULT_EXPERIMENT;
use crate::isp::NEUTRAL;

petzval_base::parameters! {
    /// What is imitated, and how.
    pub struct Plan {
        /// Name of a preset, or a file of settings or of the description of an external ISP.
        isp: String = NEUTRAL.to_owned();
        /// Further values, each `stage.key=value`.
        set: Vec<String> = Vec::new();
        /// Parameters that vary: names, stages, or `all`.
        vary: Vec<String> = crate::usual::every_parameter();
        /// Experiment that gives lens, sensor, exposure and photographs.
        experiment: String = DEFAULT_EXPERIMENT.to_owned();
        /// Steps and size of the network.
        training: ProxyTraining = ProxyTraining::default();
    }
}
