//! Errors with the path that they are about.

use std::io;
use std::path::{Path, PathBuf};

use crate::FileError;

/// An error of the system about a file or folder.
#[derive(Debug, thiserror::Error)]
#[error("{}: {source}", path.display())]
pub struct IoError {
    /// The file or folder.
    pub path: PathBuf,
    /// The error of the system.
    pub source: io::Error,
}

impl IoError {
    /// Makes an error of the system one about a path.
    pub fn at(path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self { path, source }
    }
}

/// An error in the text of a file.
#[derive(Debug, thiserror::Error)]
#[error("{}: {error}", path.display())]
pub struct InFile {
    /// The file.
    pub path: PathBuf,
    /// What is wrong, where, and what to write instead.
    pub error: Box<FileError>,
}

impl InFile {
    /// Makes an error in a text one in a file.
    pub fn at(path: &Path) -> impl FnOnce(FileError) -> Self {
        let path = path.to_owned();
        move |error| Self { path, error: Box::new(error) }
    }
}

#[cfg(test)]
mod tests {
    use std::error::Error;

    use super::*;

    #[test]
    fn an_error_names_its_path_first() {
        let missing =
            IoError::at(Path::new("a/b.toml"))(io::Error::new(io::ErrorKind::NotFound, "no such file"));
        assert_eq!(missing.to_string(), "a/b.toml: no such file");
        assert_eq!(missing.source().map(ToString::to_string).as_deref(), Some("no such file"));
        let wrong = InFile::at(Path::new("c.toml"))(FileError::at("x = 1\n", 4..5, "x", "too small"));
        assert_eq!(wrong.to_string(), "c.toml: line 1, column 5: `x = 1`: too small");
        assert_eq!(wrong.error.value, "1");
    }
}
