//! What a bank of PSFs must hold.

use std::ops::RangeInclusive;

use petzval_base::FileError;

use super::{PsfAxes, PsfFile};
use crate::OPTICAL_UM;

/// Largest number of values of a bank: 2 GiB in double precision.
pub(super) const MOST_VALUES: usize = 1 << 28;

/// Permitted cell sizes, um.
const PITCH_UM: RangeInclusive<f64> = 1e-6..=1e3;

/// How far the sum of a PSF may be from 1.
const SUM_ERROR: f64 = 1e-3;

/// A chief ray that lands closer to the plane of the fields than this lies in it, mm.
const ON_PLANE_MM: f64 = 1e-6;

/// What is wrong with a bank of PSFs.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{key} {value}: {message}; hint: {hint}")]
pub struct PsfFault {
    /// `values`, `illumination`, or a key of the axes.
    pub key: &'static str,
    /// Its value as text; empty where it is not worth repeating.
    pub value: String,
    /// What is wrong.
    pub message: String,
    /// What is right.
    pub hint: &'static str,
}

impl PsfFault {
    /// The fault as an error of the file of axes, at a key without a line.
    pub fn in_file(self) -> FileError {
        let Self { key, value, message, hint } = self;
        FileError { key: key.to_owned(), value, ..FileError::at_line(0, "", message).hint(hint) }
    }
}

pub(super) fn fault(
    key: &'static str,
    value: impl ToString,
    message: impl Into<String>,
    hint: &'static str,
) -> PsfFault {
    PsfFault { key, value: value.to_string(), message: message.into(), hint }
}

impl PsfFile {
    /// A bank of axes and arrays that agree.
    pub fn new(
        axes: PsfAxes,
        shape: [usize; 4],
        values: Vec<f64>,
        illumination: Vec<f64>,
    ) -> Result<Self, PsfFault> {
        let bank = Self { axes, shape, values, illumination };
        bank.check()?;
        Ok(bank)
    }

    /// [`PsfFile::new`] of PSFs with any positive sums, by which they are divided.
    pub fn normalised(
        axes: PsfAxes,
        shape: [usize; 4],
        values: Vec<f64>,
        illumination: Vec<f64>,
    ) -> Result<Self, PsfFault> {
        let mut bank = Self { axes, shape, values, illumination };
        bank.check_shapes()?;
        bank.check_light()?;
        bank.divide_by_sums();
        bank.check()?;
        Ok(bank)
    }

    /// Divides every PSF by its sum, if that is positive.
    pub(super) fn divide_by_sums(&mut self) {
        let cells = self.shape[2] * self.shape[3];
        for psf in self.values.chunks_exact_mut(cells) {
            let sum: f64 = psf.iter().sum();
            if sum > 0.0 && sum.is_finite() {
                psf.iter_mut().for_each(|value| *value /= sum);
            }
        }
    }

    /// Checks that axes and arrays agree, that every number is in its range, and that every PSF sums to 1.
    pub fn check(&self) -> Result<(), PsfFault> {
        self.check_shapes()?;
        self.check_axes()?;
        self.check_light()?;
        let cells = self.shape[2] * self.shape[3];
        for (i, psf) in self.values.chunks_exact(cells).enumerate() {
            let sum: f64 = psf.iter().sum();
            if (sum - 1.0).abs() > SUM_ERROR {
                let message = format!("{} sums to {}", self.place(i), (1e9 * sum).round() / 1e9);
                let hint = "divide each PSF by its sum; illumination holds how much light there is";
                return Err(fault("values", "", message, hint));
            }
        }
        Ok(())
    }

    /// Field and wavelength of a PSF, in words.
    fn place(&self, index: usize) -> String {
        format!("the PSF of field {}, wavelength {}", index / self.shape[1], index % self.shape[1])
    }

    fn check_shapes(&self) -> Result<(), PsfFault> {
        let [fields, colours, rows, columns] = self.shape;
        let shape = format!("{:?}", self.shape);
        let count = self.shape.iter().try_fold(1_usize, |n, side| n.checked_mul(*side));
        if count.is_none_or(|n| n == 0 || n > MOST_VALUES || n != self.values.len()) {
            let message = format!("{} numbers of shape {shape}", self.values.len());
            let hint = "[field, wavelength, row, column], at most 2^28 numbers";
            return Err(fault("values", shape, message, hint));
        }
        if rows != columns {
            let hint = "PSFs are square: pad them with zeros";
            return Err(fault("values", shape, "not as many rows as columns", hint));
        }
        if self.illumination.len() != fields * colours {
            let message =
                format!("{} numbers for {fields} fields of {colours} wavelengths", self.illumination.len());
            return Err(fault("illumination", "", message, "[field, wavelength], as the PSFs"));
        }
        let axes = &self.axes;
        let of_fields = [
            ("field_radius_mm", axes.field_radius_mm.len(), true),
            ("field_deg", axes.field_deg.len(), false),
            ("chief_ray_x_mm", axes.chief_ray_x_mm.len(), false),
            ("chief_ray_y_mm", axes.chief_ray_y_mm.len(), false),
            ("captured", axes.captured.len(), false),
        ];
        for (key, length, is_needed) in of_fields {
            if length != fields && (is_needed || length > 0) {
                let message = format!("{length} numbers, and the array has {fields} fields");
                return Err(fault(key, "", message, "one for each field"));
            }
        }
        for (key, length) in
            [("wavelengths_um", axes.wavelengths_um.len()), ("channels", axes.channels.len())]
        {
            if length != colours && length > 0 {
                let message = format!("{length} entries, and the array has {colours} wavelengths");
                return Err(fault(key, "", message, "one for each wavelength"));
            }
        }
        if axes.captured.iter().any(|of_field| of_field.len() != colours) {
            let message = "a field has another number of wavelengths";
            return Err(fault("captured", "", message, "one for each wavelength"));
        }
        Ok(())
    }

    fn check_axes(&self) -> Result<(), PsfFault> {
        let axes = &self.axes;
        if !PITCH_UM.contains(&axes.pitch_um) {
            let message = format!("not between {} and {}", PITCH_UM.start(), PITCH_UM.end());
            return Err(fault("pitch_um", axes.pitch_um, message, "the size of a cell in um"));
        }
        if let Some(wrong) = axes.field_radius_mm.iter().find(|mm| !(mm.is_finite() && **mm >= 0.0)) {
            return Err(fault("field_radius_mm", wrong, "no distance from the axis", "in mm, 0 on the axis"));
        }
        let angle = axes.field_deg.iter().find(|deg| deg.is_nan() || deg.abs() >= 180.0);
        if let Some(wrong) = angle {
            return Err(fault("field_deg", wrong, "no field angle", "in degrees, below 180"));
        }
        for (key, all) in [("chief_ray_x_mm", &axes.chief_ray_x_mm), ("chief_ray_y_mm", &axes.chief_ray_y_mm)]
        {
            if let Some(wrong) = all.iter().find(|mm| !mm.is_finite()) {
                return Err(fault(key, wrong, "no place on the image plane", "in mm"));
            }
        }
        if axes.image_scale_mm.is_some_and(|mm| !(mm.is_finite() && mm > 0.0)) {
            let value = axes.image_scale_mm.unwrap_or_default();
            let hint = "the focal length of a far object, in mm";
            return Err(fault("image_scale_mm", value, "not positive", hint));
        }
        if let Some(wrong) = axes.wavelengths_um.iter().find(|um| !OPTICAL_UM.contains(*um)) {
            return Err(fault("wavelengths_um", wrong, "no wavelength", "in um: 550 nm is 0.55"));
        }
        if let Some(wrong) =
            axes.captured.iter().flatten().find(|share| !(share.is_finite() && **share >= 0.0))
        {
            return Err(fault("captured", wrong, "no share of the light", "0 to 1"));
        }
        if !axes.rotationally_symmetric && (axes.chief_ray_x_mm.is_empty() || axes.chief_ray_y_mm.is_empty())
        {
            let message = "the places of the fields are missing";
            let hint = "give chief_ray_x_mm and chief_ray_y_mm of each field";
            return Err(fault("rotationally_symmetric", false, message, hint));
        }
        if axes.rotationally_symmetric
            && let Some(wrong) = axes.chief_ray_x_mm.iter().find(|mm| mm.abs() > ON_PLANE_MM)
        {
            let message =
                "a field beside the plane of the fields, in a bank that is said to be rotationally symmetric";
            return Err(fault("chief_ray_x_mm", wrong, message, "write false for rotationally_symmetric"));
        }
        Ok(())
    }

    /// Checks that all light is finite and not negative, and that every PSF has some.
    fn check_light(&self) -> Result<(), PsfFault> {
        let [_, colours, rows, columns] = self.shape;
        for (i, psf) in self.values.chunks_exact(rows * columns).enumerate() {
            if let Some((cell, wrong)) = psf.iter().enumerate().find(|(_, v)| !(v.is_finite() && **v >= 0.0))
            {
                let message = format!(
                    "{} holds {wrong} at row {}, column {}",
                    self.place(i),
                    cell / columns,
                    cell % columns
                );
                let hint = "the light on a cell is a number from 0 on; set what noise has made negative to 0";
                return Err(fault("values", wrong, message, hint));
            }
            if psf.iter().all(|value| *value == 0.0) {
                let message = format!("{} sums to 0: it has no light", self.place(i));
                return Err(fault("values", 0, message, "leave the field out, or take a larger grid"));
            }
        }
        if let Some((i, wrong)) =
            self.illumination.iter().enumerate().find(|(_, v)| !(v.is_finite() && **v >= 0.0))
        {
            let message = format!("{wrong} of field {}, wavelength {}", i / colours, i % colours);
            return Err(fault("illumination", wrong, message, "numbers from 0 on, 1 on the axis"));
        }
        Ok(())
    }
}
