//! How much of parallel work is done, told in ascending order.

use std::sync::{Mutex, PoisonError};

/// Counts units of work that end on several threads, and tells each count before the next one arises.
///
/// An atomic counter would give every unit a number of its own, too, but a thread could be held up between counting and telling: a
/// watcher would see 2 before 1.
#[derive(Debug, Default)]
pub struct Tally(Mutex<u64>);

impl Tally {
    /// Adds units and tells how many are done now. `tell` runs on the calling thread, while the others wait to count:
    /// it neither counts itself nor starts parallel work.
    pub fn add<T>(&self, units: u64, tell: impl FnOnce(u64) -> T) -> T {
        // A watcher that panicked leaves the count as it was.
        let mut done = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        *done += units;
        tell(*done)
    }
}

#[cfg(test)]
mod tests {
    use std::thread;

    use super::*;

    #[test]
    fn counts_of_four_threads_are_told_in_ascending_order() {
        let (tally, told) = (Tally::default(), Mutex::new(Vec::new()));
        thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(|| {
                    for _ in 0..500 {
                        tally.add(1, |done| {
                            thread::yield_now();
                            told.lock().unwrap().push(done);
                        });
                    }
                });
            }
        });
        assert_eq!(told.into_inner().unwrap(), (1..=2000).collect::<Vec<u64>>());
    }

    #[test]
    fn a_watcher_that_panics_stops_no_other() {
        let tally = Tally::default();
        let panicked = thread::scope(|scope| scope.spawn(|| tally.add(1, |_| panic!("watcher"))).join());
        assert!(panicked.is_err());
        assert_eq!(tally.add(2, |done| done), 3);
    }
}
