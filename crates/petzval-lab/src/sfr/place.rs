//! Where a pixel lies: in the region, and beside the edge.

use super::path::Path;
use super::region::Region;

/// Terms of light that changes, beyond a constant: `x, y`, then `x^2, x y, y^2`, then `x^3, x^2 y, x y^2, y^3`.
pub const TERMS: usize = 9;

/// The [`TERMS`], and the ways along and across the edge.
pub const WAYS: usize = TERMS + 2;

/// A pixel: its place in the region, its distance from the edge, value, and band of rows.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    pub at: [f64; 2],
    pub distance: f64,
    pub value: f64,
    pub band: usize,
}

/// Coordinates of the light: -1 to 1 over a region, from the middle of the edge.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    middle: [f64; 2],
    half: [f64; 2],
    /// Unit vector along the edge.
    along: [f64; 2],
}

impl Place {
    pub fn of(region: &Region, path: &Path) -> Self {
        let half = [0.5 * region.width as f64, 0.5 * region.height as f64];
        let middle = [path.at(half[1]).clamp(0.0, region.width as f64), half[1]];
        let length = path.slope().hypot(1.0);
        Self { middle, half, along: [path.slope() / length, 1.0 / length] }
    }

    /// The [`TERMS`], and the ways along and across the edge.
    pub fn terms(&self, at: [f64; 2]) -> [f64; WAYS] {
        let from = [0, 1].map(|k| at[k] - self.middle[k]);
        let [x, y] = [0, 1].map(|k| from[k] / self.half[k]);
        let along = (from[0] * self.along[0] + from[1] * self.along[1]) / self.half[1];
        let across = (from[0] * self.along[1] - from[1] * self.along[0]) / self.half[0];
        [x, y, x * x, x * y, y * y, x * x * x, x * x * y, x * y * y, y * y * y, along, across]
    }
}
