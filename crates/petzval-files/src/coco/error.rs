//! Errors of data sets: what makes a whole folder or file unusable.

use std::path::{Path, PathBuf};

use petzval_base::{Cancelled, FileError, IoError};

/// Why a data set could not be read or written.
#[derive(Debug, thiserror::Error)]
pub enum CocoError {
    /// A file or folder cannot be opened, read or written.
    #[error(transparent)]
    Io(#[from] IoError),
    /// A folder or file is not what is needed.
    #[error("{}: {reason}; hint: {hint}", path.display())]
    Content {
        /// The folder or file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
        /// What to do.
        hint: String,
    },
    /// Places in files are wrong.
    #[error("{}: {error}{}", path.display(), more_places(*more))]
    File {
        /// The first such file.
        path: PathBuf,
        /// What is wrong in it, where, and what to write instead.
        error: Box<FileError>,
        /// Further places that are wrong, in this file and others.
        more: usize,
    },
    /// The job was cancelled before the whole data set was read.
    #[error("stopped before the whole data set was read")]
    Stopped(#[from] Cancelled),
}

impl CocoError {
    pub(super) fn content(path: &Path, reason: impl Into<String>, hint: impl Into<String>) -> Self {
        Self::Content { path: path.to_owned(), reason: reason.into(), hint: hint.into() }
    }

    pub(super) fn file(path: &Path, error: FileError) -> Self {
        Self::File { path: path.to_owned(), error: Box::new(error), more: 0 }
    }
}

fn more_places(more: usize) -> String {
    match more {
        0 => String::new(),
        n => format!("; {n} more places are wrong"),
    }
}
