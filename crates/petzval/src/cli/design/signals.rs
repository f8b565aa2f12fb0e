//! Ctrl-C and SIGTERM ask a run to stop after the step at hand; a second one stops it at once.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;

use crate::cli::Failure;

/// The job was cut off without a checkpoint: it failed.
const EXIT_AT_ONCE: i32 = 1;

/// A flag that the first signal sets.
pub fn stop_on_signal() -> Result<Arc<AtomicBool>, Failure> {
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM] {
        // Order matters: a second signal finds the flag set and ends the process.
        flag::register_conditional_shutdown(signal, EXIT_AT_ONCE, stop.clone())
            .and_then(|_| flag::register(signal, stop.clone()))
            .map_err(|e| Failure::job(format!("signal handlers: {e}")))?;
    }
    Ok(stop)
}
