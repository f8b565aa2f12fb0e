//! Values that are made before they are needed, on threads of their own.

use std::collections::{HashMap, HashSet, VecDeque};
use std::hash::Hash;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;

/// Makes values by their keys ahead. A key alone decides a value, so that nothing depends on what is ready when.
///
/// The threads end with it. A value that could not be made is made again by the one who needs it, who gets the error.
pub struct Ahead<K, V> {
    shared: Arc<Shared<K, V>>,
    threads: Vec<JoinHandle<()>>,
}

struct Shared<K, V> {
    state: Mutex<State<K, V>>,
    /// A key was added or done, or the threads shall end.
    changed: Condvar,
    /// Most values that are kept.
    most: usize,
}

struct State<K, V> {
    waiting: VecDeque<K>,
    in_work: HashSet<K>,
    made: HashMap<K, V>,
    /// The keys of what is made, oldest first.
    order: VecDeque<K>,
    is_over: bool,
}

impl<K, V> Shared<K, V> {
    /// A state stays whole if a thread panics while it holds the lock.
    fn locked(&self) -> MutexGuard<'_, State<K, V>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A key in work. It is out of work at the end, also if the thread panics: who waits for it then makes the value.
struct InWork<'a, K: Hash + Eq + Clone, V> {
    shared: &'a Shared<K, V>,
    key: K,
}

impl<K: Hash + Eq + Clone, V> Drop for InWork<'_, K, V> {
    fn drop(&mut self) {
        self.shared.locked().in_work.remove(&self.key);
        self.shared.changed.notify_all();
    }
}

impl<K: Hash + Eq + Clone + Send + 'static, V: Send + 'static> Ahead<K, V> {
    /// So many threads that make values by `make`, and keep at most so many of them. Fewer if the system has no more threads; then values
    /// are made when they are needed.
    pub fn new(threads: usize, most: usize, make: impl Fn(&K) -> Option<V> + Send + Sync + 'static) -> Self {
        let state = State {
            waiting: VecDeque::new(),
            in_work: HashSet::new(),
            made: HashMap::new(),
            order: VecDeque::new(),
            is_over: false,
        };
        let shared = Arc::new(Shared { state: Mutex::new(state), changed: Condvar::new(), most });
        let make = Arc::new(make);
        let thread = |number: usize| {
            let (shared, make) = (shared.clone(), make.clone());
            let named = std::thread::Builder::new().name(format!("reader {number}"));
            named.spawn(move || work(&shared, &*make)).ok()
        };
        let threads = (0..threads).map_while(thread).collect();
        Self { shared, threads }
    }

    /// Whether there are threads at all.
    pub fn is_at_work(&self) -> bool {
        !self.threads.is_empty()
    }

    /// Lets the values of keys be made, in this order. Keys that are known already are not made twice.
    pub fn want(&self, keys: impl IntoIterator<Item = K>) {
        if !self.is_at_work() {
            return;
        }
        let mut state = self.shared.locked();
        for key in keys {
            let is_known =
                state.made.contains_key(&key) || state.in_work.contains(&key) || state.waiting.contains(&key);
            if !is_known {
                state.waiting.push_back(key);
            }
        }
        // What waits longest is least likely to be needed.
        while state.waiting.len() > self.shared.most {
            state.waiting.pop_front();
        }
        drop(state);
        self.shared.changed.notify_all();
    }

    /// The value of a key, if it is made or in work, for which this waits. It is not kept any longer.
    pub fn take(&self, key: &K) -> Option<V> {
        let mut state = self.shared.locked();
        loop {
            if let Some(value) = state.made.remove(key) {
                state.order.retain(|other| other != key);
                return Some(value);
            }
            if !state.in_work.contains(key) {
                state.waiting.retain(|other| other != key);
                return None;
            }
            state = self.shared.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
    }
}

impl<K, V> Drop for Ahead<K, V> {
    fn drop(&mut self) {
        let mut state = self.shared.locked();
        state.is_over = true;
        state.waiting.clear();
        drop(state);
        self.shared.changed.notify_all();
        for thread in self.threads.drain(..) {
            // A thread that panicked has shown its message, and its value was made by another.
            let _ended = thread.join();
        }
    }
}

/// What a thread does until the end.
fn work<K: Hash + Eq + Clone, V>(shared: &Shared<K, V>, make: &(impl Fn(&K) -> Option<V> + ?Sized)) {
    loop {
        let mut state = shared.locked();
        let key = loop {
            if state.is_over {
                return;
            }
            match state.waiting.pop_front() {
                Some(key) => break key,
                None => state = shared.changed.wait(state).unwrap_or_else(PoisonError::into_inner),
            }
        };
        state.in_work.insert(key.clone());
        drop(state);
        let in_work = InWork { shared, key };
        if let Some(value) = make(&in_work.key) {
            let mut state = shared.locked();
            // Of a sequence that is no longer followed the oldest values go.
            while state.made.len() >= shared.most.max(1)
                && let Some(oldest) = state.order.pop_front()
            {
                state.made.remove(&oldest);
            }
            state.order.push_back(in_work.key.clone());
            state.made.insert(in_work.key.clone(), value);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::*;

    /// Whatever is ready when, each key gives its own value.
    #[test]
    fn values_are_those_of_their_keys_and_are_made_once() {
        let made = Arc::new(AtomicUsize::new(0));
        let counter = made.clone();
        let ahead = Ahead::new(3, 40, move |key: &u64| {
            counter.fetch_add(1, Ordering::Relaxed);
            (!key.is_multiple_of(7)).then_some(key * key)
        });
        for step in 0..100_u64 {
            ahead.want((step..step + 10).filter(|key| *key < 100));
            ahead.want(step..step + 1);
            // What is not begun yet, or cannot be made, is made by whoever needs it.
            if let Some(value) = ahead.take(&step) {
                assert!(value == step * step && !step.is_multiple_of(7));
            }
        }
        drop(ahead);
        // A key may be in demand again after it was taken or failed.
        assert!(made.load(Ordering::Relaxed) <= 200);
    }

    #[test]
    fn a_value_in_work_is_waited_for_and_a_panic_leaves_nobody_waiting() {
        let (send, receive) = std::sync::mpsc::channel::<()>();
        let (begun, has_begun) = std::sync::mpsc::channel::<()>();
        let receive = Mutex::new(receive);
        let ahead = Ahead::new(1, 4, move |key: &u64| {
            begun.send(()).unwrap();
            receive.lock().unwrap().recv().unwrap();
            assert!(*key < 5, "a key that panics, on purpose");
            Some(*key)
        });
        let ahead = Arc::new(ahead);
        for (key, wanted) in [(3, Some(3)), (5, None)] {
            ahead.want([key]);
            has_begun.recv().unwrap();
            let waiting = ahead.clone();
            let taken = std::thread::spawn(move || waiting.take(&key));
            send.send(()).unwrap();
            assert_eq!(taken.join().unwrap(), wanted);
        }
        // The only thread is gone: nothing is made ahead any more, and nobody waits.
        ahead.want([1]);
        assert_eq!(ahead.take(&1), None);
    }

    #[test]
    fn the_oldest_values_go_first_and_no_more_than_stated_are_kept() {
        let ahead = Ahead::new(1, 3, |key: &u64| Some(*key));
        for key in 0..6 {
            ahead.want([key]);
            // One after the other.
            while !ahead.shared.locked().made.contains_key(&key) {
                std::thread::yield_now();
            }
        }
        assert_eq!([0, 1, 2].map(|key| ahead.take(&key)), [None; 3]);
        assert_eq!([3, 4, 5].map(|key| ahead.take(&key)), [Some(3), Some(4), Some(5)]);
        let idle = Ahead::new(0, 3, |key: &u64| Some(*key));
        idle.want([1]);
        assert_eq!(idle.take(&1), None);
    }
}
