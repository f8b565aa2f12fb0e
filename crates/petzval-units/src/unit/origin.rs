//! Where a unit was read.

use std::path::PathBuf;

/// The file and the line, from 1, that a unit was read from, where it was. It belongs neither to the unit nor to its key: units that differ in
/// it alone are equal.
#[derive(Clone, Debug, Default)]
pub struct Origin {
    pub(super) file: Option<PathBuf>,
    pub(super) line: Option<u32>,
}

impl PartialEq for Origin {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}
