//! What a real lens makes of a point: PSFs measured from captures of a pinhole.
//!
//! ```text
//! frames -> mean of N -> minus dark -> electrons/s, exposures merged -> demosaic -> centroid -> 23x23 PSF, unit sum
//!                                                            \-> estimate on fine cells -> PsfBank of the renderer
//! ```
//!
//! | step | module |
//! |---|---|
//! | which frames belong to which place of the source | [`manifest`] |
//! | mean and variance of repeated frames, dark frames | [`average`] |
//! | exposures of several times as one rate, with its variance | [`merge`] |
//! | the source, and whether there is another | `spots` |
//! | centroid, crop, background, and their noise floor | [`measure`] |
//! | light of a finely sampled PSF on the pixels of a window | [`landing`] |
//! | where the source is in each frame, and whether it moved | [`track`] |
//! | measured beside simulated | [`compare`] |
//! | PSFs on fine cells from several azimuths, for the renderer; how well they predict | [`estimate`], [`held_out`], [`register`] |
//! | a bank of PSFs as files | [`psf_file`] |
//! | frames of a simulated source, and the spectrum of its diode | [`capture`], [`led`] |
//! | a folder of captures from its manifest to measured PSFs | [`folder`] |
//!
//! Method: Tseng et al. 2021, supplement section 11. What is ours is said where it happens: the weights of the merge, the
//! predicted noise floor, and the bank.

mod ascent;
pub mod average;
pub mod capture;
pub mod compare;
mod error;
pub mod estimate;
pub mod folder;
pub mod held_out;
pub mod landing;
pub mod led;
pub mod manifest;
pub mod measure;
pub mod merge;
pub mod psf_file;
pub mod register;
mod spots;
pub mod track;
mod trouble;

pub use error::PsfCalibrationError;
pub use folder::{CalibratedPosition, calibrate_position, read_manifest};
pub use landing::{FinePsf, Landing, Spot};
pub use manifest::Manifest;
pub use measure::{CROP, Measured};

#[cfg(test)]
mod tests;
#[cfg(test)]
mod warning_tests;
