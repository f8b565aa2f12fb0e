//! What `petzval bench` measures.

use petzval::design::error::DesignError;
use petzval::jobs::JobError;

use crate::cli::failure::Failure;

/// A workload: its name, and how to make it ready to be run again and again.
pub struct Workload {
    pub name: &'static str,
    /// The instruction set that its hot loops use.
    pub simd: fn() -> &'static str,
    pub prepare: fn() -> Result<Prepared, Failure>,
}

/// A workload made ready.
pub struct Prepared {
    /// What is done, in words, and how many units of it a run does.
    pub work: String,
    /// Units of work a run, and what they are, for a rate.
    pub units: Option<(f64, &'static str)>,
    /// Whether it runs on one thread whatever the pool.
    pub single_thread: bool,
    pub run: Box<dyn FnMut() -> Result<(), Failure>>,
}

impl From<DesignError> for Failure {
    fn from(error: DesignError) -> Self {
        JobError::from(error).into()
    }
}
