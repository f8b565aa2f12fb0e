//! What every job is given beside its request.

use std::collections::{BTreeMap, BTreeSet, HashSet};
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use petzval_base::Cancel;
use petzval_design::assets::Guests;
use petzval_design::library::Library;
use petzval_learn::Device;
use petzval_learn::loss::Lpips;
use petzval_learn::score::{Score, standard_scores};

use crate::device;
use crate::error::{JobError, Result, Stopped};
use crate::event::{Event, WarningKind, Watcher};
use crate::guest::{Host, Workers};
use crate::kept::Kept;
use crate::keys::InKeys;
use crate::named_isp::external_isp;

/// A watcher that ignores everything.
#[derive(Clone, Copy, Debug, Default)]
pub struct Silent;

impl Watcher for Silent {
    fn event(&self, _: &Event) {}
}

/// Passes each warning on once: several parts of a job may find the same.
struct Once {
    watcher: Arc<dyn Watcher>,
    said: Mutex<HashSet<String>>,
}

impl Watcher for Once {
    fn event(&self, event: &Event) {
        if let Event::Warning { text, .. } = event {
            // The set stays valid if a thread panics while it holds the lock.
            let mut said = self.said.lock().unwrap_or_else(PoisonError::into_inner);
            if !said.insert(text.clone()) {
                return;
            }
        }
        self.watcher.event(event);
    }
}

/// Library, watcher and cancellation of a job.
#[derive(Clone)]
pub struct Context {
    /// Lenses, glasses, sensors, experiments, weights and tasks by name.
    pub assets: Library,
    watcher: Arc<dyn Watcher>,
    cancel: Cancel,
    /// Files that the job has written so far.
    written: Arc<Mutex<BTreeSet<PathBuf>>>,
    command: String,
    overwrites: bool,
    /// What its jobs keep from call to call.
    kept: Kept,
}

impl Context {
    /// A context whose library reports its warnings to the same watcher as its jobs; each warning is reported once.
    pub fn new(assets: Library, watcher: Arc<dyn Watcher>) -> Self {
        let watcher = Arc::new(Once { watcher, said: Mutex::default() });
        let sink = watcher.clone();
        let assets = assets.reporting_warnings(Arc::new(move |text: &str| {
            sink.event(&Event::Warning { kind: WarningKind::LensFile, text: text.to_owned() });
        }));
        let (cancel, written, command) = (Cancel::default(), Arc::default(), String::new());
        let kept = Kept::default();
        let context =
            Self { assets, watcher, cancel: cancel.clone(), written, command, overwrites: false, kept };
        context.with_cancellation(cancel)
    }

    /// The same context with another library.
    pub fn with_assets(self, assets: Library) -> Self {
        Self { assets, ..self }
    }

    /// The same context with a flag that stops its jobs once it is set.
    pub fn with_cancellation(self, cancel: Cancel) -> Self {
        let flag = cancel.clone();
        let assets = self.assets.with_external_isps(Arc::new(move |path| external_isp(path, &flag)));
        let (flag, watcher) = (cancel.clone(), self.watcher.clone());
        let guests = assets.with_guests(Arc::new(move |timeout_s| -> Arc<dyn Host> {
            let watcher = watcher.clone();
            let said = move |line: &str| watcher.event(&Event::note(line));
            Arc::new(Workers::new(timeout_s, flag.clone(), Arc::new(said)))
        }));
        Self { assets: guests.stopped_by(cancel.clone()), cancel, ..self }
    }

    /// The same context, whose jobs call classes in Python through another host than a process of their own.
    pub fn with_guests(self, guests: Guests) -> Self {
        Self { assets: self.assets.with_guests(guests), ..self }
    }

    /// The same context, whose events name keys of requests in place of flags of the command.
    pub fn in_keys(self) -> Self {
        Self { watcher: Arc::new(InKeys(self.watcher)), ..self }
    }

    /// The same context for another job, which has written nothing yet.
    pub(crate) fn for_a_job(&self) -> Self {
        Self { written: Arc::default(), ..self.clone() }
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

    /// The same context with another watcher of events.
    pub fn watched_by(&self, watcher: Arc<dyn Watcher>) -> Self {
        let again = Self::new(self.assets.clone(), watcher);
        Self { command: self.command.clone(), overwrites: self.overwrites, kept: self.kept.clone(), ..again }
    }

    /// What its jobs keep from call to call.
    pub(crate) fn kept(&self) -> &Kept {
        &self.kept
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
        self.cancel.is_set()
    }

    /// The flag behind [`Context::is_cancelled`], for work that does not know of jobs.
    pub fn cancel(&self) -> &Cancel {
        &self.cancel
    }

    /// Fails if the job is cancelled: for the end of a unit of work. `message` says where the job stopped.
    pub fn check<M: Into<String>>(&self, message: impl FnOnce() -> M) -> Result<()> {
        if self.is_cancelled() { Err(self.stopped(message()).into()) } else { Ok(()) }
    }

    /// How a cancelled job ends that stopped where the message says. It keeps the files that it has written so far.
    pub fn stopped(&self, message: impl Into<String>) -> Stopped {
        Stopped { kept: self.written(), ..Stopped::new(message) }
    }

    /// The files that the job has written so far.
    pub fn written(&self) -> Vec<PathBuf> {
        self.written.lock().unwrap_or_else(PoisonError::into_inner).iter().cloned().collect()
    }

    /// Reports an event.
    pub fn event(&self, event: &Event) {
        self.watcher.event(event);
    }

    /// Reports a warning: one thing, on one line, without a full stop.
    pub fn warning(&self, kind: WarningKind, text: impl Into<String>) {
        self.event(&Event::Warning { kind, text: text.into() });
    }

    /// Reports something that was done or found, on one line.
    pub fn note(&self, text: impl Into<String>) {
        self.event(&Event::note(text));
    }

    /// Reports how far the job has come.
    pub fn progress(&self, done: u64, total: u64, text: impl Into<String>) {
        self.event(&Event::Progress { done, total, text: text.into(), figures: BTreeMap::new() });
    }

    /// Reports a file that is whole, and what it holds. A job that is cancelled later keeps it.
    pub fn wrote(&self, path: impl Into<PathBuf>, what: &str) {
        let path = path.into();
        self.written.lock().unwrap_or_else(PoisonError::into_inner).insert(path.clone());
        self.event(&Event::File { path, what: what.to_owned() });
    }

    /// Every score of a picture, computed on the processor.
    pub fn scores(&self) -> Result<Vec<Box<dyn Score>>> {
        let weights = self.assets.bytes("weights/lpips_alex_f16.safetensors")?;
        let lpips = Lpips::from_safetensors(weights, &self.device("cpu")?)
            .map_err(|e| JobError::failed(format!("LPIPS: {e}")))?;
        Ok(standard_scores(&lpips))
    }

    /// The tensor device of a name, with automatic differentiation: `cpu`, or one that this build has a feature for.
    pub fn device(&self, name: &str) -> Result<Device> {
        device::device(name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::event::Lines;

    #[test]
    fn a_warning_is_said_once_by_whichever_part_of_a_job() {
        let kept = Arc::new(Lines::default());
        let context = Context::new(crate::built_in_assets(), kept.clone());
        let warning = |context: &Context, text: &str| context.warning(WarningKind::Other, text);
        warning(&context, "one");
        warning(&context, "two");
        warning(&context.clone().overwriting(true), "one");
        assert_eq!(*kept.0.lock().unwrap(), ["warning: one", "warning: two"]);
    }

    #[test]
    fn a_stopped_job_keeps_what_it_has_written_and_the_next_one_begins_with_nothing() {
        let context = Context::new(crate::built_in_assets(), Arc::new(Silent));
        assert!(context.check(|| "stopped").is_ok());
        context.wrote("a.png", "picture");
        context.wrote("a.png", "picture");
        context.cancel().set();
        let Err(JobError::Stopped(stopped)) = context.check(|| "stopped after 1 of 2 pictures") else {
            panic!()
        };
        assert_eq!(stopped.kept, [PathBuf::from("a.png")]);
        assert_eq!(stopped.to_string(), "stopped after 1 of 2 pictures");
        assert!(context.assets.cancel().is_set() && context.for_a_job().is_cancelled());
        assert!(context.for_a_job().written().is_empty());
    }
}
