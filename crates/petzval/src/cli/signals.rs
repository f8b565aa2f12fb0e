//! Ctrl-C and SIGTERM stop a run after the current step; a second signal stops it at once.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::iterator::Signals;

use crate::cli::failure::Failure;

/// Exit code of a job that was stopped at once, without a checkpoint.
const EXIT_AT_ONCE: i32 = 1;

/// A flag that the first signal sets.
pub fn stop_on_signal() -> Result<Arc<AtomicBool>, Failure> {
    let stop = Arc::new(AtomicBool::new(false));
    let mut signals =
        Signals::new([SIGINT, SIGTERM]).map_err(|e| Failure::job(format!("signal handlers: {e}")))?;
    let flag = stop.clone();
    std::thread::spawn(move || {
        for _ in signals.forever() {
            if flag.swap(true, Ordering::Relaxed) {
                std::process::exit(EXIT_AT_ONCE);
            }
            eprintln!(
                "stopping after the current step, with a checkpoint; a second signal stops at once, without one"
            );
        }
    });
    Ok(stop)
}
