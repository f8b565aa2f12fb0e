//! `raw`: look at raw frames, measure their sharpness, or write them in another format.

pub mod convert;
pub mod mtf;
pub mod show;

use std::path::Path;

use petzval_files::raw_file::{ColourStatistics, RawFrame, colour_statistics};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use petzval_files::raw_file::RawInfo;

/// Everything that is known of a raw frame but its pixels.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FrameSummary {
    /// The file, as it was named.
    pub file: String,
    /// Rows.
    pub height: usize,
    /// Columns.
    pub width: usize,
    /// Camera and exposure, as far as the file and its sidecar state them.
    pub info: RawInfo,
    /// Statistics of the digital numbers of each colour.
    pub colours: Vec<ColourStatistics>,
}

impl FrameSummary {
    fn new<T: Copy + Into<u32>>(file: &Path, frame: &RawFrame<T>) -> Self {
        Self {
            file: file.display().to_string(),
            height: frame.height,
            width: frame.width,
            info: frame.info.clone(),
            colours: colour_statistics(frame),
        }
    }
}
