//! Reads spectral images.
//!
//! | file | bands | wavelengths |
//! |---|---|---|
//! | `NAME.npy` | an array of three axes | sidecar `NAME.toml` |
//! | `NAME.tif`, `.tiff` | a page, or a sample of the only page, per band | sidecar `NAME.toml` |
//! | `NAME.exr` | a channel per band | channel names: `S0.450,5nm` (A. Fichet, R. Pacanowski and A. Wilkie, "An OpenEXR layout for spectral images", JCGT 10(3), 2021), `450.5nm`, `w450` |
//!
//! Values are radiance in W m-2 sr-1 nm-1. A sidecar may give a factor to that unit, also for an OpenEXR file, whose channel
//! names hold the wavelengths. An OpenEXR file that states another unit is refused without a factor.

mod exr_file;
mod npy_file;
mod sidecar;
mod tiff_file;

use std::path::{Path, PathBuf};

use petzval_base::{FileError, InFile, IoError};

pub use crate::limits::MAX_VALUES;
pub use sidecar::{Axes, Sidecar, sidecar_path};

use petzval_camera::spectral::{SpectralImage, SpectralImageError};

/// Why a spectral image could not be read.
#[derive(Debug, thiserror::Error)]
pub enum SpectralFileError {
    /// A file cannot be opened or read.
    #[error(transparent)]
    Io(#[from] IoError),
    /// The sidecar is missing.
    #[error(
        "{}: the wavelengths of {} are missing; hint: write them as `wavelength_um = [0.40, 0.42, ...]` into this file",
        sidecar.display(), image.display()
    )]
    NoSidecar {
        /// The image.
        image: PathBuf,
        /// The file that is missing.
        sidecar: PathBuf,
    },
    /// The sidecar is wrong.
    #[error(transparent)]
    Sidecar(#[from] InFile),
    /// The content contradicts the file's name.
    #[error("{}: {reason}; hint: {hint}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
        /// What to do.
        hint: &'static str,
    },
    /// The planes do not make an image.
    #[error("{}: {error}", path.display())]
    Image {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        error: SpectralImageError,
    },
}

/// The kinds of file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Npy,
    Exr,
    Tiff,
}

fn kind(path: &Path) -> Option<Kind> {
    match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
        "npy" => Some(Kind::Npy),
        "exr" => Some(Kind::Exr),
        "tif" | "tiff" => Some(Kind::Tiff),
        _ => None,
    }
}

/// Whether a file is a spectral image: `.npy`, an `.exr` whose channels are not those of a picture, or a TIFF with a sidecar.
pub fn is_spectral(path: &Path) -> bool {
    match kind(path) {
        Some(Kind::Npy) => true,
        Some(Kind::Exr) => !exr_file::is_picture(path),
        Some(Kind::Tiff) => sidecar_path(path).is_file(),
        None => false,
    }
}

/// Reads and checks a spectral image.
pub fn load_spectral(path: &Path) -> Result<SpectralImage, SpectralFileError> {
    let bytes = petzval_base::read_whole(path).map_err(IoError::at(path))?;
    let content = |(reason, hint): (String, &'static str)| SpectralFileError::Content {
        path: path.to_owned(),
        reason,
        hint,
    };
    let image = match kind(path) {
        Some(Kind::Exr) => exr_file::read(&bytes, exr_scale(path)?).map_err(content)?,
        Some(Kind::Npy) => npy_file::read(&bytes, &read_sidecar(path)?).map_err(content)?,
        Some(Kind::Tiff) => tiff_file::read(&bytes, &read_sidecar(path)?).map_err(content)?,
        None => {
            let reason = "the name does not have the extension of a spectral image".to_owned();
            return Err(content((reason, "give a .npy, .exr or .tif file")));
        }
    };
    image.validate().map_err(|error| SpectralFileError::Image { path: path.to_owned(), error })?;
    Ok(image)
}

fn read_sidecar(image: &Path) -> Result<Sidecar, SpectralFileError> {
    match sidecar_as(image, Sidecar::parse)? {
        Some(sidecar) => Ok(sidecar),
        None => Err(SpectralFileError::NoSidecar { image: image.to_owned(), sidecar: sidecar_path(image) }),
    }
}

/// The factor in the sidecar of an OpenEXR file, if there is one.
fn exr_scale(image: &Path) -> Result<Option<f64>, SpectralFileError> {
    sidecar_as(image, sidecar::parse_scale)
}

/// The sidecar of an image, read by `parse`; `None` if there is no sidecar.
fn sidecar_as<T>(
    image: &Path,
    parse: impl FnOnce(&str) -> Result<T, FileError>,
) -> Result<Option<T>, SpectralFileError> {
    let path = sidecar_path(image);
    let text = match petzval_base::read_text(&path) {
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
        other => other.map_err(IoError::at(&path))?,
    };
    Ok(Some(parse(&text).map_err(InFile::at(&path))?))
}

#[cfg(test)]
mod tests;
