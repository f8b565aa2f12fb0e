//! Digests of pictures from their first read in a run.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

use petzval_files::hex_digest;

use super::DatasetError;

/// SHA-256 of the pictures of a run by name, each from its first read. A later read must find the same content.
#[derive(Debug, Default)]
pub struct FirstReads {
    seen: Mutex<Seen>,
}

#[derive(Debug, Default)]
struct Seen {
    /// From earlier parts of the run, and from this one.
    known: HashMap<String, String>,
    /// Names that were compared in this part of the run.
    compared: HashSet<String>,
    /// Those that nobody has taken yet.
    fresh: BTreeMap<String, String>,
}

impl FirstReads {
    /// Notes the content of a picture that was read. Fails if it is not that of the first read.
    pub fn note(&self, name: &str, path: impl FnOnce() -> PathBuf, bytes: &[u8]) -> Result<(), DatasetError> {
        if self.locked(|seen| seen.compared.contains(name)) {
            return Ok(());
        }
        let digest = hex_digest(bytes);
        let is_changed = self.locked(|seen| {
            seen.compared.insert(name.to_owned());
            match seen.known.get(name) {
                Some(known) => *known != digest,
                None => {
                    seen.fresh.insert(name.to_owned(), digest.clone());
                    seen.known.insert(name.to_owned(), digest);
                    false
                }
            }
        });
        if is_changed {
            // The next read compares again: a picture that was put back is good.
            self.locked(|seen| seen.compared.remove(name));
            return Err(DatasetError::Changed { path: path(), name: name.to_owned() });
        }
        Ok(())
    }

    /// What earlier parts of the run read.
    pub fn expect(&self, known: impl IntoIterator<Item = (String, String)>) {
        self.locked(|seen| seen.known.extend(known));
    }

    /// Names and digests that were not taken before, by name.
    pub fn take_fresh(&self) -> BTreeMap<String, String> {
        self.locked(|seen| std::mem::take(&mut seen.fresh))
    }

    fn locked<R>(&self, work: impl FnOnce(&mut Seen) -> R) -> R {
        work(&mut self.seen.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_has_the_content_of_its_first_read() {
        let note = |reads: &FirstReads, name: &str, bytes: &[u8]| reads.note(name, || name.into(), bytes);
        let first = FirstReads::default();
        note(&first, "b", &[2]).unwrap();
        note(&first, "a", &[1]).unwrap();
        let known = first.take_fresh();
        assert_eq!(known.keys().collect::<Vec<_>>(), ["a", "b"]);
        assert!(first.take_fresh().is_empty());
        let later = FirstReads::default();
        later.expect(known);
        note(&later, "a", &[1]).unwrap();
        let error = note(&later, "b", &[3]).unwrap_err().to_string();
        assert!(error.contains("b: ") && error.contains("put it back"), "{error}");
        // Put back it is good.
        note(&later, "b", &[2]).unwrap();
        note(&later, "c", &[3]).unwrap();
        assert_eq!(
            later.take_fresh().into_keys().collect::<Vec<_>>(),
            ["c"],
            "the known ones are kept already"
        );
    }
}
