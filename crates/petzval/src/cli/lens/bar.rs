//! A progress bar on stderr, for jobs that count their work.

use std::sync::Arc;

use indicatif::{ProgressBar, ProgressStyle};
use petzval::jobs::{Context, Progress, Watcher};

/// The bar; it disappears with its value. Where stderr is no terminal, none is drawn.
pub struct Bar(ProgressBar);

impl Bar {
    /// A bar that appears when a job reports progress.
    pub fn new() -> Self {
        let bar = ProgressBar::no_length();
        if let Ok(style) = ProgressStyle::with_template("{msg} [{bar:30}] {pos}/{len}, {eta} left") {
            bar.set_style(style);
        }
        Self(bar)
    }

    /// A context whose jobs move this bar, and print warnings and notes above it.
    pub fn context(&self) -> Context {
        Context::new(petzval::built_in_assets(), Arc::new(AboveBar(self.0.clone())))
    }
}

impl Drop for Bar {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}

struct AboveBar(ProgressBar);

impl AboveBar {
    fn print(&self, line: &str) {
        // A bar that is not there yet must not be drawn for a line.
        match self.0.length() {
            None => eprintln!("{line}"),
            Some(_) => self.0.suspend(|| eprintln!("{line}")),
        }
    }
}

impl Watcher for AboveBar {
    fn warning(&self, text: &str) {
        self.print(&format!("warning: {text}"));
    }

    fn note(&self, text: &str) {
        self.print(text);
    }

    fn progress(&self, progress: &Progress) {
        // Another text is another part of the job, with a time of its own.
        if self.0.message() != progress.text {
            self.0.set_length(progress.total);
            self.0.set_message(progress.text.clone());
            self.0.reset();
        }
        self.0.set_position(progress.done);
    }
}
