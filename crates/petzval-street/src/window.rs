//! A rectangle of sensor pixels.

use crate::error::{LARGEST_SIDE, StreetError};

/// Farthest first row or column of a window, pixels.
const FARTHEST: i64 = 1_000_000;

/// A rectangle of sensor pixels. It may reach beyond the sensor, for example by the border that a blur kernel needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Window {
    /// First row, sensor pixels; negative above the sensor.
    pub row: i64,
    /// First column, sensor pixels; negative left of the sensor.
    pub col: i64,
    /// Rows, 1 to 16384.
    pub height: usize,
    /// Columns, 1 to 16384.
    pub width: usize,
}

impl Window {
    /// Its outline `[x1, y1, x2, y2]` in sensor pixels; pixel (row, col) covers `col..col + 1` by `row..row + 1`.
    pub fn outline_px(&self) -> [f64; 4] {
        let (x, y) = (self.col as f64, self.row as f64);
        [x, y, x + self.width as f64, y + self.height as f64]
    }

    /// An error if it has no pixels, too many, or lies far from any sensor.
    pub(crate) fn check(&self) -> Result<(), StreetError> {
        let side = 1..=LARGEST_SIDE;
        if !side.contains(&self.height) || !side.contains(&self.width) {
            return Err(StreetError::Window { height: self.height, width: self.width });
        }
        let place = -FARTHEST..=FARTHEST;
        if !place.contains(&self.row) || !place.contains(&self.col) {
            return Err(StreetError::FarWindow { row: self.row, column: self.col });
        }
        Ok(())
    }
}
