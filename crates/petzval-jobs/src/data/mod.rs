//! `data`: data sets for object detection.

pub mod check;
pub mod convert;

use petzval_files::coco::{CocoError, Loaded, check_pictures};

use crate::context::Context;
use crate::error::JobError;

pub use petzval_files::coco::convert::SourceFormat;
pub use petzval_files::coco::{ClassStatistics, Defect, Severity, Statistics};

/// Largest file of which an error shows the line, bytes.
const LARGEST_SHOWN: u64 = 20_000;

/// Checks the pictures of a data set, and says how many are done.
pub(crate) fn check_pictures_in(loaded: &mut Loaded, context: &Context) -> Result<(), JobError> {
    let count = loaded.data.images.len() as u64;
    let watch = |done: usize| {
        context.progress(done as u64, count, "pictures are decoded");
        context.cancel().check()
    };
    Ok(check_pictures(loaded, &watch)?)
}

impl From<CocoError> for JobError {
    fn from(error: CocoError) -> Self {
        match error {
            CocoError::File { path, mut error, more } => {
                if more > 0 {
                    error.message += &format!("; {more} more places are wrong");
                }
                // The line is shown beside the error, but not one that fills the screen: programs write JSON in one line.
                match path.metadata() {
                    Ok(about) if about.len() > LARGEST_SHOWN => {
                        let hint = error.hint.take().unwrap_or_default();
                        Self::input(format!("{}: {error}", path.display()), hint)
                    }
                    _ => Self::File { path, error },
                }
            }
            CocoError::Stopped(cancelled) => cancelled.into(),
            CocoError::Content { path, reason, hint } => {
                Self::input(format!("{}: {reason}", path.display()), hint)
            }
            CocoError::Io { ref source, .. } => {
                let hint = "give a file or folder that can be read, or a place that can be written";
                Self::system(error.to_string(), source, hint)
            }
        }
    }
}
