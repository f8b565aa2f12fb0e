//! Ctrl-C, SIGTERM, and SIGUSR1 and SIGUSR2, which batch systems send before the end of a time limit, stop a job.
//!
//! Jobs that can be continued end after the current step; a second Ctrl-C stops them at once. All others end at once, except that an
//! external ISP is stopped first, with its processes and its folder; a design stops it in the middle of a step.
//!
//! The other signals may be repeated. A batch system sends them to the job's shell, which passes them on, and to the job; and again at the end of
//! the grace time, when the checkpoint may still be being written.

use std::time::Duration;

use crate::base::Cancel;
use crate::jobs::machine;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGUSR1, SIGUSR2};
use signal_hook::iterator::Signals;

use crate::cli::failure::Failure;

/// Exit code of a job that was stopped at once, without a checkpoint.
const EXIT_AT_ONCE: i32 = 1;

/// How long a job may take to end by itself after a signal.
const GRACE: Duration = Duration::from_secs(1);

/// A flag that the first signal sets, for jobs that write checkpoints.
pub fn stop_on_signal() -> Result<Cancel, Failure> {
    first_signal(|| {
        noteln!(
            "stopping after the current step, with a checkpoint; a second Ctrl-C stops at once, without one"
        );
    })
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
    let all = [SIGINT, SIGTERM, SIGHUP, SIGUSR1, SIGUSR2];
    let handled = all.into_iter().filter(|signal| *signal != SIGHUP || !machine::ignores_signal(*signal));
    Signals::new(handled).map_err(|e| Failure::job(format!("signal handlers: {e}")))
}
