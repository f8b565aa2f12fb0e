//! The events of an attempt: into its log, and on to whoever watches.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use petzval_jobs::{Context, Event, Watcher};

use super::Store;

/// How often the log says how far a job is.
const PROGRESS_EVERY: Duration = Duration::from_secs(10);

/// The log of an attempt.
pub(super) struct Log {
    store: Store,
    path: PathBuf,
    outer: Context,
    state: Mutex<State>,
    has_advanced: AtomicBool,
}

#[derive(Default)]
struct State {
    /// The last time that progress was written.
    progress: Option<Instant>,
    /// The first count of the job.
    first: Option<u64>,
}

impl Log {
    /// A log in a file of a store. Events go on to the watcher of a context.
    pub fn new(store: &Store, path: PathBuf, outer: &Context) -> Self {
        let (state, has_advanced) = (Mutex::default(), AtomicBool::new(false));
        Self { store: store.clone(), path, outer: outer.clone(), state, has_advanced }
    }

    /// Whether the job has done a unit of its work.
    pub fn has_advanced(&self) -> bool {
        self.has_advanced.load(Ordering::Relaxed)
    }

    /// Whether an event is worth a line: steps are many.
    fn is_kept(&self, event: &Event) -> bool {
        // The numbers stay valid if a thread panics while it holds the lock.
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        match event {
            Event::Progress { done, .. } => {
                if *state.first.get_or_insert(*done) != *done {
                    self.has_advanced.store(true, Ordering::Relaxed);
                }
            }
            // A score that is cut short is lost, and its windows with it.
            Event::Scoring { .. } => {}
            Event::Step { .. } => self.has_advanced.store(true, Ordering::Relaxed),
            _ => return true,
        }
        let is_due = state.progress.is_none_or(|last| last.elapsed() >= PROGRESS_EVERY);
        if is_due {
            state.progress = Some(Instant::now());
        }
        is_due
    }
}

impl Watcher for Log {
    fn event(&self, event: &Event) {
        if self.is_kept(event)
            && let Ok(line) = serde_json::to_string(event)
        {
            // A log that cannot be written is no reason to stop: what counts is written elsewhere, and fails there.
            let _unwritten = self.store.layer.append(&self.path, format!("{line}\n").as_bytes());
        }
        self.outer.event(event);
    }
}
