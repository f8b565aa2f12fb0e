//! Moves the image plane of a lens before the lens is looked at.

use petzval_optics::lens::Lens;
use petzval_optics::pupil::Quadrature;
use petzval_optics::solve::{with_best_focus, with_paraxial_focus};
use serde::{Deserialize, Serialize};

use crate::error::JobError;

/// Pupil cells a side of the best focus.
const PUPIL_CELLS: usize = 64;

/// Where the image plane goes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FocusAt {
    /// Where the file puts it.
    #[default]
    File,
    /// At the paraxial image of the reference wavelength.
    Paraxial,
    /// Where the mean squared spot over the fields is least.
    Best,
}

/// The lens with its image plane there.
pub(super) fn focused(lens: Lens, focus: FocusAt) -> Result<Lens, JobError> {
    match focus {
        FocusAt::File => Ok(lens),
        FocusAt::Paraxial => Ok(with_paraxial_focus(&lens, 0.0)),
        FocusAt::Best => {
            let quadrature = Quadrature::grid(PUPIL_CELLS).map_err(|e| JobError::failed(e.to_string()))?;
            let fields: Vec<f64> = lens.fields_deg.iter().map(|f| f.to_radians()).collect();
            with_best_focus(&lens, &fields, &quadrature).ok_or_else(|| {
                JobError::setting(
                    "focus",
                    "best",
                    "at some field no ray reaches the image",
                    "--focus file leaves the image plane where the file puts it",
                )
            })
        }
    }
}
