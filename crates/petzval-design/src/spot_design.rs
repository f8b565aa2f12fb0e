//! The control that makes a gain a gain: a lens optimised, within the same bounds, for its RMS spot alone.

use petzval_optics::design_space::SmoothSpace;
use petzval_optics::lens::Lens;
use petzval_optics::spot::mean_square_spot;
use serde::{Deserialize, Serialize};

use crate::adam::Adam;
use crate::error::DesignError;
use crate::requirements::Requirements;

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
    pub fn start(space: &SmoothSpace) -> Self {
        Self { x: space.start().to_vec(), adam: Adam::default() }
    }
}

/// What spot optimisation minimises: the mean over fields and wavelengths of the squared RMS spot radius,
/// um^2, plus penalties.
pub struct SpotMerit<'a> {
    /// Where the lens may go.
    pub space: &'a SmoothSpace,
    /// Field angles, rad.
    pub fields_rad: &'a [f64],
    /// What the lens must keep.
    pub requirements: &'a Requirements,
}

/// Penalty of a violated requirement in a merit of squared spots, um^2 per mm^2.
const PENALTY_UM2_PER_MM2: f64 = 1e6;

impl SpotMerit<'_> {
    /// Merit and its derivatives by the free coordinates.
    pub fn evaluate(&self, x: &[f64]) -> Result<(f64, Vec<f64>, Lens), DesignError> {
        let lens = self.space.lens_at(x)?;
        let (square_um2, mut gradient) =
            mean_square_spot(&lens, self.fields_rad).ok_or(DesignError::NoLight {
                field_deg: self.fields_rad.last().copied().unwrap_or(0.0).to_degrees(),
            })?;
        let (penalty_mm2, by_penalty) = self.requirements.penalty(&lens)?;
        gradient += &by_penalty.scaled(PENALTY_UM2_PER_MM2);
        let value = square_um2 + PENALTY_UM2_PER_MM2 * penalty_mm2;
        let by_x = self.space.pull_back(x, &lens, &gradient);
        Ok((value, by_x, lens))
    }

    /// One step of Adam on the logarithm of the merit, whose gradient keeps its scale on the way down.
    /// Returns the RMS spot before the step, um.
    pub fn step(&self, moving: &mut MovingLens, rate: f64) -> Result<f64, DesignError> {
        let (value, gradient, _) = self.evaluate(&moving.x)?;
        // A value or gradient that is no number must not reach the moments: it shows in x instead.
        if !(value.is_finite() && gradient.iter().all(|g| g.is_finite())) {
            moving.x[0] = f64::NAN;
            return Ok(value.sqrt());
        }
        let gradient: Vec<f64> = gradient.iter().map(|g| g / value).collect();
        moving.adam.step(&mut moving.x, &gradient, rate);
        Ok(value.sqrt())
    }
}

/// Image radii that stand for equal areas of the sensor: the middles of `count` quantiles of the distance of its
/// points from its centre, mm, ascending. Spots at these fields count as the picture's places do.
pub fn area_quantile_radii_mm(height_px: usize, width_px: usize, pixel_um: f64, count: usize) -> Vec<f64> {
    // A grid over a quadrant, fine enough for the quantiles to be good to a thousandth of the diagonal.
    const CELLS: usize = 200;
    let at = |i: usize, side: usize| 0.5e-3 * pixel_um * side as f64 * (i as f64 + 0.5) / CELLS as f64;
    let mut radii: Vec<f64> =
        (0..CELLS * CELLS).map(|i| at(i / CELLS, height_px).hypot(at(i % CELLS, width_px))).collect();
    radii.sort_by(f64::total_cmp);
    (0..count).map(|i| radii[(2 * i + 1) * radii.len() / (2 * count)]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_of_a_square_are_those_of_its_area() {
        // Half of a square of side 2 lies within sqrt(2 / pi) of its centre, a little less than 1.
        let radii = area_quantile_radii_mm(2000, 2000, 1.0, 1);
        assert!((radii[0] - (2.0 / std::f64::consts::PI).sqrt()).abs() < 3e-3, "{radii:?}");
        let many = area_quantile_radii_mm(1200, 1920, 5.86, 13);
        assert!(many.is_sorted() && many[0] > 0.5 && many[12] < 6.634, "{many:?}");
    }
}
