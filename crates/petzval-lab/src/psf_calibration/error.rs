//! Errors of the PSF calibration.

use std::path::PathBuf;

use petzval_base::{Cancelled, InFile, IoError};
use petzval_camera::psf::PsfError;
use petzval_camera::sensor::{CfaPattern, SensorError};
use petzval_files::raw_file::RawFileError;

/// Why captures could not be read, or hold no PSF.
#[derive(Debug, thiserror::Error)]
pub enum PsfCalibrationError {
    /// The manifest is wrong.
    #[error(transparent)]
    File(#[from] InFile),
    /// A file could not be read or written.
    #[error(transparent)]
    Io(#[from] IoError),
    /// A frame could not be read.
    #[error(transparent)]
    Frame(#[from] RawFileError),
    /// A frame has another size than the first of its position.
    #[error(
        "{}: {width} x {height} pixels, but the first frame of position `{position}` has {first_width} x {first_height}; hint: \
         all frames of a position show the same window of the sensor", path.display()
    )]
    Size {
        /// The file.
        path: PathBuf,
        /// Position.
        position: String,
        /// Rows found.
        height: usize,
        /// Columns found.
        width: usize,
        /// Rows of the first frame.
        first_height: usize,
        /// Columns of the first frame.
        first_width: usize,
    },
    /// A frame holds numbers that the sensor cannot give.
    #[error(
        "{}: holds {value} DN, but the sensor's converter ends at {max}; hint: check `bits` of the sensor, and that numbers \
         are not shifted to fill 16 bits", path.display()
    )]
    AboveConverter {
        /// The file.
        path: PathBuf,
        /// Largest number found.
        value: u16,
        /// Largest that the sensor gives.
        max: f64,
    },
    /// A frame or its sidecar contradicts the sensor or the manifest.
    #[error(
        "{}: `{what} = {said}`, but {is}; hint: correct the one that is wrong, or take `{what}` out of the sidecar",
        path.display()
    )]
    Contradiction {
        /// The sidecar, or the frame if it has none.
        path: PathBuf,
        /// Key of the sidecar.
        what: &'static str,
        /// Its value.
        said: String,
        /// The value in the sensor or the manifest.
        is: String,
    },
    /// The exposure is impossible, or the window leaves the sensor.
    #[error("position `{position}`: {error}")]
    Sensor {
        /// Position.
        position: String,
        /// What is wrong.
        error: SensorError,
    },
    /// The mosaic is neither Bayer's nor monochrome.
    #[error(
        "the sensor's mosaic is {0}: PSFs are measured through a Bayer mosaic (RGGB, GRBG, GBRG, BGGR), or without one (mono); hint: \
         read a binned sensor (RRGG/...) out as the Bayer mosaic of its bins, with `cfa` and twice the `pixel_um`"
    )]
    Mosaic(CfaPattern),
    /// The frames are too small for a PSF and its surround.
    #[error(
        "position `{position}`: frames of {width} x {height} pixels; at least {least} x {least} are needed"
    )]
    TooSmall {
        /// Position.
        position: String,
        /// Rows.
        height: usize,
        /// Columns.
        width: usize,
        /// Least side.
        least: usize,
    },
    /// No source is above the noise.
    #[error(
        "position `{position}`: no source: the brightest spot is {sigmas:.1} standard deviations above the background; hint: \
         is the source on, in the window, and are these the right frames?"
    )]
    NoSource {
        /// Position.
        position: String,
        /// Standard deviations of the brightest spot above the background.
        sigmas: f64,
    },
    /// The PSF would be cut off.
    #[error(
        "position `{position}`: the source is at row {row:.1}, column {col:.1} of the frame, and {size} x {size} pixels around it \
         leave its {width} x {height}; hint: capture a larger window, or move the source inwards"
    )]
    NearBorder {
        /// Position.
        position: String,
        /// Row in the frame.
        row: f64,
        /// Column in the frame.
        col: f64,
        /// Pixels a side of the crop.
        size: usize,
        /// Frame rows.
        height: usize,
        /// Frame columns.
        width: usize,
    },
    /// A colour has no light.
    #[error(
        "position `{position}`: the {colour} channel has no light left after the background is subtracted"
    )]
    NoLight {
        /// Position.
        position: String,
        /// Colour.
        colour: &'static str,
    },
    /// The job was cancelled.
    #[error("stopped before all captures were measured")]
    Stopped(#[from] Cancelled),
    /// The measured PSFs make no bank.
    #[error("measured PSFs: {0}")]
    Bank(#[from] PsfError),
}
