//! The workloads of `petzval bench`.

use crate::error::Result;

/// A workload: its name, and its preparation for repeated runs.
pub struct Workload {
    pub name: &'static str,
    /// The instruction set that its hot loops use.
    pub simd: fn() -> &'static str,
    pub prepare: fn() -> Result<Prepared>,
}

/// A prepared workload.
pub struct Prepared {
    /// Description of the work of a run.
    pub work: String,
    /// Units of work in a run and their name, for a rate.
    pub units: Option<(f64, &'static str)>,
    /// Whether it always runs on one thread.
    pub single_thread: bool,
    pub run: Box<dyn FnMut() -> Result<()> + Send>,
}

impl Prepared {
    /// A workload for all threads. What a run makes is kept from the optimiser, and dropped.
    pub fn new<T>(work: impl Into<String>, mut run: impl FnMut() -> Result<T> + Send + 'static) -> Self {
        let run = move || run().map(|made| drop(std::hint::black_box(made)));
        Self { work: work.into(), units: None, single_thread: false, run: Box::new(run) }
    }

    /// The same, which always runs on one thread.
    pub fn on_one_thread(self) -> Self {
        Self { single_thread: true, ..self }
    }

    /// The same with so many units of work in a run.
    pub fn counted(self, units: f64, name: &'static str) -> Self {
        Self { units: Some((units, name)), ..self }
    }
}
