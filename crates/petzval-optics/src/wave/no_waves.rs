//! Lenses that have no waves.

use std::fmt;

use crate::lens::{Action, Lens};

/// Why a lens has no waves, see [`has_optical_paths`](crate::trace::Sequence::has_optical_paths): one of its surfaces is a thin lens.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NoWaves {
    /// The first thin lens, 0-based.
    pub surface: usize,
}

impl NoWaves {
    /// `None` if the lens has waves wherever its rays arrive.
    pub fn of(lens: &Lens) -> Option<Self> {
        let surface = lens.surfaces.iter().position(|s| matches!(s.action, Action::ThinLens { .. }))?;
        Some(Self { surface })
    }
}

impl fmt::Display for NoWaves {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "surface {} is a thin lens, which has no optical path for waves", self.surface + 1)
    }
}
