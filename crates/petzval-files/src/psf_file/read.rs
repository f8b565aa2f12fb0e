//! Reads a bank of PSFs.

use std::path::Path;

use petzval_base::{InFile, IoError};

use super::check::MOST_VALUES;
use super::names::{ILLUMINATION_FILE, VALUES_FILE};
use super::wrong_part::{WrongPart, message, part};
use super::{FORMAT, PsfAxes, PsfFile, PsfFileError, VERSION, axes_file, old_toml};
use crate::npy_array::{FloatArray, FloatType, read_floats};

/// How NumPy writes an array that is read.
const NUMPY_HINT: &str =
    "numpy.save(file, psfs) of float16, float32 or float64, [field, wavelength, row, column]";

/// What writes files of axes.
const AXES_HINT: &str =
    "`petzval psf` and `petzval psf-calibrate` write such files; the book says what they hold";

/// Reads a bank from its `psf.json`, its `psfs.toml`, or the folder that holds one.
pub fn read_psfs(path: &Path) -> Result<PsfFile, PsfFileError> {
    let path = axes_file(path);
    let text = match petzval_base::read_text(&path) {
        Err(error) if error.kind() == std::io::ErrorKind::InvalidData => {
            return Err(InFile::at(&path)(message("the file is not UTF-8 text", AXES_HINT)).into());
        }
        other => other.map_err(IoError::at(&path))?,
    };
    let beside = |name: &str| path.with_file_name(name);
    let read = |name: &str| {
        let file = beside(name);
        petzval_base::read_whole(&file).map_err(IoError::at(&file))
    };
    if path.extension().is_some_and(|ending| ending == "toml") {
        let old = old_toml::parse(&text).map_err(InFile::at(&path))?;
        let values = read(&old.values)?;
        return Ok(old_toml::bank(&old, &text, &values).map_err(|part| match part {
            WrongPart::Axes(error) | WrongPart::Illumination(error) => InFile::at(&path)(error),
            WrongPart::Values(error) => InFile::at(&beside(&old.values))(error),
        })?);
    }
    let axes = PsfAxes::parse(&text).map_err(InFile::at(&path))?;
    let light = illumination_file(&axes);
    let values = read(&axes.values_file)?;
    let illumination = light.as_deref().map(read).transpose()?;
    let names = [axes.values_file.clone(), light.unwrap_or_default()];
    Ok(bank(axes, &text, &values, illumination.as_deref()).map_err(|part| match part {
        WrongPart::Axes(error) => InFile::at(&path)(error),
        WrongPart::Values(error) => InFile::at(&beside(&names[0]))(error),
        WrongPart::Illumination(error) => InFile::at(&beside(&names[1]))(error),
    })?)
}

/// A bank of the text of `psf.json` and the bytes of its arrays.
pub fn parse_psfs(text: &str, values: &[u8], illumination: Option<&[u8]>) -> Result<PsfFile, WrongPart> {
    bank(PsfAxes::parse(text).map_err(WrongPart::Axes)?, text, values, illumination)
}

/// The file of the illumination. Files without a version do not name it.
fn illumination_file(axes: &PsfAxes) -> Option<String> {
    match axes.version {
        0 => Some(ILLUMINATION_FILE.to_owned()),
        _ => axes.illumination_file.clone(),
    }
}

fn bank(axes: PsfAxes, text: &str, values: &[u8], illumination: Option<&[u8]>) -> Result<PsfFile, WrongPart> {
    let FloatArray { shape, values, precision } =
        read_floats(values, MOST_VALUES).map_err(|reason| WrongPart::Values(message(reason, NUMPY_HINT)))?;
    let shape = <[usize; 4]>::try_from(shape).map_err(|shape| {
        WrongPart::Values(message(format!("an array of {} axes, shape {shape:?}", shape.len()), NUMPY_HINT))
    })?;
    let illumination = match illumination {
        None => vec![1.0; shape[0] * shape[1]],
        Some(bytes) => {
            let hint = "numpy.save(file, illumination) of float16, float32 or float64, [field, wavelength]";
            let array = read_floats(bytes, MOST_VALUES)
                .map_err(|reason| WrongPart::Illumination(message(reason, hint)))?;
            if array.shape != shape[..2] {
                let reason = format!("shape {:?}, and the PSFs have {shape:?}", array.shape);
                return Err(WrongPart::Illumination(message(reason, hint)));
            }
            array.values
        }
    };
    // Names of files have served; a bank is the same under others.
    let axes = PsfAxes {
        format: FORMAT.to_owned(),
        version: VERSION,
        values_file: VALUES_FILE.to_owned(),
        illumination_file: Some(ILLUMINATION_FILE.to_owned()),
        ..axes
    };
    let made = match precision {
        // Rounding to 11 bits moves the sums.
        FloatType::Float16 => PsfFile::normalised(axes, shape, values, illumination),
        FloatType::Float32 | FloatType::Float64 => PsfFile::new(axes, shape, values, illumination),
    };
    made.map_err(|fault| part(text, &fault))
}
