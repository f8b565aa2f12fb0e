//! `data`: data sets for object detection.

pub mod check;
pub mod convert;
mod memory;
mod photographs;

use petzval_base::IoError;
use petzval_files::CheckedPictures;
use petzval_files::coco::{CocoError, Loaded, PictureCheck, check_pictures_by};

use crate::context::Context;
use crate::error::{JobError, Result};
use crate::event::WarningKind;

pub use petzval_files::coco::convert::SourceFormat;
pub use petzval_files::coco::{ClassStatistics, Defect, Severity, Statistics};

/// Largest file of which an error shows the line, bytes.
const LARGEST_SHOWN: u64 = 20_000;

/// Checks the pictures of a data set, and says how many are done. Those that are remembered are not decoded again.
pub(crate) fn check_pictures_in(
    loaded: &mut Loaded,
    remembered: &CheckedPictures,
    context: &Context,
) -> Result<()> {
    let count = loaded.data.images.len() as u64;
    let watch = |done: usize| {
        if done > 0 {
            context.progress(done as u64, count, "pictures are decoded");
        }
        context.cancel().check()
    };
    let how = PictureCheck { most_light_bytes: u64::MAX, remembered };
    let checked = check_pictures_by(loaded, &how, &watch);
    warn_of_notes(remembered, context);
    Ok(checked.map(|_| ())?)
}

/// Warns of what the files of checked pictures say that is not obeyed.
fn warn_of_notes(checked: &CheckedPictures, context: &Context) {
    for clause in checked.take_notes() {
        context.warning(WarningKind::Picture, clause);
    }
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
            CocoError::Io(IoError { ref source, .. }) => {
                let hint = "give a file or folder that can be read, or a place that can be written";
                Self::system(error.to_string(), source, hint)
            }
        }
    }
}
