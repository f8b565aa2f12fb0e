//! Ctrl-C and SIGTERM ask a run to stop after the step at hand; a second one stops it at once.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::iterator::Signals;

use crate::cli::failure::Failure;

/// The job was cut off without a checkpoint: it failed.
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
            eprintln!("stopping after the step at hand, with a checkpoint (again: at once, without)");
        }
    });
    Ok(stop)
}
