//! Reads files of limited size.

use std::io::ErrorKind;
use std::path::Path;

use petzval_base::IoError;

use super::error::CocoError;

/// The bytes of a file that may have at most `most` bytes.
pub(super) fn read_bounded(path: &Path, most: u64, hint: &str) -> Result<Vec<u8>, CocoError> {
    petzval_base::read_at_most(path, most).map_err(|error| match error.kind() {
        ErrorKind::FileTooLarge => CocoError::content(path, error.to_string(), hint),
        _ => IoError::at(path)(error).into(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_above_the_limit_are_refused_with_a_hint() {
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
