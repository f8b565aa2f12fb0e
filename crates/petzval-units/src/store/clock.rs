//! Time that never jumps: how long something has been seen unchanged, on this machine alone.

use std::time::{Duration, Instant};

/// A clock of one process. Times of two machines are never compared.
pub trait Clock: Send + Sync {
    /// Time since some moment. It never goes back, whatever the time of day does.
    fn now(&self) -> Duration;

    /// Waits.
    fn wait(&self, time: Duration);
}

/// The clock of the system.
#[derive(Clone, Copy, Debug)]
pub struct SystemClock {
    start: Instant,
}

impl Default for SystemClock {
    fn default() -> Self {
        Self { start: Instant::now() }
    }
}

impl Clock for SystemClock {
    fn now(&self) -> Duration {
        self.start.elapsed()
    }

    fn wait(&self, time: Duration) {
        std::thread::sleep(time);
    }
}
