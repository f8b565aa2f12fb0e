//! The description of a network that imitates an ISP, beside its weights.

use std::collections::BTreeMap;

use petzval_base::FileError;
use serde::{Deserialize, Serialize};
use toml::Table;

/// A network in place of an ISP, and how far it is from it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct IspProxyFile {
    /// What it is, for readers.
    pub about: String,
    /// The ISP: name of a preset, or an absolute path.
    pub proxy_of: String,
    /// File of the weights, relative to this one.
    pub weights: String,
    /// Channels of the network at its finest resolution.
    pub base_channels: usize,
    /// Number of times that the network halves the picture.
    pub levels: usize,
    /// Parameters that may vary.
    pub varied: Vec<String>,
    /// Values of all parameters in training; those of varied ones are the middle of their draws.
    pub values: BTreeMap<String, f64>,
    /// How it was trained, for readers.
    #[serde(default)]
    pub training: Table,
    /// What the imitation costs, for readers.
    #[serde(default)]
    pub gap: Table,
}

impl IspProxyFile {
    /// Reads a description.
    pub(super) fn parse(text: &str) -> Result<Self, FileError> {
        FileError::read_toml(text)
    }
}
