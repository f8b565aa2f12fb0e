//! One measured place of the source, and the grid of cells of the estimate.

use super::frame::Frame;
use super::measure::{CROP, Measured};
use super::merge::Merged;

/// Number of cells of the bank along a pixel.
pub const CELLS_PER_PIXEL: usize = 3;

/// Cells along a side of the bank's grid.
pub const GRID: usize = CROP * CELLS_PER_PIXEL;

/// One measured place: the input of the estimate.
#[derive(Debug, Clone, Copy)]
pub struct Place<'a> {
    /// Radius of the field, mm.
    pub field_radius_mm: f64,
    /// Direction away from the axis, rad from the columns towards higher rows.
    pub azimuth_rad: f64,
    /// Factor from the light of the source to relative illumination before it is divided by that of the innermost field.
    pub light_factor: f64,
    /// The window.
    pub frame: &'a Frame,
    /// Rates and variances.
    pub merged: &'a Merged,
    /// PSF and centroid.
    pub measured: &'a Measured,
}
