//! Reads files of limited size.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use super::error::CocoError;

/// The bytes of a file that may have at most `most` bytes.
pub(super) fn read_bounded(path: &Path, most: u64, hint: &str) -> Result<Vec<u8>, CocoError> {
    let file = File::open(path).map_err(CocoError::io(path))?;
    let length = file.metadata().map_err(CocoError::io(path))?.len();
    let too_large = |length: String| {
        let (length, most) = (length, megabytes(most));
        CocoError::content(path, format!("the file has {length}; at most {most} are read"), hint)
    };
    if length > most {
        return Err(too_large(megabytes(length)));
    }
    let mut bytes = Vec::new();
    // A file may grow while it is read, and a pipe has no length.
    file.take(most + 1).read_to_end(&mut bytes).map_err(CocoError::io(path))?;
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_above_the_limit_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.json");
        std::fs::write(&path, b"12345").unwrap();
        assert_eq!(read_bounded(&path, 5, "split it").unwrap(), b"12345");
        let refused = read_bounded(&path, 4, "split it").unwrap_err().to_string();
        assert!(
            refused.ends_with("the file has 5 bytes; at most 4 bytes are read; hint: split it"),
            "{refused}"
        );
        assert!(read_bounded(folder.path(), 4, "").is_err());
    }
}
