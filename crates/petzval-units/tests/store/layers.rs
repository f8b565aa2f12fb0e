//! Stand-ins for file systems: one that shows changes late and lists in any order, and one that fails.

use std::collections::{BTreeMap, BTreeSet};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use petzval_units::store::{Clock, Disk, FileLayer};

/// A clock that stands still until somebody waits.
#[derive(Default)]
pub struct Simulated(AtomicU64);

impl Clock for Simulated {
    fn now(&self) -> Duration {
        Duration::from_millis(self.0.load(Ordering::Relaxed))
    }

    fn wait(&self, time: Duration) {
        self.0.fetch_add(time.as_millis() as u64, Ordering::Relaxed);
    }
}

/// How long a change takes to become visible to others.
const LATE: Duration = Duration::from_secs(5);

/// A content that a path had from some time on; none if it was removed.
struct Version {
    at: Duration,
    by: usize,
    bytes: Option<Vec<u8>>,
}

/// What a file server holds: every file with its history.
#[derive(Default)]
pub struct Server {
    files: Mutex<BTreeMap<PathBuf, Vec<Version>>>,
}

/// The view of one machine on a server: its own changes at once, those of others 5 s later. Only the exclusive making of a file, and whether a
/// folder may have a new name, are decided by the server.
pub struct Late {
    pub server: Arc<Server>,
    pub clock: Arc<Simulated>,
    pub machine: usize,
}

impl Late {
    fn visible(&self, versions: &[Version]) -> Option<Vec<u8>> {
        let now = self.clock.now();
        let is_seen = |v: &&Version| v.by == self.machine || v.at + LATE <= now;
        versions.iter().rev().find(is_seen)?.bytes.clone()
    }

    fn change(&self, path: &Path, bytes: Option<Vec<u8>>) {
        let version = Version { at: self.clock.now(), by: self.machine, bytes };
        self.server.files.lock().unwrap().entry(path.to_owned()).or_default().push(version);
    }

    /// The files below a folder as the server has them.
    fn below(&self, folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
        let files = self.server.files.lock().unwrap();
        let there = files.iter().filter(|(path, _)| path.starts_with(folder));
        there.filter_map(|(path, versions)| Some((path.clone(), versions.last()?.bytes.clone()?))).collect()
    }
}

impl FileLayer for Late {
    fn read(&self, path: &Path) -> io::Result<Vec<u8>> {
        let files = self.server.files.lock().unwrap();
        let seen = files.get(path).and_then(|versions| self.visible(versions));
        seen.ok_or_else(|| ErrorKind::NotFound.into())
    }

    fn is_folder(&self, path: &Path) -> bool {
        let files = self.server.files.lock().unwrap();
        files.iter().any(|(file, versions)| {
            file != path && file.starts_with(path) && self.visible(versions).is_some()
        })
    }

    fn create(&self, path: &Path, bytes: &[u8]) -> io::Result<bool> {
        let is_there = (self.server.files.lock().unwrap())
            .get(path)
            .is_some_and(|versions| versions.last().is_some_and(|last| last.bytes.is_some()));
        if !is_there {
            self.change(path, Some(bytes.to_vec()));
        }
        Ok(!is_there)
    }

    fn publish(&self, path: &Path, bytes: &[u8]) -> io::Result<bool> {
        self.create(path, bytes)
    }

    fn replace(&self, path: &Path, bytes: &[u8]) -> io::Result<()> {
        self.change(path, Some(bytes.to_vec()));
        Ok(())
    }

    fn append(&self, path: &Path, bytes: &[u8]) -> io::Result<()> {
        let mut all = self.read(path).unwrap_or_default();
        all.extend_from_slice(bytes);
        self.replace(path, &all)
    }

    fn make_folder(&self, _: &Path) -> io::Result<()> {
        Ok(())
    }

    /// From the last name to the first, every other one first.
    fn list(&self, path: &Path) -> io::Result<Vec<String>> {
        let files = self.server.files.lock().unwrap();
        let seen = files.iter().filter(|(_, versions)| self.visible(versions).is_some());
        let names: BTreeSet<String> = seen
            .filter_map(|(file, _)| file.strip_prefix(path).ok()?.components().next())
            .map(|name| name.as_os_str().to_string_lossy().into_owned())
            .collect();
        let backward: Vec<String> = names.into_iter().rev().collect();
        let (even, odd): (Vec<_>, Vec<_>) = backward.into_iter().enumerate().partition(|(i, _)| i % 2 == 0);
        Ok(odd.into_iter().chain(even).map(|(_, name)| name).collect())
    }

    fn rename_folder(&self, from: &Path, to: &Path) -> io::Result<()> {
        if !self.below(to).is_empty() {
            return Err(ErrorKind::DirectoryNotEmpty.into());
        }
        self.copy_folder(from, to)?;
        self.remove_folder(from)
    }

    fn copy_folder(&self, from: &Path, to: &Path) -> io::Result<()> {
        for (path, bytes) in self.below(from) {
            self.change(&to.join(path.strip_prefix(from).unwrap()), Some(bytes));
        }
        Ok(())
    }

    fn remove_folder(&self, path: &Path) -> io::Result<()> {
        self.below(path).iter().for_each(|(path, _)| self.change(path, None));
        Ok(())
    }
}

/// The file system, with digests by a function of its own.
pub struct Digesting<F>(pub F);

impl<F: Fn(&Path) -> io::Result<String> + Send + Sync> FileLayer for Digesting<F> {
    fn read(&self, path: &Path) -> io::Result<Vec<u8>> {
        Disk.read(path)
    }

    fn size(&self, path: &Path) -> io::Result<u64> {
        Disk.size(path)
    }

    fn digest(&self, path: &Path) -> io::Result<String> {
        (self.0)(path)
    }

    fn is_folder(&self, path: &Path) -> bool {
        Disk.is_folder(path)
    }

    fn create(&self, path: &Path, bytes: &[u8]) -> io::Result<bool> {
        Disk.create(path, bytes)
    }

    fn publish(&self, path: &Path, bytes: &[u8]) -> io::Result<bool> {
        Disk.publish(path, bytes)
    }

    fn replace(&self, path: &Path, bytes: &[u8]) -> io::Result<()> {
        Disk.replace(path, bytes)
    }

    fn append(&self, path: &Path, bytes: &[u8]) -> io::Result<()> {
        Disk.append(path, bytes)
    }

    fn make_folder(&self, path: &Path) -> io::Result<()> {
        Disk.make_folder(path)
    }

    fn list(&self, path: &Path) -> io::Result<Vec<String>> {
        Disk.list(path)
    }

    fn rename_folder(&self, from: &Path, to: &Path) -> io::Result<()> {
        Disk.rename_folder(from, to)
    }

    fn copy_folder(&self, from: &Path, to: &Path) -> io::Result<()> {
        Disk.copy_folder(from, to)
    }

    fn remove_folder(&self, path: &Path) -> io::Result<()> {
        Disk.remove_folder(path)
    }
}

/// How an operation fails.
#[derive(Clone, Copy, Debug)]
pub enum Fault {
    /// The disk is full: nothing is done.
    Full,
    /// The disk has become read-only: nothing is done.
    ReadOnly,
    /// The reply of the server is lost: it is done all the same.
    ReplyLost,
}

/// The file system, on which changes fail from one of them on.
pub struct Faulty {
    pub fault: Fault,
    /// Changes that succeed before.
    pub after: usize,
    pub changes: AtomicUsize,
}

impl Faulty {
    fn change<T>(&self, work: impl FnOnce() -> io::Result<T>) -> io::Result<T> {
        if self.changes.fetch_add(1, Ordering::Relaxed) < self.after {
            return work();
        }
        // Numbers of Linux.
        match self.fault {
            Fault::Full => Err(io::Error::from_raw_os_error(28)),
            Fault::ReadOnly => Err(io::Error::from_raw_os_error(30)),
            Fault::ReplyLost => work().and(Err(io::Error::from_raw_os_error(5))),
        }
    }
}

impl FileLayer for Faulty {
    fn read(&self, path: &Path) -> io::Result<Vec<u8>> {
        Disk.read(path)
    }

    fn is_folder(&self, path: &Path) -> bool {
        Disk.is_folder(path)
    }

    fn create(&self, path: &Path, bytes: &[u8]) -> io::Result<bool> {
        self.change(|| Disk.create(path, bytes))
    }

    fn publish(&self, path: &Path, bytes: &[u8]) -> io::Result<bool> {
        self.change(|| Disk.publish(path, bytes))
    }

    fn replace(&self, path: &Path, bytes: &[u8]) -> io::Result<()> {
        self.change(|| Disk.replace(path, bytes))
    }

    fn append(&self, path: &Path, bytes: &[u8]) -> io::Result<()> {
        self.change(|| Disk.append(path, bytes))
    }

    fn make_folder(&self, path: &Path) -> io::Result<()> {
        self.change(|| Disk.make_folder(path))
    }

    fn list(&self, path: &Path) -> io::Result<Vec<String>> {
        Disk.list(path)
    }

    fn rename_folder(&self, from: &Path, to: &Path) -> io::Result<()> {
        self.change(|| Disk.rename_folder(from, to))
    }

    fn copy_folder(&self, from: &Path, to: &Path) -> io::Result<()> {
        self.change(|| Disk.copy_folder(from, to))
    }

    fn remove_folder(&self, path: &Path) -> io::Result<()> {
        self.change(|| Disk.remove_folder(path))
    }
}
