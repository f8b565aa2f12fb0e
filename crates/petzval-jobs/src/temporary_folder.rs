//! Temporary folders. Where a process is killed, a later one removes its folders.

use std::fs::{File, OpenOptions};
use std::io;
use std::path::Path;

use petzval_base::sweep_parts_in;
use tempfile::TempDir;

/// A temporary folder, which only this user can read. It goes when this goes.
///
/// Where the process is killed, the folder is left. Its name is that of a part of this process ([`sweep_parts_in`]), so that a later process
/// removes it.
#[derive(Debug)]
pub struct TemporaryFolder {
    folder: TempDir,
    _lock: Option<File>,
}

impl TemporaryFolder {
    /// Makes a folder for `what`, a word of its name. Fails with the system's errors.
    pub fn new(what: &str) -> io::Result<Self> {
        let (start, ending) = (format!(".petzval-{what}-"), format!(".{}-0.part", std::process::id()));
        let folder = tempfile::Builder::new().prefix(&start).suffix(&ending).tempdir()?;
        // The lock protects the folder from processes that do not see this one. Not every system opens and locks folders.
        let lock = OpenOptions::new().read(true).open(folder.path());
        let lock = lock.ok().filter(|folder| folder.try_lock().is_ok());
        Ok(Self { folder, _lock: lock })
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        self.folder.path()
    }

    /// Removes the folders that killed processes have left.
    pub fn sweep_left() {
        sweep_parts_in(&std::env::temp_dir());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_of_killed_processes_are_swept_and_those_in_use_are_not() {
        // No process has this number: it is above the largest that Linux gives.
        let left =
            tempfile::Builder::new().prefix(".petzval-isp-").suffix(".1073741824-0.part").tempdir().unwrap();
        std::fs::write(left.path().join("frame.toml"), "x").unwrap();
        let used = TemporaryFolder::new("isp").unwrap();
        TemporaryFolder::sweep_left();
        assert!(!left.path().exists() && used.path().is_dir());
        let path = used.path().to_owned();
        drop(used);
        assert!(!path.exists());
    }
}
