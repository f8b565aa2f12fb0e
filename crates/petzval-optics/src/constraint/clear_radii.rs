//! How far from the axis the surfaces of a lens are clear, and which way light goes behind them.

use crate::gradient::LensGradient;
use crate::lens::Lens;

/// The radii at which the surfaces of a lens must be clear.
pub trait ClearRadii {
    /// The clear radius of a surface, mm.
    fn radius_mm(&self, surface: usize) -> f64;

    /// How far edges reach beyond the clear radius, mm.
    fn mount_mm(&self) -> f64;

    /// Adds the gradient of a loss that depends on the clear radius of a surface, `bar` per mm; `None` if a ray is lost.
    fn pull_back(&self, surface: usize, bar: f64, gradient: &mut LensGradient) -> Option<()>;
}

/// The clear semi-diameters of a lens as they are: fixed places at which edges are measured, not numbers that move.
pub struct SemiDiameters<'a>(pub &'a Lens);

impl ClearRadii for SemiDiameters<'_> {
    fn radius_mm(&self, surface: usize) -> f64 {
        self.0.surfaces[surface].semi_diameter_mm
    }

    fn mount_mm(&self) -> f64 {
        0.0
    }

    fn pull_back(&self, _: usize, _: f64, _: &mut LensGradient) -> Option<()> {
        Some(())
    }
}

/// 1 where light goes along +z behind a surface, -1 behind an odd number of mirrors.
pub(crate) fn direction_of_light(lens: &Lens, surface: usize) -> f64 {
    if lens.light_goes_forwards(surface) { 1.0 } else { -1.0 }
}
