//! Ctrl-C, SIGTERM, and SIGUSR1 and SIGUSR2, which batch systems send before the end of a time limit, stop a job. So does SIGXCPU, which the
//! kernel sends at a limit of CPU time (`ulimit -S -t`).
//!
//! Jobs that can be continued end after the current step; a second Ctrl-C stops them at once. All others end at once, except that an
//! external ISP is stopped first, with its processes and its folder; a design stops it in the middle of a step.
//!
//! The other signals may be repeated. The kernel sends SIGXCPU every second from the limit on. A batch system sends them to the job's shell, which passes them on, and to the job; and again at the end of
//! the grace time, when the checkpoint may still be being written.

use std::time::Duration;

use crate::base::Cancel;
use crate::jobs::{Row, machine, row};
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGUSR1, SIGUSR2, SIGXCPU};
use signal_hook::iterator::Signals;

use crate::cli::failure::Failure;

/// Exit code of a job that was stopped at once, without a checkpoint.
const EXIT_AT_ONCE: i32 = 1;

/// How long a job may take to end by itself after a signal.
const GRACE: Duration = Duration::from_secs(1);

/// What a signal does to a job that keeps checkpoints.
const WITH_CHECKPOINT: &str = "stopping with a checkpoint";

/// A flag that the first signal sets, for jobs that write checkpoints.
pub fn stop_on_signal() -> Result<Cancel, Failure> {
    stop_saying(WITH_CHECKPOINT)
}

/// A flag that the first signal sets, for jobs of these names.
pub fn stop_jobs_on_signal<'j>(names: impl IntoIterator<Item = &'j str>) -> Result<Cancel, Failure> {
    stop_saying(stopping(names))
}

fn stop_saying(text: &'static str) -> Result<Cancel, Failure> {
    let without_one = if text == WITH_CHECKPOINT { ", without one" } else { "" };
    first_signal(move || noteln!("{text}; a second Ctrl-C stops at once{without_one}"))
}

/// What a signal does to jobs of these names, in words.
pub fn stopping<'j>(names: impl IntoIterator<Item = &'j str>) -> &'static str {
    let (with, without): (Vec<&str>, Vec<&str>) =
        names.into_iter().partition(|name| row(name).is_ok_and(Row::keeps_checkpoints));
    match (with.is_empty(), without.is_empty()) {
        (_, true) => WITH_CHECKPOINT,
        (true, false) => "stopping; the job keeps no checkpoint and begins again next time",
        (false, false) => "stopping; a job with checkpoints keeps one, any other begins again next time",
    }
}

/// The same, of which nothing is said.
pub fn stop_quietly() -> Result<Cancel, Failure> {
    first_signal(|| ())
}

/// A flag that the first signal sets, which does `then` as well. A second Ctrl-C ends the program.
fn first_signal(then: impl Fn() + Send + 'static) -> Result<Cancel, Failure> {
    let stop = Cancel::default();
    let mut signals = handled()?;
    let flag = stop.clone();
    std::thread::spawn(move || {
        for signal in signals.forever() {
            match (flag.set(), signal) {
                (false, _) => then(),
                (true, SIGINT) => std::process::exit(EXIT_AT_ONCE),
                (true, _) => {}
            }
        }
    });
    Ok(stop)
}

/// A flag that the first signal sets, for jobs without checkpoints. One that has not ended soon is ended.
pub fn end_on_signal() -> Result<Cancel, Failure> {
    end_within(GRACE)
}

/// The same for jobs that may take so long to end by themselves. A second Ctrl-C ends them at once.
pub fn end_within(grace: Duration) -> Result<Cancel, Failure> {
    first_signal(move || {
        std::thread::spawn(move || {
            std::thread::sleep(grace);
            noteln!("stopped by a signal; what is not finished is not written");
            std::process::exit(EXIT_AT_ONCE);
        });
    })
}

/// The signals that end a job. The loss of its terminal ends it as well, unless the job was started by `nohup`.
fn handled() -> Result<Signals, Failure> {
    let all = [SIGINT, SIGTERM, SIGHUP, SIGUSR1, SIGUSR2, SIGXCPU];
    let handled = all.into_iter().filter(|signal| *signal != SIGHUP || !machine::ignores_signal(*signal));
    Signals::new(handled).map_err(|e| Failure::job(format!("signal handlers: {e}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_checkpoint_is_promised_for_jobs_that_keep_one() {
        assert!(stopping(["design", "lens-optimize"]).ends_with("with a checkpoint"));
        assert!(stopping(["lens-tolerance"]).contains("no checkpoint"));
        assert!(stopping(["design", "lens-tolerance"]).contains("any other begins again"));
    }
}
