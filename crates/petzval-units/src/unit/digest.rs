//! SHA-256 of files and folders by their content, each computed once while they do not change.

use std::collections::HashMap;
use std::fs::Metadata;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::SystemTime;

use petzval_design::run::hex;
use petzval_files::coco::content_digest;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

/// An input of a unit, as it was when the unit was made ready.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct InputDigest {
    /// The file or folder.
    #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
    pub path: PathBuf,
    /// SHA-256 of its content; of a folder that of the names and contents of all files in it.
    pub sha256: String,
}

/// Size and time of change of a file.
type Stamp = (u64, Option<SystemTime>);

/// Digests of files, remembered by path, size and time.
#[derive(Debug, Default)]
pub struct Digests {
    files: Mutex<HashMap<PathBuf, (Stamp, String)>>,
}

/// Folders below an input that are looked into.
const DEPTH: usize = 32;

impl Digests {
    /// The digest of a file or a folder. Fails with the system's errors.
    pub fn of(&self, path: &Path) -> io::Result<InputDigest> {
        let path = std::path::absolute(path)?;
        let sha256 = if path.is_dir() { self.folder(&path)? } else { self.file(&path)? };
        Ok(InputDigest { path, sha256 })
    }

    fn file(&self, path: &Path) -> io::Result<String> {
        let now = stamp(&std::fs::metadata(path)?);
        let known = |files: &HashMap<_, (Stamp, String)>| {
            files.get(path).filter(|(then, _)| *then == now).map(|(_, digest)| digest.clone())
        };
        // The map stays valid if a thread panics while it holds the lock.
        if let Some(digest) = known(&self.files.lock().unwrap_or_else(PoisonError::into_inner)) {
            return Ok(digest);
        }
        let digest = content_digest(path)?;
        let mut files = self.files.lock().unwrap_or_else(PoisonError::into_inner);
        files.insert(path.to_owned(), (now, digest.clone()));
        Ok(digest)
    }

    fn folder(&self, root: &Path) -> io::Result<String> {
        let mut files = Vec::new();
        collect(root, DEPTH, &mut files)?;
        files.sort();
        let mut hash = Sha256::new();
        for path in files {
            let below = path.strip_prefix(root).unwrap_or(&path);
            // Names hold no zero byte, and digests have one length.
            hash.update(below.as_os_str().as_encoded_bytes());
            hash.update([0]);
            hash.update(self.file(&path)?);
        }
        Ok(hex(hash))
    }
}

fn stamp(of: &Metadata) -> Stamp {
    (of.len(), of.modified().ok())
}

/// The files of a folder and of those in it.
fn collect(folder: &Path, depth: usize, found: &mut Vec<PathBuf>) -> io::Result<()> {
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        match std::fs::metadata(&path) {
            Ok(kind) if kind.is_dir() && depth > 0 => collect(&path, depth - 1, found)?,
            Ok(kind) if kind.is_file() => found.push(path),
            // Links to nothing and devices have no content.
            _ => {}
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_digest_is_that_of_the_content_and_changes_with_it() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::create_dir(at("in")).unwrap();
        std::fs::write(at("in/a"), "abc").unwrap();
        let digests = Digests::default();
        // The digest of FIPS 180-2, appendix B.1.
        let abc = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(digests.of(&at("in/a")).unwrap().sha256, abc);
        let one = digests.of(&at("in")).unwrap().sha256;
        std::fs::write(at("in/a"), "abcd").unwrap();
        let two = digests.of(&at("in")).unwrap().sha256;
        std::fs::rename(at("in/a"), at("in/b")).unwrap();
        let three = digests.of(&at("in")).unwrap().sha256;
        std::fs::rename(at("in"), at("moved")).unwrap();
        assert!(one != two && two != three);
        assert_eq!(digests.of(&at("moved")).unwrap().sha256, three);
        assert!(digests.of(&at("in/a")).is_err());
    }
}
