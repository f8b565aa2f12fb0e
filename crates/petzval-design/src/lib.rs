//! The joint optimisation of a camera: its lens, its network, for what it is for.
//!
//! ```text
//! Experiment -> Variants -> Camera -> Frames -> NamedLoss -> gradients -> Blocks -> run folder
//! ```
//!
//! An [`experiment`] states what is designed and which [`variant`]s are compared; [`setup`] turns its names into values;
//! the [`design_loop`] goes through the stages of each variant. In a step, the [`camera`] takes a batch of shots, the
//! objective gives the loss, and one [`block`] of the camera moves down its gradient. [`scoring`] scores finished cameras on
//! held-out photographs; [`run`] keeps everything in a folder; [`run_report`] gathers what the report shows.

pub mod adam;
pub mod assets;
mod attribution;
pub mod block;
pub mod boxes;
pub mod camera;
pub mod comparison;
pub mod design_loop;
mod detection_view;
pub mod error;
pub mod evolution;
pub mod experiment;
pub mod first_look;
pub mod fit;
pub mod glass_warnings;
pub mod input_list;
pub mod inputs;
pub mod isp_proxy;
mod lens_numbers;
pub mod lens_sampler;
pub mod lens_view;
pub mod made_cameras;
pub mod optics_proxy;
pub mod parts;
pub mod path_text;
pub mod pictures;
pub mod plausible;
mod position;
pub mod psf_plan;
mod report_pictures;
pub mod requirements;
pub mod restored;
pub mod run;
mod run_progress;
pub mod run_report;
pub mod scenes;
pub mod scoring;
pub mod seen_windows;
pub mod setup;
pub mod shots;
pub mod spectral_light;
pub mod start;
pub mod study;
pub mod validation;
