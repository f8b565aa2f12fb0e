//! Files and folders that are not whole yet: their names, and what killed processes have left of them.
//!
//! Such a part is hidden, stands beside what it becomes, and carries the number of its process: `.NAME.PROCESS-NUMBER.part`. Its process
//! holds a lock on it, which ends with the process, also on a file system that several machines share.

use std::ffi::{OsStr, OsString};
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

/// Bytes of the longest name of a file that file systems hold.
pub const LONGEST_NAME: usize = 255;

/// Folders below the swept one that are looked into.
const DEPTH: usize = 6;

/// A name for a part of `path`, which no other part has.
pub(crate) fn part_name(path: &Path) -> PathBuf {
    static PARTS: AtomicU64 = AtomicU64::new(0);
    let number = PARTS.fetch_add(1, Ordering::Relaxed);
    let name = path.file_name().unwrap_or(OsStr::new("petzval"));
    path.with_file_name(hidden(name, &format!(".{}-{number}.part", std::process::id())))
}

/// The temporary name of a file: hidden, and cut where the ending would make it too long.
fn hidden(name: &OsStr, ending: &str) -> OsString {
    let mut hidden = OsString::from(".");
    let room = LONGEST_NAME - 1 - ending.len();
    if name.len() <= room {
        hidden.push(name);
    } else {
        let name = name.to_string_lossy();
        hidden.push(&name[..name.floor_char_boundary(room)]);
    }
    hidden.push(ending);
    hidden
}

/// Locks a part for as long as the returned file is open. Where the system has no locks, the number of the process alone protects it.
pub(crate) fn held(part: File) -> File {
    let _unlocked = part.try_lock();
    part
}

/// A hidden folder for files that are not whole yet, beside `path`; it goes when this goes.
pub struct PartFolder {
    path: PathBuf,
    _lock: Option<File>,
}

impl PartFolder {
    /// Makes the folder, and those above it. Fails with the system's errors.
    pub fn beside(path: &Path) -> io::Result<Self> {
        let path = part_name(path);
        std::fs::create_dir_all(&path)?;
        // Not every system opens folders.
        let lock = File::open(&path).ok().map(held);
        Ok(Self { path, _lock: lock })
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        &self.path
    }
}

impl Drop for PartFolder {
    fn drop(&mut self) {
        // Nobody is left to handle an error.
        let _left = std::fs::remove_dir_all(&self.path);
    }
}

/// Removes the parts in a folder, and in those below it, that processes have left which are gone. What cannot be removed stays.
pub fn sweep_parts(folder: &Path) {
    sweep(folder, DEPTH);
}

/// The same in the folder alone.
pub fn sweep_parts_in(folder: &Path) {
    sweep(folder, 0);
}

fn sweep(folder: &Path, depth: usize) {
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        // A link is no part, and what it leads to is not ours.
        let Ok(kind) = entry.file_type() else { continue };
        let path = entry.path();
        match process_of(&entry.file_name()) {
            Some(process) if (kind.is_file() || kind.is_dir()) && is_left(&path, process) => {
                let _stays =
                    if kind.is_dir() { std::fs::remove_dir_all(&path) } else { std::fs::remove_file(&path) };
            }
            None if kind.is_dir() && depth > 0 => sweep(&path, depth - 1),
            _ => {}
        }
    }
}

/// The process whose part has this name.
fn process_of(name: &OsStr) -> Option<u32> {
    // The beginning may be of any bytes.
    let name = name.as_encoded_bytes().strip_prefix(b".")?.strip_suffix(b".part")?;
    let dot = name.iter().rposition(|byte| *byte == b'.')?;
    let (process, number) = std::str::from_utf8(&name[dot + 1..]).ok()?.split_once('-')?;
    number.parse::<u64>().ok()?;
    process.parse().ok()
}

/// Whether the process of a part is gone: nobody holds its lock, and no process of this machine has its number.
fn is_left(part: &Path, process: u32) -> bool {
    let own = Path::new("/proc/self");
    let lives =
        process == std::process::id() || own.exists() && own.with_file_name(process.to_string()).exists();
    !lives && File::open(part).is_ok_and(|file| file.try_lock().is_ok())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A number that no process has: above the largest that Linux gives.
    const NOBODY: u32 = 1 << 30;

    #[test]
    fn parts_of_processes_that_are_gone_are_swept_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let here = |name: &str| folder.path().join(name);
        std::fs::create_dir_all(here("below/deep")).unwrap();
        std::fs::create_dir_all(here(&format!(".shots.{NOBODY}-1.part/in"))).unwrap();
        let gone = [format!(".a.toml.{NOBODY}-0.part"), format!("below/deep/.b.{NOBODY}-7.part")];
        let own = format!(".c.{}-900.part", std::process::id());
        let kept = ["a.toml", "a.part", ".hidden.part", ".x.12.part", ".y.z-1.part", &own];
        for name in gone.iter().map(String::as_str).chain(kept) {
            std::fs::write(here(name), "x").unwrap();
        }
        // Held by a process of another machine.
        let foreign = here(&format!(".d.{NOBODY}-2.part"));
        let lock = held(File::create(&foreign).unwrap());

        sweep_parts(folder.path());
        assert!(
            gone.iter().all(|name| !here(name).exists())
                && !here(&format!(".shots.{NOBODY}-1.part")).exists()
        );
        assert!(kept.iter().all(|name| here(name).exists()) && foreign.exists());
        // Closing would not do: a program that another test is just starting still holds a copy of the open file.
        lock.unlock().unwrap();
        sweep_parts_in(folder.path());
        assert!(!foreign.exists());
    }

    #[test]
    fn a_part_folder_goes_when_it_is_dropped() {
        let folder = tempfile::tempdir().unwrap();
        let part = PartFolder::beside(&folder.path().join("new/shot")).unwrap();
        assert!(part.path().is_dir());
        sweep_parts(folder.path());
        assert!(part.path().is_dir());
        drop(part);
        assert_eq!(std::fs::read_dir(folder.path().join("new")).unwrap().count(), 0);
    }
}
