//! What jobs keep from call to call, for surroundings that make many calls of one kind: decoded pictures, cameras with their PSFs.
//!
//! It changes no result: what is kept is what would be computed again.

use std::any::Any;
use std::collections::VecDeque;
use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};

/// Most things that are kept; the one that was used longest ago goes first.
const MOST: usize = 12;

type Thing = Arc<dyn Any + Send + Sync>;

/// Things by the text of what they were made from, the last used one at the end.
#[derive(Clone, Default)]
pub(crate) struct Kept {
    things: Arc<Mutex<VecDeque<(String, Thing)>>>,
}

impl fmt::Debug for Kept {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Kept")
    }
}

impl Kept {
    /// The thing of a key, made if it is not there. Two callers that need it at one time may both make it.
    pub fn get_or<T: Any + Send + Sync, E>(
        &self,
        key: &str,
        make: impl FnOnce() -> Result<T, E>,
    ) -> Result<Arc<T>, E> {
        if let Some(found) = self.find(key) {
            return Ok(found);
        }
        let made = Arc::new(make()?);
        let thing: Thing = made.clone();
        let mut things = self.things.lock().unwrap_or_else(PoisonError::into_inner);
        things.retain(|(known, _)| known != key);
        while things.len() >= MOST {
            things.pop_front();
        }
        things.push_back((key.to_owned(), thing));
        Ok(made)
    }

    fn find<T: Any + Send + Sync>(&self, key: &str) -> Option<Arc<T>> {
        let mut things = self.things.lock().unwrap_or_else(PoisonError::into_inner);
        let at = things.iter().position(|(known, _)| known == key)?;
        let (key, thing) = things.remove(at)?;
        things.push_back((key, thing.clone()));
        thing.downcast().ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thing_is_made_once_and_the_oldest_goes_first() {
        let kept = Kept::default();
        let made = |key: &str| *kept.get_or(key, || Ok::<_, ()>(key.len())).unwrap();
        let is_kept = |key: &str| kept.get_or(key, || Err::<usize, ()>(())).is_ok();
        assert_eq!((made("a"), made("bb")), (1, 2));
        assert!(is_kept("a"));
        (0..MOST - 1).for_each(|i| assert_eq!(made(&format!("{i:03}")), 3));
        // "a" was used after "bb".
        assert!(is_kept("a") && !is_kept("bb"));
        assert!(kept.get_or("fails", || Err::<usize, _>("why")).is_err() && !is_kept("fails"));
    }
}
