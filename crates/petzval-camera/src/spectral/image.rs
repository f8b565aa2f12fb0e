//! Pictures with one plane per wavelength band.

use crate::image::{CHANNELS, LinearImage};

/// Radiance over the spectrum, one plane per band, W m-2 sr-1 nm-1.
///
/// A pixel's spectrum is linear between the bands and zero outside. Element `(band, row, col)` is at
/// `(band * height + row) * width + col`.
#[derive(Debug, Clone, PartialEq)]
pub struct SpectralImage {
    /// Wavelength of each band, um, ascending; at least two.
    pub wavelength_um: Vec<f64>,
    /// Rows.
    pub height: usize,
    /// Columns.
    pub width: usize,
    /// `bands * height * width` values.
    pub data: Vec<f32>,
}

/// Why planes do not make a spectral image.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SpectralImageError {
    /// No pixels, or fewer than two bands.
    #[error("{bands} bands of {width} x {height} pixels; at least two bands and one pixel are needed")]
    Empty {
        /// Bands.
        bands: usize,
        /// Rows.
        height: usize,
        /// Columns.
        width: usize,
    },
    /// The number of values is not bands x rows x columns.
    #[error("{bands} bands of {width} x {height} pixels need {expected} values, not {len}")]
    Length {
        /// Bands.
        bands: usize,
        /// Rows.
        height: usize,
        /// Columns.
        width: usize,
        /// Values needed.
        expected: u128,
        /// Values given.
        len: usize,
    },
    /// A wavelength is out of range or does not ascend.
    #[error("band {band} is at {wavelength_um} um; wavelengths ascend, within 0.01..100 um")]
    Wavelength {
        /// Index of the band, from 0.
        band: usize,
        /// Its wavelength.
        wavelength_um: f64,
    },
    /// A value is negative or not finite.
    #[error(
        "the radiance of band {band} at row {row}, column {col} is {value}; it must be finite and not negative"
    )]
    Value {
        /// Index of the band, from 0.
        band: usize,
        /// Row.
        row: usize,
        /// Column.
        col: usize,
        /// The value.
        value: f32,
    },
}

impl SpectralImage {
    /// Checks shapes, that wavelengths ascend, and that all radiances are finite and not negative.
    pub fn validate(&self) -> Result<(), SpectralImageError> {
        let (bands, height, width) = (self.wavelength_um.len(), self.height, self.width);
        if bands < 2 || height == 0 || width == 0 {
            return Err(SpectralImageError::Empty { bands, height, width });
        }
        let expected = bands as u128 * height as u128 * width as u128;
        if expected != self.data.len() as u128 {
            return Err(SpectralImageError::Length { bands, height, width, expected, len: self.data.len() });
        }
        for (band, &wavelength_um) in self.wavelength_um.iter().enumerate() {
            let ascends = band == 0 || self.wavelength_um[band - 1] < wavelength_um;
            if !(0.01..=100.0).contains(&wavelength_um) || !ascends {
                return Err(SpectralImageError::Wavelength { band, wavelength_um });
            }
        }
        if let Some(i) = self.data.iter().position(|v| !(v.is_finite() && *v >= 0.0)) {
            let (band, pixel) = (i / (height * width), i % (height * width));
            let (row, col) = (pixel / width, pixel % width);
            return Err(SpectralImageError::Value { band, row, col, value: self.data[i] });
        }
        Ok(())
    }

    /// Number of bands.
    pub fn bands(&self) -> usize {
        self.wavelength_um.len()
    }

    /// One band, row by row.
    pub fn plane(&self, band: usize) -> &[f32] {
        let n = self.height * self.width;
        &self.data[band * n..(band + 1) * n]
    }

    /// Three bands as three planes for the renderer.
    pub fn planes(&self, bands: [usize; CHANNELS]) -> LinearImage {
        let data = bands.iter().flat_map(|b| self.plane(*b).iter().copied()).collect();
        LinearImage { channels: CHANNELS, height: self.height, width: self.width, data }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn planes_are_checked() {
        let good = SpectralImage {
            wavelength_um: vec![0.4, 0.5],
            height: 1,
            width: 2,
            data: vec![0.0, 1.0, 2.0, 3.0],
        };
        assert!(good.validate().is_ok());
        assert_eq!(good.planes([1, 0, 1]).data, [2.0, 3.0, 0.0, 1.0, 2.0, 3.0]);
        let short = SpectralImage { data: vec![0.0; 3], ..good.clone() };
        assert!(matches!(short.validate(), Err(SpectralImageError::Length { expected: 4, .. })));
        let back = SpectralImage { wavelength_um: vec![0.5, 0.4], ..good.clone() };
        assert!(matches!(back.validate(), Err(SpectralImageError::Wavelength { band: 1, .. })));
        let one = SpectralImage { wavelength_um: vec![0.5], ..good.clone() };
        assert!(matches!(one.validate(), Err(SpectralImageError::Empty { .. })));
        let dark = SpectralImage { data: vec![0.0, 1.0, -1.0, f32::NAN], ..good };
        assert!(matches!(dark.validate(), Err(SpectralImageError::Value { band: 1, row: 0, col: 0, .. })));
    }
}
