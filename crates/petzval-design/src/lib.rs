//! The joint optimisation of lens and network.
//!
//! An [`experiment`] says what is designed; [`setup`] turns its names into values; the [`design_loop`] lets
//! blocks take turns, with [`optics`] where the lens meets the picture and [`light_path`] where the picture is
//! taken; [`joint`] brings the loss back to the lens; [`scoring`] judges on held-out photographs; [`run`] keeps everything; [`run_report`] gathers what the report shows.

pub mod adam;
pub mod assets;
pub mod cameras;
pub mod design_loop;
pub mod error;
pub mod experiment;
pub mod glass_warnings;
pub mod glasses;
pub mod inputs;
pub mod joint;
mod lens_view;
pub mod light_path;
pub mod optics;
pub mod pictures;
pub mod pinhole;
pub mod requirements;
pub mod run;
pub mod run_report;
pub mod scoring;
pub mod setup;
pub mod spectral_light;
pub mod spot_design;
