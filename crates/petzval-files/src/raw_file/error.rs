//! Errors of raw files.

use std::path::{Path, PathBuf};

use petzval_base::InFile;

/// Why a raw frame could not be read or written.
#[derive(Debug, thiserror::Error)]
pub enum RawFileError {
    /// The file cannot be opened, read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The error of the system.
        source: std::io::Error,
    },
    /// The content contradicts the file's name or its sidecar.
    #[error("{}: {reason}; hint: {hint}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
        /// What to do.
        hint: &'static str,
    },
    /// The sidecar has an error.
    #[error(transparent)]
    Sidecar(#[from] InFile),
}

impl RawFileError {
    /// An I/O error about a path.
    pub(super) fn io(path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::Io { path, source }
    }

    pub(super) fn content(path: &Path, reason: String, hint: &'static str) -> Self {
        Self::Content { path: path.to_owned(), reason, hint }
    }
}
