//! `--focus`: where the image plane of a lens goes before it is looked at.

use clap::ValueEnum;
use petzval::jobs::lens;

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

impl From<FocusAt> for lens::FocusAt {
    fn from(focus: FocusAt) -> Self {
        match focus {
            FocusAt::File => Self::File,
            FocusAt::Paraxial => Self::Paraxial,
            FocusAt::Best => Self::Best,
        }
    }
}
