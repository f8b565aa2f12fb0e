//! The wavelengths that a lens may have.

use std::ops::RangeInclusive;

/// Permitted wavelengths of a lens, um.
pub(crate) const OPTICAL_UM: RangeInclusive<f64> = 0.2..=20.0;
