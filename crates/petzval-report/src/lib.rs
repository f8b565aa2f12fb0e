//! Everything that Petzval draws: plots, sheets and reports, each page in one file that needs nothing but itself.
//!
//! Plain data goes in and text or pictures come out: nothing here reads a file, a clock or the network.
//!
//! | module | draws |
//! |---|---|
//! | [`design_report`] | a design run: lenses, PSFs, pictures, scores, curves |
//! | [`lens_sheet`] | the analyses of a lens |
//! | [`sensor_sheet`] | the characterisation of a sensor |
//! | [`psf_calibration_sheet`] | measured PSFs beside simulated ones |
//! | [`mod@psf_sheet`] | PSFs as a picture |
//! | [`layout`] | a lens to scale |
//! | [`plot`] | curves and bars over axes |

pub mod design_report;
pub mod layout;
pub mod lens_sheet;
mod number;
mod page;
mod palette;
pub mod plot;
mod png;
pub mod psf_calibration_sheet;
pub mod psf_sheet;
#[cfg(test)]
mod sample;
pub mod sensor_sheet;
mod table;
