//! The joint optimisation of a camera: its lens, its network, for what it is for.
//!
//! ```text
//! Experiment -> Variants -> Camera -> Frames -> NamedLoss -> gradients -> Blocks -> run folder
//! ```
//!
//! An [`experiment`] states what is designed and which [variants](experiment::Variant) are compared; [`setup`] turns its names into values;
//! the [`design_loop`] goes through the stages of each variant. In a step, the [`camera`] takes a batch of shots, the
//! objective gives the loss, and one [`block`] of the camera moves down its gradient. [`scoring`] scores finished cameras on
//! held-out photographs; [`run`] keeps everything in a folder; [`report`] gathers what the report shows.

mod ahead;
pub mod assets;
pub mod block;
pub mod camera;
pub mod cameras;
pub mod convolutions;
pub mod design_loop;
pub mod error;
pub mod evolution;
pub mod experiment;
pub mod first_look;
pub mod fit;
pub mod in_order;
pub mod inputs;
pub mod isp_frames;
pub mod lens;
pub mod library;
pub mod made_cameras;
pub mod objective;
pub mod pace;
pub mod parts;
pub mod path_text;
pub mod pictures;
pub mod plausible;
mod position;
pub mod report;
pub mod run;
pub mod run_progress;
pub mod run_row;
pub mod scalar_log;
pub mod scoring;
pub mod setup;
pub mod spectral_light;
pub mod study;
pub mod task;
mod tensorboard;
mod thread_safety;
pub mod trained_pictures;
pub mod validation;
