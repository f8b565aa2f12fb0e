//! A bar for jobs that count frames.

use std::sync::Arc;

use indicatif::{ProgressBar, ProgressStyle};
use petzval::jobs::{Context, Progress, Watcher};

use super::Stderr;

/// The context of [`super::context`], with a bar on stderr that is cleared at the end of the job.
pub fn context_with_frames_bar() -> Context {
    let bar = ProgressBar::new(0);
    if let Ok(style) = ProgressStyle::with_template("{msg} [{bar:30}] {pos}/{len} frames, {eta} left") {
        bar.set_style(style);
    }
    Context::new(petzval::built_in_assets(), Arc::new(FramesBar(bar)))
}

/// Draws progress as a bar, and prints what else a job reports above it.
struct FramesBar(ProgressBar);

impl FramesBar {
    /// Prints while the bar is hidden. A bar without a length has not been drawn yet, and must not be drawn by this.
    fn print(&self, print: impl FnOnce()) {
        match self.0.length() {
            Some(0) | None => print(),
            _ => self.0.suspend(print),
        }
    }
}

impl Watcher for FramesBar {
    fn warning(&self, text: &str) {
        self.print(|| Stderr.warning(text));
    }

    fn note(&self, text: &str) {
        self.print(|| Stderr.note(text));
    }

    fn progress(&self, progress: &Progress) {
        if self.0.length() != Some(progress.total) {
            self.0.set_length(progress.total);
        }
        if self.0.message() != progress.text {
            self.0.set_message(progress.text.clone());
        }
        self.0.set_position(progress.done);
    }
}

impl Drop for FramesBar {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}
