//! Decoded pictures that are kept within a stated memory.

use std::collections::{BTreeMap, HashMap};
use std::sync::{Arc, Mutex, PoisonError};

/// Values by name that take so many bytes together at most. The one that was used least recently goes first.
///
/// What it keeps decides how long things take, never what they are.
#[derive(Debug)]
pub struct Shelf<V> {
    most_bytes: u64,
    kept: Mutex<Kept<V>>,
}

#[derive(Debug)]
struct Kept<V> {
    by_name: HashMap<String, (Arc<V>, u64)>,
    /// Names by the time of their last use.
    by_use: BTreeMap<u64, String>,
    bytes: u64,
    /// Counts uses.
    clock: u64,
}

/// What takes memory.
pub trait TakesBytes {
    /// Bytes of its numbers.
    fn bytes(&self) -> u64;
}

impl TakesBytes for petzval_camera::image::LinearImage {
    fn bytes(&self) -> u64 {
        size_of_val(self.data.as_slice()) as u64
    }
}

impl<V: TakesBytes> Shelf<V> {
    /// An empty shelf.
    pub fn new(most_bytes: u64) -> Self {
        let kept = Kept { by_name: HashMap::new(), by_use: BTreeMap::new(), bytes: 0, clock: 0 };
        Self { most_bytes, kept: Mutex::new(kept) }
    }

    /// The value of a name: the kept one, or the one that `make` makes, which is kept. No lock is held meanwhile: two threads may make the same
    /// value at once.
    pub fn get<E>(&self, name: &str, make: impl FnOnce() -> Result<V, E>) -> Result<Arc<V>, E> {
        let kept = self.locked(|kept| kept.used(name));
        match kept {
            Some(value) => Ok(value),
            None => {
                let value = Arc::new(make()?);
                self.put(name, value.clone());
                Ok(value)
            }
        }
    }

    /// Keeps a value. One that is larger than the whole shelf is not kept.
    pub fn put(&self, name: &str, value: Arc<V>) {
        let bytes = value.bytes();
        if bytes > self.most_bytes {
            return;
        }
        self.locked(|kept| {
            kept.take_out(name);
            while kept.bytes + bytes > self.most_bytes
                && let Some((_, oldest)) = kept.by_use.pop_first()
            {
                kept.take_out(&oldest);
            }
            kept.clock += 1;
            kept.bytes += bytes;
            kept.by_use.insert(kept.clock, name.to_owned());
            kept.by_name.insert(name.to_owned(), (value, kept.clock));
        });
    }

    /// Forgets everything.
    pub fn clear(&self) {
        self.locked(|kept| {
            kept.by_name.clear();
            kept.by_use.clear();
            kept.bytes = 0;
        });
    }

    /// Bytes that it may keep.
    pub fn most_bytes(&self) -> u64 {
        self.most_bytes
    }

    /// Bytes of what is kept.
    pub fn bytes(&self) -> u64 {
        self.locked(|kept| kept.bytes)
    }

    /// Values stay whole if a thread panics while it holds the lock.
    fn locked<R>(&self, work: impl FnOnce(&mut Kept<V>) -> R) -> R {
        work(&mut self.kept.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl<V: TakesBytes> Kept<V> {
    fn used(&mut self, name: &str) -> Option<Arc<V>> {
        let (value, used) = self.by_name.get_mut(name)?;
        self.clock += 1;
        if let Some(name) = self.by_use.remove(used) {
            self.by_use.insert(self.clock, name);
        }
        *used = self.clock;
        Some(value.clone())
    }

    fn take_out(&mut self, name: &str) {
        if let Some((value, used)) = self.by_name.remove(name) {
            self.by_use.remove(&used);
            self.bytes -= value.bytes();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Block(u64);

    impl TakesBytes for Block {
        fn bytes(&self) -> u64 {
            self.0
        }
    }

    #[test]
    fn the_least_recently_used_value_goes_first() {
        let shelf = Shelf::new(10);
        let made = |name: &str, bytes: u64| {
            let mut is_made = false;
            let value = shelf.get(name, || -> Result<Block, ()> {
                is_made = true;
                Ok(Block(bytes))
            });
            assert_eq!(value.unwrap().0, bytes);
            is_made
        };
        assert!(made("a", 4) && made("b", 4) && !made("a", 4));
        // There is no room for three: `b` was used longer ago.
        assert!(made("c", 4) && !made("a", 4) && made("b", 4) && made("c", 4));
        assert_eq!(shelf.bytes(), 8);
        // Larger than the shelf: made each time, and nothing goes for it.
        assert!(made("d", 11) && made("d", 11) && !made("c", 4));
        assert!(shelf.get("e", || Err::<Block, _>("broken")).is_err_and(|error| error == "broken"));
        // A new value in place of an old one counts once.
        shelf.put("c", Arc::new(Block(9)));
        assert_eq!(shelf.bytes(), 9);
        shelf.clear();
        assert_eq!(shelf.bytes(), 0);
        assert!(made("c", 4));
    }
}
