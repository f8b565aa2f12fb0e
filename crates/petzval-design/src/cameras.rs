//! The three cameras that an experiment compares.

use serde::{Deserialize, Serialize};

/// A camera of the comparison, in the order in which they are made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum CameraKind {
    /// The nominal lens, fixed, with its network.
    Nominal,
    /// The lens optimised for its RMS spot alone within the same bounds, then fixed, with its network.
    SpotOptimised,
    /// Lens and network together, from the nominal lens.
    EndToEnd,
}

impl CameraKind {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Nominal, Self::SpotOptimised, Self::EndToEnd];

    /// The name in tables and files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Nominal => "nominal",
            Self::SpotOptimised => "spot-optimised",
            Self::EndToEnd => "end-to-end",
        }
    }
}
