//! The earlier form of measured PSFs: `psfs.toml` with the axes, and an array in red, green and blue beside it. It is read, and no longer written.

use petzval_base::FileError;
use petzval_camera::image::CHANNELS;
use serde::Deserialize;

use super::check::MOST_VALUES;
use super::wrong_part::{WrongPart, message, part};
use super::{Channel, PsfAxes, PsfFile, PsfOrigin};
use crate::npy_array::read_floats;

/// How NumPy writes an array that is read.
const NUMPY_HINT: &str =
    "numpy.save(file, psfs) of float16, float32 or float64, [field, channel, row, column]";

/// The axes of a bank of PSFs, as in `psfs.toml`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OldAxes {
    /// Source of the PSFs.
    source: String,
    /// File of the values beside this one: `[field][channel][row][col]`, unit sum each.
    pub values: String,
    /// Cells along a side.
    grid: usize,
    /// Cell size, um.
    pitch_um: f64,
    /// Image radius of each field, mm, ascending from 0.
    field_radius_mm: Vec<f64>,
    /// Relative illumination of each field in red, green and blue.
    illumination: Vec<[f32; CHANNELS]>,
}

pub fn parse(text: &str) -> Result<OldAxes, FileError> {
    FileError::read_toml(text)
}

/// The bank of axes with this text, and of the bytes of their array.
pub fn bank(old: &OldAxes, text: &str, values: &[u8]) -> Result<PsfFile, WrongPart> {
    let wrong = |key: &str, message: String, hint: &str| {
        Err(WrongPart::Axes(FileError::at_key(text, &[key], message).hint(hint)))
    };
    let (fields, grid) = (old.field_radius_mm.len(), old.grid);
    let count = grid.checked_mul(grid).and_then(|n| n.checked_mul(CHANNELS * fields));
    if count.is_none_or(|n| n == 0 || n > MOST_VALUES) {
        let message = format!("{fields} fields of this grid are no values, or too many");
        return wrong("grid", message, "the number of cells a side");
    }
    if old.illumination.len() != fields {
        let message = format!("{} fields, but {fields} radii", old.illumination.len());
        return wrong("illumination", message, "three numbers for each field");
    }
    if old.field_radius_mm.first().is_some_and(|mm| *mm != 0.0) || !old.field_radius_mm.is_sorted() {
        let message = "radii start at 0 and ascend".to_owned();
        return wrong("field_radius_mm", message, "radii in mm from 0 upwards");
    }
    let array =
        read_floats(values, MOST_VALUES).map_err(|reason| WrongPart::Values(message(reason, NUMPY_HINT)))?;
    let shape = [fields, CHANNELS, grid, grid];
    if array.shape != shape {
        let reason = format!("holds {:?}; {shape:?} are needed", array.shape);
        return Err(WrongPart::Values(message(reason, NUMPY_HINT)));
    }
    let axes = PsfAxes {
        source: old.source.clone(),
        kind: Some(PsfOrigin::Measured),
        channels: Channel::RGB.to_vec(),
        ..PsfAxes::new(old.pitch_um, old.field_radius_mm.clone())
    };
    let illumination = old.illumination.iter().flatten().map(|v| f64::from(*v)).collect();
    PsfFile::new(axes, shape, array.values, illumination).map_err(|fault| match part(text, &fault) {
        // Here the axes hold the illumination.
        WrongPart::Illumination(_) => {
            WrongPart::Axes(FileError::at_key(text, &["illumination"], fault.message).hint(fault.hint))
        }
        WrongPart::Axes(_) => {
            WrongPart::Axes(FileError::at_key(text, &[fault.key], fault.message).hint(fault.hint))
        }
        values => values,
    })
}
