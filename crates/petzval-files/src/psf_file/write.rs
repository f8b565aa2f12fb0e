//! Writes a bank of PSFs.

use std::path::{Path, PathBuf};

use petzval_base::{InFile, IoError, write_whole};

use super::names::{AXES_FILE, ILLUMINATION_FILE, VALUES_FILE};
use super::wrong_part::{WrongPart, part};
use super::{PsfAxes, PsfFile, PsfFileError};
use crate::npy_array::{FloatType, float_bytes};

/// The files of a bank, by name: the PSFs in a precision, the relative illumination in double precision, and last the axes, which name them.
pub fn psf_files(bank: &PsfFile, precision: FloatType) -> std::io::Result<[(&'static str, Vec<u8>); 3]> {
    let shape = bank.shape.map(|side| side as u64);
    let axes = PsfAxes {
        values_file: VALUES_FILE.to_owned(),
        illumination_file: Some(ILLUMINATION_FILE.to_owned()),
        ..bank.axes.clone()
    };
    let mut text = serde_json::to_string_pretty(&axes)?;
    text.push('\n');
    Ok([
        (VALUES_FILE, float_bytes(&shape, &bank.values, precision)?),
        (ILLUMINATION_FILE, float_bytes(&shape[..2], &bank.illumination, FloatType::Float64)?),
        (AXES_FILE, text.into_bytes()),
    ])
}

/// Writes a bank into a folder, which is made if it is not there: each file wholly or not at all, and the axes last. Returns their paths. A bank
/// with a fault is refused before anything is written.
pub fn write_psfs(bank: &PsfFile, folder: &Path, precision: FloatType) -> Result<[PathBuf; 3], PsfFileError> {
    let axes = folder.join(AXES_FILE);
    bank.check().map_err(|fault| {
        let (WrongPart::Axes(error) | WrongPart::Values(error) | WrongPart::Illumination(error)) =
            part("", &fault);
        InFile::at(&axes)(error)
    })?;
    std::fs::create_dir_all(folder).map_err(IoError::at(folder))?;
    let files = psf_files(bank, precision).map_err(IoError::at(&axes))?;
    for (name, bytes) in &files {
        let path = folder.join(name);
        write_whole(&path, bytes).map_err(IoError::at(&path))?;
    }
    Ok(files.map(|(name, _)| folder.join(name)))
}
