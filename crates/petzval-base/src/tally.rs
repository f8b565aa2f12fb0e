//! How much of parallel work is done, reported in ascending order.

use std::sync::{Mutex, PoisonError};

/// Counts units of work that end on several threads, and reports each count before the next one arises.
///
/// An atomic counter would give every unit a number of its own, too. But a thread may be held up between the counting and the report, and a
/// watcher would see 2 before 1.
#[derive(Debug, Default)]
pub struct Tally(Mutex<u64>);

impl Tally {
    /// Adds units and reports how many are done now. `report` runs on the calling thread while the others wait to count:
    /// it neither counts itself nor starts parallel work.
    pub fn add<T>(&self, units: u64, report: impl FnOnce(u64) -> T) -> T {
        // A watcher that panicked leaves the count as it was.
        let mut done = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        *done += units;
        report(*done)
    }
}

#[cfg(test)]
mod tests {
    use std::thread;

    use super::*;

    #[test]
    fn counts_of_four_threads_are_reported_in_ascending_order() {
        let (tally, seen) = (Tally::default(), Mutex::new(Vec::new()));
        thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(|| {
                    for _ in 0..500 {
                        tally.add(1, |done| {
                            thread::yield_now();
                            seen.lock().unwrap().push(done);
                        });
                    }
                });
            }
        });
        assert_eq!(seen.into_inner().unwrap(), (1..=2000).collect::<Vec<u64>>());
    }

    #[test]
    fn a_watcher_that_panics_stops_no_other() {
        let tally = Tally::default();
        let panicked = thread::scope(|scope| scope.spawn(|| tally.add(1, |_| panic!("watcher"))).join());
        assert!(panicked.is_err());
        assert_eq!(tally.add(2, |done| done), 3);
    }
}
