//! The control that makes a gain a gain: a lens optimised, within the same bounds, for its RMS spot alone.

use petzval_optics::constraint::{Clearances, clearance_penalty};
use petzval_optics::design_space::DesignSpace;
use petzval_optics::lens::Lens;
use petzval_optics::pupil::Quadrature;
use petzval_optics::spot::mean_square_spot;
use serde::{Deserialize, Serialize};

use crate::adam::Adam;
use crate::error::DesignError;

/// A lens on its way through its design space.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MovingLens {
    /// Free coordinates.
    pub x: Vec<f64>,
    /// Moments of the gradient.
    pub adam: Adam,
}

impl MovingLens {
    /// A lens at rest at the start of its space.
    pub fn start(space: &DesignSpace) -> Self {
        Self { x: space.start().to_vec(), adam: Adam::default() }
    }
}

/// What spot optimisation minimises: the mean over fields and wavelengths of the squared RMS spot radius,
/// um^2, plus penalties.
pub struct SpotMerit<'a> {
    /// Where the lens may go.
    pub space: &'a DesignSpace,
    /// Field angles, rad.
    pub fields_rad: &'a [f64],
    /// Pupil.
    pub quadrature: &'a Quadrature,
    /// What the lens must keep.
    pub clearances: Clearances,
}

/// Penalty of a violated clearance in a merit of squared spots, um^2 per mm^2.
const PENALTY_UM2_PER_MM2: f64 = 1e6;

impl SpotMerit<'_> {
    /// Merit and its derivatives by the free coordinates.
    pub fn evaluate(&self, x: &[f64]) -> Result<(f64, Vec<f64>, Lens), DesignError> {
        let lens = self.space.lens_at(x)?;
        let (square_um2, mut gradient) =
            mean_square_spot(&lens, self.fields_rad, self.quadrature).ok_or(DesignError::NoLight {
                field_deg: self.fields_rad.last().copied().unwrap_or(0.0).to_degrees(),
            })?;
        let (penalty_mm2, by_clearance) = clearance_penalty(&lens, &self.clearances);
        gradient += &by_clearance.scaled(PENALTY_UM2_PER_MM2);
        let value = square_um2 + PENALTY_UM2_PER_MM2 * penalty_mm2;
        let by_x = self.space.pull_back(x, &lens, &gradient);
        Ok((value, by_x, lens))
    }

    /// One step of Adam on the logarithm of the merit, whose gradient keeps its scale on the way down.
    /// Returns the RMS spot before the step, um.
    pub fn step(&self, moving: &mut MovingLens, rate: f64) -> Result<f64, DesignError> {
        let (value, gradient, _) = self.evaluate(&moving.x)?;
        let gradient: Vec<f64> = gradient.iter().map(|g| g / value).collect();
        moving.adam.step(&mut moving.x, &gradient, rate);
        Ok(value.sqrt())
    }
}
