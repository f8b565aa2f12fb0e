//! The plan of a search.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::super::frame::FrameOptions;

/// What is tuned for what.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    /// Folder of raw frames with sidecars.
    pub raws: PathBuf,
    /// Folder of the pictures that each should become: a picture of the same name, and of the same size.
    pub reference: PathBuf,
    /// Name of a preset, or a file of settings or of the description of an external ISP.
    #[serde(default = "usual_isp")]
    pub isp: String,
    /// Further values, each `stage.key=value`.
    #[serde(default)]
    pub set: Vec<String>,
    /// Score to raise: `psnr_db`, `ssim` or `one_minus_lpips`; `psnr` and `lpips` mean the same.
    #[serde(default = "usual_objective")]
    pub objective: String,
    /// Parameters that vary: names, stages, or `all`.
    #[serde(default = "everything")]
    pub vary: Vec<String>,
    /// What the raw files leave open.
    #[serde(default)]
    pub frame: FrameOptions,
    /// Seed of the search.
    #[serde(default = "crate::usual::seed")]
    pub seed: u64,
}

fn usual_isp() -> String {
    crate::isp::NEUTRAL.to_owned()
}

fn usual_objective() -> String {
    "psnr".to_owned()
}

fn everything() -> Vec<String> {
    vec!["all".to_owned()]
}
