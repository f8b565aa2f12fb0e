//! Output of a command while its job runs: warnings, notes, and a bar with the time left.

use std::collections::VecDeque;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use crate::jobs::{Event, TimeLeft, Watcher};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use super::plain;

/// Units of work between two plain lines if stderr is not a terminal.
const PLAIN_EVERY: u64 = 50;

/// Least time between two plain lines.
const PLAIN_APART: Duration = Duration::from_secs(2);

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

/// The time left follows the speed of the last so many units of work at least, and of the last so many seconds at least.
const RECENT_UNITS: u64 = 20;
const RECENT: Duration = Duration::from_secs(30);

/// Units of work that end within this time of each other are one point of the speed.
const POINT: Duration = Duration::from_millis(250);

/// Part of a job whose units of work are counted together.
struct Phase {
    total: u64,
    /// Times, and the units done then: the first, and those since the start of the recent past.
    points: VecDeque<(Instant, u64)>,
    /// Units done at the start.
    first: u64,
    /// When the last plain line was written.
    last_line: Instant,
}

impl Phase {
    fn new(now: Instant, done: u64, total: u64) -> Self {
        Self { total, points: VecDeque::from([(now, done)]), first: done, last_line: now }
    }

    /// Whether a report belongs to this phase. Another total, or fewer units than before, begin another one.
    fn goes_on(&self, done: u64, total: u64) -> bool {
        self.total == total && self.points.back().is_none_or(|(_, before)| done >= *before)
    }

    /// Whether a plain line is due once so many units are done.
    fn is_line_due(&self, now: Instant, done: u64) -> bool {
        let since_last = now.duration_since(self.last_line);
        let is_round = done.is_multiple_of(PLAIN_EVERY) && since_last >= PLAIN_APART;
        done > self.first && (is_round || since_last > PLAIN_AFTER)
    }

    /// Notes how many units are done.
    fn note(&mut self, now: Instant, done: u64) {
        let is_recent = |(time, _): &(Instant, u64)| now.duration_since(*time) < POINT;
        if self.points.len() > 1 && self.points.back().is_some_and(is_recent) {
            self.points.pop_back();
        }
        self.points.push_back((now, done));
        // The second point is the first one of the recent past once it is old enough.
        while let Some((time, units)) = self.points.get(1).copied()
            && now.duration_since(time) >= RECENT
            && done - units >= RECENT_UNITS
        {
            self.points.pop_front();
        }
    }

    /// How long the rest will take at the recent speed, where all units are alike: `, about 20 s left`; nothing before the first unit is done.
    fn left(&self) -> String {
        let (Some((start, before)), Some((now, done))) = (self.points.front(), self.points.back()) else {
            return String::new();
        };
        if done == before {
            return String::new();
        }
        let rest = self.total.saturating_sub(*done) as f64;
        let seconds = now.duration_since(*start).as_secs_f64() * rest / (done - before) as f64;
        format!(", about {seconds:.0} s left")
    }
}

/// The time that is left of a run: `, about 20 s left`.
fn left_in_words(left: &TimeLeft) -> String {
    let how = if left.is_least { "at least" } else { "about" };
    format!(", {how} {:.0} s left", left.seconds)
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

    /// Shows how many units of work are done, and what is done now. The job may know how long the rest takes: `left` in words.
    fn progress(&self, done: u64, total: u64, text: &str, left: Option<&str>) {
        let text = plain::message(text);
        // The numbers stay valid if a thread panics while it holds the lock.
        let mut phase = self.phase.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        let now = Instant::now();
        let phase = match &mut *phase {
            Some(phase) if phase.goes_on(done, total) => phase,
            _ => {
                *phase = Some(Phase::new(now, done, total));
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
        phase.note(now, done);
        if !self.is_plain {
            self.bar.set_message(text.clone());
            self.bar.set_position(done);
            self.bar.set_prefix(left.map_or_else(|| phase.left(), str::to_owned));
        } else if phase.is_line_due(now, done) {
            let left = left.map_or_else(|| phase.left(), str::to_owned);
            noteln!("{done}/{total}{left}: {text}");
            phase.last_line = now;
        }
    }
}

impl Watcher for Stderr {
    fn event(&self, event: &Event) {
        match event {
            Event::Warning { .. } | Event::Note { .. } | Event::Camera { .. } => {
                self.line(&event.to_string())
            }
            Event::Progress { done, total, text, .. } => self.progress(*done, *total, text, None),
            // Its steps are of many kinds: their mean says little.
            Event::Step { step, total, time_left, .. } => {
                let left = time_left.as_ref().map_or_else(String::new, left_in_words);
                self.progress(*step, *total, &event.to_string(), Some(&left));
            }
            Event::Scoring { done, total, time_left, .. } => {
                let left = time_left.as_ref().map(left_in_words);
                self.progress(*done, *total, &event.to_string(), left.as_deref());
            }
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

    /// A phase from a number of units on, and what it says after units that take so many seconds each.
    fn left_after(first: u64, total: u64, seconds: impl Iterator<Item = u64>) -> Vec<String> {
        let mut now = Instant::now();
        let mut phase = Phase::new(now, first, total);
        let mut said = vec![phase.left()];
        for (done, seconds) in (first + 1..).zip(seconds) {
            now += Duration::from_secs(seconds);
            phase.note(now, done);
            said.push(phase.left());
        }
        said
    }

    #[test]
    fn the_time_left_follows_the_recent_speed() {
        // A hundred slow units, then quick ones: the mean of all would still say 2.3 s a unit after forty of them.
        let said = left_after(0, 1000, [3; 100].into_iter().chain([1; 60]));
        assert_eq!(said[0], "", "unknown before the first unit");
        assert_eq!([&said[1], &said[100]], [", about 2997 s left", ", about 2700 s left"]);
        assert_eq!(said[140], ", about 860 s left");
    }

    #[test]
    fn units_that_a_restored_run_has_done_before_do_not_count() {
        let said = left_after(900, 1000, [2; 10].into_iter());
        assert_eq!(said[10], ", about 180 s left");
    }

    #[test]
    fn what_a_run_knows_of_the_time_left_is_said_as_it_is() {
        let left = |is_least| left_in_words(&TimeLeft { seconds: 71.6, is_least });
        assert_eq!([left(false), left(true)], [", about 72 s left", ", at least 72 s left"]);
    }

    #[test]
    fn long_units_are_averaged_over_a_number_of_them() {
        // Every tenth unit takes a minute: the time left includes such units as often as they come.
        let said = left_after(0, 400, (0..200).map(|unit| if unit % 10 == 9 { 60 } else { 1 }));
        assert_eq!(said[200], format!(", about {} s left", 200 / 10 * 69));
    }

    #[test]
    fn plain_lines_of_quick_units_are_some_time_apart() {
        // 20,000 pictures at 5,000 a second: the first fifty come too soon.
        let start = Instant::now();
        let mut phase = Phase::new(start, 0, 20_000);
        let mut lines = Vec::new();
        for done in 1..=20_000 {
            let now = start + Duration::from_micros(200) * done as u32;
            if phase.is_line_due(now, done) {
                lines.push(done);
                phase.last_line = now;
            }
        }
        assert_eq!(lines, [10_000, 20_000]);
        // Slow ones have a line after each fifty, and one when it has been quiet for long.
        let late = |seconds, done| phase.is_line_due(phase.last_line + Duration::from_secs(seconds), done);
        assert_eq!([late(3, 50), late(3, 51), late(16, 51)], [true, false, true]);
    }

    #[test]
    fn fewer_units_than_before_begin_another_phase() {
        let mut phase = Phase::new(Instant::now(), 0, 12);
        phase.note(Instant::now(), 12);
        assert!(phase.goes_on(12, 12) && !phase.goes_on(1, 12) && !phase.goes_on(12, 13));
    }
}
