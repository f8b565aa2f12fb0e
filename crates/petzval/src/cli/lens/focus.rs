//! Where the image plane of a lens goes before it is looked at.

use clap::ValueEnum;
use petzval::optics::lens::Lens;
use petzval::optics::pupil::Quadrature;
use petzval::optics::solve::{with_best_focus, with_paraxial_focus};

use crate::cli::Failure;

/// Pupil cells a side of the best focus.
const PUPIL_CELLS: usize = 64;

/// Where the image plane goes.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(super) enum FocusAt {
    /// Where the file puts it.
    File,
    /// At the paraxial image of the reference wavelength.
    Paraxial,
    /// Where the mean squared spot over the fields is least.
    Best,
}

/// The lens with the image plane where it was asked for.
pub(super) fn focused(lens: Lens, focus: FocusAt) -> Result<Lens, Failure> {
    match focus {
        FocusAt::File => Ok(lens),
        FocusAt::Paraxial => Ok(with_paraxial_focus(&lens, 0.0)),
        FocusAt::Best => {
            let quadrature = Quadrature::grid(PUPIL_CELLS).map_err(|e| Failure::job(e.to_string()))?;
            let fields: Vec<f64> = lens.fields_deg.iter().map(|f| f.to_radians()).collect();
            with_best_focus(&lens, &fields, &quadrature)
                .ok_or_else(|| Failure::input("no ray reaches the image at some field", "see --focus file"))
        }
    }
}
