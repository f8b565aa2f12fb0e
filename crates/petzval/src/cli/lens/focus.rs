//! `--focus`: the position of the image plane of a lens.

use clap::ValueEnum;
use petzval::jobs::lens;

/// Position of the image plane.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(super) enum FocusAt {
    /// As in the file.
    File,
    /// At the paraxial image of the reference wavelength.
    Paraxial,
    /// Where the mean squared spot over the fields is least.
    Best,
}

impl From<FocusAt> for lens::FocusAt {
    fn from(focus: FocusAt) -> Self {
        match focus {
            FocusAt::File => Self::File,
            FocusAt::Paraxial => Self::Paraxial,
            FocusAt::Best => Self::Best,
        }
    }
}
