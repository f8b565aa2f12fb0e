//! The workloads of `petzval bench`.

use crate::error::JobError;

/// A workload: its name, and its preparation for repeated runs.
pub struct Workload {
    pub name: &'static str,
    /// The instruction set that its hot loops use.
    pub simd: fn() -> &'static str,
    pub prepare: fn() -> Result<Prepared, JobError>,
}

/// A prepared workload.
pub struct Prepared {
    /// Description of the work of a run.
    pub work: String,
    /// Units of work in a run and their name, for a rate.
    pub units: Option<(f64, &'static str)>,
    /// Whether it always runs on one thread.
    pub single_thread: bool,
    pub run: Box<dyn FnMut() -> Result<(), JobError>>,
}
