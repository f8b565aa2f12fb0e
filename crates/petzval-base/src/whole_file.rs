//! Reading files of limited size, and writing a file completely or not at all.

use std::fs::File;
use std::io::{self, Read, Write};
use std::path::Path;

use crate::part::{held, part_name};

/// Most bytes of a file that is read as a whole: more than a stack of the largest sensors has.
const MOST_BYTES: u64 = 8 << 30;

/// Opens a file for reading. Fails with `IsADirectory` for a folder and with `InvalidInput` for a pipe, a device or a socket, which may
/// have no end, also behind a symbolic link, and with the system's errors.
pub fn open_file(path: impl AsRef<Path>) -> io::Result<File> {
    // Looked at before it is opened: opening a pipe waits for somebody to write to it.
    let kind = std::fs::metadata(&path)?.file_type();
    if kind.is_dir() {
        return Err(io::Error::new(io::ErrorKind::IsADirectory, "this is a folder, not a file"));
    }
    if !kind.is_file() {
        let message =
            "this is a pipe or a device, which may have no end; copy what it gives to a file and name that";
        return Err(io::Error::new(io::ErrorKind::InvalidInput, message));
    }
    File::open(path)
}

/// The bytes of a file. Fails as [`open_file`] does, and with `FileTooLarge` above 8 GiB.
pub fn read_whole(path: impl AsRef<Path>) -> io::Result<Vec<u8>> {
    read_at_most(path, MOST_BYTES)
}

/// Largest text that is read, bytes: tables of a million rows, and annotations of a large data set.
const MOST_TEXT: u64 = 1 << 30;

/// The text of a file in UTF-8. Fails as [`read_whole`] does, with `FileTooLarge` above 1 GiB, and with `InvalidData` if it is not UTF-8.
pub fn read_text(path: impl AsRef<Path>) -> io::Result<String> {
    let not_text = |_| io::Error::new(io::ErrorKind::InvalidData, "this is not text in UTF-8");
    String::from_utf8(read_at_most(path, MOST_TEXT)?).map_err(not_text)
}

/// The bytes of a file that has at most `most`. Fails as [`open_file`] does, and with `FileTooLarge` if there are more.
pub fn read_at_most(path: impl AsRef<Path>, most: u64) -> io::Result<Vec<u8>> {
    let file = open_file(path)?;
    let length = file.metadata()?.len();
    let too_large = |length: String| {
        let message = format!("the file has {length}; at most {} are read", megabytes(most));
        io::Error::new(io::ErrorKind::FileTooLarge, message)
    };
    if length > most {
        return Err(too_large(megabytes(length)));
    }
    let mut bytes = Vec::new();
    bytes.try_reserve_exact(length as usize).map_err(|_| io::Error::from(io::ErrorKind::OutOfMemory))?;
    // A file may grow while it is read, and some of the system have no length.
    file.take(most + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > most {
        return Err(too_large("more".to_owned()));
    }
    Ok(bytes)
}

fn megabytes(bytes: u64) -> String {
    match bytes {
        ..10_000_000 => format!("{bytes} bytes"),
        _ => format!("{} MB", bytes / 1_000_000),
    }
}

/// Writes a file under a temporary name in the same folder, then renames it. No reader sees an incomplete file, and after a
/// failure, also of the power, the old file is unchanged.
///
/// Fails with `InvalidInput` if `path` names no file, with `IsADirectory` if it is a folder, and with the system's errors.
pub fn write_whole(path: &Path, bytes: &[u8]) -> io::Result<()> {
    placed(path, bytes, |beside| std::fs::rename(beside, path))
}

/// The same where no file is: of several processes that write one at a time, one succeeds.
///
/// Fails as [`write_whole`] does, and with `AlreadyExists` if a file is there, which stays as it is.
pub fn create_whole(path: &Path, bytes: &[u8]) -> io::Result<()> {
    placed(path, bytes, |beside| match std::fs::hard_link(beside, path) {
        // The second name stays.
        Ok(()) => std::fs::remove_file(beside),
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => Err(error),
        // Not every file system has links: there an empty file keeps the name.
        Err(_) => File::create_new(path).and_then(|_| std::fs::rename(beside, path)),
    })
}

/// Writes a file under a temporary name beside `path`, and lets `place` bring it to its own.
fn placed(path: &Path, bytes: &[u8], place: impl Fn(&Path) -> io::Result<()>) -> io::Result<()> {
    if path.file_name().is_none() {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, "the path names no file"));
    }
    // A file cannot replace a folder. Checking here gives the same message on every system.
    if path.is_dir() {
        return Err(io::Error::new(io::ErrorKind::IsADirectory, "this is a folder"));
    }
    let beside = part_name(path);
    let written = File::create(&beside)
        .map(held)
        .and_then(|mut file| file.write_all(bytes).and_then(|()| file.sync_all()).map(|()| file))
        .and_then(|_held| place(&beside));
    if written.is_err() {
        // Return the first error. Removal may fail too, because the temporary file may not exist.
        let _ = std::fs::remove_file(&beside);
    }
    written
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::part::LONGEST_NAME;

    #[test]
    fn a_failure_leaves_nothing_behind() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.bin");
        write_whole(&path, b"one").unwrap();
        write_whole(&path, b"two").unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"two");
        assert!(write_whole(folder.path(), b"x").is_err());
        assert!(write_whole(&folder.path().join("none/a.bin"), b"x").is_err());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn one_of_several_creates_a_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.bin");
        let tries: Vec<std::thread::JoinHandle<io::Result<()>>> = (0..4_u8)
            .map(|i| {
                let path = path.clone();
                std::thread::spawn(move || create_whole(&path, &[i; 3]))
            })
            .collect();
        let ends: Vec<io::Result<()>> = tries.into_iter().map(|thread| thread.join().unwrap()).collect();
        let first = ends.iter().position(Result::is_ok).unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), [first as u8; 3]);
        let refused: Vec<io::ErrorKind> =
            ends.into_iter().filter_map(Result::err).map(|e| e.kind()).collect();
        assert_eq!(refused, [io::ErrorKind::AlreadyExists; 3]);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn every_name_that_a_file_can_have_is_written() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["a".repeat(LONGEST_NAME), "ä".repeat(LONGEST_NAME / 2)] {
            write_whole(&folder.path().join(&name), b"x").unwrap();
            assert_eq!(std::fs::read(folder.path().join(&name)).unwrap(), b"x");
        }
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2);
    }

    #[test]
    fn files_above_the_limit_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.json");
        std::fs::write(&path, b"12345").unwrap();
        assert_eq!(read_at_most(&path, 5).unwrap(), b"12345");
        assert_eq!(read_text(&path).unwrap(), "12345");
        let refused = read_at_most(&path, 4).unwrap_err();
        assert_eq!(refused.kind(), io::ErrorKind::FileTooLarge);
        assert_eq!(refused.to_string(), "the file has 5 bytes; at most 4 bytes are read");
        std::fs::write(&path, b"a\xff").unwrap();
        assert_eq!(read_text(&path).unwrap_err().kind(), io::ErrorKind::InvalidData);
        assert_eq!(read_whole(folder.path()).unwrap_err().kind(), io::ErrorKind::IsADirectory);
    }

    #[cfg(unix)]
    #[test]
    fn what_has_no_end_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let link = folder.path().join("endless");
        std::os::unix::fs::symlink("/dev/zero", &link).unwrap();
        assert_eq!(read_whole(&link).unwrap_err().kind(), io::ErrorKind::InvalidInput);
        let socket = folder.path().join("socket");
        let _held = std::os::unix::net::UnixListener::bind(&socket).unwrap();
        assert_eq!(open_file(&socket).unwrap_err().kind(), io::ErrorKind::InvalidInput);
    }
}
