//! Banks of point-spread functions as files: computed, measured, or made elsewhere.
//!
//! A folder holds three files. `psf.json` has the axes ([`PsfAxes`]) and names the other two.
//!
//! | file | array | holds |
//! |---|---|---|
//! | `psf.npy` | `[field, wavelength, row, column]` | the light on each cell; every PSF sums to 1 |
//! | `illumination.npy` | `[field, wavelength]` | relative illumination, 1 on the axis; 1 everywhere if the file is left out |
//!
//! The arrays are float16, float32 or float64 of either byte order, in C or Fortran order. Rows run along y, columns along x of the image plane. The
//! image point, where the chief ray lands, is in the middle of the grid: the centre of cell `i` is at `(i - (cells - 1) / 2) * pitch_um`. Cells
//! hold the light that falls on them, before any pixel integrates it.
//!
//! The fields of a rotationally symmetric lens lie on the +y axis, so that rows run away from the axis. Another lens has its fields anywhere, at the
//! places of their chief rays.
//!
//! Two earlier forms are read as well: `psf.json` without a version, and `psfs.toml` with an array in single precision.

mod axes;
mod check;
mod for_cameras;
mod names;
mod old_toml;
mod read;
#[cfg(test)]
mod tests;
mod write;
mod wrong_part;

use std::path::{Path, PathBuf};

use petzval_base::{InFile, IoError};

pub use axes::{Channel, FORMAT, PsfAxes, PsfOrigin, VERSION};
pub use check::PsfFault;
pub use names::{AXES_FILE, ILLUMINATION_FILE, OLD_AXES_FILE, VALUES_FILE};
pub use petzval_optics::psf::PsfMethod as Method;
pub use read::{parse_psfs, read_psfs};
pub use write::{psf_files, write_psfs};
pub use wrong_part::WrongPart;

/// A bank of point-spread functions with its axes.
#[derive(Clone, Debug, PartialEq)]
pub struct PsfFile {
    /// The axes.
    pub axes: PsfAxes,
    /// Numbers of fields, of wavelengths, of rows and of columns.
    pub shape: [usize; 4],
    /// The light on each cell, `[field][wavelength][row][column]`; each PSF sums to 1.
    pub values: Vec<f64>,
    /// Relative illumination, `[field][wavelength]`.
    pub illumination: Vec<f64>,
}

/// Why a bank of PSFs could not be read or written.
#[derive(Debug, thiserror::Error)]
pub enum PsfFileError {
    /// A file is wrong.
    #[error(transparent)]
    File(#[from] InFile),
    /// A file could not be read or written.
    #[error(transparent)]
    Io(#[from] IoError),
}

/// The file with the axes that a path means: the file itself, or the one in a folder.
pub fn axes_file(path: &Path) -> PathBuf {
    if !path.is_dir() {
        return path.to_owned();
    }
    let [new, old] = [AXES_FILE, OLD_AXES_FILE].map(|name| path.join(name));
    if old.is_file() && !new.is_file() { old } else { new }
}
