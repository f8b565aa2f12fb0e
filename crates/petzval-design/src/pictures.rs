//! Held-out pictures of a run, kept as PNG files for the report.

use std::io::ErrorKind;

use petzval_files::encoded_png_bytes;

use crate::error::{DesignError, Result};
use crate::run::picture_names::{file_name, whole_name};
use crate::run::{RunFolder, write_file};
use crate::task::ScoredPicture;

/// Saves the pictures of a camera, and the truth beside them, if no other camera has: in streets the truth is what its own lens sees, and the first
/// camera has the focal length of the experiment. A whole frame of an earlier state of the camera is removed.
pub fn save(run: &RunFolder, camera: &str, pictures: &[ScoredPicture]) -> Result<()> {
    let whole = run.picture(&whole_name(Some(camera)));
    match std::fs::remove_file(&whole) {
        Err(error) if error.kind() != ErrorKind::NotFound => return Err(DesignError::io(&whole)(error)),
        _ => {}
    }
    for (index, picture) in pictures.iter().enumerate() {
        let truth = run.picture(&file_name(index, "truth", None));
        if !truth.is_file() {
            write_file(&truth, &encoded_png_bytes(&picture.truth)?)?;
        }
        for (image, state) in [(&picture.developed, "developed"), (&picture.output, "output")] {
            write_file(&run.picture(&file_name(index, state, Some(camera))), &encoded_png_bytes(image)?)?;
        }
    }
    Ok(())
}
