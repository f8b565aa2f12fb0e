//! The binary part of the Python package `petzval`. It is private: typed modules of the package call it.
//!
//! Arrays come in as anything that NumPy can make an array of, and go out without a copy. What has many names goes through as JSON. All work is
//! done without Python's lock, on the threads of `pool`, and is watched as `watch` says.

mod arrays;
mod camera;
mod detector;
mod develop;
mod error;
mod glass;
mod guest;
mod jobs;
mod lens;
mod lift;
mod linear_isp;
mod pictures;
mod pool;
mod psf;
mod psf_files;
mod psf_picture;
mod raw_frame;
mod render;
mod requests;
mod run;
mod sensor;
mod sheet;
mod space;
mod tolerance;
mod watch;
mod weights;

use std::ffi::OsString;

use pyo3::prelude::*;

/// How many threads work has.
#[pyfunction]
fn threads(py: Python<'_>) -> PyResult<usize> {
    pool::threads().map_err(|e| error::exception(py, &e))
}

/// Chooses how many threads the next work has; 0 means those of a batch system, else one per core.
#[pyfunction]
fn set_threads(threads: usize) {
    pool::set_threads(threads);
}

/// The command with these words, the first of which is its own name; returns its exit code.
#[pyfunction]
fn command(py: Python<'_>, words: Vec<OsString>) -> u8 {
    py.detach(|| petzval::cli::main(words).number())
}

/// The module.
#[pymodule(gil_used = false)]
mod _petzval {
    use pyo3::prelude::*;

    /// Adds the version of the package and its constants.
    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))?;
        module.add("MOST_THREADS", petzval_jobs::MOST_THREADS)
    }

    #[pymodule_export]
    use super::camera::{PyCamera, PyFrame};
    #[pymodule_export]
    use super::detector::PyDetector;
    #[pymodule_export]
    use super::develop::PyIsp;
    #[pymodule_export]
    use super::glass::PyGlass;
    #[pymodule_export]
    use super::jobs::{call, job_names, job_schemas};
    #[pymodule_export]
    use super::lens::PyLens;
    #[pymodule_export]
    use super::lift::{lift, lifted_step};
    #[pymodule_export]
    use super::linear_isp::PyLinearIsp;
    #[pymodule_export]
    use super::pictures::{picture_png, read_picture};
    #[pymodule_export]
    use super::psf::PyPsfPlan;
    #[pymodule_export]
    use super::psf_files::{is_rotationally_symmetric, psfs_load, psfs_of, psfs_save};
    #[pymodule_export]
    use super::psf_picture::psf_picture;
    #[pymodule_export]
    use super::raw_frame::PyRawFrame;
    #[pymodule_export]
    use super::render::{PyDistortion, PyRenderer, wiener};
    #[pymodule_export]
    use super::run::{PyCameras, PyRun};
    #[pymodule_export]
    use super::sensor::PySensor;
    #[pymodule_export]
    use super::sheet::PySheet;
    #[pymodule_export]
    use super::space::PyDesignSpace;
    #[pymodule_export]
    use super::tolerance::lens_of_trial;
    #[pymodule_export]
    use super::watch::PyCancel;
    #[pymodule_export]
    use super::weights::PyNetwork;
    #[pymodule_export]
    use super::{command, set_threads, threads};
}
