//! Output of a command while its job runs: warnings, notes, and a bar with the time left.

use std::sync::Mutex;
use std::time::{Duration, Instant};

use crate::jobs::{Event, Watcher};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use super::plain;

/// Units of work between two plain lines if stderr is not a terminal.
const PLAIN_EVERY: u64 = 50;

/// Time after which a plain line comes earlier.
const PLAIN_AFTER: Duration = Duration::from_secs(15);

/// Shows the reports of a job on stderr: a bar on a terminal, plain lines elsewhere.
pub struct Stderr {
    bar: ProgressBar,
    is_plain: bool,
    phase: Mutex<Option<Phase>>,
}

/// Time between two drawings of the bar while a unit of work takes long.
const REDRAWN_EVERY: Duration = Duration::from_secs(1);

/// Part of a job whose units of work are counted together.
struct Phase {
    start: Instant,
    /// Units done at the start.
    first: u64,
    total: u64,
    /// When the last plain line was written.
    last_line: Instant,
}

impl Phase {
    /// How long the rest will take at the mean speed so far: `, about 20 s left`; nothing before the first unit is done.
    fn left(&self, done: u64) -> String {
        match done.checked_sub(self.first) {
            None | Some(0) => String::new(),
            Some(taken) => {
                let rest = self.total.saturating_sub(done) as f64;
                let seconds = self.start.elapsed().as_secs_f64() * rest / taken as f64;
                format!(", about {seconds:.0} s left")
            }
        }
    }
}

impl Stderr {
    /// Shows nothing until the job reports something.
    pub fn new() -> Self {
        let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
        let style = "{msg}\n[{elapsed_precise}] {bar:40} {pos}/{len}{prefix}";
        if let Ok(style) = ProgressStyle::with_template(style) {
            bar.set_style(style);
        }
        Self { is_plain: bar.is_hidden(), bar, phase: Mutex::new(None) }
    }

    /// Writes what an event says: one thing, on one line.
    fn line(&self, text: &str) {
        let text = plain::line(text);
        if self.is_plain { noteln!("{text}") } else { self.bar.suspend(|| noteln!("{text}")) }
    }

    /// Shows how many units of work are done, and what is done now.
    fn progress(&self, done: u64, total: u64, text: &str) {
        let text = plain::message(text);
        // The numbers stay valid if a thread panics while it holds the lock.
        let mut phase = self.phase.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        let phase = match &mut *phase {
            Some(phase) if phase.total == total => phase,
            _ => {
                let now = Instant::now();
                *phase = Some(Phase { start: now, first: done, total, last_line: now });
                self.bar.set_length(total);
                self.bar.set_position(done);
                self.bar.set_message(text.clone());
                self.bar.set_prefix("");
                if !self.is_plain {
                    self.bar.enable_steady_tick(REDRAWN_EVERY);
                }
                return;
            }
        };
        if !self.is_plain {
            self.bar.set_message(text.clone());
            self.bar.set_position(done);
            self.bar.set_prefix(phase.left(done));
        } else if done > phase.first
            && (done.is_multiple_of(PLAIN_EVERY) || phase.last_line.elapsed() > PLAIN_AFTER)
        {
            noteln!("{done}/{total}{}: {text}", phase.left(done));
            phase.last_line = Instant::now();
        }
    }
}

impl Watcher for Stderr {
    fn event(&self, event: &Event) {
        match event {
            Event::Warning { .. } | Event::Note { .. } | Event::Camera { .. } => {
                self.line(&event.to_string())
            }
            Event::Progress { done, total, text } => self.progress(*done, *total, text),
            Event::Step { step, total, .. } => self.progress(*step, *total, &event.to_string()),
            // What a verb has written it prints at its end.
            Event::File { .. } => {}
        }
    }
}

impl Drop for Stderr {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_left_is_that_of_the_mean_speed_and_unknown_before_the_first_unit() {
        let start = Instant::now().checked_sub(Duration::from_secs(30)).unwrap();
        let phase = Phase { start, first: 10, total: 40, last_line: start };
        assert_eq!([phase.left(9), phase.left(10)], ["", ""]);
        assert_eq!([phase.left(20), phase.left(40)], [", about 60 s left", ", about 0 s left"]);
    }
}
