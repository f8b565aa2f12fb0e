//! PSFs that a request names in place of those of a lens.

use std::path::Path;
use std::sync::Arc;

use petzval_base::{InFile, pasted};
use petzval_camera::psf::PsfBank;
use petzval_files::psf_file::{PsfFault, PsfFile, PsfFileError, axes_file, read_psfs};
use petzval_lab::psf_calibration::manifest::MANIFEST_FILE;

use crate::error::{JobError, Result};

/// The file that `psfs` of a request names. For captures, the error explains how to measure PSFs from them.
pub(crate) fn bank_of(path: &Path) -> Result<PsfFile> {
    let results = path.join("psf-calibration");
    if path.join(MANIFEST_FILE).is_file() && !axes_file(path).is_file() {
        let hint = if axes_file(&results).is_file() {
            format!("the PSFs that were measured from them are in {}", results.display())
        } else {
            format!("run `petzval psf-calibrate {}` first, then give {}", pasted(path), results.display())
        };
        return Err(JobError::input(
            format!("--psfs {}: these are captures, not PSFs", path.display()),
            hint,
        ));
    }
    Ok(read_psfs(path)?)
}

/// The PSFs of a file as cameras take them.
pub(crate) fn bank(path: &Path) -> Result<Arc<PsfBank>> {
    Ok(Arc::new(bank_of(path)?.for_cameras().map_err(in_file(path))?))
}

/// What cameras cannot take of a file, as an error of the file.
pub(crate) fn in_file(path: &Path) -> impl Fn(PsfFault) -> JobError {
    move |fault| JobError::File { path: axes_file(path), error: Box::new(fault.in_file()) }
}

impl From<PsfFileError> for JobError {
    fn from(error: PsfFileError) -> Self {
        match error {
            PsfFileError::File(InFile { path, error }) => Self::File { path, error },
            PsfFileError::Io(error) => {
                let hint = "PSFs are a folder of results of `petzval psf` or `petzval psf-calibrate`, or its psf.json";
                Self::system(error.to_string(), &error.source, hint)
            }
        }
    }
}
