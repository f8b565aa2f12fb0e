//! Petzval designs a camera as one thing: lens, sensor, development and network, by gradient.
//!
//! This crate is the facade over the light path, in the order of the light, and the `petzval` command. [`optics`] traces
//! the lens, [`camera`] renders, exposes and develops the picture, [`learn`] holds networks and losses, [`design`]
//! optimises them together.

pub mod cli;

pub use petzval_base as base;
pub use petzval_camera as camera;
pub use petzval_design as design;
pub use petzval_files as files;
pub use petzval_jobs as jobs;
pub use petzval_lab as lab;
pub use petzval_learn as learn;
pub use petzval_optics as optics;
pub use petzval_report as report;
pub use petzval_studio as studio;
pub use petzval_units as units;

pub use petzval_jobs::built_in_assets;
