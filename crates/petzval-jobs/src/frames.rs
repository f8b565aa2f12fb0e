//! Progress in frames.

use petzval_base::{Cancelled, Tally};

use crate::context::Context;

/// Counts the frames of a job and reports each to its watcher, from any thread and in ascending order.
pub(crate) struct Frames<'a> {
    context: &'a Context,
    total: u64,
    done: Tally,
}

impl<'a> Frames<'a> {
    pub(crate) fn new(context: &'a Context, total: usize) -> Self {
        Self { context, total: total as u64, done: Tally::default() }
    }

    /// Counts one more frame. Fails if the job is cancelled.
    pub(crate) fn add(&self, text: &str) -> Result<(), Cancelled> {
        self.report(1, text);
        self.context.cancel().check()
    }

    /// Reports what the job does now, without a new frame.
    pub(crate) fn now(&self, text: &str) {
        self.report(0, text);
    }

    fn report(&self, more: u64, text: &str) {
        self.done.add(more, |done| self.context.progress(done, self.total, text));
    }
}
