//! The temporary folder in which a command works, and its guard.

use std::fs::{File, OpenOptions};
use std::io;
use std::path::Path;
use std::sync::Mutex;

use petzval_base::sweep_parts_in;
use tempfile::TempDir;

use super::guard::Guard;

/// A folder that goes when this goes, or when this process dies. Fields are dropped in their order: the guard outlives the folder.
///
/// Where the guard is killed as well, as by the end of a batch job, the folder is left. Its name is that of a part of this process
/// ([`sweep_parts_in`]), so that a later process removes it.
pub(crate) struct Workplace {
    folder: TempDir,
    _lock: Option<File>,
    guard: Mutex<Guard>,
}

/// Removes the folders that processes have left which were killed together with their guards.
pub(super) fn sweep_left() {
    sweep_parts_in(&std::env::temp_dir());
}

impl Workplace {
    /// Makes the folder.
    pub fn new() -> io::Result<Self> {
        let ending = format!(".{}-0.part", std::process::id());
        let folder = tempfile::Builder::new().prefix(".petzval-isp-").suffix(&ending).tempdir()?;
        // The lock protects the folder from processes that do not see this one. Not every system opens and locks folders.
        let lock = OpenOptions::new().read(true).open(folder.path());
        let lock = lock.ok().filter(|folder| folder.try_lock().is_ok());
        let guard = Mutex::new(Guard::of(folder.path())?);
        Ok(Self { folder, _lock: lock, guard })
    }

    /// The folder.
    pub fn folder(&self) -> &Path {
        self.folder.path()
    }

    /// Says which group of processes works in the folder.
    pub fn begins(&self, group: u32) -> io::Result<()> {
        self.guard.lock().unwrap_or_else(|poisoned| poisoned.into_inner()).watch(group)
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
        let used = Workplace::new().unwrap();
        sweep_left();
        assert!(!left.path().exists() && used.folder().is_dir());
        let path = used.folder().to_owned();
        drop(used);
        assert!(!path.exists());
    }
}
