//! Locks on folders in which one process at a time works.
//!
//! The lock is held on a file in the folder, and ends with the process, also on a file system that several machines share.

use std::fs::{self, File, TryLockError};
use std::io::{self, Read, Seek, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Further tries to take a lock, and the time between them.
const TRIES: usize = 5;
const BETWEEN_TRIES: Duration = Duration::from_millis(20);

/// A lock, in whose file the process at work has its name.
#[derive(Debug)]
pub struct WorkLock {
    file: File,
    path: PathBuf,
    end: End,
}

/// What becomes of the file when the lock is dropped.
#[derive(Debug)]
enum End {
    /// It has these bytes again.
    Restored(Vec<u8>),
    /// It is removed.
    Removed,
}

impl WorkLock {
    /// Locks a file, which need not exist, and writes `holder` into it. Dropped, the file is what it was before: work that is refused stays as
    /// it is.
    ///
    /// Fails with `WouldBlock` if another process holds the lock, and with the system's errors.
    pub fn kept(path: &Path, holder: &[u8]) -> Result<Self, TryLockError> {
        let mut lock = Self::taken(path)?;
        let before = lock.contents().map_err(TryLockError::Error)?;
        lock.end = End::Restored(before);
        lock.write(holder).map_err(TryLockError::Error)?;
        Ok(lock)
    }

    /// The same with a file that goes with the lock.
    pub fn passing(path: &Path, holder: &[u8]) -> Result<Self, TryLockError> {
        let mut lock = Self::taken(path)?;
        lock.write(holder).map_err(TryLockError::Error)?;
        Ok(lock)
    }

    /// Takes the lock. Whoever looks whether a process is at work holds a shared one for a moment: a held lock is tried again.
    fn taken(path: &Path) -> Result<Self, TryLockError> {
        let mut taken = Self::tried(path);
        for _ in 0..TRIES {
            if !matches!(taken, Err(TryLockError::WouldBlock)) {
                break;
            }
            std::thread::sleep(BETWEEN_TRIES);
            taken = Self::tried(path);
        }
        taken
    }

    fn tried(path: &Path) -> Result<Self, TryLockError> {
        // The process that holds the lock has written its name into the file: it is not truncated before the lock is held.
        let mut options = fs::OpenOptions::new();
        options.read(true).write(true).create(true).truncate(false);
        let file = options.open(path).map_err(TryLockError::Error)?;
        file.try_lock()?;
        // A process that has ended has taken the file away: its lock keeps nobody out.
        if !is_at(&file, path) {
            return Err(TryLockError::WouldBlock);
        }
        Ok(Self { file, path: path.to_owned(), end: End::Removed })
    }

    /// What the file holds now, and no more.
    fn contents(&mut self) -> io::Result<Vec<u8>> {
        let mut contents = Vec::new();
        let length = self.file.metadata()?.len();
        (&mut self.file).take(length).read_to_end(&mut contents)?;
        Ok(contents)
    }

    fn write(&mut self, contents: &[u8]) -> io::Result<()> {
        self.file.rewind()?;
        self.file.set_len(0)?;
        self.file.write_all(contents)
    }
}

impl Drop for WorkLock {
    fn drop(&mut self) {
        // A name or a file that stays does no harm: only a lock that is held counts.
        let _stays = match std::mem::replace(&mut self.end, End::Removed) {
            End::Restored(before) => self.write(&before),
            // Where the file was taken away, another process may have made its own.
            End::Removed if is_at(&self.file, &self.path) => fs::remove_file(&self.path),
            End::Removed => Ok(()),
        };
        // Closing would not do: a program that is just being started holds a copy of the open file.
        let _ends_with_the_process = self.file.unlock();
    }
}

/// Whether an open file is still the one of this path.
#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;

    let place = |found: io::Result<fs::Metadata>| found.ok().map(|found| (found.dev(), found.ino()));
    place(file.metadata()).is_some_and(|own| place(fs::metadata(path)) == Some(own))
}

/// Whether a file of this path is there: others that are open under the same name cannot be told apart here.
#[cfg(not(unix))]
fn is_at(_: &File, path: &Path) -> bool {
    path.exists()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_at_a_time_holds_a_lock_and_the_file_is_then_as_before() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("work.lock");
        fs::write(&path, "before").unwrap();
        let kept = WorkLock::kept(&path, b"me").unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "me");
        assert!(matches!(WorkLock::kept(&path, b"you"), Err(TryLockError::WouldBlock)));
        assert!(matches!(WorkLock::passing(&path, b"you"), Err(TryLockError::WouldBlock)));
        assert_eq!(fs::read_to_string(&path).unwrap(), "me");
        drop(kept);
        assert_eq!(fs::read_to_string(&path).unwrap(), "before");

        // A lock that a killed process has left keeps nobody out.
        let passing = WorkLock::passing(&path, b"you").unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "you");
        assert!(matches!(WorkLock::passing(&path, b"me"), Err(TryLockError::WouldBlock)));
        drop(passing);
        assert!(!path.exists());
        assert!(matches!(
            WorkLock::passing(&folder.path().join("none/work.lock"), b""),
            Err(TryLockError::Error(_))
        ));
    }

    #[cfg(unix)]
    #[test]
    fn a_file_that_was_taken_away_and_made_anew_is_another() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("work.lock");
        let file = File::create(&path).unwrap();
        assert!(is_at(&file, &path));
        fs::remove_file(&path).unwrap();
        assert!(!is_at(&file, &path));
        let other = File::create(&path).unwrap();
        assert!(!is_at(&file, &path) && is_at(&other, &path));
    }
}
