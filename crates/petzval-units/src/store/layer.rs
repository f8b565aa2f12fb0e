//! The operations on files that a store is made of. Each is one that a network file system without locks does in one step.

use std::fs::{self, File, OpenOptions};
use std::io::{self, ErrorKind, Write};
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

use petzval_design::run::hex;
use petzval_files::coco::content_digest;
use sha2::{Digest, Sha256};

/// What a store does with files.
///
/// A change may become visible to other machines seconds later, and listings may be in any order. Only `create` and the new name of a folder are
/// exclusive at once.
pub trait FileLayer: Send + Sync {
    /// The bytes of a file.
    fn read(&self, path: &Path) -> io::Result<Vec<u8>>;

    /// Bytes of a file. Fails with `NotFound` if there is no such file.
    fn size(&self, path: &Path) -> io::Result<u64> {
        self.read(path).map(|bytes| bytes.len() as u64)
    }

    /// SHA-256 of the content of a file, hexadecimal.
    fn digest(&self, path: &Path) -> io::Result<String> {
        self.read(path).map(|bytes| hex(Sha256::new_with_prefix(bytes)))
    }

    /// Whether there is a folder.
    fn is_folder(&self, path: &Path) -> bool;

    /// Makes a file that is whole as soon as it is there. Returns `false` and changes nothing if there is one already.
    fn create(&self, path: &Path, bytes: &[u8]) -> io::Result<bool>;

    /// As `create`; the file outlives a loss of power as soon as this returns.
    fn publish(&self, path: &Path, bytes: &[u8]) -> io::Result<bool>;

    /// Writes a file whole in place of what is there.
    fn replace(&self, path: &Path, bytes: &[u8]) -> io::Result<()>;

    /// Writes bytes behind the end of a file, which is made if it is not there.
    fn append(&self, path: &Path, bytes: &[u8]) -> io::Result<()>;

    /// Makes a folder, with those above it. One that is there stays.
    fn make_folder(&self, path: &Path) -> io::Result<()>;

    /// The names in a folder, in any order.
    fn list(&self, path: &Path) -> io::Result<Vec<String>>;

    /// Gives a folder another name. Fails with `AlreadyExists` or `DirectoryNotEmpty` where a folder with files has that name, at once on all
    /// machines, and with `NotFound` where there is no such folder.
    fn rename_folder(&self, from: &Path, to: &Path) -> io::Result<()>;

    /// Copies a folder with all that is in it to a place where nothing is.
    fn copy_folder(&self, from: &Path, to: &Path) -> io::Result<()>;

    /// Removes a folder with all that is in it. One that is not there is no error.
    fn remove_folder(&self, path: &Path) -> io::Result<()>;
}

/// The file system.
#[derive(Clone, Copy, Debug, Default)]
pub struct Disk;

/// Folders in a folder of results that are copied.
const DEPTH: usize = 64;

impl FileLayer for Disk {
    fn read(&self, path: &Path) -> io::Result<Vec<u8>> {
        petzval_base::read_whole(path)
    }

    fn size(&self, path: &Path) -> io::Result<u64> {
        let file = fs::metadata(path)?;
        if file.is_file() { Ok(file.len()) } else { Err(ErrorKind::NotFound.into()) }
    }

    fn digest(&self, path: &Path) -> io::Result<String> {
        content_digest(path)
    }

    fn is_folder(&self, path: &Path) -> bool {
        path.is_dir()
    }

    fn create(&self, path: &Path, bytes: &[u8]) -> io::Result<bool> {
        create(path, bytes, false)
    }

    fn publish(&self, path: &Path, bytes: &[u8]) -> io::Result<bool> {
        create(path, bytes, true)
    }

    fn replace(&self, path: &Path, bytes: &[u8]) -> io::Result<()> {
        let part = part_of(path);
        let written = write_new(&part, bytes, false).and_then(|()| fs::rename(&part, path));
        if written.is_err() {
            let _stays = fs::remove_file(&part);
        }
        written
    }

    fn append(&self, path: &Path, bytes: &[u8]) -> io::Result<()> {
        OpenOptions::new().create(true).append(true).open(path)?.write_all(bytes)
    }

    fn make_folder(&self, path: &Path) -> io::Result<()> {
        fs::create_dir_all(path)
    }

    fn list(&self, path: &Path) -> io::Result<Vec<String>> {
        let name = |entry: io::Result<fs::DirEntry>| Ok(entry?.file_name().to_string_lossy().into_owned());
        fs::read_dir(path)?.map(name).collect()
    }

    fn rename_folder(&self, from: &Path, to: &Path) -> io::Result<()> {
        fs::rename(from, to)
    }

    fn copy_folder(&self, from: &Path, to: &Path) -> io::Result<()> {
        copy(from, to, DEPTH)
    }

    fn remove_folder(&self, path: &Path) -> io::Result<()> {
        match fs::remove_dir_all(path) {
            Err(error) if error.kind() != ErrorKind::NotFound => Err(error),
            _ => Ok(()),
        }
    }
}

/// A name beside a file that no other process and no other machine uses.
fn part_of(path: &Path) -> std::path::PathBuf {
    static PARTS: AtomicU64 = AtomicU64::new(0);
    let number = PARTS.fetch_add(1, Ordering::Relaxed);
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let machine = petzval_design::run::Holder::own();
    path.with_file_name(format!(".{name}.{}-{}-{number}.new", machine.mark(), machine.pid))
}

/// Makes a file that is whole as soon as it is there.
fn create(path: &Path, bytes: &[u8], is_synced: bool) -> io::Result<bool> {
    let part = part_of(path);
    let made = write_new(&part, bytes, is_synced).and_then(|()| link(&part, path, bytes));
    // A name of its own, which nobody else waits for.
    let _stays = fs::remove_file(&part);
    if let (true, Ok(true), Some(folder)) = (is_synced, &made, path.parent()) {
        // Not every system opens folders.
        let _unsynced = OpenOptions::new().read(true).open(folder).and_then(|folder| folder.sync_all());
    }
    made
}

/// Writes a new file, and if need be sees that the disk has it.
fn write_new(path: &Path, bytes: &[u8], is_synced: bool) -> io::Result<()> {
    let mut file = File::create(path)?;
    file.write_all(bytes)?;
    if is_synced { file.sync_all() } else { Ok(()) }
}

/// Gives a whole file a second name, which must be new.
fn link(part: &Path, path: &Path, bytes: &[u8]) -> io::Result<bool> {
    match fs::hard_link(part, path) {
        Ok(()) => Ok(true),
        // The reply of a server may be lost, and the call repeated: then the link of the first call is in the way of the second.
        Err(error) if error.kind() == ErrorKind::AlreadyExists => Ok(is_linked(part)),
        Err(_) if is_linked(part) => Ok(true),
        // A file system without hard links.
        Err(error) if is_unsupported(&error) => {
            match OpenOptions::new().write(true).create_new(true).open(path) {
                Ok(mut file) => file.write_all(bytes).and_then(|()| file.sync_all()).map(|()| true),
                Err(error) if error.kind() == ErrorKind::AlreadyExists => Ok(false),
                Err(error) => Err(error),
            }
        }
        Err(error) => Err(error),
    }
}

/// Whether a file has a second name.
#[cfg(unix)]
fn is_linked(part: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    fs::metadata(part).is_ok_and(|file| file.nlink() == 2)
}

#[cfg(not(unix))]
fn is_linked(_: &Path) -> bool {
    false
}

/// Whether a file system has no hard links: EPERM, ENOSYS or EOPNOTSUPP of Linux, or what Rust calls so.
fn is_unsupported(error: &io::Error) -> bool {
    error.kind() == ErrorKind::Unsupported || matches!(error.raw_os_error(), Some(1 | 38 | 95))
}

fn copy(from: &Path, to: &Path, depth: usize) -> io::Result<()> {
    fs::create_dir_all(to)?;
    for entry in fs::read_dir(from)? {
        let entry = entry?;
        let (kind, target) = (entry.file_type()?, to.join(entry.file_name()));
        match depth {
            _ if kind.is_file() => {
                // Parts of files come and go while another process works there.
                match fs::copy(entry.path(), target) {
                    Err(error) if error.kind() != ErrorKind::NotFound => return Err(error),
                    _ => {}
                }
            }
            1.. if kind.is_dir() => copy(&entry.path(), &target, depth - 1)?,
            _ => {}
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_created_once_and_leaves_nothing_beside_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("claim");
        let made: Vec<bool> = std::thread::scope(|scope| {
            let threads: Vec<_> = (0..8)
                .map(|i: u8| {
                    scope.spawn({
                        let path = path.clone();
                        move || Disk.create(&path, &[i; 100]).unwrap()
                    })
                })
                .collect();
            threads.into_iter().map(|thread| thread.join().unwrap()).collect()
        });
        assert_eq!(made.iter().filter(|made| **made).count(), 1);
        let winner = made.iter().position(|made| *made).unwrap() as u8;
        assert_eq!(Disk.read(&path).unwrap(), [winner; 100]);
        Disk.replace(&path, b"other").unwrap();
        Disk.append(&path, b"!").unwrap();
        assert_eq!(Disk.read(&path).unwrap(), b"other!");
        assert_eq!(Disk.list(folder.path()).unwrap(), ["claim"]);
        assert!(Disk.create(&folder.path().join("none/claim"), b"").is_err());
    }

    #[test]
    fn a_folder_does_not_take_the_place_of_one_with_files() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        for name in ["a", "b"] {
            fs::create_dir(at(name)).unwrap();
            fs::write(at(name).join("file"), name).unwrap();
        }
        let kind = |from: &str| Disk.rename_folder(&at(from), &at("b")).unwrap_err().kind();
        assert!(matches!(kind("a"), ErrorKind::AlreadyExists | ErrorKind::DirectoryNotEmpty));
        assert_eq!(kind("none"), ErrorKind::NotFound);
        assert_eq!(fs::read_to_string(at("a/file")).unwrap(), "a");
        assert_eq!(fs::read_to_string(at("b/file")).unwrap(), "b");
    }

    #[test]
    fn folders_are_copied_with_all_that_is_in_them() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::create_dir_all(at("a/b/c")).unwrap();
        fs::write(at("a/b/c/d"), "x").unwrap();
        fs::write(at("a/e"), "y").unwrap();
        Disk.copy_folder(&at("a"), &at("f")).unwrap();
        Disk.remove_folder(&at("a")).unwrap();
        Disk.remove_folder(&at("a")).unwrap();
        assert!(!Disk.is_folder(&at("a")));
        assert_eq!(
            (fs::read(at("f/b/c/d")).unwrap(), fs::read(at("f/e")).unwrap()),
            (b"x".to_vec(), b"y".to_vec())
        );
    }
}
