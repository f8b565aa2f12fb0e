//! Pictures that the page has sent: files in a temporary folder, which is deleted at the end.

use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use petzval_base::write_whole;
use serde_json::Value;
use tempfile::TempDir;

/// Most pictures that are kept; the oldest goes first.
const MOST: usize = 8;

/// What the name of such a picture begins with.
const PREFIX: &str = "upload:";

/// The key of a request that may name one.
const KEY: &str = "photo";

/// The pictures.
pub struct Uploads {
    folder: TempDir,
    kept: Mutex<VecDeque<(String, PathBuf)>>,
}

impl Uploads {
    /// None so far.
    pub fn new() -> std::io::Result<Self> {
        Ok(Self {
            folder: tempfile::Builder::new().prefix("petzval-studio-").tempdir()?,
            kept: Mutex::default(),
        })
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
