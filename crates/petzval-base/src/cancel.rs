//! How a job is stopped: a flag that long work looks at between its units.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// A flag that stops a job. Clones share it.
///
/// Work that takes more than a second looks at it between its units: pictures, frames, fields, lenses, steps. Inner
/// kernels do not.
#[derive(Clone, Debug, Default)]
pub struct Cancel(Arc<AtomicBool>);

/// The work was cancelled before its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("cancelled")]
pub struct Cancelled;

impl Cancel {
    /// Sets the flag. Returns whether it was set before.
    pub fn set(&self) -> bool {
        self.0.swap(true, Ordering::Relaxed)
    }

    /// Whether the flag is set.
    pub fn is_set(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }

    /// Fails if the flag is set, so that work between two units ends with `?`.
    pub fn check(&self) -> Result<(), Cancelled> {
        if self.is_set() { Err(Cancelled) } else { Ok(()) }
    }
}

impl From<Arc<AtomicBool>> for Cancel {
    fn from(flag: Arc<AtomicBool>) -> Self {
        Self(flag)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clones_share_the_flag_and_a_second_signal_is_known_as_one() {
        let cancel = Cancel::default();
        let work = cancel.clone();
        assert_eq!((work.check(), work.is_set()), (Ok(()), false));
        assert!(!cancel.set());
        assert_eq!((work.check(), work.is_set()), (Err(Cancelled), true));
        assert!(work.set());
        assert!(!Cancel::default().is_set());
    }
}
