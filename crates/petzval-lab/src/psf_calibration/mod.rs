//! PSFs of a real lens, measured from captures of a pinhole.
//!
//! ```text
//! frames -> mean of N -> minus dark -> electrons/s, exposures merged -> demosaic -> centroid -> 23x23 PSF, unit sum
//!                                                            \-> estimate on fine cells -> PsfBank of the renderer
//! ```
//!
//! | step | module |
//! |---|---|
//! | the frames of each place of the source | [`manifest`] |
//! | mean and variance of repeated frames, dark frames | [`average`] |
//! | exposures of several times as one rate, with its variance | [`merge`] |
//! | the window of a source on the sensor | [`frame`] |
//! | find the source, and other sources | `spots` |
//! | centroid, crop, background, and their noise floor | [`measure`] |
//! | light of a finely sampled PSF on the pixels of a window | [`landing`] |
//! | position of the source in each frame, and its movement | [`track`] |
//! | comparison of measured and simulated PSFs | [`compare`] |
//! | one measured place of the source | [`place`] |
//! | PSFs on fine cells from several azimuths, for the renderer; how well they predict | [`estimate`], [`held_out`], [`register`] |
//! | frames of a simulated source, and the spectrum of its diode | [`capture`], [`led`] |
//! | a folder of captures from its manifest to measured PSFs | [`folder`] |
//!
//! Method: Tseng et al. 2021, supplement section 11. Our additions are the weights of the merge, the
//! predicted noise floor, and the bank; the modules describe them.

mod ascent;
pub mod average;
pub mod capture;
pub mod compare;
mod error;
pub mod estimate;
mod exposure_report;
pub mod folder;
pub mod frame;
pub mod held_out;
pub mod landing;
pub mod led;
pub mod manifest;
pub mod measure;
pub mod merge;
pub mod place;
pub mod register;
mod spots;
pub mod track;
mod warnings;

pub use error::PsfCalibrationError;
pub use exposure_report::ExposureReport;
pub use folder::{CalibratedPosition, calibrate_position, read_manifest};
pub use landing::{FinePsf, Landing, Spot};
pub use manifest::Manifest;
pub use measure::{CROP, Measured};

#[cfg(test)]
mod tests;
#[cfg(test)]
mod warning_tests;
