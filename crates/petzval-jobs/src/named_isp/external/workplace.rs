//! The temporary folder in which a command works, and its guard.

use std::io;
use std::path::Path;
use std::sync::Mutex;

use super::guard::Guard;
use crate::temporary_folder::TemporaryFolder;

/// A folder that goes when this goes, or when this process dies. Fields are dropped in their order: the guard outlives the folder.
///
/// Where the guard is killed as well, as by the end of a batch job, the folder is left for [`TemporaryFolder::sweep_left`].
pub(crate) struct Workplace {
    folder: TemporaryFolder,
    guard: Mutex<Guard>,
}

impl Workplace {
    /// Makes the folder.
    pub fn new() -> io::Result<Self> {
        let folder = TemporaryFolder::new("isp")?;
        let guard = Mutex::new(Guard::of(folder.path())?);
        Ok(Self { folder, guard })
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
