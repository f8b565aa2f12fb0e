//! `lens`: looks at a lens, converts it, or makes it better.

pub mod analyze;
pub mod convert;
mod focus;
pub mod optimize;
pub mod show;
pub mod tolerance;
pub mod trace;

use std::path::Path;

use petzval_base::write_whole;
use petzval_design::error::DesignError;

use crate::error::JobError;

pub use focus::FocusAt;

/// Writes a file wholly or not at all.
fn write(path: &Path, contents: impl AsRef<[u8]>) -> Result<(), JobError> {
    Ok(write_whole(path, contents.as_ref()).map_err(DesignError::io(path))?)
}
