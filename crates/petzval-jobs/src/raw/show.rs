//! `raw show`: what a raw frame is.

use std::path::PathBuf;

use petzval_files::raw_file::load_any_raw;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::FrameSummary;
use crate::context::Context;
use crate::error::Result;

/// A raw frame to summarise: gray TIFF or PNG of 8 or 16 bits, a NumPy array, a packed `.raw` with its sidecar, or DNG with
/// the cargo feature `dng`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Request {
    /// The frame.
    pub file: PathBuf,
}

/// Size, camera, exposure and statistics of the frame.
pub type Response = FrameSummary;

/// Reads the frame and summarises it.
pub fn run(request: &Request, _context: &Context) -> Result<Response> {
    Ok(FrameSummary::new(&request.file, &load_any_raw(&request.file)?))
}
