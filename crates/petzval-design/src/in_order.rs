//! Independent items on all threads, folded in their order.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

/// The fold so far, and the items that wait for earlier ones.
struct Folded<T, A, E> {
    sum: A,
    /// Items folded so far.
    count: usize,
    waiting: BTreeMap<usize, Result<T, E>>,
    failed: Option<E>,
}

/// `fold(... fold(fold(start, make(0)), make(1)) ..., make(count - 1))`. The calls of `make` run on all threads of the pool at once, those of
/// `fold` one at a time and in order, so that sums have the same bits on any number of threads.
///
/// A thread makes one item after the other, and never begins a second one while the first waits for another thread: at most as many items
/// are in work as there are threads. Parallel loops inside `make` run on threads that have no item of their own. Fails with the error of
/// the first item that fails, by its number; later items that are not begun by then are not made.
///
/// It returns when every thread of the pool has come by: other work that blocks a thread of the same pool delays it.
pub fn in_order<T: Send, A: Send, E: Send>(
    count: usize,
    start: A,
    make: impl Fn(usize) -> Result<T, E> + Sync,
    fold: impl Fn(A, T) -> A + Sync,
) -> Result<A, E> {
    let next = AtomicUsize::new(0);
    let folded = Folded { sum: Some(start), count: 0, waiting: BTreeMap::new(), failed: None };
    let folded = Mutex::new(folded);
    // A broadcast gives every thread this loop once. Tasks of a scope could be taken up inside the parallel loops of each other.
    rayon::broadcast(|_| {
        loop {
            let item = next.fetch_add(1, Ordering::Relaxed);
            if item >= count {
                return;
            }
            let made = make(item);
            let mut folded = folded.lock().unwrap_or_else(PoisonError::into_inner);
            if made.is_err() {
                next.store(count, Ordering::Relaxed);
            }
            folded.waiting.insert(item, made);
            folded.fold_ready(&fold);
        }
    });
    let Folded { sum, failed, .. } = folded.into_inner().unwrap_or_else(PoisonError::into_inner);
    match (failed, sum) {
        (Some(error), _) => Err(error),
        (None, Some(sum)) => Ok(sum),
        (None, None) => unreachable!("the sum is put back after each fold"),
    }
}

impl<T, A, E> Folded<T, Option<A>, E> {
    /// Folds the items whose predecessors are folded.
    fn fold_ready(&mut self, fold: &impl Fn(A, T) -> A) {
        while self.failed.is_none()
            && let Some(made) = self.waiting.remove(&self.count)
        {
            match made {
                Ok(made) => self.sum = self.sum.take().map(|sum| fold(sum, made)),
                Err(error) => self.failed = Some(error),
            }
            self.count += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use rayon::prelude::*;

    use super::*;

    fn on_threads<R: Send>(threads: usize, work: impl FnOnce() -> R + Send) -> R {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(work)
    }

    #[test]
    fn sums_have_the_same_bits_on_any_number_of_threads() {
        // Terms whose sum depends on their order.
        let term = |i: usize| (i as f32 * 0.7).sin() * 10f32.powi(i as i32 % 7);
        let expected = (0..100).map(term).fold(0.0, |sum, v| sum + v);
        for threads in [1, 2, 3, 8] {
            let sum = on_threads(threads, || {
                // Early items take longer, and have parallel loops of their own.
                let make = |i: usize| {
                    let work: u64 = (0..(100 - i as u64) * 200).into_par_iter().map(|k| k % 3).sum();
                    std::hint::black_box(work);
                    Ok::<f32, ()>(term(i))
                };
                in_order(100, 0.0_f32, make, |sum, v| sum + v)
            });
            assert_eq!(sum, Ok(expected), "{threads} threads");
        }
        assert_eq!(in_order(0, 5, |_| Ok::<_, ()>(1), |a, b| a + b), Ok(5));
    }

    #[test]
    fn no_thread_begins_an_item_inside_another() {
        on_threads(3, || {
            let busy: Vec<AtomicUsize> = (0..3).map(|_| AtomicUsize::new(0)).collect();
            let make = |_| {
                let own = &busy[rayon::current_thread_index().unwrap()];
                let others = own.fetch_add(1, Ordering::SeqCst);
                let sum: usize = (0..20_000_usize).into_par_iter().map(|k| std::hint::black_box(k) % 5).sum();
                std::hint::black_box(sum);
                own.fetch_sub(1, Ordering::SeqCst);
                if others == 0 { Ok(()) } else { Err(others) }
            };
            assert_eq!(in_order(60, (), make, |(), ()| ()), Ok(()));
        });
    }

    #[test]
    fn the_first_item_that_fails_decides() {
        for threads in [1, 2, 8] {
            let folded = AtomicUsize::new(0);
            let found = on_threads(threads, || {
                let make = |i: usize| if i < 7 { Ok(i) } else { Err(i) };
                in_order(40, 0, make, |sum, i| {
                    folded.fetch_add(1, Ordering::SeqCst);
                    sum + i
                })
            });
            assert_eq!((found, folded.into_inner()), (Err(7), 7), "{threads} threads");
        }
    }
}
