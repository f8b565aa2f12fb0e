//! What is to be said of PSFs that are less accurate than scores need.

use petzval_camera::render::{BlendError, RenderGeometry};
use petzval_design::experiment::PsfConfig;

use crate::event::WarningKind;

/// The warning of PSFs on so many pupil cells a side whose error is `error`; `None` if they are as accurate as scores need.
pub(super) fn coarse_pupil(psf: &PsfConfig, cells: usize, error: f64) -> Option<(WarningKind, String)> {
    let most = psf.scoring_pupil_error;
    (error > most).then(|| {
        (
            WarningKind::PsfError,
            format!("PSFs on {cells} pupil cells a side have an error of {error:.3} (L1), more than {most}"),
        )
    })
}

/// The warning of patches that blend PSFs with an error of `blend`; `None` if they are as accurate as scores need.
pub(super) fn coarse_patches(
    psf: &PsfConfig,
    geometry: &RenderGeometry,
    blend: &BlendError,
) -> Option<(WarningKind, String)> {
    (blend.median > psf.scoring_blend_error).then(|| {
        (WarningKind::PsfError, format!(
            "the PSF changes so quickly over the sensor that {} x {} patches blend it with an error of {:.3} (L1, median), {:.3} at worst",
            geometry.patches.0, geometry.patches.1, blend.median, blend.largest
        ))
    })
}
