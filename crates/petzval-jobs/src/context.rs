//! What every job is given beside its request.

use std::collections::HashSet;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

use petzval_design::library::Library;
use petzval_learn::Device;
use petzval_learn::loss::Lpips;
use petzval_learn::score::{Score, standard_scores};

use crate::device;
use crate::error::JobError;
use crate::named_isp::external_isp;

/// Receives what a job reports while it works. The command prints it, a studio draws it.
pub trait Watcher: Send + Sync {
    /// Something that the user should know before believing the result; the job continues. One line, without a full stop.
    fn warning(&self, text: &str);

    /// Something that the job has done, such as a file it has written. One line.
    fn note(&self, text: &str) {
        let _ = text;
    }

    /// How far the job has come.
    fn progress(&self, progress: &Progress) {
        let _ = progress;
    }
}

/// How far a job has come.
#[derive(Clone, Debug, PartialEq)]
pub struct Progress {
    /// Units of work done, in the unit that the job counts: steps, rounds, pictures.
    pub done: u64,
    /// Units of work in all; 0 if unknown.
    pub total: u64,
    /// What the job is doing now.
    pub text: String,
}

/// A watcher that ignores everything.
#[derive(Clone, Copy, Debug, Default)]
pub struct Silent;

impl Watcher for Silent {
    fn warning(&self, _: &str) {}
}

/// Passes each warning on once: several parts of a job may find the same.
struct Once {
    watcher: Arc<dyn Watcher>,
    said: Mutex<HashSet<String>>,
}

impl Watcher for Once {
    fn warning(&self, text: &str) {
        // The set stays valid if a thread panics while it holds the lock.
        let mut said = self.said.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        if said.insert(text.to_owned()) {
            drop(said);
            self.watcher.warning(text);
        }
    }

    fn note(&self, text: &str) {
        self.watcher.note(text);
    }

    fn progress(&self, progress: &Progress) {
        self.watcher.progress(progress);
    }
}

/// Library, watcher and cancellation of a job.
#[derive(Clone)]
pub struct Context {
    /// Lenses, glasses, sensors, experiments, weights and tasks by name.
    pub assets: Library,
    watcher: Arc<dyn Watcher>,
    cancelled: Arc<AtomicBool>,
    command: String,
    overwrites: bool,
}

impl Context {
    /// A context whose library reports its warnings to the same watcher as its jobs; each warning is reported once.
    pub fn new(assets: Library, watcher: Arc<dyn Watcher>) -> Self {
        let watcher = Arc::new(Once { watcher, said: Mutex::default() });
        let sink = watcher.clone();
        let assets = assets.reporting_warnings(Arc::new(move |text: &str| sink.warning(text)));
        let cancelled = Arc::default();
        let context = Self { assets, watcher, cancelled, command: String::new(), overwrites: false };
        context.with_cancellation(Arc::new(AtomicBool::new(false)))
    }

    /// The same context with another library.
    pub fn with_assets(self, assets: Library) -> Self {
        Self { assets, ..self }
    }

    /// The same context with a flag that stops its jobs once it is set.
    pub fn with_cancellation(self, cancelled: Arc<AtomicBool>) -> Self {
        let flag = cancelled.clone();
        let assets = self.assets.with_external_isps(Arc::new(move |path| external_isp(path, &flag)));
        Self { assets, cancelled, ..self }
    }

    /// The same context with the command line that its jobs keep beside their results.
    pub fn with_command(self, command: String) -> Self {
        Self { command, ..self }
    }

    /// The same context, whose jobs may overwrite results that are there.
    pub fn overwriting(self, overwrites: bool) -> Self {
        Self { overwrites, ..self }
    }

    /// Whether jobs may overwrite results that are there.
    pub fn overwrites(&self) -> bool {
        self.overwrites
    }

    /// The same context, whose reports nobody sees.
    pub fn silent(&self) -> Self {
        Self { watcher: Arc::new(Silent), ..self.clone() }
    }

    /// The command line that called the jobs; may be empty.
    pub fn command(&self) -> &str {
        &self.command
    }

    /// Whether the job should stop at its next safe point.
    pub fn is_cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }

    /// The flag behind [`Context::is_cancelled`].
    pub fn cancellation(&self) -> &Arc<AtomicBool> {
        &self.cancelled
    }

    /// Reports a warning.
    pub fn warning(&self, text: impl AsRef<str>) {
        self.watcher.warning(text.as_ref());
    }

    /// Reports something that was done.
    pub fn note(&self, text: impl AsRef<str>) {
        self.watcher.note(text.as_ref());
    }

    /// Reports how far the job has come.
    pub fn progress(&self, done: u64, total: u64, text: impl Into<String>) {
        self.watcher.progress(&Progress { done, total, text: text.into() });
    }

    /// Every score of a picture, computed on the processor.
    pub fn scores(&self) -> Result<Vec<Box<dyn Score>>, JobError> {
        let weights = self.assets.bytes("weights/lpips_alex_f16.safetensors")?;
        let lpips = Lpips::from_safetensors(weights, &self.device("cpu")?)
            .map_err(|e| JobError::failed(format!("LPIPS: {e}")))?;
        Ok(standard_scores(&lpips))
    }

    /// The tensor device of a name, with automatic differentiation: `cpu`, or one that this build has a feature for.
    pub fn device(&self, name: &str) -> Result<Device, JobError> {
        device::device(name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Default)]
    struct Kept(Mutex<Vec<String>>);

    impl Watcher for Kept {
        fn warning(&self, text: &str) {
            self.0.lock().unwrap().push(text.to_owned());
        }
    }

    #[test]
    fn a_warning_is_said_once_by_whichever_part_of_a_job() {
        let kept = Arc::new(Kept::default());
        let context = Context::new(crate::built_in_assets(), kept.clone());
        context.warning("one");
        context.warning("two");
        context.clone().overwriting(true).warning("one");
        assert_eq!(*kept.0.lock().unwrap(), ["one", "two"]);
    }
}
