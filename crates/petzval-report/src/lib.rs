//! All plots, sheets and reports of Petzval, each page in one self-contained file.
//!
//! The input is plain data, and the output is text or pictures: nothing here reads a file, a clock or the network.
//!
//! | module | draws |
//! |---|---|
//! | [`design_report`] | a design run: lenses, PSFs, pictures, scores, curves |
//! | [`lens_sheet`] | the analyses of a lens |
//! | [`optimize_sheet`] | a lens before and after an optimisation |
//! | [`tolerance_sheet`] | what tolerances cost, and lenses made at random |
//! | [`sensor_sheet`] | the characterisation of a sensor |
//! | [`psf_calibration_sheet`] | measured PSFs beside simulated ones |
//! | [`comparison`] | several runs |
//! | [`side_by_side`] | one picture by several cameras |
//! | [`sweep_page`] | a sweep: its table, a scatter plot, pictures by its units |
//! | [`isp_strip`] | the stages of an ISP |
//! | [`isp_proxy_sheet`] | an ISP and the network that imitates it |
//! | [`chart_sheet`] | a developed test chart: colours, noise, sharpness |
//! | [`mtf_sheet`] | the MTF at slanted edges |
//! | [`data_sheet`] | a data set for object detection: classes, defects, samples with their boxes |
//! | [`optics_proxy_sheet`] | PSFs of a network beside exact ones |
//! | [`mod@psf_sheet`] | PSFs as a picture |
//! | [`layout`] | a lens to scale |
//! | [`mod@prescription`] | the surfaces of a lens as a table |
//! | [`plot`] | curves and bars over axes |

pub mod chart_sheet;
pub mod comparison;
pub mod data_sheet;
pub mod design_report;
pub mod isp_proxy_sheet;
pub mod isp_strip;
pub mod layout;
pub mod lens_sheet;
pub mod mtf_sheet;
mod number;
pub mod optics_proxy_sheet;
pub mod optimize_sheet;
mod page;
mod palette;
pub mod plot;
mod png;
pub mod prescription;
pub mod psf_calibration_sheet;
pub mod psf_sheet;
mod raster_text;
mod rgb_picture;
#[cfg(test)]
mod sample;
pub mod sensor_sheet;
pub mod side_by_side;
pub mod sweep_page;
mod table;
pub mod tolerance_sheet;
mod words;

pub use number::{signed_with_error, with_error};
pub use palette::class_colour;
pub use words::capitalised;
