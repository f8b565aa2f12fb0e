//! Pictures that the page has sent: files in a temporary folder, which is deleted at the end.

use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use petzval_base::write_whole;
use petzval_jobs::TemporaryFolder;
use serde_json::Value;

/// Most pictures that are kept; the oldest goes first.
const MOST: usize = 8;

/// What the name of such a picture begins with.
const PREFIX: &str = "upload:";

/// The key of a request that may name one.
const KEY: &str = "photo";

/// The pictures.
pub struct Uploads {
    folder: TemporaryFolder,
    kept: Mutex<VecDeque<(String, PathBuf)>>,
}

impl Uploads {
    /// None so far. What studios have left that were killed is removed.
    pub fn new() -> std::io::Result<Self> {
        TemporaryFolder::sweep_left();
        Ok(Self { folder: TemporaryFolder::new("studio")?, kept: Mutex::default() })
    }

    /// The folder, which only this user can read.
    pub fn folder(&self) -> &Path {
        self.folder.path()
    }

    /// Keeps the bytes of a picture; returns the name by which requests find it.
    pub fn keep(&self, bytes: &[u8]) -> std::io::Result<String> {
        let name = format!("{PREFIX}{:016x}", rand::random::<u64>());
        let path = self.folder.path().join(&name[PREFIX.len()..]);
        write_whole(&path, bytes)?;
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        while kept.len() >= MOST {
            if let Some((_, path)) = kept.pop_front() {
                let _gone = std::fs::remove_file(path);
            }
        }
        kept.push_back((name.clone(), path));
        Ok(name)
    }

    /// Puts the path of a picture in place of its name in a request.
    pub fn put_in(&self, request: &mut Value) {
        let Some(Value::String(name)) = request.get_mut(KEY) else { return };
        if !name.starts_with(PREFIX) {
            return;
        }
        let kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, path)) = kept.iter().find(|(known, _)| known == name) {
            *name = path.display().to_string();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_of_killed_studios_are_removed_and_those_of_this_one_are_not() {
        // No process has this number: it is above the largest that Linux gives.
        let ending = ".1073741824-0.part";
        let left = tempfile::Builder::new().prefix(".petzval-studio-").suffix(ending).tempdir().unwrap();
        std::fs::write(left.path().join("0123456789abcdef"), "a picture").unwrap();
        let uploads = Uploads::new().unwrap();
        assert!(!left.path().exists() && uploads.folder().is_dir());
        // Another studio finds whose the folder is by its name.
        let own = uploads.folder().to_string_lossy().into_owned();
        assert!(own.ends_with(&format!(".{}-0.part", std::process::id())), "{own}");
        uploads.keep(b"a picture").unwrap();
        drop(uploads);
        assert!(!Path::new(&own).exists());
    }
}
