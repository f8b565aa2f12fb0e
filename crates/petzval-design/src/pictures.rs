//! Held-out pictures of a run, kept as PNG files for the report.

use petzval_files::encoded_png_bytes;

use crate::error::DesignError;
use crate::run::{RunFolder, write_file};
use crate::scoring::ScoredPicture;

/// File name of a state of picture `index`: `truth`, or `developed` and `output` of a camera.
pub fn file_name(index: usize, state: &str, camera: Option<&str>) -> String {
    match camera {
        Some(camera) => format!("{index:02}-{camera}-{state}.png"),
        None => format!("{index:02}-{state}.png"),
    }
}

/// Saves the pictures of a camera, and the truth beside them.
pub fn save(run: &RunFolder, camera: &str, pictures: &[ScoredPicture]) -> Result<(), DesignError> {
    for (index, picture) in pictures.iter().enumerate() {
        for (image, file) in [
            (&picture.truth, file_name(index, "truth", None)),
            (&picture.developed, file_name(index, "developed", Some(camera))),
            (&picture.output, file_name(index, "output", Some(camera))),
        ] {
            write_file(&run.picture(&file), &encoded_png_bytes(image)?)?;
        }
    }
    Ok(())
}
