//! The plan of a search.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::isp::NEUTRAL;
use crate::isp::frame::FrameOptions;

/// What is tuned for what.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Plan {
    /// Folder of raw frames with sidecars.
    pub raws: PathBuf,
    /// Folder of the pictures that each should become: a picture of the same name, and of the same size.
    pub reference: PathBuf,
    /// Name of a preset, or a file of settings or of the description of an external ISP.
    pub isp: String,
    /// Further values, each `stage.key=value`.
    pub set: Vec<String>,
    /// Score to raise: `psnr_db`, `ssim` or `one_minus_lpips`; `psnr` and `lpips` mean the same.
    pub objective: String,
    /// Parameters that vary: names, stages, or `all`.
    pub vary: Vec<String>,
    /// What the raw files leave open.
    pub frame: FrameOptions,
    /// Seed of the search.
    pub seed: u64,
}

impl Default for Plan {
    fn default() -> Self {
        Self {
            raws: PathBuf::new(),
            reference: PathBuf::new(),
            isp: NEUTRAL.to_owned(),
            set: Vec::new(),
            objective: "psnr".to_owned(),
            vary: crate::usual::every_parameter(),
            frame: FrameOptions::default(),
            seed: crate::usual::seed(),
        }
    }
}
