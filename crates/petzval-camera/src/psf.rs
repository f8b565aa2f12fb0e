//! Point spread functions over the field: how the lens spreads the light of a point, and what share of it arrives.

use petzval_base::table::Interval;

use crate::image::CHANNELS;

/// Image radii and sampling grid of a bank of PSFs, without the values. Those may be held in a tensor or a file.
#[derive(Debug, Clone, PartialEq)]
pub struct PsfLayout {
    /// Image radius of each field, mm, ascending, the first 0.
    pub field_radius_mm: Vec<f64>,
    /// Cells along one side of the square grid.
    pub grid: usize,
    /// Size of one cell, um.
    pub pitch_um: f64,
}

/// PSFs of one rotationally symmetric lens.
///
/// The PSF of field `i` belongs to an image point on the +y axis of the image plane at `field_radius_mm[i]`. Rows are y
/// ascending, columns x ascending; the image point lies between the cells `grid/2 - 1` and `grid/2`, so the centre of
/// cell `i` is at `(i - (grid - 1)/2) * pitch_um`. Every PSF has unit sum; `illumination` holds the loss of light.
#[derive(Debug, Clone, PartialEq)]
pub struct PsfBank {
    /// Image radius of each field, mm, ascending, the first 0: where the chief ray of the field lands, distortion included.
    pub field_radius_mm: Vec<f64>,
    /// Cells along one side of the square grid.
    pub grid: usize,
    /// Size of one cell, um.
    pub pitch_um: f64,
    /// Energy per cell, `[field][channel][row][col]`; sums to 1 for each field and channel.
    pub values: Vec<f32>,
    /// Relative illumination `[field][channel]`: irradiance of the image of a uniform scene, 1 on the axis; vignetting, the cos^4
    /// law and distortion are included.
    pub illumination: Vec<f32>,
}

/// Why a bank of PSFs cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PsfError {
    /// The bank has no field.
    #[error("the PSF bank has no field")]
    NoField,
    /// Radii are not finite, do not start at 0 or do not ascend.
    #[error("field {index} of the PSF bank has radius {radius_mm} mm; radii start at 0 and ascend")]
    Radius {
        /// Index of the field.
        index: usize,
        /// Its radius.
        radius_mm: f64,
    },
    /// The grid or its pitch is not positive.
    #[error("PSF grid {grid} with a pitch of {pitch_um} um; both must be positive")]
    Grid {
        /// Cells along a side.
        grid: usize,
        /// Cell size.
        pitch_um: f64,
    },
    /// A buffer has the wrong number of values.
    #[error("{what} holds {len} values; {expected} are needed")]
    Length {
        /// Which buffer.
        what: &'static str,
        /// Values given.
        len: usize,
        /// Values needed.
        expected: usize,
    },
    /// A PSF or an illumination has a value that is not finite or below zero.
    #[error("{what} of field {field}, channel {channel} holds the value {value}")]
    Value {
        /// Which buffer.
        what: &'static str,
        /// Field index.
        field: usize,
        /// Channel index.
        channel: usize,
        /// The value.
        value: f32,
    },
    /// A PSF does not have unit sum.
    #[error("the PSF of field {field}, channel {channel} sums to {sum}; hint: divide it by its sum")]
    Sum {
        /// Field index.
        field: usize,
        /// Channel index.
        channel: usize,
        /// The sum found.
        sum: f64,
    },
}

impl PsfLayout {
    /// Number of fields.
    pub fn fields(&self) -> usize {
        self.field_radius_mm.len()
    }

    /// Number of values: fields x channels x grid x grid.
    pub fn len(&self) -> usize {
        self.fields() * CHANNELS * self.grid * self.grid
    }

    /// True if there is no field.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Adds the derivatives by the field radii of a loss whose derivative by the upper weight of [`bracket`](Self::bracket) at
    /// `radius_mm` is `by_w_hi`, 1/mm; the lower weight is one minus the upper.
    pub(crate) fn pull_back_bracket(&self, radius_mm: f64, by_w_hi: f64, by_radius: &mut [f64]) {
        let (lo, w_lo, w_hi) = self.bracket(radius_mm);
        // w_hi = (r - r_lo) / (r_hi - r_lo); beyond the outermost field it is constant.
        if let [below, above, ..] = self.field_radius_mm[lo..] {
            by_radius[lo] -= by_w_hi * w_lo / (above - below);
            by_radius[lo + 1] -= by_w_hi * w_hi / (above - below);
        }
    }

    /// Checks radii, grid and pitch.
    pub fn validate(&self) -> Result<(), PsfError> {
        if self.field_radius_mm.is_empty() {
            return Err(PsfError::NoField);
        }
        check_radii(&self.field_radius_mm)?;
        if self.grid == 0 || !self.pitch_um.is_finite() || self.pitch_um <= 0.0 {
            return Err(PsfError::Grid { grid: self.grid, pitch_um: self.pitch_um });
        }
        Ok(())
    }

    /// The two fields around an image radius and their linear weights `(field_lo, w_lo, w_hi)`; the upper field is
    /// `min(field_lo + 1, fields - 1)`. Beyond the outermost field the result is the outermost field with weight 1.
    pub fn bracket(&self, radius_mm: f64) -> (usize, f64, f64) {
        self.bracket_at(radius_mm, Interval::in_slice(radius_mm, &self.field_radius_mm))
    }

    /// [`bracket`](Self::bracket), found from the lower field of a radius nearby.
    #[inline]
    pub(crate) fn bracket_near(&self, radius_mm: f64, field_lo: usize) -> (usize, f64, f64) {
        self.bracket_at(radius_mm, Interval::near(radius_mm, &self.field_radius_mm, field_lo))
    }

    #[inline]
    fn bracket_at(&self, radius_mm: f64, interval: Option<Interval>) -> (usize, f64, f64) {
        let radii = &self.field_radius_mm;
        let last = radii.len() - 1;
        match interval {
            Some(Interval { lower, share }) if radius_mm < radii[last] => {
                let w_hi = share.clamp(0.0, 1.0);
                (lower, 1.0 - w_hi, w_hi)
            }
            _ => (last, 1.0, 0.0),
        }
    }
}

impl PsfBank {
    /// Radii and grid of this bank without its values.
    pub fn layout(&self) -> PsfLayout {
        PsfLayout { field_radius_mm: self.field_radius_mm.clone(), grid: self.grid, pitch_um: self.pitch_um }
    }

    /// Checks shapes, that all values are finite and not negative, and that every PSF sums to 1 within 1e-3.
    pub fn validate(&self) -> Result<(), PsfError> {
        let layout = self.layout();
        layout.validate()?;
        check_len("PSF values", self.values.len(), layout.len())?;
        check_len("relative illumination", self.illumination.len(), layout.fields() * CHANNELS)?;
        for (i, psf) in self.values.chunks_exact(self.grid * self.grid).enumerate() {
            let (field, channel) = (i / CHANNELS, i % CHANNELS);
            if let Some(&value) = psf.iter().find(|v| !v.is_finite() || **v < 0.0) {
                return Err(PsfError::Value { what: "the PSF", field, channel, value });
            }
            let sum: f64 = psf.iter().map(|&v| v as f64).sum();
            if (sum - 1.0).abs() > 1e-3 {
                return Err(PsfError::Sum { field, channel, sum });
            }
        }
        for (i, &value) in self.illumination.iter().enumerate() {
            if !value.is_finite() || value < 0.0 {
                let (field, channel) = (i / CHANNELS, i % CHANNELS);
                return Err(PsfError::Value { what: "the illumination", field, channel, value });
            }
        }
        Ok(())
    }
}

/// Checks that radii are finite, start at 0 and ascend.
pub(crate) fn check_radii(radii_mm: &[f64]) -> Result<(), PsfError> {
    for (index, &radius_mm) in radii_mm.iter().enumerate() {
        let ascends = if index == 0 { radius_mm == 0.0 } else { radius_mm > radii_mm[index - 1] };
        if !radius_mm.is_finite() || !ascends {
            return Err(PsfError::Radius { index, radius_mm });
        }
    }
    Ok(())
}

pub(crate) fn check_len(what: &'static str, len: usize, expected: usize) -> Result<(), PsfError> {
    if len == expected { Ok(()) } else { Err(PsfError::Length { what, len, expected }) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bank() -> PsfBank {
        let mut values = vec![0.0; 2 * CHANNELS * 16];
        for psf in values.chunks_exact_mut(16) {
            psf[5] = 1.0;
        }
        PsfBank {
            field_radius_mm: vec![0.0, 2.0],
            grid: 4,
            pitch_um: 1.0,
            values,
            illumination: vec![1.0; 6],
        }
    }

    #[test]
    fn validation_accepts_a_good_bank_and_names_each_defect() {
        assert_eq!(bank().validate(), Ok(()));
        let broken = |change: fn(&mut PsfBank)| {
            let mut b = bank();
            change(&mut b);
            b.validate().unwrap_err()
        };
        assert!(matches!(broken(|b| b.field_radius_mm.clear()), PsfError::NoField));
        assert!(matches!(broken(|b| b.field_radius_mm[1] = 0.0), PsfError::Radius { index: 1, .. }));
        assert!(matches!(broken(|b| b.pitch_um = f64::NAN), PsfError::Grid { .. }));
        assert!(matches!(broken(|b| b.values.truncate(3)), PsfError::Length { .. }));
        assert!(matches!(broken(|b| b.values[17] = -1.0), PsfError::Value { field: 0, channel: 1, .. }));
        assert!(matches!(broken(|b| b.values[5] = 2.0), PsfError::Sum { field: 0, channel: 0, .. }));
        assert!(matches!(
            broken(|b| b.illumination[5] = f32::NAN),
            PsfError::Value { field: 1, channel: 2, .. }
        ));
    }

    #[test]
    fn bracket_is_linear_inside_and_constant_outside() {
        let layout = PsfLayout { field_radius_mm: vec![0.0, 1.0, 3.0], grid: 2, pitch_um: 1.0 };
        assert_eq!(layout.bracket(0.0), (0, 1.0, 0.0));
        assert_eq!(layout.bracket(1.5), (1, 0.75, 0.25));
        assert_eq!(layout.bracket(9.0), (2, 1.0, 0.0));
        let axis_only = PsfLayout { field_radius_mm: vec![0.0], grid: 2, pitch_um: 1.0 };
        assert_eq!(axis_only.bracket(4.0), (0, 1.0, 0.0));
    }
}
